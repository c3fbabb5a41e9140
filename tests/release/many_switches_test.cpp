// Ten thousand changes of mode in one release: synthetic hands and forces that oscillate fast. Every run ends
// typed, each switch costs as much as the one before, and nothing but the event log grows.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/simple_scenes.hpp"

namespace unhand {
namespace {

constexpr double kFrequency = 200, kPeriod = 2 * M_PI / kFrequency;  // of the shaking [rad/s], [s]
constexpr double kShaking = 20;                                      // amplitude of the acceleration [m/s²]
constexpr double kMass = 0.5;                                        // [kg]

/// f_N = mean + swing sin wt [N].
class OscillatingForce final : public contact::NormalForce {
 public:
  OscillatingForce(double mean, double swing, double frequency)
      : mean_(mean), swing_(swing), frequency_(frequency) {}
  double at(const contact::Window&, double t) const override {
    return mean_ + swing_ * std::sin(frequency_ * t);
  }
  dynamics::Dual at(const contact::Window&, const dynamics::Dual& t) const override {
    return mean_ + swing_ * sin(frequency_ * t);
  }
  void kinks(std::vector<double>&) const override {}
  void kinks(std::vector<dynamics::Dual>&) const override {}
  double release_time() const override { return std::numeric_limits<double>::infinity(); }

 private:
  double mean_, swing_, frequency_;
};

class ManySwitches : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    contact::ContactParameters<double> p;
    p.patch = {0.5, 0.02, 2.0 / 3, 2};  // n μ = 1: the friction limit is f_N
    model = contact::make_contact_model(GetParam(), p);
  }
  release::ReleaseResult<double> run(const release::HandMotion& hand, const contact::NormalForce& force,
                                     const dynamics::IntegratorOptions& integrator) const {
    const release::ReleaseProblem<double> problem{hand, force, *model, {kMass, 1e-3}, {0, 0}, {0, 0},
                                                  0.0,  {},    0.0};
    release::ReleaseOptions options;
    options.integrator = integrator;
    return simulate_release(problem, options);
  }
  static int brakes() { return std::string(GetParam()) == "sliding_pivot" ? 1 : 0; }
  static support::SwayingHand shaken(double periods) {
    std::array<support::SwayingHand::Coordinate, 3> c{};
    c[0].amplitude = kShaking / (kFrequency * kFrequency);
    c[0].frequency = kFrequency;
    return support::SwayingHand(c, periods * kPeriod);
  }
  static dynamics::IntegratorOptions options() {
    dynamics::IntegratorOptions o{.tolerances = {1e-6, 1e-8}};
    o.event_budget = 20'000;
    o.step_budget = 2'000'000;
    return o;
  }

  std::unique_ptr<contact::ContactModel> model;
};
INSTANTIATE_TEST_SUITE_P(, ManySwitches, testing::Values("sliding_pivot", "limit_surface"),
                         [](const auto& law) { return std::string(law.param); });

TEST_P(ManySwitches, OfAShakenBlock) {
  // μ g/A = 0.8 sticks and slips by turns, twice a period; 0.5 never sticks and turns around twice
  // (tests/dynamics/plate_test.cpp has the thresholds). The sliding pivot brakes at the end of each slip.
  for (const double ratio : {0.8, 0.5}) {
    const int each = 2 * ((ratio > 0.537 ? 2 : 1) + brakes());
    const int periods = 10'400 / each;
    const support::ConstantForce force(ratio * kMass * kShaking);
    const auto result = run(shaken(periods), force, options());
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated) << to_string(result.integration);
    const auto& events = result.events;
    ASSERT_GE(events.size(), 10'000u) << ratio;
    // The start may cost or save a switch or two.
    EXPECT_NEAR(static_cast<double>(events.size()), each * periods, 4) << ratio;
    // In the steady state every switch comes back a period later: 1e-7, the tolerance over an acceleration.
    for (std::size_t k = events.size() / 2; k < events.size() - each; k += 97)
      EXPECT_NEAR(events[k + each].t - events[k].t, kPeriod, 1e-7) << ratio << ' ' << k;
    EXPECT_LT(result.statistics.steps, 200 * static_cast<long>(events.size()));
    EXPECT_LE(events.capacity(), 2 * events.size() + 32);
    EXPECT_TRUE(result.trajectory.empty());
  }
}

TEST_P(ManySwitches, OfAPulsatingGrip) {
  // A steady pull of 20 m/s² against f_N/m of 30 ± 25 m/s² at 2 kHz: slip while the grip is weak, rest while
  // it is strong.
  constexpr double kFast = 2e3;
  const double end = 5'100 * 2 * M_PI / kFast;
  const OscillatingForce force(15, 12.5, kFast);
  auto o = options();
  o.guard_interval = 0.5e-3;
  const auto result = run(support::accelerating_hand({20, 0, 0}, end), force, o);
  EXPECT_EQ(result.integration, dynamics::Outcome::horizon);
  EXPECT_NEAR(static_cast<double>(result.events.size()), (2 + brakes()) * 5'100, 4);
  EXPECT_GE(result.events.size(), 10'000u);
  EXPECT_LT(result.statistics.steps, 200 * static_cast<long>(result.events.size()));
}

TEST_P(ManySwitches, StopAtTheirBudgetsWithTheLogUpToThere) {
  const support::ConstantForce force(0.8 * kMass * kShaking);
  const auto whole = run(shaken(2'600), force, options());
  auto o = options();
  o.event_budget = dynamics::IntegratorOptions{}.event_budget;
  const auto events = run(shaken(2'600), force, o);
  EXPECT_EQ(events.outcome, release::ReleaseOutcome::not_solved);
  EXPECT_EQ(events.integration, dynamics::Outcome::event_budget_spent);
  ASSERT_EQ(events.events.size(), static_cast<std::size_t>(o.event_budget));
  for (std::size_t k = 0; k < events.events.size(); k += 101)
    EXPECT_EQ(events.events[k].t, whole.events[k].t) << k;

  o = options();
  o.step_budget = 5'000;
  const auto steps = run(shaken(2'600), force, o);
  EXPECT_EQ(steps.outcome, release::ReleaseOutcome::not_solved);
  EXPECT_EQ(steps.integration, dynamics::Outcome::step_budget_spent);
  EXPECT_LE(steps.statistics.steps, o.step_budget + 1);
  EXPECT_TRUE(std::isfinite(steps.detach.twist.vx));
}

TEST_P(ManySwitches, EachIsLoggedWithTheStateOfItsInstant) {
  // μ g/A = 0.4: the slip stops and sets in again the other way at once. At that instant the slip is zero, in
  // the event log and in the recorded trajectory.
  const support::ConstantForce force(0.4 * kMass * kShaking);
  const auto result = run(shaken(10), force, {.tolerances = {1e-9, 1e-11}, .record = true});
  int reversals = 0;
  for (const auto& event : result.events) {
    const auto slip = [&](double t) {
      return contact::Relative<double>::from(result.trajectory.at(t)).slip.x;
    };
    if (event.kind != dynamics::EventKind::guard || event.y[3] != 0 || event.y[4] != 0 || event.y[5] != 0)
      continue;
    if (event.mode_before == 0 || event.t > 9.9 * kPeriod) continue;  // out of stick; at the very end
    ++reversals;
    EXPECT_NEAR(slip(event.t), 0, 1e-12) << event.t;
    // 1e-5 s to either side: the slip has the signs of a passage, and the size that friction and shaking give
    const double before = slip(event.t - 1e-5), after = slip(event.t + 1e-5);
    EXPECT_LT(before * after, 0) << event.t;
    EXPECT_LT(std::max(std::abs(before), std::abs(after)), 1e-5 * 1.5 * kShaking) << event.t;
  }
  EXPECT_GE(reversals, 18);
}

}  // namespace
}  // namespace unhand
