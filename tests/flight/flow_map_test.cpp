// The planner's view of flights: the flow map with its gradient, and the backward reachable tube in two
// forms.
#include "flight/flow_map.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <stdexcept>

#include "tests/support/best_difference.hpp"

namespace unhand::flight {
namespace {

using State = PlaneState<double>;

State random_state(std::mt19937_64& random) {
  std::uniform_real_distribution<double> r(-2, -0.2), z(-0.3, 1), forward(0.5, 4), up(-2, 4);
  return {r(random), z(random), forward(random), up(random)};
}

TEST(FlowMap, IsTheParabola) {
  std::mt19937_64 random(1);
  const double g = 9.81;
  int landed = 0;
  for (int n = 0; n < 200; ++n) {
    const State s = random_state(random);
    const auto flow = flow_map(s, {});
    const double root = s.z_rate * s.z_rate + 2 * g * s.z;
    const bool lands = root >= 0 && (s.z >= 0 || s.z_rate > 0);
    ASSERT_EQ(flow.has_value(), lands) << n;
    if (!lands) continue;
    ++landed;
    const double t = (s.z_rate + std::sqrt(root)) / g;
    EXPECT_NEAR(flow->landing, s.r + s.r_rate * t, 1e-13);
    EXPECT_EQ(flow->gradient[0], 1);
    EXPECT_NEAR(flow->gradient[1], s.r_rate / std::sqrt(root), 1e-11 * (1 + 1 / std::sqrt(root)));
    EXPECT_NEAR(flow->gradient[2], t, 1e-13);
    EXPECT_NEAR(flow->gradient[3], s.r_rate * t / std::sqrt(root), 1e-11 * (1 + 1 / std::sqrt(root)));
  }
  EXPECT_GT(landed, 100);
}

TEST(FlowMap, GradientIsTheCentralDifferenceWithDrag) {
  const State at{-1.2, 0.4, 2.5, 1.5};
  for (const double k : {0.0, 0.2}) {
    const Medium medium{9.81, k};
    const auto flow = flow_map(at, medium);
    ASSERT_TRUE(flow);
    const std::array<double State::*, 4> members{&State::r, &State::z, &State::r_rate, &State::z_rate};
    for (int i = 0; i < 4; ++i) {
      const auto landing = [&](double value) {
        State moved = at;
        moved.*members[i] = value;
        return flow_map(moved, medium)->landing;
      };
      const double best = support::best_difference(landing, at.*members[i], flow->gradient[i]);
      // The bottom of the V: the integrator's steps, chosen to 1e-8, scatter by some 1e-9 of the landing.
      EXPECT_LT(best, k > 0 ? 1e-5 : 1e-8) << i;
    }
  }
}

TEST(ReachableTube, LevelIsNegativeWhereTheFlightLandsInTheSet) {
  std::mt19937_64 random(2);
  const LandingSet set{0.3, 1, 3.5, -5, -1};
  for (const double k : {0.0, 0.15}) {
    int inside = 0, never = 0;
    for (int n = 0; n < 500; ++n) {
      const State s = random_state(random);
      const auto end = landing_of(s, {9.81, k});
      const double level = tube_level(s, set, {9.81, k});
      ASSERT_TRUE(std::isfinite(level));
      const bool in = end && std::abs(end->r) < 0.3 && end->r_rate > 1 && end->r_rate < 3.5 &&
                      end->z_rate > -5 && end->z_rate < -1;
      EXPECT_EQ(level < 0, in) << n;
      inside += in;
      never += !end;
      if (!end) {
        EXPECT_GE(level, 1);
      }
    }
    EXPECT_GT(inside, 15);
    EXPECT_GT(never, 15);
  }
}

TEST(ReachableTube, AFlightThatNeverGetsThereIsJudgedByItsApex) {
  const LandingSet set{0.3, 1, 3.5, -5, -1};
  const double g = 9.81, apex = -0.21;
  for (const double climbs : {0.0, 0.8, 2.5})  // later and earlier on the same rise
    EXPECT_NEAR(tube_level({0.1, apex - climbs * climbs / (2 * g), 2, climbs}, set, {g, 0}), 1 + 0.21 / 0.3,
                1e-12);
}

TEST(ReachableTube, SampledAndImplicitFormsAgree) {
  const LandingSet set{0.1, 0.8, 3.0, -5, -0.5};
  for (const double k : {0.0, 0.15}) {
    const Medium medium{9.81, k};
    const auto samples = sample_tube(set, medium, {400, 0.9, 4, 3});
    ASSERT_EQ(samples.size(), 400u);
    // Flown back to the set: to the rounding of the closed form, or the integrator's 1e-8 over half widths of
    // 0.1 m.
    const double tolerance = k > 0 ? 1e-6 : 1e-9;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double level = tube_level(samples[i], set, medium);
      EXPECT_LE(level, tolerance) << i;
      if (i % 4 == 0) {
        EXPECT_NEAR(level, 0, tolerance) << i;  // from the set's boundary
      } else {
        EXPECT_LT(level, -1e-6) << i;
      }
    }
  }
}

// Backward in time drag has no bound: 2 s before it lands at 10 m/s, no object with k = 0.15 1/m was in
// flight.
TEST(ReachableTube, SamplesWithDragAreStatesThatLandInTheSet) {
  LandingSet set;  // comes down at 0 to 10 m/s: grazing flights, too
  set.half_length = 0.1;
  for (const double k : {0.05, 0.15, 1.0})
    for (const double longest : {0.5, 2.0, 20.0})
      for (const auto& state : sample_tube(set, {9.81, k}, {200, longest, 4, 5})) {
        ASSERT_TRUE(std::isfinite(state.r) && std::isfinite(state.z) && std::isfinite(state.r_rate) &&
                    std::isfinite(state.z_rate))
            << k << ' ' << longest;
        EXPECT_LT(std::hypot(state.r_rate, state.z_rate), 102) << k << ' ' << longest;
        EXPECT_LE(tube_level(state, set, {9.81, k}), 1e-6) << k << ' ' << longest;  // the integrator's
      }
}

TEST(ReachableTube, RefusesWhatIsNoSet) {
  for (const Medium& medium : {Medium{9.81, -0.1}, Medium{0.0, 0.1}, Medium{9.81, std::nan("")}})
    EXPECT_THROW(tube_level({}, {0.1}, medium), std::invalid_argument);
  for (int n = 0; n < 4; ++n) {
    double x[4] = {-1, -0.3, 2, 1};
    x[n] = std::nan("");
    EXPECT_THROW(tube_level({x[0], x[1], x[2], x[3]}, {0.1}, {}), std::invalid_argument);
  }
  EXPECT_THROW(tube_level({-1, -0.3, 2, 1}, {0.1}, {0.0, 0.1}), std::invalid_argument);
  EXPECT_THROW(tube_level({}, {0.0}, {}), std::invalid_argument);
  EXPECT_THROW(tube_level({}, {0.1, 2, 1}, {}), std::invalid_argument);
  EXPECT_THROW(tube_level({}, {0.1, 0, 1, -1, 1}, {}), std::invalid_argument);
  // one infinite side would make the other one no bound
  EXPECT_THROW(tube_level({}, {0.1, -INFINITY, 1}, {}), std::invalid_argument);
  EXPECT_THROW(sample_tube({0.1, 0, 1, -INFINITY, 0}, {}), std::invalid_argument);
}

TEST(FlowMap, RefusesWhatIsNoFlight) {
  for (int n = 0; n < 4; ++n) {
    double x[4] = {-1, -0.3, 2, 5};
    x[n] = n % 2 ? std::nan("") : INFINITY;
    EXPECT_THROW(flow_map({x[0], x[1], x[2], x[3]}, {}), std::invalid_argument) << n;
  }
  for (const Medium& medium : {Medium{9.81, -0.1}, Medium{0.0, 0.0}, Medium{std::nan(""), 0.0}})
    EXPECT_THROW(flow_map({-1, -0.3, 2, 5}, medium), std::invalid_argument);
}

TEST(ReachableTube, SamplingsOutOfRangeAreRefused) {
  for (const TubeSampling& wrong :
       {TubeSampling{-1}, TubeSampling{1, 0}, TubeSampling{1, 101}, TubeSampling{1, 1, 0}})
    EXPECT_THROW(sample_tube({0.1}, {}, wrong), std::invalid_argument);
  EXPECT_THROW(sample_tube({0}, {}), std::invalid_argument);
  EXPECT_TRUE(sample_tube({0.1}, {}, {0}).empty());
}

}  // namespace
}  // namespace unhand::flight
