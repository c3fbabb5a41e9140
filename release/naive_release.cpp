#include "release/naive_release.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "release/release_system.hpp"

namespace unhand::release {

using dynamics::Acceleration;
using dynamics::Pose;
using dynamics::Twist;
using dynamics::Vec2;
using dynamics::Wrench;

NaiveResult simulate_release_naive(const ReleaseProblem<double>& problem, const contact::Patch<double>& patch,
                                   const NaiveOptions& options) {
  validate(problem);
  constexpr double kLeast = 1e-7;     // [s]: a release of 0.1 s then takes a million steps
  constexpr double kMostSteps = 1e8;  // some seconds of computing
  const double release = problem.normal_force.release_time(), L = patch.length();
  const double last_time = std::min(release, problem.hand.end());
  const double least = std::max(kLeast, (last_time - problem.start) / kMostSteps);
  if (!(options.step >= least && options.step <= 0.1))
    throw std::invalid_argument(
        fmt::format("naive release: step = {} is not in [{}, 0.1] s", options.step, least));
  if (!(options.smoothing >= 0 && std::isfinite(options.smoothing)))
    throw std::invalid_argument(
        fmt::format("naive release: smoothing = {} is not in [0, inf) m/s", options.smoothing));
  validate(patch);
  require_released(problem.normal_force, problem.hand.end());
  double t = problem.start;
  HandState<double> hand = problem.hand.at({t, t + options.step}, t);
  const double theta = hand.pose.theta + problem.grasp.angle;
  Vec2<double> r = dynamics::rotate(theta, Vec2<double>{problem.grasp.com_offset, problem.grasp.across});
  Pose<double> pose{hand.pose.x + r.x, hand.pose.z + r.z, theta};
  Twist<double> twist =
      dynamics::twist_at_com(Twist<double>{hand.twist.vx + problem.slip.x, hand.twist.vz + problem.slip.z,
                                           hand.twist.omega + problem.spin},
                             r);

  NaiveResult result;
  if (!(release <= problem.hand.end())) {
    result.outcome = ReleaseOutcome::never_separated;
    return result;
  }
  std::array<double, 3> last{};
  while (t < release) {
    const double dt = std::min(options.step, release - t);
    const dynamics::Window window{t, t + dt};
    hand = problem.hand.at(window, t);
    r = {pose.x - hand.pose.x, pose.z - hand.pose.z};
    const Twist<double> patch_twist = dynamics::twist_at_patch(twist, r);
    const std::array<double, 3> slip{patch_twist.vx - hand.twist.vx, patch_twist.vz - hand.twist.vz,
                                     L * (patch_twist.omega - hand.twist.omega)};
    const double size = std::sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2] +
                                  options.smoothing * options.smoothing);
    const double pressed = problem.normal_force.at(window, t);
    if (!(pressed >= 0))
      throw std::invalid_argument(
          fmt::format("naive release: normal force = {} N at {} s is not in [0, inf) N", pressed, t));
    const double k = size > 0 ? patch.f_max(pressed) / size : 0.0;
    const Acceleration<double> a = dynamics::acceleration_under(
        problem.body, Wrench<double>{-k * slip[0], -k * slip[1], -k * L * slip[2]}, r, problem.gravity);
    if (last[0] * slip[0] + last[1] * slip[1] + last[2] * slip[2] < 0) ++result.reversals;
    last = slip;
    pose = {pose.x + dt * twist.vx, pose.z + dt * twist.vz, pose.theta + dt * twist.omega};
    twist = {twist.vx + dt * a.ax, twist.vz + dt * a.az, twist.omega + dt * a.alpha};
    t += dt;
    ++result.steps;
  }
  result.detach = {t, pose, twist};
  result.outcome = is_finite(result.detach) ? ReleaseOutcome::detached : ReleaseOutcome::not_solved;
  return result;
}

}  // namespace unhand::release
