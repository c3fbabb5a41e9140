// Air and tilt in flight: their derivatives through the landing, and what they must leave alone.
#include "flight/effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "dynamics/gravity_effects.hpp"
#include "flight/fly.hpp"
#include "tests/flight/tight.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::flight {
namespace {

using dynamics::Dual;

constexpr int kParameters = 6;  // drag, lift, wind x, wind z, tilt, ω
constexpr const char* kNames[] = {"k", "k_m", "w_x", "w_z", "tilt", "omega"};

template <class S>
std::array<S, 4> land(const std::array<S, kParameters>& p) {
  dynamics::Gravity<S> gravity;
  gravity.tilt = p[4];
  FlightProblem<S> problem{{S(0.1), S(1.2), S(0.3)}, {S(2.5), S(1.7), p[5]}, gravity.at(9.81)};
  problem.drag_k = p[0];
  problem.lift_km = p[1];
  problem.wind = {p[2], p[3]};
  problem.tracked = {S(0.02), S(0)};
  const auto flown = fly(problem, kTight);
  EXPECT_EQ(flown.outcome, FlightOutcome::landed);
  return {flown.landing.flight_time, flown.landing.pose.x, flown.landing.pose.theta, flown.landing.twist.vz};
}

void expect_gradient(const std::array<double, kParameters>& at, const char* where) {
  const auto exact = land(support::seeded(at));
  for (int k = 0; k < kParameters; ++k) {
    if (k == 0 && at[0] == 0) continue;  // drag is one-sided there
    const auto best =
        support::best_differences_by(static_cast<std::size_t>(k), land<double>, at, exact, 1e-3);
    for (int j = 0; j < 4; ++j)
      EXPECT_LT(best[j], 1e-7 * std::max(1.0, std::abs(exact[j].v[k])))
          << where << ": answer " << j << " by " << kNames[k] << ", slope " << exact[j].v[k];
  }
}

TEST(AirEffects, GradientOfTheLandingIsTheCentralDifference) {
  expect_gradient({0.06, 0.02, 0.7, -0.4, 0.03, -9}, "all at once");
  expect_gradient({0.06, 0, 0, 0, 0, 5}, "drag alone");
  expect_gradient({0, 0.05, 0, 0, 0.02, 5}, "lift alone");
}

TEST(AirEffects, DragAtNeutralHasItsOneSidedDerivative) {
  std::array<Dual, kParameters> seeded{};
  seeded[5] = Dual(5);
  seeded[0] = dynamics::independent(0.0, 0);
  const auto exact = land(seeded);
  const auto base = land<double>({0, 0, 0, 0, 0, 5}), some = land<double>({1e-5, 0, 0, 0, 0, 5});
  for (int j = 0; j < 4; ++j)
    EXPECT_NEAR((some[j] - base[j]) / 1e-5, exact[j].v[0], 1e-3 * std::max(1.0, std::abs(exact[j].v[0])));
}

TEST(AirEffects, WindIsABoostedFrame) {
  // In the frame of the air there is no wind; it moves on at w while the object flies.
  const dynamics::Vec2<double> w{1.3, -0.7};
  FlightProblem<double> windy{{0.1, 1.2, 0.3}, {2.5, 1.7, -6}, {0, -9.81}};
  windy.drag_k = 0.08;
  windy.lift_km = 0.03;
  auto boosted = windy;
  windy.wind = w;
  boosted.twist.vx -= w.x;
  boosted.twist.vz -= w.z;
  const std::vector<double> times{0.1, 0.35, 0.8};
  const auto a = fly_through(windy, times, kTight), b = fly_through(boosted, times, kTight);
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_NEAR(a[i].x, b[i].x + w.x * times[i], 1e-11);
    EXPECT_NEAR(a[i].z, b[i].z + w.z * times[i], 1e-11);
    EXPECT_NEAR(a[i].theta, b[i].theta, 1e-12);
  }
  // Along the ground the landing is the same event in both frames.
  windy.wind = {w.x, 0};
  boosted.twist.vz = windy.twist.vz;
  const auto landed = fly(windy, kTight), calm = fly(boosted, kTight);
  ASSERT_EQ(landed.outcome, FlightOutcome::landed);
  ASSERT_EQ(calm.outcome, FlightOutcome::landed);
  EXPECT_NEAR(landed.landing.flight_time, calm.landing.flight_time, 1e-11);
  EXPECT_NEAR(landed.landing.pose.x, calm.landing.pose.x + w.x * calm.landing.flight_time, 1e-11);
  EXPECT_NEAR(landed.landing.twist.vx, calm.landing.twist.vx + w.x, 1e-11);
}

TEST(AirEffects, WindWithoutDragOrLiftIsNothing) {
  const auto calm = land<double>({0, 0, 0, 0, 0.02, 5}), windy = land<double>({0, 0, 2, -1, 0.02, 5});
  EXPECT_EQ(calm, windy);
}

TEST(AirEffects, EachIsTheFlightsTerm) {
  const std::vector<std::string> names{"flight.quadratic_drag.k", "flight.magnus_lift.k_m", "flight.wind.w_x",
                                       "flight.wind.w_z"};
  const std::vector<double> values{0.03, 0.02, 1.3, -0.7};
  Air<double> air;
  dynamics::apply_effects(air_effects(), dynamics::Values<double>(names, values), air);
  EXPECT_EQ(air.extra_drag, 0.03);
  EXPECT_EQ(air.lift, 0.02);
  EXPECT_EQ(air.wind.x, 1.3);
  EXPECT_EQ(air.wind.z, -0.7);
}

TEST(GravityTilt, TurnsGravityAlone) {
  dynamics::Gravity<double> gravity;
  EXPECT_EQ(gravity.at(9.81).x, 0);
  EXPECT_EQ(gravity.at(9.81).z, -9.81);
  gravity.tilt = 0.1;
  const auto down = gravity.at(9.81);
  EXPECT_DOUBLE_EQ(down.x, 9.81 * std::sin(0.1));
  EXPECT_DOUBLE_EQ(down.z, -9.81 * std::cos(0.1));
}

}  // namespace
}  // namespace unhand::flight
