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
constexpr int kBends = Ramp::kBends, kPlain = 6, kParameters = kPlain + kBends;
constexpr double kFlattest = 0.4, kSteepest = 6.0;  // shapes [-]
constexpr double kFirst = 7.0;                      // χ² that the first bend must be worth beside BIC, and
constexpr double kFurther = 3.0;                    // each further one: what is no power may be anything
constexpr double kChosen = 1.5;     // of the variance, where the samples have chosen the form as well
constexpr double kBendSigma = 4.0;  // 1 σ of a bend before the samples are seen [-]
using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
using Free = std::array<bool, kPlain>;  // grip, slope, tail, start, release, log shape

constexpr Free kAll = {true, true, true, true, true, true};

// The derivative of the ramp at t: slope per unit, times in units of `tick`.
Vector derivative(const Ramp& r, double t, double tick) {
  Vector g = Vector::Zero();
  const double length = r.release - r.start, height = r.grip - r.tail;
  if (t <= r.start) {
    g.head<kPlain>() << 1.0, (t - r.start) / tick, 0.0, -r.slope * tick, 0.0, 0.0;
  } else if (t < r.release) {
    const double u = (r.release - t) / length, s = 1.0 - u;
    const double power = std::pow(u, r.shape) * std::exp(r.bent(s));
    double bending = 0.0, s_j = 1.0;  // d/ds Σ bend_j s^j
    for (int j = 0; j < kBends; ++j) {
      bending += (j + 1) * r.bend[j] * s_j;
      s_j *= s;
      g[kPlain + j] = height * power * s_j;
    }
    const double per_u = height * power * (r.shape / u - bending) / length * tick;
    g.head<kPlain>() << power, 0.0, 1.0 - power, per_u * u, per_u * s, height * power * std::log(u) * r.shape;
  } else {
    g[2] = 1.0;
  }
  return g;
}

// Gauss-Newton system of samples [from, to): slope per unit, times in units of `tick`.
void linearise(const ForceSeries& s, const Ramp& r, std::size_t from, std::size_t to,
               const std::vector<double>& weight, double tick, Matrix& a, Vector& b) {
  a.setZero();
  b.setZero();
  for (std::size_t k = from; k < to; ++k) {
    const Vector g = derivative(r, s.time[k], tick);
    const double w = weight[k] / (s.sigma * s.sigma);
    a.noalias() += w * g * g.transpose();
    b.noalias() += w * (s.value[k] - r.at(s.time[k])) * g;
  }
  for (int j = 0; j < kBends; ++j) {
    a(kPlain + j, kPlain + j) += 1.0 / (kBendSigma * kBendSigma);
    b[kPlain + j] -= r.bend[j] / (kBendSigma * kBendSigma);
  }
}

// Leaves what is not free, and the bends beyond the first `bends`, out of the system.
void fix(Matrix& a, Vector& b, const Free& free, int bends) {
  for (int i = 0; i < kParameters; ++i) {
    if (i < kPlain ? free[i] : i < kPlain + bends) continue;
    a.row(i).setZero();
    a.col(i).setZero();
    a(i, i) = 1.0;
    b[i] = 0.0;
  }
}

double bend_cost(const Ramp& r) {
  double sum = 0.0;
  for (const double b : r.bend) sum += b * b / (kBendSigma * kBendSigma);
  return sum;
}

// Of a time that is anywhere between two samples [s²].
double between_samples(const ForceSeries& s) { return tick_of(s) * tick_of(s) / 12.0; }

// Levenberg-Marquardt on samples [from, to) over the free parameters and so many bends; returns the variance
// of the release [s²].
double refine(const ForceSeries& s, Ramp& ramp, std::size_t from, std::size_t to,
              const std::vector<double>& weight, const Free& free, int bends) {
  const double tick = tick_of(s);
  Matrix a;
  Vector b;
  const auto cost = [&](const Ramp& r) { return chi2(s, r, from, to, weight) + bend_cost(r); };
  double best = cost(ramp), damping = 1e-3;
  for (int iteration = 0; iteration < 60; ++iteration) {
    linearise(s, ramp, from, to, weight, tick, a, b);
    fix(a, b, free, bends);
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
      next.shape = std::clamp(ramp.shape * std::exp(std::clamp(d[5], -0.5, 0.5)), kFlattest, kSteepest);
      for (int j = 0; j < bends; ++j) next.bend[j] += std::clamp(d[kPlain + j], -2.0, 2.0);
      if (!(next.release - next.start > 0.5 * tick)) continue;
      const double trial = cost(next);
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
  fix(a, b, free, bends);
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

// Weights of what stands out of the ramp and out of its neighbours: a ramp of another form leaves a sample or
// two on one side where the rate is low, and they keep their weight.
std::vector<double> weights(const ForceSeries& s, const Ramp& ramp, const std::vector<double>& spikes,
                            std::size_t from, std::size_t to) {
  std::vector<double> out = outlier_weights(whitened(s, ramp), from, to);
  for (std::size_t k = from; k < to; ++k) out[k] = std::max(out[k], spikes[k]);
  return out;
}

// Running medians of 2 `side` + 1, at the ends of fewer.
std::vector<double> calmed(std::span<const double> x, std::size_t side = 2) {
  std::vector<double> out;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const std::size_t first = k < side ? 0 : k - side, last = std::min(x.size(), k + side + 1);
    const std::size_t count = last - first - (last - first + 1) % 2;  // odd
    out.push_back(dynamics::median(x.subspan(k < side ? 0 : last - count, count)));
  }
  return out;
}

// Weights of what stands out of its neighbours, whatever the ramp.
std::vector<double> spike_weights(const ForceSeries& s) {
  std::vector<double> e = calmed(s.value);
  for (std::size_t k = 0; k < s.size(); ++k) e[k] = (s.value[k] - e[k]) / s.sigma;
  return outlier_weights(e, 0, s.size());
}

// As how many samples one of [from, to) counts, whose noise neighbours share: 1 + 2 Σ ρ_k over the
// autocorrelations of the residuals e, as long as they stand out of what white noise shows; 1 for white
// noise.
double samples_per_witness(const std::vector<double>& e, std::size_t from, std::size_t to) {
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

// Spikes weighted, and then, a few times over, what stands out of the ramp found before.
double refine_robustly(const ForceSeries& s, Ramp& ramp, std::size_t from, std::size_t to,
                       const std::vector<double>& spikes, std::vector<double>& weight, const Free& free,
                       int bends) {
  double variance = refine(s, ramp, from, to, weight, free, bends);
  constexpr int kTimes = 4;
  for (int k = 0; k < kTimes; ++k) {
    std::vector<double> next = weights(s, ramp, spikes, from, to);
    if (next == weight) break;
    weight = std::move(next);
    variance = refine(s, ramp, from, to, weight, free, bends);
  }
  return variance;
}

// What so many bends promise to first order: the χ² that they take away, how far the release moves [s], its
// variance [s²], and ln of the number of witnesses.
struct Promise {
  double gain{}, shift{}, variance{}, log_witnesses{}, per_chi2{};  // of χ², one witness with its noise
};
Promise promise(const ForceSeries& s, const Ramp& ramp, std::size_t from, std::size_t to,
                const std::vector<double>& weight, const Free& free, int bends) {
  const double tick = tick_of(s);
  Matrix a;
  Vector b;
  linearise(s, ramp, from, to, weight, tick, a, b);
  fix(a, b, free, bends);
  for (int i = 0; i < kParameters; ++i) a(i, i) += 1e-12;
  const Eigen::LDLT<Matrix> factor(a);
  const Vector step = factor.solve(b);
  std::vector<double> e = whitened(s, ramp);  // after the step: what is left is noise, as far as it tells
  double left = 0.0;
  for (std::size_t k = from; k < to; ++k) {
    e[k] -= derivative(ramp, s.time[k], tick).dot(step) / s.sigma;
    left += weight[k] * e[k] * e[k];
  }
  const double noise = std::max(1.0, left / static_cast<double>(to - from));
  const double samples = samples_per_witness(e, from, to);
  const double variance = factor.solve(Vector::Unit(4))[4] * tick * tick, n = static_cast<double>(to - from);
  return {b.dot(step) / (samples * noise), step[4] * tick, samples * variance, std::log(n / samples),
          1.0 / (samples * noise)};
}

// The ramp in [from, to) with as many bends as have evidence; returns the variance of the release [s²]. The
// first one must convince (BIC). Forms with more bends than were taken count by what their evidence leaves
// open.
double refine_form(const ForceSeries& s, Ramp& ramp, std::size_t from, std::size_t to,
                   const std::vector<double>& spikes, const Free& free) {
  std::vector<double> weight = spikes;
  double variance = refine_robustly(s, ramp, from, to, spikes, weight, free, 0);
  const std::size_t begin = std::max(from, index_of(s, ramp.start));
  const auto inside = static_cast<int>(std::max(begin, index_of(s, ramp.release)) - begin);
  const int most = std::clamp((inside - 6) / 3, 0, kBends);
  int bends = 0;
  for (;;) {
    int best = bends;
    double evidence = 0.0, needed = 0.0, per_chi2 = 1.0, all = 1.0;
    double sum = variance * samples_per_witness(whitened(s, ramp), from, to) * (bends > 0 ? kChosen : 1.0);
    for (int then = bends + 1; then <= most; ++then) {
      const Promise p = promise(s, ramp, from, to, weight, free, then);
      const double first = bends > 0 ? kFurther : p.log_witnesses + kFirst;
      const double price = first + (then - bends - 1) * kFurther;
      if (p.gain - price > evidence) {
        evidence = p.gain - price;
        best = then, needed = price, per_chi2 = p.per_chi2;
      }
      const double share = std::exp(std::min(0.0, 0.5 * (p.gain - (then - bends) * first)));
      all += share;
      sum += share * (p.variance + p.shift * p.shift);
    }
    // A shape at its bound: the end falls at once, somewhere between two samples.
    if (ramp.shape < kFlattest + 1e-3) sum = std::max(sum, all * between_samples(s));
    if (best == bends) return sum / all;
    Ramp next = ramp;
    std::vector<double> next_weight = weight;
    const double next_variance = refine_robustly(s, next, from, to, spikes, next_weight, free, best);
    // The promise was to first order.
    const double gain = chi2(s, ramp, from, to, weight) - chi2(s, next, from, to, weight);
    if (!(gain * per_chi2 > needed)) return sum / all;
    ramp = next, weight = next_weight, variance = next_variance, bends = best;
  }
}

constexpr double kNoise = 1.1;  // χ² per sample, beside its own statistical scatter
// The most χ² of n samples that is noise, at `z` standard deviations.
double noise_limit(double n, double z) { return kNoise * n + z * std::sqrt(2.0 * n); }

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

double above_tail(const ForceSeries& s, double tail, double peak) {
  return std::max(6.0 * s.sigma, 0.02 * (peak - tail));
}

std::size_t later_rise(const ForceSeries& measured, double tail, double peak) {
  constexpr double kLower = 0.25;    // of the peak
  constexpr std::size_t kLevel = 3;  // samples
  const std::vector<double> calm = calmed(measured.value, 1);
  const double above = above_tail(measured, tail, peak), high = tail + kLower * (peak - tail);
  std::size_t last = calm.size();  // the last sample of what is higher
  while (last > 0 && calm[last - 1] < high) --last;
  if (last == 0 || !(high > tail + above)) return calm.size();
  std::size_t level = 0;  // samples since the force was last above the threshold
  for (std::size_t k = last; k < calm.size(); ++k) {
    if (calm[k] - tail <= above)
      ++level;
    else if (level >= kLevel)
      return k;
    else
      level = 0;
  }
  return calm.size();
}

std::optional<Descent> last_descent(const ForceSeries& measured, double tail, double peak) {
  const std::vector<double> calm = calmed(measured.value);
  const ForceSeries s{measured.time, calm, measured.sigma};
  const auto n = static_cast<std::ptrdiff_t>(s.size());
  std::ptrdiff_t last = n - 1;
  while (last >= 0 && s.value[last] - tail <= above_tail(s, tail, peak)) --last;
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

double tick_of(const ForceSeries& s) {
  return (s.time.back() - s.time.front()) / static_cast<double>(s.size() - 1);
}

std::size_t index_of(const ForceSeries& s, double t) {
  return static_cast<std::size_t>(std::lower_bound(s.time.begin(), s.time.end(), t) - s.time.begin());
}

Opening find_opening(const ForceSeries& s, const Descent& guess) {
  const std::size_t n = s.size();
  const std::vector<double> spikes = spike_weights(s);
  Opening o{guess.ramp, 0.0, false, false};
  const auto left = [&](std::size_t from, std::size_t to) {
    return chi2(s, o.ramp, from, to, weights(s, o.ramp, spikes, from, to));
  };
  const auto judge = [&](std::size_t from) {
    const std::size_t start = index_of(s, o.ramp.start);
    const std::size_t grip = start > from ? start - from : 0;
    o.straight_grip =
        from == 0 && left(from, start) <= noise_limit(std::max(1.0, static_cast<double>(grip)), 4.0);
    o.modelled = left(start, n) <= noise_limit(static_cast<double>(n - start), 4.0);
  };
  o.release_variance = refine_form(s, o.ramp, guess.plateau, n, spikes, kAll);
  judge(guess.plateau);
  if (o.straight_grip && o.modelled) return o;
  // A grip that is not straight: only what lies near the opening says where it starts.
  const double length = o.ramp.release - o.ramp.start;
  const std::size_t near = std::max(guess.plateau, index_of(s, o.ramp.start - 0.4 * length));
  const std::size_t after = std::min(n, index_of(s, o.ramp.release + 2.0 * length));
  o.ramp.bend = {};
  o.release_variance = refine_form(s, o.ramp, near, after, spikes, kAll);
  judge(guess.plateau);
  if (o.modelled) return o;
  // A ramp of another form: each of its ends from its own neighbourhood, as wide as a power still explains.
  const auto explained = [&](const Ramp& r, std::size_t from, std::size_t to) {
    return chi2(s, r, from, to, spikes) <= noise_limit(static_cast<double>(to - from), 2.0);
  };
  constexpr std::size_t kFewest = 6;
  Ramp whole = o.ramp;
  whole.bend = {};
  Ramp end = whole, start = whole;
  std::vector<double> ends = {whole.release};  // from the whole ramp and from ever narrower neighbourhoods
  bool found = false;
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t upper = index_of(s, whole.release - part * length);
    if (index_of(s, whole.release) < upper + kFewest) break;
    Ramp nearer = whole;
    const double variance =
        refine_form(s, nearer, upper, after, spikes, {true, false, true, false, true, true});
    ends.push_back(nearer.release);
    if (found) break;  // one narrower than needed: what the neighbourhood's width makes of the release
    end = nearer;
    const auto count = static_cast<double>(after - upper);
    o.release_variance = variance * std::max(1.0, chi2(s, end, upper, after, spikes) / count);
    found = explained(end, upper, after);
  }
  if (ends.size() > 1) o.release_variance += std::pow(ends.back() - ends[ends.size() - 2], 2);
  o.release_variance = std::max(o.release_variance, between_samples(s));
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t lower = index_of(s, whole.start + part * length);
    if (lower < index_of(s, whole.start) + kFewest) break;
    start = whole;
    refine(s, start, near, lower, spikes, {true, true, false, true, false, true}, 0);
    if (explained(start, near, lower)) break;
  }
  if (start.start < end.release)
    o.ramp = {start.grip, start.slope, end.tail, start.start, end.release, end.shape, {}};
  judge(guess.plateau);
  o.modelled = false;
  return o;
}

}  // namespace unhand::contact
