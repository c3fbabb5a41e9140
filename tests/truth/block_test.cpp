// A block on an incline and a block on an accelerating hand: slides, stops, sticks, goes the other way. Along
// a line every law of friction is Coulomb's, and its answer is a parabola.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

// n μ f_N = 2 × 0.5 × 4 = 4 N on 0.5 kg: friction decelerates by A = 8 m/s².
constexpr double kFriction = 8, kMass = 0.5;

class Block : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    ContactParameters<double> p;
    p.patch = {0.5, 0.02, 2.0 / 3, 2};
    model = make_contact_model(GetParam(), p);
  }
  release::ReleaseResult<double> run(const release::HandMotion& hand, dynamics::Vec2<double> gravity,
                                     dynamics::Vec2<double> slip = {}) {
    const release::ReleaseProblem<double> problem{hand, force, *model, {kMass, 1e-3}, gravity, {0, 0},
                                                  0.0,  slip,  0.0};
    auto result = simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}, .record = true}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
    words = mode_events(problem, result);
    return result;
  }
  static double slip_at(const release::ReleaseResult<double>& result, double t) {
    return Relative<double>::from(result.trajectory.at(t)).slip.x;
  }
  bool decoupled() const { return std::string(GetParam()) == "sliding_pivot"; }

  std::unique_ptr<ContactModel> model;
  support::ConstantForce force{4.0};
  std::vector<release::ModeEvent> words;
};
INSTANTIATE_TEST_SUITE_P(, Block,
                         testing::Values("sliding_pivot", "limit_surface", "limit_surface_disc",
                                         "limit_surface_quartic"),
                         [](const auto& law) { return std::string(law.param); });

// 1e-9: parabolas are exact for every stepper; the onset of a slip is known to a relative 1e-5 over its first
// 5e-6 s.

TEST_P(Block, OnASteepInclineSlidesFromTheStart) {
  const auto hand = support::still_hand(0.5);
  for (const double direction : {0.0, 1.0, -2.0}) {
    const double g = 9.81;
    const auto result = run(hand, {g * std::cos(direction), g * std::sin(direction)});
    EXPECT_TRUE(result.slips_at_start);
    EXPECT_NEAR(norm(result.relative.slip), (g - kFriction) * 0.5, 1e-9);
    EXPECT_NEAR(std::atan2(result.relative.slip.z, result.relative.slip.x), direction, 1e-9);
    EXPECT_NEAR(norm(lever(Scene<double>{}, result.relative)), 0.5 * (g - kFriction) * 0.25, 1e-9);
    EXPECT_EQ(result.events.size(), 1u);
  }
}

TEST_P(Block, OnAGentleInclineStopsAndStays) {
  const auto hand = support::still_hand(1.0);
  const double g = 5;  // along the incline, < 8
  const auto result = run(hand, {g, 0}, {0.6, 0});
  if (decoupled()) {
    ASSERT_FALSE(words.empty());
    EXPECT_EQ(words[0].mode, "brake");  // the carrying force is within the limit, but the block still slips
  }
  const double t = 0.6 / (kFriction - g);
  EXPECT_NEAR(result.events.back().t, t, 1e-9);
  EXPECT_EQ(words.back().cause, "slip stops");
  EXPECT_EQ(words.back().mode, "stick");
  EXPECT_EQ(result.relative.slip.x, 0.0);
  EXPECT_NEAR(result.relative.arm.x, 0.5 * 0.6 * t, 1e-9);
  EXPECT_NEAR(slip_at(result, 0.5 * t), 0.3, 1e-9);
}

TEST_P(Block, SlidingUpASteepInclineComesBack) {
  // Up against g = 12: decelerates by g + A, then slides down at g − A. The decoupled model's force points
  // along the required one, up the incline, whatever the slip does: it decelerates by g − A only, and feeds
  // energy meanwhile.
  const auto hand = support::still_hand(0.5);
  const double g = 12, v = 1;
  const auto result = run(hand, {-g, 0}, {v, 0});
  if (decoupled()) {
    EXPECT_NEAR(result.relative.slip.x, v - (g - kFriction) * 0.5, 1e-9);
    return;
  }
  const double top = v / (g + kFriction);
  ASSERT_GE(result.events.size(), 2u);
  EXPECT_NEAR(result.events.back().t, top, 1e-9);
  EXPECT_EQ(words.back().mode, "slip");
  EXPECT_NEAR(result.relative.slip.x, -(g - kFriction) * (0.5 - top), 1e-8);
}

TEST_P(Block, OnAHandThatAcceleratesSlidesStopsAndSticks) {
  // 20 m/s² for 0.05 s, then uniform motion, then gently on: lags by 12 m/s², catches up by 8 m/s².
  const auto hand = release::PolynomialHand::segments(
      0, {}, {0.2, 0, 0}, {{0.02, {}, {}}, {0.07, {20, 0, 0}, {}}, {0.2, {}, {}}, {0.3, {7.9, 0, 0}, {}}});
  const auto result = run(hand, {0, 0});
  const double lag = 12 * 0.05, stop = 0.07 + lag / kFriction;
  EXPECT_FALSE(result.slips_at_start);
  EXPECT_NEAR(slip_at(result, 0.045), -12 * 0.025, 1e-9);
  EXPECT_NEAR(slip_at(result, 0.07), -lag, 1e-9);
  bool stopped = false;
  for (std::size_t i = 0; i < words.size(); ++i)
    if (words[i].cause == "slip stops") {
      stopped = true;
      EXPECT_NEAR(words[i].time, stop, 1e-9);
      EXPECT_EQ(words[i].mode, "stick");
    }
  EXPECT_TRUE(stopped);
  EXPECT_NEAR(result.relative.arm.x, -0.5 * lag * 0.05 - 0.5 * lag * lag / kFriction, 1e-9);
  EXPECT_EQ(slip_at(result, 0.25), 0.0);  // holds 7.9 < 8
  EXPECT_EQ(words.back().mode, "stick");
}

TEST_P(Block, GoesTheOtherWayWhenTheHandDoes) {
  // +20 then −20 m/s²: the block lags to −0.6 m/s; friction helps the hand to stop that (8 + 20 m/s²), and
  // from zero it runs ahead at 20 − 8 = 12 m/s². The decoupled model turns its force at the jump already: 12
  // m/s² throughout.
  const auto hand =
      release::PolynomialHand::segments(0, {}, {}, {{0.05, {20, 0, 0}, {}}, {0.2, {-20, 0, 0}, {}}});
  const auto result = run(hand, {0, 0});
  EXPECT_TRUE(result.slips_at_start);
  EXPECT_NEAR(slip_at(result, 0.05), -0.6, 1e-9);
  if (decoupled()) {
    EXPECT_NEAR(result.relative.slip.x, -0.6 + 12 * 0.15, 1e-9);
  } else {
    const double turn = 0.05 + 0.6 / 28;
    EXPECT_NEAR(result.events.back().t, turn, 1e-9);
    EXPECT_NEAR(result.relative.slip.x, 12 * (0.2 - turn), 1e-8);
  }
}

TEST_P(Block, AtTheLimitTheThresholdIsSharp) {
  const auto holds = run(support::accelerating_hand({kFriction * (1 - 1e-9), 0, 0}, 0.2), {0, 0});
  EXPECT_FALSE(holds.slips_at_start);
  EXPECT_TRUE(holds.events.empty());
  EXPECT_EQ(holds.relative.arm.x, 0.0);
  const auto slips = run(support::accelerating_hand({kFriction * (1 + 1e-6), 0, 0}, 0.2), {0, 0});
  EXPECT_TRUE(slips.slips_at_start);
  EXPECT_NEAR(slips.relative.slip.x, -kFriction * 1e-6 * 0.2, 1e-9);
}

/// A block at rest in a hand that sways with the acceleration −A sin(s), s = w t, where friction is ρ A.
struct Shaken {
  static constexpr double kPhaseRate = 20;  ///< w [rad/s]

  static support::SwayingHand hand(double rho, double phases) {
    std::array<support::SwayingHand::Coordinate, 3> c{};
    c[0].amplitude = kFriction / rho / (kPhaseRate * kPhaseRate);
    c[0].frequency = kPhaseRate;
    return support::SwayingHand(c, phases / kPhaseRate);
  }
};

TEST_P(Block, OnAShakenHandSlipsAndStopsWhereTheClosedFormsSay) {
  for (const double rho : {0.6, 0.7, 0.8, 0.9, 0.99}) {
    const auto result = run(Shaken::hand(rho, 3.9), {0, 0});
    EXPECT_FALSE(result.slips_at_start) << rho;
    ASSERT_GE(words.size(), 2u) << rho;
    const double begin = words[0].time * Shaken::kPhaseRate;
    const auto end = std::find_if(words.begin(), words.end(),
                                  [](const release::ModeEvent& word) { return word.cause == "slip stops"; });
    ASSERT_NE(end, words.end()) << rho;
    EXPECT_EQ(end->mode, "stick") << rho;
    const double stop = end->time * Shaken::kPhaseRate;
    // 1e-9 s, as an event's time, in phase; the slip's speed is the sum of what drove it
    EXPECT_NEAR(begin, std::asin(rho), 1e-9 * Shaken::kPhaseRate) << rho;
    EXPECT_NEAR(std::cos(stop) - std::cos(begin) + rho * (stop - begin), 0, 1e-9 * Shaken::kPhaseRate) << rho;
  }
}

TEST_P(Block, OnAShakenHandSticksFromTheThresholdOn) {
  const double threshold = 1 / std::sqrt(1 + M_PI * M_PI / 4);  // 0.53703
  // Whether it sticks once the start is forgotten. The threshold itself would be approached for ever; 300
  // units of phase leave less than 1e-4 of it.
  const auto sticks = [&](double rho) {
    const auto result = run(Shaken::hand(rho, 400), {0, 0});
    EXPECT_GT(words.size(), 100u) << "slips at every turn";
    return std::any_of(words.begin(), words.end(), [](const release::ModeEvent& word) {
      return word.mode == "stick" && word.time * Shaken::kPhaseRate > 300;
    });
  };
  EXPECT_FALSE(sticks(threshold - 2e-4));
  EXPECT_TRUE(sticks(threshold + 2e-4));
  EXPECT_TRUE(sticks(1 - 1e-3));
  run(Shaken::hand(1 + 1e-3, 400), {0, 0});
  EXPECT_TRUE(words.empty()) << "always sticks";
}

}  // namespace
}  // namespace unhand::contact
