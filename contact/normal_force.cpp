#include "contact/normal_force.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "dynamics/spline_fit.hpp"

namespace unhand::contact {
namespace {

using dynamics::value_of;
using Polynomial = SampledNormalForce::Polynomial;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

OpeningProfile<Dual> with_derivatives(const OpeningProfile<double>& q) {
  return {q.open_command, Dual(q.grip_force), Dual(q.dead_time), Dual(q.opening_time), Dual(q.shape)};
}

void check(const OpeningProfile<double>& q) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok || !std::isfinite(value))
      throw std::invalid_argument(std::string("OpeningProfile: ") + name + " = " + std::to_string(value) +
                                  ", must be " + range);
  };
  require(true, "open_command", q.open_command, "finite [s]");
  require(q.grip_force > 0.0, "grip_force", q.grip_force, "> 0 [N]");
  require(q.dead_time >= 0.0, "dead_time", q.dead_time, ">= 0 [s]");
  require(q.opening_time > 0.0, "opening_time", q.opening_time, "> 0 [s]");
  require(q.shape > 0.0, "shape", q.shape, "> 0");
}

}  // namespace

ProfileNormalForce::ProfileNormalForce(const OpeningProfile<Dual>& profile)
    : profile_(profile),
      values_{profile.open_command, profile.grip_force.a, profile.dead_time.a, profile.opening_time.a,
              profile.shape.a} {
  check(values_);
}

ProfileNormalForce::ProfileNormalForce(const OpeningProfile<double>& profile)
    : ProfileNormalForce(with_derivatives(profile)) {}

void ProfileNormalForce::kinks(std::vector<double>& out) const {
  out.push_back(values_.open_command + values_.dead_time);
  out.push_back(release_time());
}

void ProfileNormalForce::kinks(std::vector<Dual>& out) const {
  out.push_back(profile_.open_command + profile_.dead_time);
  out.push_back(profile_.open_command + profile_.dead_time + profile_.opening_time);
}

double ProfileNormalForce::release_time() const {
  return values_.open_command + values_.dead_time + values_.opening_time;
}

SampledNormalForce::SampledNormalForce(Polynomial force, std::vector<double> kinks, double release)
    : force_(std::move(force)), kinks_(std::move(kinks)), release_(release) {
  for (std::size_t i = 1; i < kinks_.size(); ++i)
    if (!(kinks_[i] > kinks_[i - 1])) throw std::invalid_argument("SampledNormalForce: kinks must increase");
  if (std::isfinite(release_) && (kinks_.empty() || kinks_.back() != release_))
    throw std::invalid_argument("SampledNormalForce: the last kink must be the release, " +
                                std::to_string(release_) + " s");
}

void SampledNormalForce::kinks(std::vector<double>& out) const {
  out.insert(out.end(), kinks_.begin(), kinks_.end());
}

void SampledNormalForce::kinks(std::vector<Dual>& out) const {
  for (double t : kinks_) out.push_back(Dual(t));
}

namespace {

struct Series {
  std::span<const double> time, value;
  double sigma{};
  std::size_t size() const { return time.size(); }
};

// grip + slope (t − start) until start, then tail + (grip − tail) u^shape with u from 1 to 0, then tail.
struct Ramp {
  double grip{}, slope{}, tail{}, start{}, release{}, shape{1.0};

  double u(double t) const { return std::clamp((release - t) / (release - start), 0.0, 1.0); }
  double at(double t) const {
    return t <= start ? grip + slope * (t - start) : tail + (grip - tail) * std::pow(u(t), shape);
  }
};

constexpr int kParameters = 6;
using Vector = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
using Free = std::array<bool, kParameters>;  // grip, slope, tail, start, release, log shape

double chi2(const Series& s, const Ramp& ramp, std::size_t from, std::size_t to) {
  double sum = 0.0;
  for (std::size_t k = from; k < to; ++k) sum += std::pow((ramp.at(s.time[k]) - s.value[k]) / s.sigma, 2);
  return sum;
}

// Gauss-Newton system of samples [from, to): slope per unit, times in units of `tick`.
void linearise(const Series& s, const Ramp& r, std::size_t from, std::size_t to, double tick, Matrix& a,
               Vector& b) {
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
    g /= s.sigma;
    a.noalias() += g * g.transpose();
    b.noalias() += g * ((s.value[k] - model) / s.sigma);
  }
}

// Levenberg-Marquardt on samples [from, to) over the free parameters; returns the variance of the release
// [s²].
double refine(const Series& s, Ramp& ramp, std::size_t from, std::size_t to, const Free& free) {
  const double tick = (s.time.back() - s.time.front()) / static_cast<double>(s.size() - 1);
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
  double best = chi2(s, ramp, from, to), damping = 1e-3;
  for (int iteration = 0; iteration < 60; ++iteration) {
    linearise(s, ramp, from, to, tick, a, b);
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
      const double trial = chi2(s, next, from, to);
      if (trial <= best) {
        gain = best - trial;
        best = trial;
        ramp = next;
        moved = true;
      }
    }
    if (!moved || gain < 1e-6) break;
  }
  linearise(s, ramp, from, to, tick, a, b);
  fix(a, b);
  for (int i = 0; i < kParameters; ++i) a(i, i) += 1e-12;
  const double variance = a.ldlt().solve(Vector::Unit(4))[4] * tick * tick;
  return variance > 0.0 ? variance : 0.0;
}

double median(std::vector<double> x) {
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

// σ from fourth differences (variance 70 σ² for white noise).
double scatter(std::span<const double> y) {
  std::vector<double> size;
  for (std::size_t i = 4; i < y.size(); ++i)
    size.push_back(std::abs(y[i] - 4.0 * y[i - 1] + 6.0 * y[i - 2] - 4.0 * y[i - 3] + y[i - 4]));
  return size.empty() ? 0.0 : median(std::move(size)) / 0.6745 / std::sqrt(70.0);
}

// The last descent of the series from a plateau to the tail: a first guess, and where its plateau begins.
struct Descent {
  Ramp ramp;
  std::size_t plateau{};
  double height{};
};

std::optional<Descent> last_descent(const Series& s, double noise, double tail, double peak) {
  const auto n = static_cast<std::ptrdiff_t>(s.size());
  std::ptrdiff_t last = n - 1;
  while (last >= 0 && s.value[last] - tail <= std::max(6.0 * noise, 0.02 * (peak - tail))) --last;
  if (last < 0) return std::nullopt;
  double top = -kInfinity;
  std::ptrdiff_t first = last;
  for (std::ptrdiff_t k = last; k >= 0;
       --k) {  // back over the plateau, up to where an earlier grip began to close
    top = std::max(top, s.value[k]);
    if (s.value[k] < top - std::max(8.0 * noise, 0.15 * (top - tail))) break;
    first = k;
  }
  while (first < last && s.value[first] < top - std::max(6.0 * noise, 0.03 * (top - tail))) ++first;
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
  const double level = grip.empty() ? top : median(std::move(grip));
  const double high = crossing(tail + 0.8 * (level - tail)), low = crossing(tail + 0.2 * (level - tail));
  Descent best;
  best.plateau = static_cast<std::size_t>(first);
  best.height = level - tail;
  double least = kInfinity;
  const double tick = (s.time.back() - s.time.front()) / static_cast<double>(n - 1);
  for (double p : {0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2}) {
    const double u_high = std::pow(0.8, 1.0 / p), u_low = std::pow(0.2, 1.0 / p);
    const double length = std::max(tick, (low - high) / (u_high - u_low));
    Ramp ramp{level, 0.0, tail, 0.0, low + u_low * length, p};
    ramp.start = ramp.release - length;
    const double x = chi2(s, ramp, best.plateau, s.size());
    if (x < least) {
      least = x;
      best.ramp = ramp;
    }
  }
  return best;
}

double noise_limit(double target, double n) { return target * n + 4.0 * std::sqrt(2.0 * n); }

std::size_t index_of(const Series& s, double t) {
  return static_cast<std::size_t>(std::lower_bound(s.time.begin(), s.time.end(), t) - s.time.begin());
}

// Instants where the polynomial changes sign in (from, to).
std::vector<double> sign_changes(const Polynomial& f, double from, double to) {
  const Window all{-kInfinity, kInfinity};
  const auto value = [&](double t) { return f.value(all, t)[0]; };
  std::vector<double> out;
  for (std::size_t i = 0; i < f.pieces().size(); ++i) {
    const double a = std::max(from, f.breaks()[i]), b = std::min(to, f.breaks()[i + 1]);
    constexpr int kParts = 12;
    for (int k = 0; a < b && k < kParts; ++k) {
      double low = a + (b - a) * k / kParts, high = a + (b - a) * (k + 1) / kParts;
      const bool sign = value(low) > 0.0;
      if (sign == (value(high) > 0.0)) continue;
      for (int bisection = 0; bisection < 50; ++bisection) {
        const double middle = 0.5 * (low + high);
        ((value(middle) > 0.0) == sign ? low : high) = middle;
      }
      if (high > from && high < to && (out.empty() || high > out.back())) out.push_back(high);
    }
  }
  return out;
}

Polynomial::Coefficients constant(double f) {
  Polynomial::Coefficients c{};
  c[0][0] = f;
  return c;
}

// A cubic on [0, h] from y with slope m to zero with slope m_end, monotone.
Polynomial::Coefficients landing(double h, double y, double m, double m_end) {
  Polynomial::Coefficients c{};
  c[0][0] = y;
  c[1][0] = m;
  c[2][0] = (-3.0 * y / h - 2.0 * m - m_end) / h;
  c[3][0] = (2.0 * y / h + m + m_end) / (h * h);
  return c;
}

// The force as pieces, cut off at zero by whoever evaluates it, with its kinks.
struct Pieces {
  std::vector<double> breaks;
  std::vector<Polynomial::Coefficients> pieces;
  std::vector<double> kinks;
};

SampledNormalForce assemble(const Series& s, Pieces p, double release) {
  const double tick = (s.time.back() - s.time.front()) / static_cast<double>(s.size() - 1);
  // Before the first sample, and after the release or the last sample, the force is constant.
  p.pieces.insert(p.pieces.begin(), constant(std::max(0.0, p.pieces.front()[0][0])));
  p.breaks.insert(p.breaks.begin(), p.breaks.front() - tick);
  const Polynomial so_far(p.breaks, p.pieces);
  const double end = p.breaks.back();
  const double last = so_far.value(Window{p.breaks.front(), end}, end)[0];
  p.pieces.push_back(constant(std::isfinite(release) ? 0.0 : std::max(0.0, last)));
  p.breaks.push_back(end + tick);
  std::sort(p.kinks.begin(), p.kinks.end());
  p.kinks.erase(std::unique(p.kinks.begin(), p.kinks.end()), p.kinks.end());
  return {Polynomial(std::move(p.breaks), std::move(p.pieces)), std::move(p.kinks), release};
}

dynamics::SplineOptions spline_options(const NormalForceOptions& o) {
  dynamics::SplineOptions out;
  out.chi2_target = o.chi2_target;
  out.min_samples_per_interval = o.min_samples_per_interval;
  return out;
}

void finish(const Series& s, NormalForceFit& fit, double parameters) {
  NormalForceSummary& u = fit.summary;
  u.sigma = s.sigma;
  u.release_time = fit.force.release_time();
  const Window all{-kInfinity, kInfinity};
  double sum = 0.0, tail = 0.0;
  int count = 0;
  for (std::size_t k = 0; k < s.size(); ++k)
    if (s.time[k] >= u.release_time) {
      tail += s.value[k];
      ++count;
    }
  if (count > 0) {
    u.tail_mean = tail / count;
    u.tail_mean_sigma = s.sigma / std::sqrt(static_cast<double>(count));
  }
  // The bias is faded out over the ramp: against the samples it is put back.
  for (std::size_t k = 0; k < s.size(); ++k) {
    const double t = s.time[k], length = u.release_time - u.opening_start;
    const double fade = std::isfinite(length) ? std::clamp((t - u.opening_start) / length, 0.0, 1.0)
                                              : (t >= u.release_time ? 1.0 : 0.0);
    const double e = (fit.force.at(all, t) + fade * u.tail_mean - s.value[k]) / s.sigma;
    sum += e * e;
    u.max_whitened_residual = std::max(u.max_whitened_residual, std::abs(e));
  }
  u.chi2_per_dof = sum / std::max(1.0, static_cast<double>(s.size()) - parameters);
  for (double t : fit.force.force().breaks())
    if (t > s.time.front() && t < std::min(u.release_time, s.time.back())) ++u.knots;
}

// A spline through all samples, without an opening.
NormalForceFit without_release(const Series& s, const NormalForceOptions& options) {
  dynamics::SplineProblem<1, 5> problem;
  problem.begin = s.time.front();
  problem.end = s.time.back();
  const std::array<double, 1> sigma = {s.sigma};
  if (s.size() < 8) {  // too few for a quintic: a straight line
    double mean_t = 0.0, mean_f = 0.0, cross = 0.0, square = 0.0;
    for (std::size_t k = 0; k < s.size(); ++k) {
      mean_t += s.time[k] / static_cast<double>(s.size());
      mean_f += s.value[k] / static_cast<double>(s.size());
    }
    for (std::size_t k = 0; k < s.size(); ++k) {
      cross += (s.time[k] - mean_t) * (s.value[k] - mean_f);
      square += (s.time[k] - mean_t) * (s.time[k] - mean_t);
    }
    Polynomial::Coefficients line = constant(mean_f + cross / square * (problem.begin - mean_t));
    line[1][0] = cross / square;
    Pieces p{{problem.begin, problem.end}, {line}, {}};
    p.kinks = sign_changes(Polynomial(p.breaks, p.pieces), problem.begin, problem.end);
    NormalForceFit fit{assemble(s, std::move(p), kInfinity), {}};
    finish(s, fit, 2.0);
    return fit;
  }
  problem.observations = {{0, s.time, s.value, sigma}};
  const auto spline = dynamics::fit_spline(problem, spline_options(options));
  Pieces p{spline.polynomial.breaks(), spline.polynomial.pieces(), {}};
  p.kinks = sign_changes(spline.polynomial, problem.begin, problem.end);
  NormalForceFit fit{assemble(s, std::move(p), kInfinity), {}};
  fit.summary.grip_force = fit.force.at(Window{-kInfinity, kInfinity}, s.time.front());
  finish(s, fit, spline.summary.knots + 6.0);
  return fit;
}

// The opening as measured: start, release and shape of its ramp, and which of its parts are what the model
// says.
struct Opening {
  Ramp ramp;
  double release_variance{};
  bool straight_grip{}, power_law{};
};

Opening find_opening(const Series& s, const Descent& guess, const NormalForceOptions& options) {
  const std::size_t n = s.size();
  Opening o{guess.ramp, 0.0, false, false};
  const auto judge = [&](std::size_t from) {
    const std::size_t start = index_of(s, o.ramp.start);
    const std::size_t grip = start > from ? start - from : 0;
    o.straight_grip =
        from == 0 && chi2(s, o.ramp, from, start) <=
                         noise_limit(options.chi2_target, std::max(1.0, static_cast<double>(grip)));
    o.power_law =
        chi2(s, o.ramp, start, n) <= noise_limit(options.chi2_target, static_cast<double>(n - start));
  };
  o.release_variance = refine(s, o.ramp, guess.plateau, n, {true, true, true, true, true, true});
  judge(guess.plateau);
  if (o.straight_grip && o.power_law) return o;
  // A grip that is not straight: only what lies near the opening says where it starts.
  const double length = o.ramp.release - o.ramp.start;
  const std::size_t near = std::max(guess.plateau, index_of(s, o.ramp.start - 0.4 * length));
  const std::size_t after = std::min(n, index_of(s, o.ramp.release + 2.0 * length));
  o.release_variance = refine(s, o.ramp, near, after, {true, true, true, true, true, true});
  judge(guess.plateau);
  if (o.power_law) return o;
  // A ramp of another form: each of its ends from its own neighbourhood, as wide as a power still explains.
  const auto explained = [&](const Ramp& r, std::size_t from, std::size_t to) {
    const auto count = static_cast<double>(to - from);
    return chi2(s, r, from, to) <= options.chi2_target * count + 2.0 * std::sqrt(2.0 * count);
  };
  constexpr std::size_t kFewest = 6;
  const Ramp whole = o.ramp;
  Ramp end = whole, start = whole;
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t upper = index_of(s, whole.release - part * length);
    if (index_of(s, whole.release) < upper + kFewest) break;
    end = whole;
    o.release_variance = refine(s, end, upper, after, {true, false, true, false, true, true});
    if (explained(end, upper, after)) break;
  }
  for (double part : {0.5, 0.35, 0.25, 0.18, 0.12}) {
    const std::size_t lower = index_of(s, whole.start + part * length);
    if (lower < index_of(s, whole.start) + kFewest) break;
    start = whole;
    refine(s, start, near, lower, {true, true, false, true, false, true});
    if (explained(start, near, lower)) break;
  }
  if (start.start < end.release)
    o.ramp = {start.grip, start.slope, end.tail, start.start, end.release, end.shape};
  judge(guess.plateau);
  o.power_law = false;
  return o;
}

NormalForceFit with_release(const Series& s, Opening o, const NormalForceOptions& options) {
  // A spline needs samples; a stretch with hardly any is left to the model.
  constexpr std::size_t kFewest = 8;
  if (index_of(s, o.ramp.start) < kFewest) o.straight_grip = true;
  if (index_of(s, o.ramp.release) < index_of(s, std::max(o.ramp.start, s.time.front())) + kFewest)
    o.power_law = true;
  const double begin = s.time.front(), release = o.ramp.release;
  const double tick = (s.time.back() - begin) / static_cast<double>(s.size() - 1);
  // A start before the log, or right at its ends, is not a kink of this series.
  const bool starts = o.ramp.start > begin + 2.0 * tick;
  const double start = starts ? o.ramp.start : begin;
  const auto unbiased = [&](double t, double f) {
    return f - o.ramp.tail * std::clamp((t - o.ramp.start) / (release - o.ramp.start), 0.0, 1.0);
  };
  // From `touch` on the force is below the noise and lands on zero by itself.
  const double height = std::max(o.ramp.grip - o.ramp.tail, 10.0 * s.sigma);
  double least = std::pow(std::min(0.3, std::max(0.01, s.sigma / height)), 1.0 / o.ramp.shape);
  least = std::clamp(least, 1e-3, 0.5);
  const double touch = release - least * (release - std::max(start, o.ramp.start));

  // What the pieces follow: the model where it explains the samples, or else the samples.
  std::vector<double> t_grip, f_grip, t_ramp, f_ramp;
  const auto grid = [&](double from, double to, auto&& place) {
    constexpr int kPoints = 192;
    for (int k = 0; k <= kPoints; ++k)
      place(from + (to - from) * k / kPoints, static_cast<double>(k) / kPoints);
  };
  double sigma_grip = s.sigma, sigma_ramp = s.sigma;
  if (starts && o.straight_grip) {
    sigma_grip *= 0.02;
    for (int k = 0; k < 8; ++k) {
      t_grip.push_back(begin + (start - begin) * k / 8.0);
      f_grip.push_back(o.ramp.grip + o.ramp.slope * (t_grip.back() - start));
    }
  } else if (starts) {
    for (std::size_t k = 0; k < s.size() && s.time[k] < start; ++k) {
      t_grip.push_back(s.time[k]);
      f_grip.push_back(s.value[k]);
    }
  }
  if (o.power_law) {
    sigma_ramp *= 0.02;
    grid(0.0, 1.0, [&](double, double x) {  // denser towards the release
      const double t = start + (touch - start) * x * (2.0 - x);
      t_ramp.push_back(t);
      f_ramp.push_back(
          unbiased(t, o.ramp.tail + (o.ramp.grip - o.ramp.tail) * std::pow(o.ramp.u(t), o.ramp.shape)));
    });
  } else {
    for (std::size_t k = 0; k < s.size() && s.time[k] <= release; ++k)
      if (s.time[k] >= start) {
        t_ramp.push_back(s.time[k]);
        f_ramp.push_back(unbiased(s.time[k], s.value[k]));
      }
  }
  dynamics::SplineProblem<1, 5> problem;
  problem.begin = begin;
  problem.end = o.power_law ? touch : release;
  if (starts) problem.breaks = {{start, 0}};
  if (starts) problem.observations.push_back({0, t_grip, f_grip, {sigma_grip}});
  problem.observations.push_back({0, t_ramp, f_ramp, {sigma_ramp}});
  if (!o.power_law) problem.end_value = {0.0};
  const auto spline = dynamics::fit_spline(problem, spline_options(options));

  // Up to `touch` the spline; then the landing, from its value and slope to zero.
  const Window before{-kInfinity, touch};
  const auto state = spline.polynomial.at(before, touch);
  Pieces p;
  const auto& breaks = spline.polynomial.breaks();
  for (std::size_t i = 0; i + 1 < breaks.size() && breaks[i] < touch; ++i) {
    p.breaks.push_back(breaks[i]);
    p.pieces.push_back(spline.polynomial.pieces()[i]);
  }
  p.breaks.push_back(touch);
  p.kinks = sign_changes(spline.polynomial, begin, touch);
  if (starts) p.kinks.push_back(start);
  double end = release;
  if (state.value[0] > 0.0) {
    const double h = release - touch, y = state.value[0], secant = -y / h;
    const double slope = std::clamp(state.first[0], 3.0 * secant, 0.0);
    if (slope != state.first[0]) p.kinks.push_back(touch);
    // the end's slope takes the cubic through u^p half way
    const double middle = y * std::pow(0.5, o.ramp.shape);
    const double slope_end = std::clamp(slope + (4.0 * y - 8.0 * middle) / h, 3.0 * secant, 0.0);
    p.pieces.push_back(landing(h, y, slope, slope_end));
    p.breaks.push_back(release);
  } else {  // the samples' spline is at zero already: from its last crossing on
    end = p.kinks.empty() ? begin : *std::max_element(p.kinks.begin(), p.kinks.end());
    while (p.breaks.size() > 2 && p.breaks[p.breaks.size() - 2] >= end) {
      p.breaks.pop_back();
      p.pieces.pop_back();
    }
    p.breaks.back() = end;
  }
  p.kinks.push_back(end);
  NormalForceFit fit{assemble(s, std::move(p), end), {}};
  fit.summary.power_law = o.power_law;
  fit.summary.grip_force = o.ramp.grip;
  if (starts) fit.summary.opening_start = start;
  fit.summary.shape = o.ramp.shape;
  fit.summary.release_sigma = std::sqrt(o.release_variance);
  finish(s, fit, (o.straight_grip && o.power_law) ? 6.0 : spline.summary.knots + 8.0);
  return fit;
}

}  // namespace

NormalForceFit smooth_normal_force(std::span<const double> time, std::span<const double> value, double sigma,
                                   const NormalForceOptions& options) {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("smooth_normal_force: " + what);
  };
  require(time.size() == value.size(), "time and value must have the same size");
  require(time.size() >= 4, "a series needs at least 4 samples, got " + std::to_string(time.size()));
  for (std::size_t k = 0; k < time.size(); ++k) {
    require(std::isfinite(time[k]) && (k == 0 || time[k] > time[k - 1]), "time must be finite and increase");
    require(std::isfinite(value[k]), "value must be finite");
  }
  std::vector<double> sorted(value.begin(), value.end());
  std::sort(sorted.begin(), sorted.end());
  const double peak = sorted[sorted.size() * 9 / 10];
  const double natural = scatter(value);
  const Series s{
      time, value,
      std::isfinite(sigma) && sigma > 0.0 ? sigma : std::max(natural, 1e-6 * std::max(1.0, std::abs(peak)))};
  const double noise = std::max(s.sigma, natural);  // a declaration may be too optimistic

  const std::size_t n = s.size();
  const double tail = (value[n - 1] + value[n - 2] + value[n - 3]) / 3.0;
  const auto is_zero = [&](double level, double height) {
    return std::abs(level) <= std::max(options.max_tail_bias * height, 5.0 * noise);
  };
  if (!is_zero(tail, sorted.back())) return without_release(s, options);
  const std::optional<Descent> descent = last_descent(s, noise, tail, std::max(peak, 0.5 * sorted.back()));
  if (!descent) {  // nothing but zero: released from the beginning
    NormalForceFit fit{
        {Polynomial({time.front(), time.back()}, {constant(0.0)}), {time.front()}, time.front()}, {}};
    finish(s, fit, 1.0);
    return fit;
  }
  const Opening opening = find_opening(s, *descent, options);
  const double tick = (time.back() - time.front()) / static_cast<double>(n - 1);
  const bool sound = std::isfinite(opening.ramp.release) && index_of(s, opening.ramp.release) + 3 <= n &&
                     opening.ramp.release > time.front() + 3.0 * tick &&
                     is_zero(opening.ramp.tail, descent->height);
  if (!sound) return without_release(s, options);
  return with_release(s, opening, options);
}

}  // namespace unhand::contact
