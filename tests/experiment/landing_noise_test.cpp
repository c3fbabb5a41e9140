// The noise of landings that declare none, against that of the sensor that made them.
#include "experiment/landing_noise.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "experiment/observations.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using testing::HasSubstr;

/// Thirty throws, five of each condition, whose landings do not say how noisy they are.
datasets::ThrowLog unsure(bool mocap) {
  CampaignDesign design = campaign_design("quick12");
  design.repetitions = 5;
  design.sensors.mocap = mocap;
  auto log = generate_campaign(design, 3);
  for (auto& one : log.throws) one.landing->pose.sigma.clear();
  return log;
}

const SensorSuite kSensors = campaign_design("quick12").sensors;

TEST(LandingNoise, IsTheSensorsWhereMotionCaptureSawTheLanding) {
  auto log = unsure(true);
  EXPECT_EQ(landings_without_sigma(log), 30);
  const auto noise = landing_noise(log);
  // 24 degrees of freedom: 1 σ of 14 %; the track's own noise adds a hundredth
  EXPECT_NEAR(noise.x.value(), kSensors.landing_sigma[0], 0.45 * kSensors.landing_sigma[0]);
  EXPECT_NEAR(noise.theta.value(), kSensors.landing_sigma[1], 0.45 * kSensors.landing_sigma[1]);
  EXPECT_THAT(noise.how, HasSubstr("motion capture within repetitions"));
  // What a frame is off by is in all landings, and no noise.
  for (auto& one : log.throws) one.landing->pose(0, 0) += 0.05;
  EXPECT_NEAR(landing_noise(log).x.value(), *noise.x, 1e-9);
}

// Two objects may be thrown under conditions of one name: what differs between them is no noise.
TEST(LandingNoise, ObjectsAreNotPooled) {
  auto log = unsure(true);
  const auto before = landing_noise(log);
  const std::string first = log.throws.front().object;
  int others = 0;
  for (auto& one : log.throws) {
    one.condition = one.condition.substr(one.condition.find('/'));
    if (one.object == first) continue;
    one.landing->pose(0, 0) += 0.1;  // as its frame, or its size
    ++others;
  }
  ASSERT_GT(others, 0);
  EXPECT_NEAR(landing_noise(log).x.value(), *before.x, 1e-9);
}

TEST(LandingNoise, IsWhatThrowsDifferByWhereNothingElseTells) {
  const auto noise = landing_noise(unsure(false));
  EXPECT_GT(noise.x.value(), kSensors.landing_sigma[0]);
  EXPECT_GT(noise.theta.value(), kSensors.landing_sigma[1]);
  EXPECT_THAT(noise.how, HasSubstr("as large as throws differ"));
}

// Half of the landings were measured with a ruler, which tells no angle.
TEST(LandingNoise, AnglesThatWereNotMeasuredHaveNoSayInIt) {
  auto log = unsure(true);
  const auto before = landing_noise(log);
  for (std::size_t i = 0; i < log.throws.size(); i += 2) {
    auto& pose = log.throws[i].landing->pose;
    pose(0, 1) = 0, pose.sigma = {kSensors.landing_sigma[0], 10};
  }
  const auto noise = landing_noise(log);
  EXPECT_EQ(noise.x, before.x);
  EXPECT_NEAR(noise.theta.value(), kSensors.landing_sigma[1], 0.6 * kSensors.landing_sigma[1]);
}

TEST(LandingNoise, HeldOutLandingsHaveNoSayInWhatAFitTrusts) {
  for (const bool mocap : {true, false}) {
    auto log = unsure(mocap);
    const auto before = landing_noise(log);
    double sign = 1;
    for (auto& one : log.throws)
      if (one.split == datasets::Split::test) one.landing->pose(0, 0) += 0.2 * sign, sign = -sign;
    EXPECT_EQ(landing_noise(log).x, before.x);
    for (auto& one : log.throws) one.split = datasets::Split::test;  // where nothing is fitted, all tell
    EXPECT_GT(landing_noise(log).x.value(), 10 * kSensors.landing_sigma[0]);
  }
}

TEST(LandingNoise, WeighsTheLandingsOfALogThatDeclaresNone) {
  const auto sigma_in = [](const datasets::ThrowLog& log, Channel channel) {
    const auto& one = log.throws.front();
    const auto all = observe(log, one, prepare(log, one, "(in memory)")).all;
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const auto& o) { return o.channel == channel; });
    return found == all.end() ? 0.0 : found->sigma;
  };
  auto log = unsure(true);
  const auto noise = landing_noise(log);
  EXPECT_EQ(sigma_in(log, Channel::landing_x), *noise.x);
  EXPECT_EQ(sigma_in(log, Channel::landing_theta), *noise.theta);
  auto zero = log;  // as of the other sensors, 0 declares nothing
  for (auto& one : zero.throws) one.landing->pose.sigma = {0, 0};
  EXPECT_EQ(sigma_in(zero, Channel::landing_x), *landing_noise(zero).x);
  EXPECT_EQ(landings_without_sigma(zero), landings_without_sigma(log));
  for (auto& one : zero.throws) one.landing->pose.sigma = {0.002, 0};
  EXPECT_NEAR(sigma_in(zero, Channel::landing_x), 0.002, 1e-5);
  EXPECT_EQ(sigma_in(zero, Channel::landing_theta), *landing_noise(zero).theta);
  log.throws.resize(2);  // too few to tell: left out, not trusted to the last digit
  EXPECT_FALSE(landing_noise(log).x);
  EXPECT_EQ(sigma_in(log, Channel::landing_x), 0);
  EXPECT_THAT(in_words(landing_noise(log), 2), HasSubstr("not used"));
}

}  // namespace
