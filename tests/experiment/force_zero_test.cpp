// A normal force that does not end at zero is told.
#include "experiment/force_zero.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/small_campaign.hpp"

namespace unhand::experiment {
namespace {

datasets::ThrowLog offset_log(double level) {
  auto log = testing_support::small_log();
  for (auto& one : log.throws)
    for (double& f : one.ft->normal_force.data) f += level;
  return log;
}

TEST(ForceZero, ASensorThatWasTaredIsNotTold) { EXPECT_FALSE(untared_force(force_openings(offset_log(0)))); }

TEST(ForceZero, TheLevelAfterThePadsHavePartedIsTheSensors) {
  for (const double level : {-0.5, 1.0, 8.0, 60.0}) {
    const auto told = untared_force(force_openings(offset_log(level)));
    ASSERT_TRUE(told) << level;
    EXPECT_NEAR(told->level, level, 5 * told->sigma);
    EXPECT_GT(told->grip, level);
    EXPECT_GT(told->throws, 0);
  }
}

// What is plain in the noise may be too little of the grip to matter.
TEST(ForceZero, AThousandthOfTheGripIsNotTold) {
  const double grip = untared_force(force_openings(offset_log(1)))->grip;
  for (const double sign : {1.0, -1.0}) {
    EXPECT_FALSE(untared_force(force_openings(offset_log(sign * 0.001 * grip))));
    EXPECT_TRUE(untared_force(force_openings(offset_log(sign * 0.01 * grip))));
  }
}

// A sensor whose zero drifts between throws, about zero.
TEST(ForceZero, ZerosThatScatterFromThrowToThrowAreNoCommonOne) {
  int told = 0;
  const auto clean = offset_log(0);
  constexpr unsigned kSeeds = 30;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    auto log = clean;
    for (auto& one : log.throws) {
      const double zero = normal(random);
      for (double& f : one.ft->normal_force.data) f += zero;
    }
    told += untared_force(force_openings(log)).has_value();
  }
  EXPECT_LE(told, 1);
}

/// Nothing says that the pads let go: they may still press.
TEST(ForceZero, PadsThatMayStillPressAreNoDoubt) {
  auto log = offset_log(1);
  for (auto& one : log.throws) one.landing.reset(), one.free_flight.reset();
  EXPECT_FALSE(untared_force(force_openings(log)));
}

}  // namespace
}  // namespace unhand::experiment
