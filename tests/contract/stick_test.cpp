// Sticking is rest: nothing creeps, however the hand moves.
#include "tests/contract/every_model.hpp"

namespace unhand {
namespace {

class Stick : public EveryModel {};
UNHAND_EVERY_MODEL(Stick);

TEST_P(Stick, DoesNotCreepInTenSeconds) {
  // demands up to 35 N and 1.3 N m, limits 160 N and 3.2 N m; the hand sways in all its coordinates
  const support::SwayingHand hand(
      {{{0, 0.3, 0.1, 0.05, 12, 0.3}, {1, -0.2, 0.2, 0.04, 9, 1}, {0.4, 1.5, 0.1, 0.2, 7, 2}}}, 10);
  const support::ConstantForce force(100);
  contact::ContactParameters<double> p;
  p.patch = {0.8, 0.03, 2.0 / 3, 2};
  p.open_command = 20;
  p.delay = 0;
  const auto model = make(p);
  const double offset = 0.123456789, angle = 0.987654321;
  const release::ReleaseProblem<double> problem{
      hand, force, *model, {0.3, 1e-3}, dynamics::level_gravity(9.81), {offset, angle}, 0.0, {}, 0.0};
  const auto result = simulate_release(problem);
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  EXPECT_FALSE(result.slips_at_start);
  EXPECT_TRUE(result.events.empty());
  // bit for bit
  EXPECT_EQ(result.relative.arm.x, offset);
  EXPECT_EQ(result.relative.arm.z, 0.0);
  EXPECT_EQ(result.relative.angle, angle);
  EXPECT_EQ(result.relative.slip.x, 0.0);
  EXPECT_EQ(result.relative.slip.z, 0.0);
  EXPECT_EQ(result.relative.spin, 0.0);
}

/// Only the decoupled model carries the contact point exactly.
class Pivot : public EveryModel {};
INSTANTIATE_TEST_SUITE_P(, Pivot, testing::Values("sliding_pivot"));

TEST_P(Pivot, LeavesThePatchWhereItIs) {
  std::mt19937_64 random(11);
  int pivots = 0;
  for (int i = 0; i < 40; ++i) {
    const auto thrown = support::random_throw(random, 0.3);
    auto p = support::parameters_of(thrown);
    p.patch.mu *= 5;         // strong against sliding,
    p.patch.radius *= 0.04;  // weak against turning
    const auto model = make(p);
    const auto problem = support::problem_of(thrown, *model);
    release::ReleaseOptions options;
    options.integrator.record = true;
    const auto result = simulate_release(problem, options);
    for (const auto& piece : result.trajectory.pieces) {
      if (piece.phase.mode > 2) break;
      pivots += piece.phase.mode > 0;
      for (const auto& y : piece.nodes) {
        EXPECT_EQ(y[0], thrown.grasp.com_offset) << describe(thrown);
        EXPECT_EQ(y[1], 0.0);
        EXPECT_EQ(y[3], 0.0);
        EXPECT_EQ(y[4], 0.0);
      }
    }
  }
  EXPECT_GT(pivots, 100);
}

}  // namespace
}  // namespace unhand
