#include "datasets/summary.hpp"

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
  EXPECT_EQ(noise->declared, 2U);
  EXPECT_EQ(noise->lowest[0], 2e-4);
  EXPECT_EQ(noise->highest[0], 5e-4);
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
