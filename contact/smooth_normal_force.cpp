#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "contact/opening_ramp.hpp"
#include "dynamics/median.hpp"
#include "dynamics/spline_fit.hpp"
#include "dynamics/straight_line.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::contact {

double bias_share(const NormalForceSummary& u, double t) {
  const double length = u.release_time - u.opening_start;
  if (!std::isfinite(length)) return t >= u.release_time ? 1.0 : 0.0;
  return std::clamp((t - u.opening_start) / length, 0.0, 1.0);
}

namespace {

using Polynomial = SampledNormalForce::Polynomial;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

SampledNormalForce assemble(const ForceSeries& s, Pieces p, double release) {
  const double tick = tick_of(s);
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

void finish(const ForceSeries& s, NormalForceFit& fit, double parameters) {
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
  for (std::size_t k = 0; k < s.size(); ++k) {  // against the samples the bias is put back
    const double t = s.time[k];
    const double e = (fit.force.at(all, t) + bias_share(u, t) * u.tail_mean - s.value[k]) / s.sigma;
    sum += e * e;
  }
  u.chi2_per_dof = sum / std::max(1.0, static_cast<double>(s.size()) - parameters);
}

// A spline through all samples, without an opening.
NormalForceFit without_release(const ForceSeries& s) {
  dynamics::SplineProblem<1, 5> problem;
  problem.begin = s.time.front();
  problem.end = s.time.back();
  const std::array<double, 1> sigma = {s.sigma};
  if (s.size() < 8) {  // too few for a quintic: a straight line
    const auto fitted = dynamics::fit_line(s.time, s.value);
    Polynomial::Coefficients line = constant(fitted.at(problem.begin));
    line[1][0] = fitted.slope;
    Pieces p{{problem.begin, problem.end}, {line}, {}};
    p.kinks = sign_changes(Polynomial(p.breaks, p.pieces), problem.begin, problem.end);
    NormalForceFit fit{assemble(s, std::move(p), kInfinity), {}};
    fit.summary.grip_force = std::max(0.0, fitted.at(problem.begin));
    finish(s, fit, 2.0);
    return fit;
  }
  problem.observations = {{0, s.time, s.value, sigma}};
  const auto spline = dynamics::fit_spline(problem);
  Pieces p{spline.polynomial.breaks(), spline.polynomial.pieces(), {}};
  p.kinks = sign_changes(spline.polynomial, problem.begin, problem.end);
  NormalForceFit fit{assemble(s, std::move(p), kInfinity), {}};
  fit.summary.grip_force = fit.force.at(Window{-kInfinity, kInfinity}, s.time.front());
  finish(s, fit, spline.summary.knots + 6.0);
  return fit;
}

// What the spline follows on a stretch: the model where it explains the samples, or else the samples.
struct Followed {
  std::vector<double> time, value;
  double sigma;
  void add(double t, double f) {
    time.push_back(t);
    value.push_back(f);
  }
};
constexpr double kModelSigma = 0.02;  // of the model's values, by that of a sample

Followed follow_grip(const ForceSeries& s, const Opening& o) {
  Followed out{{}, {}, s.sigma};
  const double begin = s.time.front(), start = o.ramp.start;
  if (o.straight_grip) {
    out.sigma *= kModelSigma;
    for (int k = 0; k < 8; ++k) {
      const double t = begin + (start - begin) * k / 8.0;
      out.add(t, o.ramp.grip + o.ramp.slope * (t - start));
    }
  } else {
    for (std::size_t k = 0; k < s.size() && s.time[k] < start; ++k) out.add(s.time[k], s.value[k]);
  }
  return out;
}

// From `start` to `touch`, or with samples to the release. The sensor's bias is faded out over the ramp.
Followed follow_ramp(const ForceSeries& s, const Opening& o, double start, double touch) {
  Followed out{{}, {}, s.sigma};
  const double release = o.ramp.release;
  const auto unbiased = [&](double t, double f) {
    return f - o.ramp.tail * std::clamp((t - o.ramp.start) / (release - o.ramp.start), 0.0, 1.0);
  };
  if (o.modelled) {
    out.sigma *= kModelSigma;
    constexpr int kPoints = 192;
    for (int k = 0; k <= kPoints; ++k) {  // denser towards the release
      const double x = static_cast<double>(k) / kPoints, t = start + (touch - start) * x * (2.0 - x);
      out.add(t, unbiased(t, o.ramp.at(t)));
    }
  } else {
    for (std::size_t k = 0; k < s.size() && s.time[k] <= release; ++k)
      if (s.time[k] >= start) out.add(s.time[k], unbiased(s.time[k], s.value[k]));
  }
  return out;
}

Pieces up_to(const Polynomial& spline, double touch) {
  Pieces out;
  const auto& breaks = spline.breaks();
  for (std::size_t i = 0; i + 1 < breaks.size() && breaks[i] < touch; ++i) {
    out.breaks.push_back(breaks[i]);
    out.pieces.push_back(spline.pieces()[i]);
  }
  out.breaks.push_back(touch);
  return out;
}

// Adds the way from the last break, where the force has this value and slope, to zero at the release. Where
// it is at zero already, the pieces end at their last kink. Returns where the force ends.
double land(Pieces& p, double value, double first, double release, double shape) {
  const double touch = p.breaks.back();
  if (value > 0.0) {
    const double h = release - touch, y = value, secant = -y / h;
    const double slope = std::clamp(first, 3.0 * secant, 0.0);
    if (slope != first) p.kinks.push_back(touch);
    // the end's slope takes the cubic through u^p half way
    const double middle = y * std::pow(0.5, shape);
    const double slope_end = std::clamp(slope + (4.0 * y - 8.0 * middle) / h, 3.0 * secant, 0.0);
    p.pieces.push_back(landing(h, y, slope, slope_end));
    p.breaks.push_back(release);
    return release;
  }
  const double end = p.kinks.empty() ? p.breaks.front() : *std::max_element(p.kinks.begin(), p.kinks.end());
  while (p.breaks.size() > 2 && p.breaks[p.breaks.size() - 2] >= end) {
    p.breaks.pop_back();
    p.pieces.pop_back();
  }
  p.breaks.back() = end;
  return end;
}

// Whether the force stays within what was measured, and a fifth: a spline through rubbish may not.
bool is_within(const ForceSeries& s, const SampledNormalForce& force) {
  double most = 5.0 * s.sigma;
  for (const double f : s.value) most = std::max(most, std::abs(f));
  const Window all{-kInfinity, kInfinity};
  constexpr int kParts = 4;
  for (std::size_t k = 0; k + 1 < s.size(); ++k)
    for (int part = 0; part < kParts; ++part)
      if (!(force.at(all, s.time[k] + (s.time[k + 1] - s.time[k]) * part / kParts) <= 1.2 * most))
        return false;
  return true;
}

// The samples without the sensor's bias, joined by straight lines, and to zero at the release.
SampledNormalForce broken_line(const ForceSeries& s, const NormalForceSummary& u) {
  const double release = u.release_time;
  Pieces p;
  const auto add = [&](double t, double f) {
    if (!p.breaks.empty()) {
      const double from = p.pieces.back()[0][0];
      p.pieces.back()[1][0] = (f - from) / (t - p.breaks.back());
    }
    p.breaks.push_back(t);
    p.pieces.push_back(constant(f));
  };
  for (std::size_t k = 0; k < s.size() && s.time[k] < release; ++k)
    add(s.time[k], std::max(0.0, s.value[k] - bias_share(u, s.time[k]) * u.tail_mean));
  if (std::isfinite(release)) add(release, 0.0);
  p.pieces.pop_back();
  p.kinks = {p.breaks.begin() + 1, p.breaks.end()};
  if (!std::isfinite(release)) p.kinks.pop_back();
  return assemble(s, std::move(p), release);
}

// The fit, its force within what was measured.
NormalForceFit within(const ForceSeries& s, NormalForceFit fit) {
  if (is_within(s, fit.force)) return fit;
  fit.force = broken_line(s, fit.summary);
  fit.summary.power_law = false;
  finish(s, fit, 0.0);
  return fit;
}

NormalForceFit with_release(const ForceSeries& s, Opening o) {
  const bool judged = o.modelled && o.ramp.bend == decltype(o.ramp.bend){};
  // A spline needs samples; a stretch with hardly any is left to the model.
  constexpr std::size_t kFewest = 8;
  if (index_of(s, o.ramp.start) < kFewest) o.straight_grip = true;
  if (index_of(s, o.ramp.release) < index_of(s, std::max(o.ramp.start, s.time.front())) + kFewest)
    o.modelled = true;
  const double begin = s.time.front(), release = o.ramp.release;
  const double tick = tick_of(s);
  // A start before the log, or right at its ends, is not a kink of this series.
  const bool starts = o.ramp.start > begin + 2.0 * tick;
  const double start = starts ? o.ramp.start : begin;
  // From `touch` on the force is below the noise and lands on zero by itself.
  const double height = std::max(o.ramp.grip - o.ramp.tail, 10.0 * s.sigma);
  double least = std::pow(std::min(0.3, std::max(0.01, s.sigma / height)), 1.0 / o.ramp.shape);
  least = std::clamp(least, 1e-3, 0.5);
  const double touch = release - least * (release - std::max(start, o.ramp.start));

  const Followed grip = starts ? follow_grip(s, o) : Followed{};
  const Followed ramp = follow_ramp(s, o, start, touch);
  dynamics::SplineProblem<1, 5> problem;
  problem.begin = begin;
  problem.end = o.modelled ? touch : release;
  if (starts) problem.breaks = {{start, 0}};
  if (starts) problem.observations.push_back({0, grip.time, grip.value, {grip.sigma}});
  problem.observations.push_back({0, ramp.time, ramp.value, {ramp.sigma}});
  if (!o.modelled) problem.end_value = {0.0};
  const auto spline = dynamics::fit_spline(problem);

  // Up to `touch` the spline; then the landing, from its value and slope to zero.
  Pieces p = up_to(spline.polynomial, touch);
  p.kinks = sign_changes(spline.polynomial, begin, touch);
  if (starts) p.kinks.push_back(start);
  const auto state = spline.polynomial.at(Window{-kInfinity, touch}, touch);
  const double end = land(p, state.value[0], state.first[0], release, o.ramp.shape);
  p.kinks.push_back(end);
  NormalForceFit fit{assemble(s, std::move(p), end), {}};
  fit.summary.power_law = judged;
  fit.summary.grip_force = o.ramp.grip;
  if (starts) fit.summary.opening_start = start;
  fit.summary.ramp_start = start;
  fit.summary.shape = o.ramp.shape;
  const double length = release - o.ramp.start;
  double release_sigma = std::hypot(std::sqrt(o.release_variance), release - end);
  // Start, end and shape need three samples, and a fourth to be told how well they are known.
  if (index_of(s, release) < index_of(s, std::max(o.ramp.start, begin)) + 4)
    release_sigma = std::hypot(release_sigma, tick);
  fit.summary.release_sigma = std::min(release_sigma, 0.5 * length);
  finish(s, fit, (o.straight_grip && o.modelled) ? 6.0 : spline.summary.knots + 8.0);
  return fit;
}

// The samples before `rise`, at the tail where they are below it beyond doubt: pads do not pull, so the
// sensor rings.
std::vector<double> without_pull(const ForceSeries& s, std::size_t rise, double tail, double peak) {
  std::vector<double> out(s.value.begin(), s.value.begin() + static_cast<std::ptrdiff_t>(rise));
  for (double& f : out)
    if (f < tail - above_tail(s, tail, peak)) f = tail;
  return out;
}

// Takes the samples from `rise` on, after the release, into the summary of those before them.
void add_later(std::span<const double> time, std::span<const double> value, std::size_t rise,
               NormalForceSummary& u) {
  double sum = u.chi2_per_dof * static_cast<double>(rise);
  for (std::size_t k = rise; k < time.size(); ++k) {
    sum += std::pow((value[k] - u.tail_mean) / u.sigma, 2);
    u.later_rise = std::max(u.later_rise, value[k] - u.tail_mean);
  }
  u.chi2_per_dof = sum / static_cast<double>(time.size());
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
  const double natural = dynamics::trimmed_white_noise(value);  // a declaration may be too optimistic
  const double declared = std::isfinite(sigma) && sigma > 0.0 ? sigma : 1e-6 * std::max(1.0, std::abs(peak));
  const ForceSeries s{time, value, std::max(declared, natural)};

  const std::size_t n = s.size();
  const double tail = dynamics::median(value.last(3));
  const auto is_zero = [&](double level, double height) {
    return std::abs(level) <= std::max(options.max_tail_bias * height, 5.0 * s.sigma);
  };
  if (!is_zero(tail, sorted.back())) return within(s, without_release(s));
  const double highest = std::max(peak, 0.5 * sorted.back());
  if (const std::size_t rise = later_rise(s, tail, highest); rise < n) {
    const std::vector<double> pressed = without_pull(s, rise, tail, highest);
    NormalForceFit before = smooth_normal_force(time.first(rise), pressed, sigma, options);
    add_later(time, value, rise, before.summary);
    return before;
  }
  const std::optional<Descent> descent = last_descent(s, tail, highest);
  // Pads that press lightly and never part are told by the mean, which knows the level better than a sample.
  const double mean = std::accumulate(value.begin(), value.end(), 0.0) / static_cast<double>(n);
  if (!descent && mean > s.sigma * std::max(2.0, 5.0 / std::sqrt(static_cast<double>(n))))
    return within(s, without_release(s));
  if (!descent) {  // nothing but zero: released from the beginning
    NormalForceFit fit{
        {Polynomial({time.front(), time.back()}, {constant(0.0)}), {time.front()}, time.front()}, {}};
    finish(s, fit, 1.0);
    return fit;
  }
  const Opening opening = find_opening(s, *descent);
  const double tick = tick_of(s);
  const bool sound = std::isfinite(opening.ramp.release) && index_of(s, opening.ramp.release) + 3 <= n &&
                     opening.ramp.release > time.front() + 3.0 * tick &&
                     is_zero(opening.ramp.tail, descent->height);
  if (!sound) return within(s, without_release(s));
  return within(s, with_release(s, opening));
}

}  // namespace unhand::contact
