#include "release/hand_motion.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "dynamics/spline_fit.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::release {
namespace {

using Columns = std::array<double, 3>;

Columns sigma_to_use(std::span<const double> rows, const Columns& declared) {
  Columns out;
  for (int c = 0; c < 3; ++c)
    out[c] = std::isfinite(declared[c]) && declared[c] > 0.0
                 ? declared[c]
                 : std::max(1e-6, dynamics::white_noise(rows, c, 3));
  return out;
}

// Whether `derived` is a difference quotient of `values` in all columns that move, and has noise: of a smooth
// motion every derivative is its difference quotient.
bool is_differenced(std::span<const double> time, std::span<const double> values,
                    std::span<const double> derived) {
  constexpr double kSame = 1e-6, kNoisy = 1e-4;  // of the largest
  constexpr double kMost = 0.9;  // of the samples: ends, and what was clipped, may be otherwise
  const std::size_t n = time.size();
  if (n < 8) return false;
  bool moves = false;
  for (std::size_t c = 0; c < 3; ++c) {
    double largest = 0;
    for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, std::abs(derived[3 * i + c]));
    if (largest == 0) continue;
    moves = true;
    if (!(dynamics::white_noise(derived, c, 3) > kNoisy * largest)) return false;
    std::array<std::size_t, 3> same{};  // central, backward, forward
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const double before = time[i] - time[i - 1], after = time[i + 1] - time[i];
      const double backward = (values[3 * i + c] - values[3 * (i - 1) + c]) / before,
                   forward = (values[3 * (i + 1) + c] - values[3 * i + c]) / after;
      const double central = (after * backward + before * forward) / (before + after);
      const double candidates[] = {central, backward, forward};
      for (std::size_t k = 0; k < 3; ++k)
        if (std::abs(derived[3 * i + c] - candidates[k]) <= kSame * largest) ++same[k];
    }
    if (static_cast<double>(*std::max_element(same.begin(), same.end())) < kMost * static_cast<double>(n - 2))
      return false;
  }
  return moves;
}

// Samples on each side of a jump: of strong ones, and of weak but noisy ones.
constexpr std::array<std::size_t, 3> kReaches = {6, 14, 32};
constexpr double kSignificant = 8.0;  // a jump, in σ of its own estimate
constexpr std::size_t kMostJumps = 8;

// Polynomials of degree < kTerms fitted to samples [first, last) of the three columns, in an orthonormal
// basis of those samples, and extrapolated to one instant.
constexpr int kTerms = 4;

struct LocalFit {
  Columns value{};      // at the instant
  Columns lower{};      // the same with one degree less
  Columns chi2{};       // sum of squared residuals over σ²
  double variance{};    // of value, per σ²
  double last_share{};  // part of the variance from the highest degree
};

LocalFit fit_locally(const HandSeries& s, std::span<const double> rows, const Columns& sigma,
                     std::size_t first, std::size_t last, double at) {
  // three-term recurrence: p_{k+1} = (x − a_k) p_k − b_k p_{k−1}
  const double origin = s.time[first], scale = 1.0 / (s.time[last - 1] - s.time[first]);
  const std::size_t n = last - first;
  std::array<double, 3 * kReaches.back()> p, q{};  // twice the reach, and a jump sought one reach aside
  p.fill(1.0);
  double pa = 1.0, qa = 0.0, norm_before = 1.0;
  const double x_at = (at - origin) * scale;
  LocalFit fit;
  for (std::size_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c)
      fit.chi2[c] += std::pow((rows[(first + i) * 3 + c] - rows[first * 3 + c]) / sigma[c], 2);
  for (int c = 0; c < 3; ++c) fit.value[c] = rows[first * 3 + c];
  for (int k = 0; k < kTerms; ++k) {
    double norm = 0.0, moment = 0.0;
    Columns dot{};
    for (std::size_t i = 0; i < n; ++i) {
      const double x = (s.time[first + i] - origin) * scale;
      norm += p[i] * p[i];
      moment += x * p[i] * p[i];
      for (int c = 0; c < 3; ++c) dot[c] += p[i] * (rows[(first + i) * 3 + c] - rows[first * 3 + c]);
    }
    if (k == kTerms - 1) fit.lower = fit.value;
    for (int c = 0; c < 3; ++c) {
      fit.value[c] += dot[c] / norm * pa;
      fit.chi2[c] = std::max(0.0, fit.chi2[c] - dot[c] * dot[c] / norm / (sigma[c] * sigma[c]));
    }
    fit.last_share = pa * pa / norm;
    fit.variance += fit.last_share;
    const double a = moment / norm, b = k > 0 ? norm / norm_before : 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double x = (s.time[first + i] - origin) * scale;
      const double up = (x - a) * p[i] - b * q[i];
      q[i] = p[i];
      p[i] = up;
    }
    const double up = (x_at - a) * pa - b * qa;
    qa = pa;
    pa = up;
    norm_before = norm;
  }
  return fit;
}

struct Step {
  Columns size{}, sigma{}, excess{};  // right minus left, its σ, and what is left of it beyond curvature
  double chi2{};
};

// The step of `rows` at the instant `at` between samples k − 1 and k, from `reach` samples on each side.
Step step_at(const HandSeries& s, std::span<const double> rows, const Columns& sigma, std::size_t from,
             std::size_t k, std::size_t to, double at) {
  const LocalFit left = fit_locally(s, rows, sigma, from, k, at);
  const LocalFit right = fit_locally(s, rows, sigma, k, to, at);
  const double dof = std::max<double>(1.0, static_cast<double>(to - from) - 2.0 * kTerms);
  Step step;
  for (int c = 0; c < 3; ++c) {
    const double inflate = std::sqrt(std::max(1.0, (left.chi2[c] + right.chi2[c]) / dof));
    step.size[c] = right.value[c] - left.value[c];
    step.sigma[c] = sigma[c] * inflate * std::sqrt(left.variance + right.variance);
    const auto curvature = [&](const LocalFit& f) {
      return std::max(0.0,
                      std::abs(f.value[c] - f.lower[c]) - 3.0 * sigma[c] * inflate * std::sqrt(f.last_share));
    };
    step.excess[c] = std::max(0.0, std::abs(step.size[c]) - 2.0 * (curvature(left) + curvature(right)));
    step.chi2 += left.chi2[c] + right.chi2[c];
  }
  return step;
}

// Gaps k (between samples k − 1 and k) where the acceleration jumps, with the reach that showed each.
struct Found {
  std::size_t gap, reach;
};

std::vector<Found> find_jumps(const HandSeries& s, const Columns& sigma) {
  const std::size_t n = s.time.size();
  std::vector<Found> found;
  const auto bounds = [&](std::size_t k, std::size_t reach) {
    std::size_t from = k > reach ? k - reach : 0, to = std::min(n, k + reach);
    for (const Found& f : found) {
      if (f.gap <= k) from = std::max(from, f.gap);
      if (f.gap > k) to = std::min(to, f.gap);
    }
    return std::pair{from, to};
  };
  const auto significance = [&](const Step& step) {
    double most = 0.0;
    for (int c = 0; c < 3; ++c) most = std::max(most, step.excess[c] / step.sigma[c]);
    return most;
  };
  for (std::size_t reach : kReaches) {
    if (n < 2 * kReaches[0]) break;
    while (found.size() < kMostJumps) {
      // Where one cubic over both sides fits worse than two, by most.
      double most = 0.0;
      std::size_t near = 0;
      for (std::size_t k = kReaches[0]; k + kReaches[0] <= n; ++k) {
        const auto [from, to] = bounds(k, reach);
        if (k < from + kTerms + 1 || to < k + kTerms + 1) continue;
        const Step step = step_at(s, s.acceleration, sigma, from, k, to, s.time[k]);
        if (significance(step) > most) {
          most = significance(step);
          near = k;
        }
      }
      if (most <= kSignificant) break;
      // A jump also spoils the fits of the gaps beside it: its place is where two cubics over one fixed
      // stretch fit best.
      const auto [from, to] = bounds(near, 2 * reach);
      double least = std::numeric_limits<double>::infinity();
      std::size_t best = near;
      for (std::size_t k = std::max(from + kTerms + 1, near > reach ? near - reach : 0);
           k + kTerms + 1 <= to && k <= near + reach; ++k) {
        const double chi2 = step_at(s, s.acceleration, sigma, from, k, to, s.time[k]).chi2;
        if (chi2 < least) {
          least = chi2;
          best = k;
        }
      }
      const auto [a, b] = bounds(best, reach);
      const Step step = step_at(s, s.acceleration, sigma, a, best, b, s.time[best]);
      if (significance(step) <= kSignificant) break;
      found.push_back({best, reach});
    }
  }
  std::sort(found.begin(), found.end(), [](const Found& x, const Found& y) { return x.gap < y.gap; });
  return found;
}

// When the jump happened: at the sample that first holds the later value, unless the twists from both sides
// meet earlier by more than their noise.
double instant_of(const HandSeries& s, const Found& jump, std::size_t from, std::size_t to,
                  const Columns& sigma_twist, const Columns& sigma_acceleration) {
  const double t = s.time[jump.gap], before = s.time[jump.gap - 1];
  if (jump.gap < from + kTerms + 1 || to < jump.gap + kTerms + 1) return t;
  const Step dv = step_at(s, s.twist, sigma_twist, from, jump.gap, to, t);
  const Step da = step_at(s, s.acceleration, sigma_acceleration, from, jump.gap, to, t);
  double information = 0.0, sum = 0.0;
  for (int c = 0; c < 3; ++c) {
    if (da.excess[c] < kSignificant * da.sigma[c]) continue;
    const double weight = 1.0 / (dv.sigma[c] * dv.sigma[c]);
    information += da.size[c] * da.size[c] * weight;
    sum += da.size[c] * dv.size[c] * weight;
  }
  if (!(information > 0.0)) return t;
  const double shift = -sum / information, sigma = 1.0 / std::sqrt(information);
  const bool resolved = sigma < 0.05 * (t - before) && std::abs(shift) > 6.0 * sigma + 1e-4 * (t - before);
  return resolved && shift < 0.0 ? std::max(t + shift, before) : t;
}

void check(const HandSeries& s) {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("fit_hand_motion: " + what);
  };
  require(s.time.size() >= 4, "a hand needs at least 4 samples, got " + std::to_string(s.time.size()));
  const auto rows = [&](std::span<const double> x, const char* name) {
    require(x.size() == 3 * s.time.size(), std::string(name) + " must hold three values per time");
    for (double value : x) require(std::isfinite(value), std::string(name) + " must be finite");
  };
  rows(s.pose, "pose");
  rows(s.twist, "twist");
  rows(s.acceleration, "acceleration");
  for (std::size_t i = 0; i < s.time.size(); ++i)
    require(std::isfinite(s.time[i]) && (i == 0 || s.time[i] > s.time[i - 1]),
            "time must be finite and increase");
}

/// How far pose and twist may be apart at a break: absolutely [m, rad, per s], and as a share of the terms
/// that sum up to them, of which each is rounded.
constexpr double kRounding = 1e-9, kRoundingShare = 1e-7;

void require_continuous(const PolynomialHand::Polynomial& path) {
  constexpr const char* kName[] = {"x", "z", "theta"};
  const auto& breaks = path.breaks();
  const auto& pieces = path.pieces();
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double h = breaks[i + 1] - breaks[i];
    for (std::size_t n = 0; n < 3; ++n) {
      std::array<double, 3> at{}, terms{};  // pose, twist and acceleration at the end
      double power = 1;
      for (std::size_t k = 0; k < pieces[i].size(); ++k, power *= h) {
        const double c = pieces[i][k][n], m = static_cast<double>(k);
        const std::array<double, 3> term = {c * power, k < 1 ? 0 : m * c * power / h,
                                            k < 2 ? 0 : m * (m - 1) * c * power / (h * h)};
        for (std::size_t d = 0; d < 3; ++d) at[d] += term[d], terms[d] += std::abs(term[d]);
      }
      if (!std::isfinite(terms[0] + terms[1] + terms[2]))
        throw std::invalid_argument(fmt::format("PolynomialHand: {} is not finite between {} and {} s",
                                                kName[n], breaks[i], breaks[i + 1]));
      if (i + 1 == pieces.size()) continue;
      for (std::size_t d = 0; d < 2; ++d) {
        const double next = pieces[i + 1][d][n], step = next - at[d];
        if (!(std::abs(step) <= kRounding + kRoundingShare * (terms[d] + std::abs(next))))
          throw std::invalid_argument(fmt::format("PolynomialHand: {}{} jumps by {} at {} s",
                                                  d == 0 ? "" : "the rate of ", kName[n], step,
                                                  breaks[i + 1]));
      }
    }
  }
}

}  // namespace

PolynomialHand::PolynomialHand(Polynomial path, std::vector<double> jumps)
    : path_(std::move(path)), jumps_(std::move(jumps)) {
  require_continuous(path_);
  const auto& breaks = path_.breaks();
  for (std::size_t i = 0; i < jumps_.size(); ++i)
    if ((i > 0 && !(jumps_[i] > jumps_[i - 1])) ||
        !std::binary_search(breaks.begin() + 1, breaks.end() - 1, jumps_[i]))
      throw std::invalid_argument(fmt::format(
          "PolynomialHand: jumps must increase and be interior breaks of the path, got {} s", jumps_[i]));
}

PolynomialHand PolynomialHand::segments(double t_start, const dynamics::Pose<double>& pose,
                                        const dynamics::Twist<double>& twist,
                                        const std::vector<HandSegment>& stretches) {
  if (stretches.empty())
    throw std::invalid_argument("PolynomialHand::segments: stretches is empty; at least one is needed");
  if (!std::isfinite(t_start))
    throw std::invalid_argument(
        fmt::format("PolynomialHand::segments: t_start = {} s is not finite", t_start));
  std::vector<double> breaks = {t_start};
  std::vector<Polynomial::Coefficients> pieces;
  Columns x = {pose.x, pose.z, pose.theta}, v = {twist.vx, twist.vz, twist.omega};
  for (const HandSegment& stretch : stretches) {
    const double h = stretch.t_end - breaks.back();
    if (!(h > 0.0) || !std::isfinite(h))
      throw std::invalid_argument(
          fmt::format("PolynomialHand::segments: t_end = {} s is not in ({}, inf) s, after the end before it",
                      stretch.t_end, breaks.back()));
    const Columns a = {stretch.acceleration.ax, stretch.acceleration.az, stretch.acceleration.alpha};
    const Columns j = {stretch.jerk.ax, stretch.jerk.az, stretch.jerk.alpha};
    for (int n = 0; n < 3; ++n)
      if (!std::isfinite(a[n]) || !std::isfinite(j[n]) || !std::isfinite(x[n]) || !std::isfinite(v[n]))
        throw std::invalid_argument(fmt::format(
            "PolynomialHand::segments: pose, twist, accelerations and jerks must be finite; those "
            "of the stretch to {} s are not",
            stretch.t_end));
    Polynomial::Coefficients c{};
    for (int n = 0; n < 3; ++n) {
      c[0][n] = x[n];
      c[1][n] = v[n];
      c[2][n] = a[n] / 2.0;
      c[3][n] = j[n] / 6.0;
      x[n] += h * (v[n] + h * (a[n] / 2.0 + h * j[n] / 6.0));
      v[n] += h * (a[n] + h * j[n] / 2.0);
    }
    for (int n = 0; n < 3; ++n)
      if (!std::isfinite(x[n]) || !std::isfinite(v[n]))
        throw std::invalid_argument(
            fmt::format("PolynomialHand::segments: pose and twist at {} s are not finite", stretch.t_end));
    pieces.push_back(c);
    breaks.push_back(stretch.t_end);
  }
  std::vector<double> jumps;
  if (pieces.size() > 1) jumps.assign(breaks.begin() + 1, breaks.end() - 1);
  return PolynomialHand(Polynomial(std::move(breaks), std::move(pieces)), std::move(jumps));
}

HandFit fit_hand_motion(const HandSeries& s, std::span<const double> declared) {
  check(s);
  const Columns sigma_x = sigma_to_use(s.pose, s.pose_sigma);
  const Columns sigma_v = sigma_to_use(s.twist, s.twist_sigma);
  const Columns sigma_a = sigma_to_use(s.acceleration, s.acceleration_sigma);
  const std::size_t n = s.time.size();

  std::vector<double> jumps;
  if (!declared.empty()) {
    for (double t : declared)
      if (t > s.time.front() && t < s.time.back()) jumps.push_back(t);
    std::sort(jumps.begin(), jumps.end());
  } else {
    // A declaration may be too optimistic; a false jump would be worse than a missed one.
    Columns cautious = sigma_a;
    for (int c = 0; c < 3; ++c)
      cautious[c] = std::max(cautious[c], dynamics::white_noise(s.acceleration, c, 3));
    const std::vector<Found> found = find_jumps(s, cautious);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const std::size_t least = i > 0 ? found[i - 1].gap : 0,
                        most = i + 1 < found.size() ? found[i + 1].gap : n;
      const std::size_t gap = found[i].gap, reach = found[i].reach;
      jumps.push_back(instant_of(s, found[i], gap > least + reach ? gap - reach : least,
                                 std::min(most, gap + reach), sigma_v, cautious));
    }
  }
  // A stretch needs three samples of its own to say anything about its acceleration's course.
  std::vector<double> kept;
  for (double t : jumps) {
    const auto count = [&](double from, double to) {
      return std::lower_bound(s.time.begin(), s.time.end(), to) -
             std::lower_bound(s.time.begin(), s.time.end(), from);
    };
    if (count(kept.empty() ? s.time.front() : kept.back(), t) >= 3 && count(t, s.time.back()) >= 2)
      kept.push_back(t);
  }
  jumps = std::move(kept);

  dynamics::SplineProblem<3, 5> problem;
  problem.begin = s.time.front();
  problem.end = s.time.back();
  for (double t : jumps) problem.breaks.push_back({t, 1});
  HandFitSummary summary;
  summary.twist_differenced = is_differenced(s.time, s.pose, s.twist);
  summary.acceleration_differenced = is_differenced(s.time, s.twist, s.acceleration);
  problem.observations = {{0, s.time, s.pose, sigma_x}};
  if (!summary.twist_differenced) problem.observations.push_back({1, s.time, s.twist, sigma_v});
  if (!summary.acceleration_differenced) problem.observations.push_back({2, s.time, s.acceleration, sigma_a});
  auto fit = dynamics::fit_spline(problem);

  auto chi2 = fit.summary.chi2.begin();
  summary.pose_chi2 = *chi2++;
  if (!summary.twist_differenced) summary.twist_chi2 = *chi2++;
  if (!summary.acceleration_differenced) summary.acceleration_chi2 = *chi2++;
  summary.pose_sigma = sigma_x;
  summary.twist_sigma = sigma_v;
  summary.acceleration_sigma = sigma_a;
  summary.chi2_per_dof = fit.summary.chi2_per_dof;
  summary.noise_reached = fit.summary.noise_reached;
  return {PolynomialHand(std::move(fit.polynomial), std::move(jumps)), summary};
}

}  // namespace unhand::release
