// What a force sensor shows of itself is told: a zero that is none, ringing, the end of its range, filters,
// hum.
#include "experiment/force_sensor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
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

/// Notes of a log whose normal forces were changed sample by sample: (t − release [s], f [N]) -> f.
std::vector<LogNote> notes_of(const std::function<double(double, double)>& change) {
  auto log = testing_support::small_log();
  const auto openings = force_openings(log);
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    auto& ft = *log.throws[i].ft;
    for (std::size_t k = 0; k < ft.time.rows; ++k)
      ft.normal_force.data[k] = change(ft.time(k) - openings[i]->release_time, ft.normal_force(k));
  }
  return force_notes(log, force_openings(log));
}

TEST(ForceNotes, AGoodSensorHasNone) {
  EXPECT_TRUE(notes_of([](double, double f) { return f; }).empty());
  EXPECT_TRUE(notes_of([](double, double f) { return std::round(f / 0.1) * 0.1; }).empty());  // on a grid
}

TEST(ForceNotes, PadsThatTouchOnceMoreAreTold) {
  const auto notes = notes_of([](double t, double f) {
    const double s = (t - 0.012) / 0.006;
    return f + (s > 0 && s < 1 ? 3 * std::sin(M_PI * s) : 0.0);
  });
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0].said, testing::HasSubstr("rises again by 3.0"));
  EXPECT_EQ(notes[0].throws, 12);
}

TEST(ForceNotes, ASensorAtTheEndOfItsRangeIsTold) {
  const auto notes = notes_of([](double, double f) { return std::min(f, 40.0); });
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0].said, testing::HasSubstr("stands at 40 N"));
  EXPECT_EQ(notes[0].throws, 12);
}

TEST(ForceNotes, AFilterAndHumAreTold) {
  double before = 0;
  const auto filtered = notes_of([&before](double t, double f) {
    if (t < -0.11) before = f;
    return before += (1 - std::exp(-1.0 / 3)) * (f - before);  // 3 ms, at 1 kHz
  });
  ASSERT_EQ(filtered.size(), 1U);
  EXPECT_THAT(filtered[0].said, testing::HasSubstr("low-pass filter"));
  const auto humming = notes_of([](double t, double f) { return f + 0.25 * std::sin(2 * M_PI * 50 * t); });
  ASSERT_EQ(humming.size(), 1U);
  EXPECT_THAT(humming[0].said, testing::HasSubstr("hum of some 50 Hz"));
}

}  // namespace
}  // namespace unhand::experiment
