// The sliding pivot where force and torque reach their limits together: a level bar in a hand at rest, whose
// lever is the patch's length, so that τ_p/τ_max = f_p/f_max = m g/f_max throughout.
#include <gtest/gtest.h>

#include "contact/sliding_pivot.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

/// Two pads that open linearly on a bar held beside its CoM.
struct LevelBar {
  static constexpr double lever = 0.01, mass = 0.2, inertia = 1e-5;  // m, kg, kg m²
  static constexpr double friction = 0.5, grip = 30, opening = 0.1;  // -, N, s
  static constexpr double command = 0.02, free = command + opening;  // s
};

struct BarLetGo {
  double omega, vz;  // rad/s, m/s, at detach
  std::string last;  // the last mode with friction
};

/// `excess`: of the patch's length over the lever; above zero the force's limit comes first.
BarLetGo release_with(double excess, double tolerance = 1e-9) {
  const support::SwayingHand hand = support::still_hand(LevelBar::free + 0.02);
  const ProfileNormalForce force({LevelBar::command, LevelBar::grip, 0, LevelBar::opening, 1});
  const SlidingPivot model(Patch<double>{LevelBar::friction, 1.5 * LevelBar::lever * (1 + excess)});
  const release::ReleaseProblem<double> problem{
      hand, force, model, {LevelBar::mass, LevelBar::inertia}, {0, -9.81}, {LevelBar::lever, 0},
      0.0,  {},    0.0};
  const auto result =
      simulate_release(problem, {.integrator = {.tolerances = {tolerance, 0.01 * tolerance}}});
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << excess;
  const auto words = mode_events(problem, result);
  return {result.detach.twist.omega, result.detach.twist.vz, words.at(words.size() - 2).mode};
}

// What pivots must slide before f_max is gone, however soon after the torque's limit the force's comes, so
// also within the microsecond in which the onset of a spin is followed in closed form. At zero excess the
// torque l f_max of the force that is left is τ_max, which just holds: no spin, and a fall under m g − f_max
// for as long as f_max lasts, so v = −g τ/2.
TEST(BothLimits, WhatPivotsSlidesBeforeTheEnd) {
  const double left = LevelBar::opening * LevelBar::mass * 9.81 / (2 * LevelBar::friction * LevelBar::grip);
  for (const double size : {1e-3, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 0.0})
    for (const double sign : {1.0, -1.0}) {
      const BarLetGo bar = release_with(sign * size);
      EXPECT_NE(bar.last.substr(0, 5), "pivot") << sign * size;
      // What is spun until the force's limit: 4 to 7 rad/s times the excess.
      EXPECT_NEAR(bar.omega, 0, 1e-9 + 10 * size) << sign * size << ' ' << bar.last;
      EXPECT_NEAR(bar.vz, -9.81 * left / 2, 2e-7) << sign * size << ' ' << bar.last;
    }
}

// Where the two are exactly together the spin that sets out is of rounding's size, and so is the guard that
// waits for its end: whenever that is taken to be, the fall is the same.
TEST(BothLimits, ASpinOfRoundingsSizeDoesNotDisturbTheFall) {
  const double left = LevelBar::opening * LevelBar::mass * 9.81 / (2 * LevelBar::friction * LevelBar::grip);
  for (const double tolerance : {1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
    const BarLetGo bar = release_with(0, tolerance);
    EXPECT_NEAR(bar.omega, 0, 1e-9) << tolerance;
    EXPECT_NEAR(bar.vz, -9.81 * left / 2, 10 * tolerance + 1e-12) << tolerance;
  }
}

}  // namespace
}  // namespace unhand::contact
