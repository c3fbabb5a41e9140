#include "flight/flow_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "dynamics/require_finite.hpp"
#include "flight/fly.hpp"

namespace unhand::flight {

using dynamics::Dual;
using dynamics::value_of;

namespace {

/// Of a flight with drag [s]: what rises at 100 m/s and comes down as slowly as a feather has landed by then.
constexpr double kLongest = 1000;

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
  problem.longest = kLongest;
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
  const bool finite = std::isfinite(set.r_rate_low) && std::isfinite(set.r_rate_high) &&
                      std::isfinite(set.z_rate_low) && std::isfinite(set.z_rate_high);
  if (!finite || !(set.r_rate_low < set.r_rate_high) || !(set.z_rate_low < set.z_rate_high) ||
      !(set.z_rate_high <= 0))
    throw std::invalid_argument(fmt::format(
        "landing set: velocities [{}, {}] and [{}, {}] m/s are not finite ranges, the second at most 0",
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

namespace {

/// With drag, the fastest that a flight is followed back to [m/s]: backward in time, drag has the speed grow
/// without bound within a finite time, before which there is no flight.
constexpr double kFastest = 100;
/// How slowly a sampled flight may come down, without drag and with it [m/s]: it has just risen above the
/// height, by 5e-14 m and by 1e-6 m, and rounding or the integrator must not lose that.
constexpr double kSlowest = 1e-6, kSlowestWithDrag = 5e-3;

/// `longest` seconds backward in time, or to where it had kFastest: by the closed form, or by Runge-Kutta
/// steps of at most 1 ms and a hundredth of the time in which drag takes the speed away, whose error at
/// throwing speeds is below 1e-11 m.
PlaneState<double> before(PlaneState<double> s, double longest, const Medium& medium) {
  const double g = medium.gravity, k = medium.drag_k;
  if (k == 0)
    return {s.r - longest * s.r_rate, s.z - longest * s.z_rate - 0.5 * g * longest * longest, s.r_rate,
            s.z_rate + g * longest};
  const auto rate = [&](const PlaneState<double>& x) -> PlaneState<double> {
    const double drag = k * std::hypot(x.r_rate, x.z_rate);
    return {x.r_rate, x.z_rate, -drag * x.r_rate, -drag * x.z_rate - g};
  };
  const auto plus = [](const PlaneState<double>& a, double h,
                       const PlaneState<double>& b) -> PlaneState<double> {
    return {a.r + h * b.r, a.z + h * b.z, a.r_rate + h * b.r_rate, a.z_rate + h * b.z_rate};
  };
  for (double left = longest; left > 0;) {
    const double speed = std::hypot(s.r_rate, s.z_rate);
    if (speed > kFastest) break;
    const double step = std::min({left, 1e-3, 1e-2 / (k * std::max(speed, 1e-3))}), h = -step;
    const auto k1 = rate(s), k2 = rate(plus(s, h / 2, k1)), k3 = rate(plus(s, h / 2, k2)),
               k4 = rate(plus(s, h, k3));
    s = plus(plus(plus(plus(s, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
    left -= step;
  }
  return s;
}

}  // namespace

std::vector<PlaneState<double>> sample_tube(const LandingSet& set, const Medium& medium,
                                            const TubeSampling& sampling) {
  validate(set);
  validate(medium);
  if (sampling.count < 0 || sampling.boundary_every < 1 || !(sampling.longest > 0 && sampling.longest <= 100))
    throw std::invalid_argument(fmt::format(
        "sample_tube: count = {} is not >= 0, boundary_every = {} not >= 1, or longest = {} s not in "
        "(0, 100] s",
        sampling.count, sampling.boundary_every, sampling.longest));
  std::mt19937_64 random(sampling.seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const std::array<std::array<double, 2>, 3> ranges{{{-set.half_length, set.half_length},
                                                     {set.r_rate_low, set.r_rate_high},
                                                     {set.z_rate_low, set.z_rate_high}}};
  std::vector<PlaneState<double>> out;
  out.reserve(static_cast<std::size_t>(sampling.count));
  for (int i = 0; i < sampling.count; ++i) {
    double x[3];
    for (int k = 0; k < 3; ++k) x[k] = ranges[k][0] + unit(random) * (ranges[k][1] - ranges[k][0]);
    if (i % sampling.boundary_every == 0) {
      const int face = static_cast<int>(6 * unit(random));
      x[face % 3] = ranges[face % 3][face / 3];
    }
    // A flight that comes down at ż = 0 has just touched the height: the tube ends there.
    const double down = std::min(x[2], medium.drag_k > 0 ? -kSlowestWithDrag : -kSlowest);
    out.push_back(before({x[0], 0, x[1], down}, unit(random) * sampling.longest, medium));
  }
  return out;
}

}  // namespace unhand::flight
