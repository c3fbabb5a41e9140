// Phases of next to no length: onsets and stops beside a time event, brakes of light objects, pads without
// friction that nothing is asked of.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/support/simple_scenes.hpp"

namespace unhand {
namespace {

constexpr const char* kSlidingLaws[] = {"limit_surface", "limit_surface_disc", "limit_surface_quartic",
                                        "sliding_pivot"};
const dynamics::RigidBody<double> kBlock{0.25, 4e-4};

std::unique_ptr<contact::ContactModel> block_law(const char* name) {
  contact::ContactParameters<double> pads;
  pads.patch = {0.4, 0.01, 2.0 / 3, 2};  // f_max = 0.8 f_N, τ_max = f_max · 20/3 mm
  return contact::make_contact_model(name, pads);
}

double first_guard(const release::ReleaseResult<double>& result) {
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) return event.t;
  return std::nan("");
}

/// Every instant from the start to the end is recorded, and events are in order.
void expect_covered(const release::ReleaseProblem<double>& problem,
                    const release::ReleaseResult<double>& result, const std::string& what) {
  const auto& pieces = result.trajectory.pieces;
  ASSERT_FALSE(pieces.empty()) << what;
  EXPECT_EQ(pieces.front().t0, problem.start) << what;
  for (std::size_t i = 1; i < pieces.size(); ++i)  // a time minus a lead is rounded
    EXPECT_NEAR(pieces[i].t0, pieces[i - 1].t1, 1e-16) << what << ' ' << i;
  EXPECT_EQ(pieces.back().t1, result.detach.time) << what;
  for (std::size_t i = 1; i < result.events.size(); ++i)
    EXPECT_GE(result.events[i].t, result.events[i - 1].t) << what << ' ' << i;
}

// The hand's acceleration jumps just as the grip gives way: from within the spacing of times to a
// microsecond, so that what is left of the phase after the onset's lead is from nothing to more than that.
TEST(ShortPhases, AnOnsetNextToAJumpOfTheHand) {
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.013, 20, 0, 0.05, 1});
  for (const char* name : kSlidingLaws)
    for (const dynamics::Acceleration<double>& a :
         {dynamics::Acceleration<double>{8, 6, 0}, {0, 0, 100}, {8, 3, 60}}) {
      const auto law = block_law(name);
      const auto released = [&](double jump) {
        const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {0, 0, 0},
                                                            {{jump, a}, {0.2, {2, -3, 10}}});
        const release::ReleaseProblem<double> problem{hand, force, *law, kBlock, {0, 0}, {0.0, 0.3}};
        const auto result =
            release::simulate_release(problem, {.integrator = {.tolerances = {}, .record = true}});
        EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached)
            << name << ' ' << jump << ' ' << dynamics::to_string(result.integration);
        expect_covered(problem, result, name);
        return result;
      };
      const double gives_way = first_guard(released(0.1));
      const auto later = released(gives_way + 1e-7).detach.twist;
      for (const double size : {1e-17, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9})
        for (const double by : {0.0, 1 * size, 2 * size, 3 * size, 5 * size, 7 * size}) {
          const auto at = released(gives_way + by).detach.twist;
          EXPECT_NEAR(at.vx, later.vx, 1e-5) << name << ' ' << by;  // 100 m/s² in 1e-7 s
          EXPECT_NEAR(at.omega, later.omega, 1e-4) << name << ' ' << by;
        }
    }
}

// A slip that stops at the start or beside a jump of the hand is followed to rest along a straight line: that
// instant is recorded, too, and does not reach beyond the jump.
TEST(ShortPhases, AStopBesideATimeEventLeavesNoHole) {
  const support::ConstantForce force(20);
  for (const char* name : kSlidingLaws) {
    const auto law = block_law(name);
    const auto stops = [&](double jump, double slip) {
      const auto hand = release::PolynomialHand::segments(0.0, {0, 0, 0}, {0, 0, 0},
                                                          {{jump, {0, 0, 0}}, {0.2, {1, -1, 3}}});
      const release::ReleaseProblem<double> problem{hand,       force,      *law, kBlock,
                                                    {0, -9.81}, {0.0, 0.3}, 0.0,  {slip, 0.4 * slip}};
      const auto result =
          release::simulate_release(problem, {.integrator = {.tolerances = {}, .record = true}});
      EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated) << name << ' ' << jump;
      EXPECT_EQ(norm(result.relative.slip), 0) << name << ' ' << jump;
      expect_covered(problem, result, std::string(name) + ' ' + std::to_string(jump));
      return first_guard(result);
    };
    for (const double slip : {1e-12, 1e-9, 1e-8, 1e-7, 2e-7, 3e-7, 1e-6}) stops(0.1, slip);
    const double rest = stops(0.1, 0.5);
    for (const double before : {1e-7, 3e-8, 1.5e-8, 1e-8, 7e-9, 3e-9, 1e-9, 1e-11, 1e-13, 0.0, -1e-9})
      stops(rest - before, 0.5);
  }
}

// A brake across the lever turns a light object at once, in nanoseconds, and only then is on its way to rest:
// it is not at rest, and its energy not gone, by then.
TEST(ShortPhases, ABrakeOfALightObjectClosesItsEnergy) {
  constexpr double kAcross[] = {1e-2, 1e-4, 1e-5, 1e-6, 1e-7};  // I/(m l²)
  int brakes = 0;
  for (const double ratio : kAcross) {
    std::mt19937_64 random(5);
    for (int k = 0; k < 60; ++k) {
      const auto thrown = support::random_throw(random, 1.0);
      const double lever = thrown.grasp.com_offset;
      if (lever < 0.02) continue;
      const auto law = contact::make_contact_model("sliding_pivot", support::parameters_of(thrown));
      auto problem = support::problem_of(thrown, *law);
      problem.body.inertia = ratio * problem.body.mass * lever * lever;
      const auto result = release::simulate_release(problem, {.ledger = true});
      ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << ratio << ' ' << k;
      const auto& e = result.ledger;
      const double turned_over = std::abs(e.mechanical_change) + std::abs(e.hand_work) +
                                 std::abs(e.linear_friction) + std::abs(e.torsional_friction) +
                                 e.nonphysical_work;
      // The integrator's 1e-8; the lighter, the faster it sways across the lever while it slides.
      EXPECT_LT(std::abs(e.residual), 1e-6 * turned_over) << ratio << ' ' << k;
      brakes += std::any_of(result.events.begin(), result.events.end(),
                            [](const auto& event) { return event.mode_after >= 6 && event.mode_after <= 8; });
    }
  }
  EXPECT_GE(brakes, 30);
}

// Nothing is asked of the pads while the hand falls freely without turning, so neither of the two limits nor
// a sign of the spin is told by what is demanded at the instant where that ends.
TEST(ShortPhases, PadsWithoutFrictionBesideAHandInFreeFall) {
  std::mt19937_64 random(17);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const auto some = [&](double a, double b) { return uniform(0, 1) < 0.5 ? 0.0 : uniform(a, b); };
  for (int k = 0; k < 500; ++k) {
    std::vector<release::HandSegment> stretches;
    double t = 0;
    for (int i = 0; i < 3; ++i) {
      t += uniform(0.003, 0.03);
      stretches.push_back({t, {some(-9, 9), -9.81 + some(-9, 9), some(-50, 50)}});
      if (uniform(0, 1) < 0.5) stretches.back() = {t, {0, -9.81, some(-50, 50)}};
      if (uniform(0, 1) < 0.3)
        stretches.back().jerk = {uniform(-100, 100), uniform(-100, 100), uniform(-500, 500)};
    }
    stretches.push_back({0.3, {0, -9.81, some(-5, 5)}});
    const dynamics::Twist<double> twist{uniform(-2, 2), uniform(-2, 2), some(-3, 3)};
    const double theta = some(-2, 2), lever = some(-0.15, 0.15), angle = some(-3, 3);
    const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, theta}, twist, stretches);
    const contact::ProfileNormalForce force({0.02, 60, uniform(0, 0.02), uniform(0.02, 0.1), 1});
    contact::ContactParameters<double> pads;
    pads.patch = {0.0, 0.0106};
    const auto law = contact::make_contact_model("sliding_pivot", pads);
    const auto result = release::simulate_release<double>(
        {hand, force, *law, {0.246, 2.4e-3}, dynamics::level_gravity(9.81), {lever, angle}});
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached)
        << k << ' ' << dynamics::to_string(result.integration);
    EXPECT_NEAR(result.detach.twist.omega, twist.omega, 1e-7) << k;
    EXPECT_NEAR(result.detach.twist.vx, twist.vx - twist.omega * lever * std::sin(theta + angle), 1e-6) << k;
    EXPECT_NEAR(result.detach.twist.vz,
                twist.vz + twist.omega * lever * std::cos(theta + angle) - 9.81 * result.detach.time, 1e-6)
        << k;
  }
}

}  // namespace
}  // namespace unhand
