#include "fitting/profile.hpp"

#include <algorithm>
#include <cmath>

#include "fitting/card.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

namespace {

/// The parameters of an opening that no sensor saw: any of a family of openings with the same tail may let an
/// object go in the same way, and the curvature where one of its throws begins to slip early says nothing of
/// the others.
bool is_of_opening(const Unknown& unknown) {
  return std::find(std::begin(kOpeningParameters), std::end(kOpeningParameters), unknown.name) !=
         std::end(kOpeningParameters);
}

bool is_weak(const FittedUnknown& u, double half) {
  return is_of_opening(u.unknown) || u.at_bound || half > 0.2 * std::abs(u.value) ||
         !std::isfinite(u.data_sigma) ||
         (u.unknown.prior_sigma && u.data_sigma > 0.5 * *u.unknown.prior_sigma);
}

/// Where the profile is t sigmas away, on the side of `sign`: by secants on the distance in sigmas, which is
/// a straight line for a parabola; `unit` is the rise of the cost at one sigma. Infinite if that is beyond
/// the range, or if simulations fail on this side however near: then nothing was seen to bound it. Each fit
/// starts where the others would go if the cost were its parabola: `along`, their change per change of k.
double end_of(FitRounds& rounds, const FitResult& fit, std::size_t k, const Eigen::VectorXd& along, double t,
              double unit, double sign) {
  const FittedUnknown& u = fit.campaign[k];
  const double bound = sign > 0 ? u.unknown.high : u.unknown.low;
  const auto clipped = [&](double v) { return sign > 0 ? std::min(v, bound) : std::max(v, bound); };
  double near = u.value, z_near = 0, far = clipped(u.value + sign * t * u.sigma);
  FitRounds::Point point = rounds.solution_point();  // of the last solution: the next is near it
  const std::vector<double>& scale = rounds.shared().scale;
  const auto follow = [&](FitRounds::Point& from, double value) {
    const double moved = value - from.campaign[k] * scale[k];
    for (std::size_t j = 0; j < scale.size(); ++j) {
      const Unknown& other = fit.campaign[j].unknown;
      if (j == k || rounds.is_fixed(other)) continue;
      const double to = from.campaign[j] * scale[j] + along[static_cast<Eigen::Index>(j)] * moved;
      from.campaign[j] = std::clamp(to, other.low, other.high) / scale[j];
    }
  };
  bool seen = false;
  for (int step = 0; step < 8; ++step) {
    if (far == near) return sign * HUGE_VAL;
    follow(point, far);
    const double rise = rounds.cost_with(k, far, point) - rounds.solution().cost;
    const double z = std::sqrt(std::max(0.0, rise) / unit);
    seen |= std::isfinite(z);
    if (!std::isfinite(z)) point = rounds.solution_point();
    if (std::abs(z - t) < 0.02 * t) return far;
    if (z < t && far == bound) return sign * HUGE_VAL;
    // Where a simulation fails the distance is infinite: half way.
    double slope = (z - z_near) / (far - near),
           next = std::isfinite(z) && slope * sign > 0 ? far + (t - z) / slope : 0.5 * (near + far);
    if (z < t) {
      next = clipped(sign * std::min(sign * next, sign * (far + 2 * (far - u.value))));
      near = far;
      z_near = z;
    } else {
      next = sign * std::max(sign * next, sign * (near + 0.1 * (far - near)));
    }
    far = next;
  }
  return seen ? far : sign * HUGE_VAL;
}

}  // namespace

void profile(FitRounds& rounds, FitResult& fit) {
  const auto width = static_cast<Eigen::Index>(fit.campaign.size());
  for (std::size_t k = 0; k < fit.campaign.size(); ++k) {
    FittedUnknown& u = fit.campaign[k];
    const double t = student_factor(u.degrees_of_freedom), half = t * u.sigma;
    if (rounds.is_fixed(u.unknown) || !is_weak(u, half) || !(u.sigma > 0)) continue;
    if (!(u.data_sigma <
          u.unknown.high - u.unknown.low)) {  // the log has no say: a profile would be the prior's
      u.profile = {-HUGE_VAL, HUGE_VAL};
      continue;
    }
    // The cost's own curvature claims a smaller sigma where throws scatter beyond the noise.
    Eigen::MatrixXd H = rounds.information();
    for (Eigen::Index j = 0; j < width; ++j)
      if (const auto& prior = fit.campaign[static_cast<std::size_t>(j)].unknown.prior_sigma)
        H(j, j) += 1 / (*prior * *prior);
    const auto i = static_cast<Eigen::Index>(k);
    const Eigen::VectorXd column = guarded_inverse(H, rounds.shared().scale).col(i);
    const double claimed = column[i];
    if (!column.allFinite() || !(claimed > 0)) {
      u.profile = {-HUGE_VAL, HUGE_VAL};
      continue;
    }
    const double unit = 0.5 * u.sigma * u.sigma / claimed;
    const Eigen::VectorXd along = column / claimed;
    const std::array<double, 2> found{end_of(rounds, fit, k, along, t, unit, -1),
                                      end_of(rounds, fit, k, along, t, unit, 1)};
    if (std::abs(u.value - half - found[0]) > 0.1 * half || std::abs(u.value + half - found[1]) > 0.1 * half)
      u.profile = found;
  }
}

}  // namespace unhand::fitting
