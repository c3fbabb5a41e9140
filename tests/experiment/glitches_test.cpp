// Frames in which a tracker was elsewhere for once, and motions that are none.
#include "experiment/glitches.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "experiment/synthetic_campaign.hpp"

namespace unhand::experiment {
namespace {

/// The frames that are off, by number.
std::vector<std::size_t> numbers(const std::vector<bool>& off) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < off.size(); ++i)
    if (off[i]) out.push_back(i);
  return out;
}

TEST(Glitches, AFrameElsewhereIsOneAndWhatForcesDoIsNot) {
  constexpr double kNoise = 1e-4, kRate = 240;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<double> times;
  std::vector<std::vector<double>> columns(1);
  // Thrown at 3 m/s; let go at 0.1 s, where 100 m/s² set in at once.
  for (int i = 0; i < 72; ++i) {
    const double t = i / kRate, after = std::max(0.0, t - 0.1);
    times.push_back(t);
    columns[0].push_back(3 * t - 50 * after * after + kNoise * normal(random));
  }
  const std::array sigma{kNoise};
  auto off = glitches(times, columns, sigma);
  EXPECT_EQ(std::count(off.begin(), off.end(), true), 0);
  columns[0][20] += 0.02, columns[0][50] -= 0.005;
  off = glitches(times, columns, sigma);
  EXPECT_EQ(std::count(off.begin(), off.end(), true), 2);
  EXPECT_TRUE(off[20] && off[50]);
}

// A tracker that loses an object may hold its pose: to the bit, as no noise does. One at rest on a grid does,
// too.
TEST(Glitches, AFrameThatRepeatsTheOneBeforeInMotionIsOne) {
  constexpr double kNoise = 1e-4, kRate = 120, kGrid = 1e-3;
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  std::vector<double> times;
  std::vector<std::vector<double>> columns(2);
  for (int i = 0; i < 90; ++i) {
    const double t = i / kRate, moving = std::max(0.0, t - 0.25);
    times.push_back(t);
    columns[0].push_back(kGrid * std::round((4 * moving + kNoise * normal(random)) / kGrid));
    columns[1].push_back(kGrid * std::round((2 * moving * moving + kNoise * normal(random)) / kGrid));
  }
  const std::array sigma{kNoise, kNoise};
  EXPECT_EQ(glitches(times, columns, sigma), std::vector<bool>(times.size(), false));
  std::vector<bool> expected(times.size(), false);
  for (const std::size_t i : {40U, 60U, 61U, 89U})
    for (auto& x : columns) x[i] = x[i - 1], expected[i] = true;
  EXPECT_EQ(glitches(times, columns, sigma), expected);
}

// Side by side, at both ends, and beside frames that were lost; but not the frames about an impact.
TEST(Glitches, NeedNoGoodNeighbours) {
  constexpr double kNoise = 1e-4, kRate = 120;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> times;
  std::vector<std::vector<double>> columns(2);
  for (int i = 0; i < 100; ++i) {
    if (i % 17 == 5) continue;
    const double t = i / kRate;
    times.push_back(t);
    columns[0].push_back(3 * t - 5 * t * t + kNoise * normal(random));
    columns[1].push_back(std::abs(t - 0.4) + kNoise * normal(random));  // bounces
  }
  const std::array sigma{kNoise, kNoise};
  EXPECT_EQ(glitches(times, columns, sigma), std::vector<bool>(times.size(), false));
  const std::array<std::size_t, 7> wild{0, 5, 30, 31, 60, times.size() - 2, times.size() - 1};
  double by = 0.02;
  for (const std::size_t i : wild) columns[0][i] += by, by *= -0.8;
  std::vector<bool> expected(times.size(), false);
  for (const std::size_t i : wild) expected[i] = true;
  const auto off = glitches(times, columns, sigma);
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_EQ(off[i], expected[i]) << i << " of " << times.size();
}

/// A box that lies, is thrown up at 2 m/s, bounces twice and lies again, at 240 Hz.
double bouncing(double t, double lies) {
  constexpr double g = 9.81;
  t -= lies;
  if (t < 0) return 0;
  for (double v = 2; v > 0.5; v *= 0.5) {
    const double flight = 2 * v / g;
    if (t < flight) return v * t - 0.5 * g * t * t;
    t -= flight;
  }
  return 0;
}

// Nor is a throw that ends in a long rest, whatever the noise: each frame follows those before or after it.
TEST(Glitches, AreNoImpacts) {
  constexpr double kRate = 240;
  for (const double noise : {3e-5, 2e-4})
    for (const double lies : {0.1, 5.0})
      for (unsigned seed = 0; seed < 20; ++seed) {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal;
        std::vector<double> times;
        std::vector<std::vector<double>> columns(1);
        for (int i = 0; i < kRate * (lies + 2); ++i) {
          times.push_back((i + 0.01 * seed) / kRate);
          columns[0].push_back(bouncing(times.back(), lies) + noise * normal(random));
        }
        const std::array sigma{noise};
        EXPECT_THAT(numbers(glitches(times, columns, sigma)), testing::IsEmpty())
            << noise << " " << lies << " " << seed;
        const auto off = static_cast<std::size_t>(kRate * (lies + 0.1));  // in flight
        const std::vector<std::size_t> wild{off, off + 1, off + 30, off + 40, off + 41, off + 42};
        for (const std::size_t i : wild) columns[0][i] += 100 * noise;
        EXPECT_EQ(numbers(glitches(times, columns, sigma)), wild) << noise << " " << lies << " " << seed;
      }
}

TEST(Glitches, OfACampaignAreFoundAndNoOthers) {
  auto log = generate_campaign(campaign_design("quick12"), 4);
  EXPECT_EQ(mark_glitches(log), 0u);
  const auto clean = log;
  std::size_t n = 0;
  for (auto& one : log.throws)
    for (const std::size_t frame : {12u, 30u, 47u}) {
      one.mocap->pose(frame, n % 3) += n % 3 == 2 ? 0.3 : 0.02;  // rad, m
      ++n;
    }
  EXPECT_EQ(mark_glitches(log), n);
  for (std::size_t k = 0; k < log.throws.size(); ++k)
    for (std::size_t i = 0; i < log.throws[k].mocap->time.rows; ++i) {
      const bool wild = i == 12 || i == 30 || i == 47;
      EXPECT_EQ(log.throws[k].mocap->is_valid(i), clean.throws[k].mocap->is_valid(i) && !wild) << i;
    }
}

}  // namespace
}  // namespace unhand::experiment
