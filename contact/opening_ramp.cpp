#include "contact/opening_ramp.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::contact {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kOutlier = 3.5;  // residual/σ
constexpr int kParameters = 6;
using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
using Free = std::array<bool, kParameters>;  // grip, slope, tail, start, release, log shape

// Gauss-Newton system of samples [from, to): slope per unit, times in units of `tick`.
void linearise(const ForceSeries& s, const Ramp& r, std::size_t from, std::size_t to,
               const std::vector<double>& weight, double tick, Matrix& a, Vector& b) {
  a.setZero();
  b.setZero();
  const double length = r.release - r.start, height = r.grip - r.tail;
  for (std::size_t k = from; k < to; ++k) {
    const double t = s.time[k];
    Vector g = Vector::Zero();
    double model = r.tail;
    if (t <= r.start) {
      model = r.grip + r.slope * (t - r.start);
      g << 1.0, (t - r.start) / tick, 0.0, -r.slope * tick, 0.0, 0.0;
    } else if (t < r.release) {
      const double u = (r.release - t) / length, power = std::pow(u, r.shape);
      model += height * power;
      g << power, 0.0, 1.0 - power, height * r.shape * power / length * tick,
          height * r.shape * power / u * (1.0 - u) / length * tick, height * power * std::log(u) * r.shape;
    } else {
      g[2] = 1.0;
    }
    const double w = weight[k] / (s.sigma * s.sigma);
    a.noalias() += w * g * g.transpose();
    b.noalias() += w * (s.value[k] - model) * g;
  }
}

double tick_of(const ForceSeries& s) {
  return (s.time.back() - s.time.front()) / static_cast<double>(s.size() - 1);
}

// Of a time that is anywhere between two samples [s²].
double between_samples(const ForceSeries& s) { return tick_of(s) * tick_of(s) / 12.0; }

// Levenberg-Marquardt on samples [from, to) over the free parameters; returns the variance of the release
// [s²].
double refine(const ForceSeries& s, Ramp& ramp, std::size_t from, std::size_t to,
              const std::vector<double>& weight, const Free& free) {
  const double tick = tick_of(s);
  const auto fix = [&](Matrix& a, Vector& b) {
    for (int i = 0; i < kParameters; ++i) {
      if (free[i]) continue;
      a.row(i).setZero();
      a.col(i).setZero();
      a(i, i) = 1.0;
      b[i] = 0.0;
    }
  };
  Matrix a;
  Vector b;
  double best = chi2(s, ramp, from, to, weight), damping = 1e-3;
  for (int iteration = 0; iteration < 60; ++iteration) {
    linearise(s, ramp, from, to, weight, tick, a, b);
    fix(a, b);
    bool moved = false;
    double gain = 0.0;
    for (; damping < 1e8 && !moved; damping *= moved ? 0.1 : 8.0) {
      Matrix damped = a;
      for (int i = 0; i < kParameters; ++i) damped(i, i) = a(i, i) * (1.0 + damping) + 1e-12;
      const Vector d = damped.ldlt().solve(b);
      Ramp next = ramp;
      next.grip += d[0];
      next.slope += d[1] / tick;
      next.tail += d[2];
      next.start += std::clamp(d[3], -10.0, 10.0) * tick;
      next.release += std::clamp(d[4], -10.0, 10.0) * tick;
      next.shape = std::clamp(ramp.shape * std::exp(std::clamp(d[5], -0.5, 0.5)), 0.4, 6.0);
      if (!(next.release - next.start > 0.5 * tick)) continue;
      const double trial = chi2(s, next, from, to, weight);
      if (trial <= best) {
        gain = best - trial;
        best = trial;
        ramp = next;
        moved = true;
      }
    }
    if (!moved || gain < 1e-6) break;
  }
  linearise(s, ramp, from, to, weight, tick, a, b);
  fix(a, b);
  for (int i = 0; i < kParameters; ++i) a(i, i) += 1e-12;
  const double variance = a.ldlt().solve(Vector::Unit(4))[4] * tick * tick;
  return variance > 0.0 ? variance : between_samples(s);
}

std::vector<double> whitened(const ForceSeries& s, const Ramp& ramp) {
  std::vector<double> e;
  for (std::size_t k = 0; k < s.size(); ++k) e.push_back((s.value[k] - ramp.at(s.time[k])) / s.sigma);
  return e;
}

double misfit(const ForceSeries& s, const Ramp& ramp, std::size_t from, std::size_t to) {
  return chi2(s, ramp, from, to, outlier_weights(whitened(s, ramp), from, to));
}

// Running medians of five, at the ends of three.
std::vector<double> calmed(std::span<const double> x) {
  std::vector<double> out;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const std::size_t first = k < 2 ? 0 : k - 2, last = std::min(x.size(), k + 3);
    const std::size_t count = last - first - (last - first + 1) % 2;  // odd
    out.push_back(dynamics::median(x.subspan(k < 2 ? 0 : last - count, count)));
  }
  return out;
}

// Weights of what stands out of its neighbours, whatever the ramp.
std::vector<double> spike_weights(const ForceSeries& s) {
  std::vector<double> e = calmed(s.value);
  for (std::size_t k = 0; k < s.size(); ++k) e[k] = (s.value[k] - e[k]) / s.sigma;
  return outlier_weights(e, 0, s.size());
}

// Spikes weighted, and then, a few times over, what stands out of the ramp found before.
double refine_robustly(const ForceSeries& s, Ramp& ramp, std::size_t from, std::size_t to,
                       std::vector<double> weight) {
  constexpr Free kAll = {true, true, true, true, true, true};
  double variance = refine(s, ramp, from, to, weight, kAll);
  constexpr int kTimes = 4;
  for (int k = 0; k < kTimes; ++k) {
    std::vector<double> next = outlier_weights(whitened(s, ramp), from, to);
    if (next == weight) break;
    weight = std::move(next);
    variance = refine(s, ramp, from, to, weight, kAll);
  }
  return variance;
}

// As how many samples one of [from, to) counts, whose noise neighbours share: 1 + 2 Σ ρ_k over the
// autocorrelations of the residuals, as long as they stand out of what white noise shows; 1 for white noise.
double samples_per_witness(const ForceSeries& s, const Ramp& ramp, std::size_t from, std::size_t to) {
  const std::vector<double> e = whitened(s, ramp);
  const auto n = static_cast<double>(to - from);
  const std::size_t most = std::min<std::size_t>((to - from) / 4, 1000);  // lags
  double squares = 0, sum = 0;
  for (std::size_t k = from; k < to; ++k) squares += e[k] * e[k];
  for (std::size_t lag = 1; lag < most && squares > 0; ++lag) {
    double product = 0;
    for (std::size_t k = from + lag; k < to; ++k) product += e[k] * e[k - lag];
    if (product / squares < 2 / std::sqrt(n)) break;
    sum += product / squares;
  }
  return 1 + 2 * sum;
}

double noise_limit(double target, double n) { return target * n + 4.0 * std::sqrt(2.0 * n); }

}  // namespace

std::vector<double> outlier_weights(const std::vector<double>& e, std::size_t from, std::size_t to) {
  constexpr std::size_t kIsolated = 2;
  std::vector<double> weight(e.size(), 1.0);
  for (std::size_t k = from; k < to;) {
    const double side = std::copysign(1.0, e[k]);
    std::size_t end = k;
    while (end < to && side * e[end] > kOutlier) ++end;
    if (end - k <= kIsolated)
      for (std::size_t i = k; i < end; ++i) weight[i] = std::pow(kOutlier / e[i], 2);
    k = std::max(end, k + 1);
  }
  return weight;
}

double chi2(const ForceSeries& s, const Ramp& ramp, std::size_t from, std::size_t to,
            const std::vector<double>& weight) {
  double sum = 0.0;
  for (std::size_t k = from; k < to; ++k)
    sum += weight[k] * std::pow((ramp.at(s.time[k]) - s.value[k]) / s.sigma, 2);
  return sum;
}

std::optional<Descent> last_descent(const ForceSeries& measured, double tail, double peak) {
  const std::vector<double> calm = calmed(measured.value);
  const ForceSeries s{measured.time, calm, measured.sigma};
  const auto n = static_cast<std::ptrdiff_t>(s.size());
  std::ptrdiff_t last = n - 1;
  while (last >= 0 && s.value[last] - tail <= std::max(6.0 * s.sigma, 0.02 * (peak - tail))) --last;
  if (last < 0) return std::nullopt;
  double top = -kInfinity;
  std::ptrdiff_t first = last;
  for (std::ptrdiff_t k = last; k >= 0;
       --k) {  // back over the plateau, up to where an earlier grip began to close
    top = std::max(top, s.value[k]);
    if (s.value[k] < top - std::max(8.0 * s.sigma, 0.15 * (top - tail))) break;
    first = k;
  }
  while (first < last && s.value[first] < top - std::max(6.0 * s.sigma, 0.03 * (top - tail))) ++first;
  const auto crossing = [&](double level) {
    std::ptrdiff_t k = last;
    while (k > first && s.value[k] <= level) --k;
    if (k + 1 >= n) return s.time[k];
    const double drop = s.value[k] - s.value[k + 1];
    const double part = drop > 0.0 ? std::clamp((s.value[k] - level) / drop, 0.0, 1.0) : 0.5;
    return s.time[k] + part * (s.time[k + 1] - s.time[k]);
  };
  const double edge = crossing(tail + 0.9 * (top - tail));
  std::vector<double> grip;
  for (std::ptrdiff_t k = first; k <= last && s.time[k] <= edge; ++k) grip.push_back(s.value[k]);
  const double level = grip.empty() ? top : dynamics::median(grip);
  const double high = crossing(tail + 0.8 * (level - tail)), low = crossing(tail + 0.2 * (level - tail));
  Descent best;
  best.plateau = static_cast<std::size_t>(first);
  best.height = level - tail;
  double least = kInfinity;
  const double tick = tick_of(s);
  for (double p : {0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2}) {
    const double u_high = std::pow(0.8, 1.0 / p), u_low = std::pow(0.2, 1.0 / p);
    const double length = std::max(tick, (low - high) / (u_high - u_low));
    Ramp ramp{level, 0.0, tail, 0.0, low + u_low * length, p};
    ramp.start = ramp.release - length;
    const double x = misfit(measured, ramp, best.plateau, s.size());
    if (x < least) {
      least = x;
      best.ramp = ramp;
    }
  }
  return best;
}

std::size_t index_of(const ForceSeries& s, double t) {
  return static_cast<std::size_t>(std::lower_bound(s.time.begin(), s.time.end(), t) - s.time.begin());
}

Opening find_opening(const ForceSeries& s, const Descent& guess, const NormalForceOptions& options) {
  const std::size_t n = s.size();
  const std::vector<double> spikes = spike_weights(s);
  Opening o{guess.ramp, 0.0, false, false};
  const auto judge = [&](std::size_t from) {
    const std::size_t start = index_of(s, o.ramp.start);
    const std::size_t grip = start > from ? start - from : 0;
    o.straight_grip =
        from == 0 && misfit(s, o.ramp, from, start) <=
                         noise_limit(options.chi2_target, std::max(1.0, static_cast<double>(grip)));
    o.power_law =
        misfit(s, o.ramp, start, n) <= noise_limit(options.chi2_target, static_cast<double>(n - start));
  };
  o.release_variance = refine_robustly(s, o.ramp, guess.plateau, n, spikes);
  judge(guess.plateau);
  const auto counted = [&](std::size_t from, std::size_t to) {
    o.release_variance *= samples_per_witness(s, o.ramp, from, to);
    return o;
  };
  if (o.straight_grip && o.power_law) return counted(guess.plateau, n);
  // A grip that is not straight: only what lies near the opening says where it starts.
  const double length = o.ramp.release - o.ramp.start;
  const std::size_t near = std::max(guess.plateau, index_of(s, o.ramp.start - 0.4 * length));
  const std::size_t after = std::min(n, index_of(s, o.ramp.release + 2.0 * length));
  o.release_variance = refine_robustly(s, o.ramp, near, after, spikes);
  judge(guess.plateau);
  if (o.power_law) return counted(near, after);
  // A ramp of another form: each of its ends from its own neighbourhood, as wide as a power still explains.
  const auto explained = [&](const Ramp& r, std::size_t from, std::size_t to) {
    const auto count = static_cast<double>(to - from);
    return chi2(s, r, from, to, spikes) <= options.chi2_target * count + 2.0 * std::sqrt(2.0 * count);
  };
  constexpr std::size_t kFewest = 6;
  const Ramp whole = o.ramp;
  Ramp end = whole, start = whole;
  std::vector<double> ends = {whole.release};  // from the whole ramp and from ever narrower neighbourhoods
  bool found = false;
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t upper = index_of(s, whole.release - part * length);
    if (index_of(s, whole.release) < upper + kFewest) break;
    Ramp nearer = whole;
    const double variance = refine(s, nearer, upper, after, spikes, {true, false, true, false, true, true});
    ends.push_back(nearer.release);
    if (found) break;  // one narrower than needed: what the neighbourhood's width makes of the release
    end = nearer;
    const auto count = static_cast<double>(after - upper);
    o.release_variance = variance * std::max(1.0, chi2(s, end, upper, after, spikes) / count) *
                         samples_per_witness(s, end, upper, after);
    found = explained(end, upper, after);
  }
  if (ends.size() > 1) o.release_variance += std::pow(ends.back() - ends[ends.size() - 2], 2);
  o.release_variance = std::max(o.release_variance, between_samples(s));
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t lower = index_of(s, whole.start + part * length);
    if (lower < index_of(s, whole.start) + kFewest) break;
    start = whole;
    refine(s, start, near, lower, spikes, {true, true, false, true, false, true});
    if (explained(start, near, lower)) break;
  }
  if (start.start < end.release)
    o.ramp = {start.grip, start.slope, end.tail, start.start, end.release, end.shape};
  judge(guess.plateau);
  o.power_law = false;
  return o;
}

}  // namespace unhand::contact
