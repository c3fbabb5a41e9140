// The grid of a sensor's readings, and what rounding to it adds.
#include "dynamics/quantisation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace unhand::dynamics {
namespace {

constexpr double kStep = 1e-3;

/// Readings of a motion of so many steps per sample, with noise, rounded where asked for.
std::vector<double> readings(double steps_per_sample, double noise, bool rounded) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, noise);
  std::vector<double> out;
  for (int i = 0; i < 150; ++i) {
    const double x = 0.4 + steps_per_sample * kStep * i + normal(random);
    out.push_back(rounded ? kStep * std::round(x / kStep) : x);
  }
  return out;
}

TEST(Quantisation, TheStepIsFoundOfSlowAndOfSteadyFastMotions) {
  for (const double speed : {0.0, 0.3, 1.7, 9.4, 40.3})
    EXPECT_NEAR(quantisation_step(readings(speed, 0.6 * kStep, true)), kStep, 1e-9) << speed;
}

TEST(Quantisation, ReadingsThatAreNotRoundedLieOnNoGrid) {
  for (const double speed : {0.0, 0.3, 9.4})
    EXPECT_EQ(quantisation_step(readings(speed, 0.6 * kStep, false)), 0) << speed;
  EXPECT_EQ(quantisation_step(std::vector<double>(50, 1.5)), 0);
  EXPECT_EQ(quantisation_step({}), 0);
}

TEST(Quantisation, RoundingAddsTheErrorOfAUniformStep) {
  const auto exact = readings(9.4, 0.6 * kStep, false), rounded = readings(9.4, 0.6 * kStep, true);
  double sum = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) sum += (rounded[i] - exact[i]) * (rounded[i] - exact[i]);
  const double rms = std::sqrt(sum / static_cast<double>(exact.size()));
  EXPECT_NEAR(rms, rounding_sigma(kStep), 0.1 * rounding_sigma(kStep));
}

}  // namespace
}  // namespace unhand::dynamics
