// Frames in which a tracker was elsewhere for once, and motions that are none.
#include "experiment/glitches.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "experiment/synthetic_campaign.hpp"

namespace unhand::experiment {
namespace {

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
