#include "planners/flip/flip_throw.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "contact/registry.hpp"
#include "flight/projectile.hpp"
#include "planners/arm/dynamics.hpp"
#include "release/simulate_release.hpp"

namespace unhand::planners::flip {

std::optional<FlipPose> fly_flip(const DetachVector& d) {
  for (const double x : d)
    if (!std::isfinite(x))
      throw std::invalid_argument(fmt::format("flight of a bar: a state with {} is not finite", x));
  const auto landing =
      flight::project<double>({d[0], d[1], d[2]}, {d[3], d[4], d[5]}, {0.0, kGravity.z()}, 0.0);
  if (!landing) return {};
  return FlipPose{landing->pose.x, landing->pose.theta + kFromHanging};
}

std::optional<FlipRelease> release_bar(const release::HandMotion& hand, const HeldBar& held,
                                       std::vector<dynamics::Wrench<double>>* on_bar, double step) {
  if (!contact::follows_pads(held.pads.law))
    throw std::invalid_argument(
        fmt::format("release of a bar: the law {} does not follow the pads", held.pads.law));
  if (!(step > 0 && std::isfinite(step)))
    throw std::invalid_argument(fmt::format("release of a bar: step = {} is not in (0, inf) s", step));
  contact::ContactParameters<double> pads;
  pads.patch = contact::Patch<double>::of_length(held.pads.mu, held.pads.length, held.pads.count);
  pads.law_values = held.pads.law_values;
  const auto law = contact::make_contact_model(held.pads.law, pads);
  const Gripper& g = held.gripper;
  const contact::ProfileNormalForce force(
      contact::OpeningProfile<double>{0.0, g.grip_force, g.dead_time, g.opening_time, g.shape});
  if (!(force.release_time() < hand.end())) return {};
  const release::ReleaseProblem<double> problem{hand,
                                                force,
                                                *law,
                                                {held.bar.mass, held.bar.inertia},
                                                {0.0, kGravity.z()},
                                                {held.bar.com_offset, held.angle},
                                                hand.begin(),
                                                {},
                                                0.0};
  release::ReleaseOptions options;
  options.integrator.record = on_bar != nullptr;
  const auto result = release::simulate_release<double>(problem, options);
  if (result.outcome != release::ReleaseOutcome::detached) return {};
  const auto& detach = result.detach;
  const auto at = hand.at({hand.begin(), hand.end()}, detach.time);
  if (on_bar) {
    on_bar->clear();
    for (int k = 0; k * step < hand.end(); ++k) {
      const double t = k * step;
      on_bar->push_back(t < detach.time ? release::sample_release(problem, result, t).wrench
                                        : dynamics::Wrench<double>{});
    }
  }
  return FlipRelease{
      detach.time,
      {detach.pose.x, detach.pose.z, detach.pose.theta, detach.twist.vx, detach.twist.vz, detach.twist.omega},
      {at.pose.x, at.pose.z, at.pose.theta, at.twist.vx, at.twist.vz, at.twist.omega}};
}

}  // namespace unhand::planners::flip
