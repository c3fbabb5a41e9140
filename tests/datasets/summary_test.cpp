// What a log is said to hold: rates, gaps, noise and scatter.
#include "datasets/summary.hpp"

#include <cmath>
#include <random>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

TEST(Summary, CountsRatesGapsAndNoise) {
  ThrowLog log = planar_log();
  Series& time = log.throws[1].mocap->time;
  for (std::size_t i = 20; i < time.rows; ++i) time(i) += 0.05;  // a gap after row 19
  log.throws[1].mocap->valid[8] = 0;
  log.throws[1].mocap->pose.sigma[0] = 5e-4;
  log.throws[1].ft.reset();
  const LogSummary s = summarise(log);

  EXPECT_EQ(s.throws, 2U);
  EXPECT_EQ(s.train, 1U);
  EXPECT_EQ(s.test, 1U);
  EXPECT_EQ(s.free_flights, 0U);
  EXPECT_EQ(s.conditions.at("bar/pitch-23"), 2U);
  EXPECT_THAT(s.objects, testing::ElementsAre("bar", "plain"));

  std::vector<std::string> channels;
  for (const ChannelSummary& c : s.each[1].channels) channels.push_back(c.group);
  EXPECT_THAT(channels, testing::ElementsAre("hand", "mocap", "imu"));
  const ChannelSummary& poses = s.each[1].channels[1];
  EXPECT_NEAR(poses.rate, 240, 1e-9);
  EXPECT_NEAR(poses.longest_gap, 0.05 + 1.0 / 240, 1e-12);
  EXPECT_EQ(poses.gap_at, time(19));
  EXPECT_EQ(poses.lost, 2U);
  EXPECT_EQ(poses.longest_loss, 2U);

  const auto group =
      std::find_if(s.groups.begin(), s.groups.end(), [](const auto& g) { return g.group == "mocap"; });
  ASSERT_NE(group, s.groups.end());
  EXPECT_EQ(group->throws, 2U);
  EXPECT_EQ(group->rows, 60U);
  EXPECT_EQ(group->lost, 3U);
  EXPECT_NEAR(group->worst_gap_ratio, 13, 1e-9);  // (0.05 + 1/240) / (1/240)
  EXPECT_EQ(group->worst_gap_throw, "002");

  const auto noise =
      std::find_if(s.noise.begin(), s.noise.end(), [](const auto& n) { return n.dataset == "mocap/pose"; });
  ASSERT_NE(noise, s.noise.end());
  EXPECT_EQ(noise->columns, "x,z,theta");
  EXPECT_EQ(noise->units, "m,m,rad");
  EXPECT_EQ(noise->declared, 2U);
  EXPECT_EQ(noise->lowest[0], 2e-4);
  EXPECT_EQ(noise->highest[0], 5e-4);
}

// A force sensor with white noise of 1 σ = `noise` on a motion of 10 rad/s; its log declares 0.05 N.
NoiseSummary force_noise(double noise, double rate, double declared = 0.05) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  ThrowLog log = planar_log();
  for (Throw& toss : log.throws) {
    FtLog& felt = *toss.ft;
    constexpr std::size_t kRows = 300;
    felt.time = clock_of(kRows, rate);
    felt.wrench = {kRows, 3, std::vector<double>(3 * kRows), {0.02, 0.02, 2e-4}};
    felt.normal_force = {kRows, 1, {}, {declared}};
    for (std::size_t i = 0; i < kRows; ++i)
      felt.normal_force.data.push_back(20 + 5 * std::sin(10 * felt.time(i)) + noise * normal(random));
  }
  const LogSummary s = summarise(log);
  return *std::ranges::find_if(s.noise, [](const auto& n) { return n.dataset == "ft/normal_force"; });
}

// A phone that is shaken, falls for a second and is caught: its noise is that of the fall.
TEST(Summary, ScatterOfAPhoneIsThatOfItsFalls) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  ThrowLog log = planar_log();
  log.throws.resize(1);
  Throw& toss = log.throws.front();
  toss.hand.reset(), toss.ft.reset(), toss.mocap.reset(), toss.landing.reset(), toss.detach_time.reset();
  toss.free_flight = {1.0, 2.0};
  ImuLog& felt = toss.imu.emplace();
  constexpr std::size_t kRows = 600;
  felt.time = clock_of(kRows, 200);
  felt.specific_force = {kRows, 3, {}, {0.02, 0.02, 0.02}};
  for (std::size_t i = 0; i < kRows; ++i)
    for (int axis = 0; axis < 3; ++axis)
      felt.specific_force.data.push_back((std::abs(felt.time(i) - 1.5) <= 0.5 ? 0.02 : 1.0) * normal(random));
  const LogSummary s = summarise(log);
  const auto noise =
      std::ranges::find_if(s.noise, [](const auto& n) { return n.dataset == "imu/specific_force"; });
  ASSERT_NE(noise, s.noise.end());
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(noise->scatter.at(axis), 0.02, 3 * 0.02 * 1.07 / std::sqrt(200.0));  // of 200 samples
    EXPECT_FALSE(noise->too_small.at(axis));
  }
}

TEST(Summary, ScatterTellsADeclaredNoiseThatIsTooSmall) {
  constexpr double kSure = 3 * 1.07 / 24.4;  // of 600 samples
  for (double ratio : {0.5, 1.0, 1.4, 2.0}) {
    const NoiseSummary n = force_noise(0.05 * ratio, 1000);
    EXPECT_NEAR(n.scatter.at(0), 0.05 * ratio, kSure * 0.05 * ratio);
    EXPECT_NEAR(n.ratio.at(0), ratio, kSure * ratio);
    EXPECT_EQ(n.too_small.at(0), ratio > 1.2) << ratio;
  }
  // A motion that is fast for the sensor is no noise: ω Δt = 0.5, 5 (ω Δt)³/√20 = 0.14 N in third
  // differences.
  EXPECT_FALSE(force_noise(0.05, 20).too_small.at(0));
  EXPECT_FALSE(force_noise(0, 20).too_small.at(0));
  const NoiseSummary zero = force_noise(0.05, 1000, 0);
  EXPECT_EQ(zero.zero, 2U);
  EXPECT_EQ(zero.ratio.at(0), 0);
  EXPECT_FALSE(zero.too_small.at(0));
}

TEST(Summary, TimesAreThoseOfTheFilesClock) {
  ThrowLog log = planar_log();
  const LogSummary before = summarise(log);
  log.clock_origin = 1.7e9;
  const LogSummary after = summarise(log);
  for (std::size_t i = 0; i < before.each.size(); ++i)
    for (std::size_t k = 0; k < before.each[i].channels.size(); ++k) {
      const ChannelSummary &a = before.each[i].channels[k], &b = after.each[i].channels[k];
      EXPECT_NEAR(b.start - 1.7e9, a.start, 1e-6);
      EXPECT_NEAR(b.end - 1.7e9, a.end, 1e-6);
      EXPECT_NEAR(b.gap_at - 1.7e9, a.gap_at, 1e-6);
    }
}

TEST(Summary, OneSampleHasNoRate) {
  ThrowLog log = spatial_log();
  log.throws[0].mocap->time = clock_of(1, 1);
  log.throws[0].mocap->pose.rows = 1;
  log.throws[0].mocap->pose.data.resize(7);
  const LogSummary s = summarise(log);
  EXPECT_EQ(s.each[0].channels[0].rate, 0);
  EXPECT_EQ(s.free_flights, 2U);
}

TEST(Summary, JsonSaysWhatItIs) {
  const std::string json = to_json(summarise(planar_log()));
  EXPECT_THAT(json, testing::StartsWith("{\n \"schema\": \"inspect\",\n \"schema_version\": 1,"));
  EXPECT_THAT(json, testing::HasSubstr("\"train\": 1,"));
  EXPECT_THAT(json, testing::HasSubstr("Würfe"));
  EXPECT_THAT(json, testing::Not(testing::HasSubstr("null")));
  EXPECT_EQ(json.back(), '\n');
}

}  // namespace
}  // namespace unhand::datasets::test
