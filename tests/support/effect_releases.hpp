// Releases of random throws under a variation of the friction limits.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/support/simple_scenes.hpp"

namespace unhand::support {

constexpr int kDetach = 6;  ///< x, z, θ, v_x, v_z, ω at detach

template <class S>
struct Detached {
  std::array<S, kDetach> state;
  std::vector<int> modes;  ///< entered, in order
};

template <class S>
Detached<S> detach(const std::string& law, const RandomThrow& thrown,
                   const contact::FrictionVariation<S>& variation, double tolerance) {
  contact::ContactParameters<S> p;
  p.patch = {S(thrown.patch.mu), S(thrown.patch.radius), S(thrown.patch.torque_factor), thrown.patch.pads};
  p.variation = variation;
  const auto model = contact::make_contact_model(law, p);
  const release::ReleaseProblem<S> problem{thrown.hand,
                                           thrown.force,
                                           *model,
                                           {S(thrown.body.mass), S(thrown.body.inertia)},
                                           {S(0.0), S(-kGravity)},
                                           {S(thrown.grasp.com_offset), S(thrown.grasp.angle)},
                                           0.0,
                                           {},
                                           S(0.0)};
  release::ReleaseOptions options;
  options.integrator.tolerances = {tolerance, 1e-2 * tolerance};
  // one method for both scalars: the double runs then follow the same steps
  if (law != "sliding_pivot") options.integrator.method = dynamics::Method::radau;
  const auto result = simulate_release(problem, options);
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << law;
  const auto& [time, pose, twist] = result.detach;
  Detached<S> out{{pose.x, pose.z, pose.theta, twist.vx, twist.vz, twist.omega}, {result.slips_at_start}};
  for (const auto& event : result.events) out.modes.push_back(event.mode_after);
  return out;
}

}  // namespace unhand::support
