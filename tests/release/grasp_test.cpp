// Where pads hold an object.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/normal_force.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::release {
namespace {

/// A bar held at (ahead, across) of its own axes is the bar held at |(ahead, across)| on its axis and turned:
/// round pads and a body of one mass and inertia do not know where its x axis points.
TEST(Grasp, BesideTheAxisIsOnTheAxisOfATurnedBody) {
  const double ahead = 0.06, across = 0.008, turned = std::atan2(across, ahead);
  const auto hand = support::accelerating_hand({2, 5, -30}, 0.3);
  const contact::ProfileNormalForce force(contact::OpeningProfile<dynamics::Dual>{
      0.05, dynamics::Dual(25.0), dynamics::Dual(0.005), dynamics::Dual(0.06), dynamics::Dual(1.0)});
  for (const char* law : {"limit_surface_disc", "limit_surface", "sliding_pivot"}) {
    contact::ContactParameters<dynamics::Dual> parameters;
    parameters.patch =
        contact::Patch<dynamics::Dual>::of_length(dynamics::Dual(0.5), dynamics::Dual(0.007), 2);
    parameters.open_command = 0.05;
    const auto contact = contact::make_contact_model(law, parameters);
    const auto thrown = [&](const Grasp<double>& grasp) {
      ReleaseOptions options;
      options.integrator.tolerances = {1e-10, 1e-13};
      return simulate_release(
          ReleaseProblem<double>{hand, force, *contact, {0.2, 4e-4}, {0, -9.81}, grasp, 0.0, {}, 0.0},
          options);
    };
    const auto beside = thrown({ahead, 0.4, across});
    const auto on = thrown({std::hypot(ahead, across), 0.4 + turned, 0});
    ASSERT_EQ(beside.outcome, ReleaseOutcome::detached);
    EXPECT_NEAR(beside.detach.pose.x, on.detach.pose.x, 1e-9) << law;
    EXPECT_NEAR(beside.detach.pose.z, on.detach.pose.z, 1e-9) << law;
    EXPECT_NEAR(beside.detach.pose.theta, on.detach.pose.theta - turned, 1e-8) << law;
    EXPECT_NEAR(beside.detach.twist.omega, on.detach.twist.omega, 1e-6) << law;
    EXPECT_GT(std::abs(on.relative.angle - 0.4 - turned), 0.01) << law << ": it turned in the hand";
  }
}

TEST(Grasp, OneFarBesideTheAxisIsRefused) {
  const auto hand = support::still_hand(1);
  const support::ConstantForce force(10);
  contact::ContactParameters<dynamics::Dual> parameters;
  parameters.patch = contact::Patch<dynamics::Dual>::of_length(dynamics::Dual(0.5), dynamics::Dual(0.007), 2);
  const auto contact = contact::make_contact_model("limit_surface", parameters);
  EXPECT_THROW(simulate_release(ReleaseProblem<double>{
                   hand, force, *contact, {0.2, 4e-4}, {0, -9.81}, {0.05, 0, std::nan("")}, 0.0, {}, 0.0}),
               std::invalid_argument);
}

}  // namespace
}  // namespace unhand::release
