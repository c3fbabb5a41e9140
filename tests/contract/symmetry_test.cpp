// What physics does not know of: where up is on the page, left from right, and uniform motion.
#include <cmath>

#include "tests/contract/every_model.hpp"

namespace unhand {
namespace {

using dynamics::Vec2;
using support::TransformedHand;

class Symmetry : public EveryModel {
 protected:
  static constexpr int kThrows = 25;
  static release::ReleaseOptions options() {
    // The steps depend on the frame (errors are judged by component), so results agree to the integrator's
    // error: 1e-9 is asked for, 1e-11 relative per step.
    return {.integrator = {.tolerances = {1e-11, 1e-13}}};
  }
  static void expect_same(const contact::Relative<double>& a, const contact::Relative<double>& b,
                          double tolerance, const std::string& inputs) {
    EXPECT_NEAR(a.arm.x, b.arm.x, tolerance) << inputs;
    EXPECT_NEAR(a.arm.z, b.arm.z, tolerance) << inputs;
    EXPECT_NEAR(a.angle, b.angle, tolerance) << inputs;
    EXPECT_NEAR(a.slip.x, b.slip.x, tolerance) << inputs;
    EXPECT_NEAR(a.slip.z, b.slip.z, tolerance) << inputs;
    EXPECT_NEAR(a.spin, b.spin, tolerance * 20) << inputs;  // rad/s: a metre per second at 5 cm
  }
};
UNHAND_EVERY_MODEL(Symmetry);

TEST_P(Symmetry, NoDirectionIsSpecial) {
  std::mt19937_64 random(21);
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    const double angle = std::uniform_real_distribution<double>(-M_PI, M_PI)(random);
    const auto model = make(support::parameters_of(thrown));
    const auto problem = support::problem_of(thrown, *model);
    const TransformedHand turned(thrown.hand, false, angle, {});
    const release::ReleaseProblem<double> other{
        turned,       thrown.force, *model, thrown.body, turned.vector(problem.gravity),
        thrown.grasp, 0.0,          {},     0.0};
    const auto a = simulate_release(problem, options()), b = simulate_release(other, options());
    ASSERT_EQ(a.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    ASSERT_EQ(b.outcome, a.outcome) << describe(thrown);
    auto expected = a.relative;
    expected.slip = turned.vector(expected.slip);
    expect_same(b.relative, expected, 1e-9, describe(thrown) + " angle " + std::to_string(angle));
  }
}

TEST_P(Symmetry, NeitherIsLeftNorRight) {
  std::mt19937_64 random(22);
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    auto pads = support::parameters_of(thrown);
    if (i % 3 == 2) pads.variation.compliance = 1e-5;  // m/N: they give
    const auto model = make(pads);
    const auto problem = support::problem_of(thrown, *model);
    const TransformedHand mirrored(thrown.hand, true, 0, {});
    const release::ReleaseProblem<double> other{mirrored,
                                                thrown.force,
                                                *model,
                                                thrown.body,
                                                problem.gravity,
                                                {thrown.grasp.com_offset, -thrown.grasp.angle},
                                                0.0,
                                                {},
                                                0.0};
    const auto a = simulate_release(problem, options()), b = simulate_release(other, options());
    ASSERT_EQ(a.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    ASSERT_EQ(b.outcome, a.outcome) << describe(thrown);
    const auto& y = a.relative;
    expect_same(b.relative, {{y.arm.x, -y.arm.z}, -y.angle, {-y.slip.x, y.slip.z}, -y.spin}, 1e-9,
                describe(thrown));
    EXPECT_NEAR(b.detach.pose.x, -a.detach.pose.x, 1e-9);
    EXPECT_NEAR(b.detach.twist.omega, -a.detach.twist.omega, 2e-8);
  }
}

TEST_P(Symmetry, UniformMotionIsRest) {
  std::mt19937_64 random(23);
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    const auto model = make(support::parameters_of(thrown));
    const auto problem = support::problem_of(thrown, *model);
    const Vec2<double> v{3.5, -7.25};
    const TransformedHand moving(thrown.hand, false, 0, v);
    const release::ReleaseProblem<double> other{
        moving, thrown.force, *model, thrown.body, problem.gravity, thrown.grasp, 0.0, {}, 0.0};
    const auto a = simulate_release(problem, options()), b = simulate_release(other, options());
    ASSERT_EQ(b.outcome, a.outcome) << describe(thrown);
    // the law never sees the velocity of the hand: equal to the bit
    EXPECT_EQ(b.relative.state(), a.relative.state()) << describe(thrown);
    EXPECT_EQ(b.detach.time, a.detach.time);
    EXPECT_NEAR(b.detach.twist.vx, a.detach.twist.vx + v.x, 1e-12);
    EXPECT_NEAR(b.detach.twist.vz, a.detach.twist.vz + v.z, 1e-12);
    EXPECT_NEAR(b.detach.pose.z, a.detach.pose.z + v.z * a.detach.time, 1e-12);
  }
}

/// A grip that is weak for what the hand does: most throws slide, brake and turn, many of them at once.
struct RoughThrow {
  std::vector<release::HandSegment> stretches;
  dynamics::Pose<double> pose;
  dynamics::Twist<double> twist;
  contact::OpeningProfile<double> opening;
  contact::ContactParameters<double> pads;
  dynamics::RigidBody<double> body;
  release::Grasp<double> grasp;
  Vec2<double> slip;
  double spin{};

  explicit RoughThrow(std::mt19937_64& random) {
    const auto uniform = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
    const double s = uniform(0, 1) < 0.5 ? 5 : 30;
    pose = {uniform(-1, 1), uniform(0, 2), uniform(-3, 3)};
    twist = {uniform(-3, 3), uniform(-3, 3), uniform(-6, 6)};
    stretches = {{uniform(0.03, 0.09),
                  {uniform(-s, s), uniform(-s, s), uniform(-3 * s, 3 * s)},
                  {uniform(-10 * s, 10 * s), uniform(-10 * s, 10 * s), 0}},
                 {0.3, {uniform(-s, s), uniform(-s, s), uniform(-3 * s, 3 * s)}}};
    opening = {uniform(0.01, 0.04), uniform(5, 60), uniform(0, 0.02), uniform(0.02, 0.1), uniform(0.7, 3)};
    pads.patch = {uniform(0.2, 0.9), uniform(0.004, 0.02)};
    pads.open_command = opening.open_command;
    pads.delay = 0.02;
    const double mass = uniform(0.05, 0.5), gyration = uniform(0.02, 0.15);
    body = {mass, mass * gyration * gyration};
    grasp = {uniform(-0.15, 0.15), uniform(-3, 3)};
    if (uniform(0, 1) < 0.3) slip = {uniform(-1, 1), uniform(-1, 1)}, spin = uniform(-5, 5);
  }

  /// The same throw, `later` [s].
  release::ReleaseResult<double> simulate(const contact::ContactModel& model, double later,
                                          const release::ReleaseOptions& options) const {
    auto ends = stretches;
    for (auto& stretch : ends) stretch.t_end += later;
    auto profile = opening;
    profile.open_command += later;
    const auto hand = release::PolynomialHand::segments(later, pose, twist, ends);
    const contact::ProfileNormalForce force(profile);
    const bool carried = model.name() == "gripper_delay";
    return simulate_release(
        release::ReleaseProblem<double>{hand, force, model, body, dynamics::level_gravity(9.81), grasp, later,
                                        carried ? Vec2<double>{} : slip, carried ? 0.0 : spin},
        options);
  }
};

TEST_P(Symmetry, NoInstantIsSpecial) {
  std::mt19937_64 random(11);
  release::ReleaseOptions options;
  options.integrator.tolerances = {1e-9, 1e-11};
  int slid_both_ways = 0;
  const int throws = decoupled() ? 6000 : 300;  // it takes that many to meet every pair of modes
  for (int i = 0; i < throws; ++i) {
    const RoughThrow thrown(random);
    auto pads = thrown.pads;
    const auto a = thrown.simulate(*make(pads), 0, options);
    ASSERT_EQ(a.outcome, release::ReleaseOutcome::detached) << i;
    for (const auto& event : a.events) slid_both_ways += event.mode_before == 9 && event.mode_after != 9;
    for (const double later : {-1.0, 10.0}) {
      pads.open_command = thrown.opening.open_command + later;
      const auto b = thrown.simulate(*make(pads), later, options);
      ASSERT_EQ(b.outcome, a.outcome) << i;
      EXPECT_NEAR(b.detach.time - later, a.detach.time, 1e-9) << i;
      expect_same(b.relative, a.relative, 1e-6, "throw " + std::to_string(i));
    }
  }
  if (decoupled()) {
    EXPECT_GT(slid_both_ways, 20);  // the mode between two slides was reached, and left
  }
}

}  // namespace
}  // namespace unhand
