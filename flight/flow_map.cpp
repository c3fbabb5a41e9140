#include "flight/flow_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "dynamics/require_finite.hpp"
#include "flight/fly.hpp"

namespace unhand::flight {

using dynamics::Dual;
using dynamics::value_of;

namespace {

void validate(const Medium& medium) {
  if (!(medium.gravity > 0 && medium.drag_k >= 0 && std::isfinite(medium.gravity + medium.drag_k)))
    throw std::invalid_argument(fmt::format("medium: gravity {} m/s² is not > 0, or drag_k {} 1/m not >= 0",
                                            medium.gravity, medium.drag_k));
}

template <class S>
void validate(const PlaneState<S>& state) {
  dynamics::require_finite("flight in the plane", {{"r", value_of(state.r), "m"},
                                                   {"z", value_of(state.z), "m"},
                                                   {"r_rate", value_of(state.r_rate), "m/s"},
                                                   {"z_rate", value_of(state.z_rate), "m/s"}});
}

}  // namespace

template <class S>
std::optional<PlaneState<S>> landing_of(const PlaneState<S>& release, const Medium& medium) {
  validate(release);
  validate(medium);
  if (medium.drag_k == 0) {  // the closed form without fly()'s checks: planners ask a hundred thousand times
    const auto landing = project<S>({release.r, release.z, S(0.0)}, {release.r_rate, release.z_rate, S(0.0)},
                                    {S(0.0), S(-medium.gravity)}, S(0.0));
    if (!landing) return {};
    return PlaneState<S>{landing->pose.x, landing->pose.z, landing->twist.vx, landing->twist.vz};
  }
  FlightProblem<S> problem;
  problem.pose = {release.r, release.z, S(0.0)};
  problem.twist = {release.r_rate, release.z_rate, S(0.0)};
  problem.gravity = {S(0.0), S(-medium.gravity)};
  problem.drag_k = S(medium.drag_k);
  const auto flown = fly(problem);
  if (flown.outcome != FlightOutcome::landed) return {};
  const auto& [x, z, theta] = flown.landing.pose;
  return PlaneState<S>{x, z, flown.landing.twist.vx, flown.landing.twist.vz};
}

template std::optional<PlaneState<double>> landing_of(const PlaneState<double>&, const Medium&);
template std::optional<PlaneState<Dual>> landing_of(const PlaneState<Dual>&, const Medium&);

std::optional<FlowMap> flow_map(const PlaneState<double>& at, const Medium& medium) {
  using dynamics::independent;
  const auto landing = landing_of<Dual>(
      {independent(at.r, 0), independent(at.z, 1), independent(at.r_rate, 2), independent(at.z_rate, 3)},
      medium);
  if (!landing) return {};
  const auto& v = landing->r.v;
  return FlowMap{landing->r.a, {v[0], v[1], v[2], v[3]}};
}

namespace {

/// |x − c|/h − 1
double beyond(double x, double low, double high) {
  return std::abs(x - 0.5 * (low + high)) / (0.5 * (high - low)) - 1;
}

void validate(const LandingSet& set) {
  if (!(set.half_length > 0 && std::isfinite(set.half_length)))
    throw std::invalid_argument(
        fmt::format("landing set: half_length {} is not in (0, inf) m", set.half_length));
  if (!(set.r_rate_low < set.r_rate_high) || !(set.z_rate_low < set.z_rate_high) || !(set.z_rate_high <= 0))
    throw std::invalid_argument(
        fmt::format("landing set: velocities [{}, {}] and [{}, {}] m/s are not ranges, the second at most 0",
                    set.r_rate_low, set.r_rate_high, set.z_rate_low, set.z_rate_high));
}

}  // namespace

double tube_level(const PlaneState<double>& release, const LandingSet& set, const Medium& medium) {
  validate(set);
  const auto landing = landing_of(release, medium);
  if (!landing) {
    const double rise = release.z_rate > 0 ? release.z_rate * release.z_rate / (2 * medium.gravity) : 0;
    return 1 + std::max(0.0, -(release.z + rise)) / set.half_length;
  }
  return std::max({beyond(landing->r, -set.half_length, set.half_length),
                   beyond(landing->r_rate, set.r_rate_low, set.r_rate_high),
                   beyond(landing->z_rate, set.z_rate_low, set.z_rate_high)});
}

}  // namespace unhand::flight
