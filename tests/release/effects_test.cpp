// A hand that lags behind its log and a normal force that is late.
#include "release/effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "contact/contact_model.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::release {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Window kAlways{-kInfinity, kInfinity};
constexpr double kJumps[] = {0.03, 0.06};

PolynomialHand logged() {
  return PolynomialHand::segments(0.0, {0.5, 0.8, -0.3}, {1.0, -0.4, 2.0},
                                  {{kJumps[0], {3, 5, -20}, {40, 0, 300}},
                                   {kJumps[1], {-60, 20, 150}, {0, -500, 0}},
                                   {0.1, {10, -90, -40}, {}}});
}
std::array<double, 3> pose(const HandState<double>& h) { return {h.pose.x, h.pose.z, h.pose.theta}; }
std::array<double, 3> twist(const HandState<double>& h) { return {h.twist.vx, h.twist.vz, h.twist.omega}; }
std::array<double, 3> acceleration(const HandState<double>& h) {
  return {h.acceleration.ax, h.acceleration.az, h.acceleration.alpha};
}

TEST(LaggedHand, IsTheFineIntegrationOfTheLag) {
  const auto log = logged();
  for (const double lag : {2e-3, 0.01, 0.05}) {
    const LaggedHand hand(log, Dual(lag));
    std::array<double, 3> y = pose(hand.at(kAlways, 0.0));
    constexpr int kSteps = 20000;
    const double h = 0.1 / kSteps;
    // RK4; both jumps of the acceleration fall on steps
    const auto slope = [&](const std::array<double, 3>& at, double time, int n) {
      return (pose(log.at(kAlways, time))[n] - at[n]) / lag;
    };
    for (int i = 1; i <= kSteps; ++i) {
      const double t = (i - 1) * h;
      std::array<double, 3> next = y;
      for (int n = 0; n < 3; ++n) {
        std::array<double, 3> at = y;
        const double a = slope(y, t, n);
        at[n] = y[n] + 0.5 * h * a;
        const double b = slope(at, t + 0.5 * h, n);
        at[n] = y[n] + 0.5 * h * b;
        const double c = slope(at, t + 0.5 * h, n);
        at[n] = y[n] + h * c;
        next[n] += h / 6 * (a + 2 * b + 2 * c + slope(at, t + h, n));
      }
      y = next;
      if (i % 1990 != 0) continue;
      const auto state = hand.at(kAlways, i * h);
      for (int n = 0; n < 3; ++n) {
        EXPECT_NEAR(pose(state)[n], y[n], 1e-12) << lag << " at " << i * h;
        // the lag's own equation and its derivative
        EXPECT_NEAR(lag * twist(state)[n], pose(log.at(kAlways, i * h))[n] - y[n], 1e-12);
        EXPECT_NEAR(lag * acceleration(state)[n], twist(log.at(kAlways, i * h))[n] - twist(state)[n], 1e-12);
      }
    }
  }
}

TEST(LaggedHand, HasSettledAtTheStartAndIsSmoothAtTheJumps) {
  const double lag = 0.004;
  const auto log = logged();
  const LaggedHand hand(log, Dual(lag));
  // y − τ v + τ² a − τ³ j
  EXPECT_NEAR(hand.at(kAlways, 0.0).pose.x, 0.5 - lag * 1 + lag * lag * 3 - lag * lag * lag * 40, 1e-15);
  for (const double t : kJumps) {
    const auto before = hand.at({0, t}, t), after = hand.at({t, 1}, t);
    for (int n = 0; n < 3; ++n) {
      EXPECT_NEAR(pose(before)[n], pose(after)[n], 1e-14);
      EXPECT_NEAR(twist(before)[n], twist(after)[n], 1e-12);
      EXPECT_NEAR(acceleration(before)[n], acceleration(after)[n], 1e-9) << "the log's jump is smoothed";
    }
  }
}

TEST(LaggedHand, IsSettledBeforeTheLogHoweverShortTheLag) {
  const auto log = logged();
  for (const double lag : {0.01, 1e-5, 1e-9}) {
    const auto a = LaggedHand(log, Dual(lag)).at(kAlways, -0.02), b = log.at(kAlways, -0.02);
    for (int n = 0; n < 3; ++n)  // y(t) = u(t) − τ u̇(t) + …, of which the first term bounds the rest here
      EXPECT_NEAR(pose(a)[n], pose(b)[n], 5 * lag * (1 + std::abs(twist(b)[n]))) << lag;
  }
}

TEST(LaggedHand, ATinyLagIsTheLogAFewOfItLater) {
  const auto log = logged();
  for (const double lag : {1e-6, 1e-9, 1e-12})
    for (const double jump : kJumps)
      for (const double later : {1.0, 3.0, 40.0}) {
        const LaggedHand hand(log, Dual(lag));
        const double t = jump + later * lag;
        const auto a = acceleration(hand.at({jump, 0.1}, t)), before = acceleration(log.at({0, jump}, jump)),
                   after = acceleration(log.at({jump, 0.1}, jump));
        for (int n = 0; n < 3; ++n)  // the jump dies as exp(−(t − t_i)/τ); the rest of the log is slow
          EXPECT_NEAR(a[n], after[n] + (before[n] - after[n]) * std::exp(-(t - jump) / lag), 0.05)
              << lag << ' ' << later;
      }
}

TEST(LaggedHand, WithoutLagIsTheLog) {
  const auto log = logged();
  const LaggedHand hand(log, Dual(0));
  for (const double t : {0.0, 0.01, 0.045, 0.09}) {
    const auto a = hand.at(kAlways, t), b = log.at(kAlways, t);
    for (int n = 0; n < 3; ++n) {
      EXPECT_NEAR(pose(a)[n], pose(b)[n], 1e-15);
      EXPECT_NEAR(acceleration(a)[n], acceleration(b)[n], 1e-12);
    }
  }
}

TEST(LaggedHand, DerivativesAreCentralDifferences) {
  const auto log = logged();
  const double lag = 0.008;
  const LaggedHand hand(log, dynamics::independent(lag, 0));
  for (const double t : {0.005, 0.031, 0.05, 0.08}) {
    const auto exact = hand.at(kAlways, dynamics::independent(t, 1));
    const auto slope = exact.acceleration.alpha.v;
    const auto by_lag = [&](double tau) {
      return LaggedHand(log, Dual(tau)).at(kAlways, t).acceleration.alpha;
    };
    const auto by_time = [&](double at) { return hand.at(kAlways, at).acceleration.alpha; };
    EXPECT_LT(support::best_difference(by_lag, lag, slope[0], 1e-4), 1e-6 * std::max(1e3, std::abs(slope[0])))
        << t;
    EXPECT_LT(support::best_difference(by_time, t, slope[1], 1e-4), 1e-6 * std::max(1e3, std::abs(slope[1])))
        << t;
  }
}

TEST(LaggedHand, RefusesTimesOutOfRange) {
  const auto log = logged();
  EXPECT_THROW(LaggedHand(log, Dual(-1e-3)), std::invalid_argument);
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0, 20});
  EXPECT_THROW(DelayedForce(force, Dual(2)), std::invalid_argument);
}

/// 40 N up to 0.1 s, where it drops: the window says on which side.
class DroppingForce final : public contact::NormalForce {
 public:
  double at(const Window& w, double) const override { return 0.5 * (w.begin + w.end) < 0.1 ? 40 : 0; }
  Dual at(const Window& w, const Dual& t) const override { return Dual(at(w, t.a)); }
  void kinks(std::vector<double>& out) const override { out.push_back(0.1); }
  void kinks(std::vector<Dual>& out) const override { out.push_back(Dual(0.1)); }
  double release_time() const override { return 0.1; }
};

TEST(DelayedForce, DropsWhereItsWindowsMeet) {
  const DroppingForce base;
  for (const double delay : {-0.04, 0.03}) {
    const DelayedForce late(base, Dual(delay));
    const double drop = 0.1 + delay;
    EXPECT_EQ(late.at({drop - 0.02, drop}, drop), 40) << delay;
    EXPECT_EQ(late.at({drop, drop + 0.02}, drop), 0) << delay;
    EXPECT_EQ(late.at({drop - 0.02, drop}, Dual(drop)).a, 40) << delay;
    EXPECT_EQ(late.at({drop, drop + 0.02}, Dual(drop)).a, 0) << delay;
  }
}

TEST(DelayedForce, IsTheForceOfAnEarlierInstant) {
  const contact::ProfileNormalForce base(contact::OpeningProfile<double>{0.02, 20, 0.005, 0.04, 1.3});
  for (const double delay : {-0.007, 0.004}) {
    const DelayedForce late(base, dynamics::independent(delay, 0));
    EXPECT_DOUBLE_EQ(late.release_time(), 0.065 + delay);
    const auto kinks = late.NormalForce::kinks();
    ASSERT_EQ(kinks.size(), base.NormalForce::kinks().size());
    for (std::size_t i = 0; i < kinks.size(); ++i)
      EXPECT_DOUBLE_EQ(kinks[i], base.NormalForce::kinks()[i] + delay);
    for (const double t : {0.001, 0.03, 0.05, 0.06, 0.09}) {
      EXPECT_DOUBLE_EQ(late.at(kAlways, t), base.at(kAlways, t - delay));
      const double h = 1e-6,
                   slope = (base.at(kAlways, t - delay + h) - base.at(kAlways, t - delay - h)) / (2 * h);
      const Dual exact = late.at(kAlways, Dual(t));
      EXPECT_NEAR(exact.v[0], -slope, 1e-4 * std::max(1.0, std::abs(slope)));
    }
    // the release as Dual moves with the delay
    Dual release;
    contact::force_release(late, release);
    EXPECT_EQ(release.v[0], 1);
    // limits from both sides of the shifted kink
    const double kink = kinks.front();
    EXPECT_NEAR(late.at({0, kink}, kink), late.at({kink, 1}, kink), 1e-12);
    // of the slope, too: flat before the ramp and f₀ p/T steep after it
    EXPECT_EQ(late.at({0, kink}, Dual(kink, 1)).v[1], 0);
    EXPECT_NEAR(late.at({kink, 1}, Dual(kink, 1)).v[1], -20 * 1.3 / 0.04, 1e-6);
  }
}

}  // namespace
}  // namespace unhand::release
