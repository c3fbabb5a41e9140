// Which samples of a log are observations, and how far they are trusted.
#include "experiment/observations.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "contact/patch.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;

/// A throw of the noisy campaign, and what is observed of it.
struct Observed {
  datasets::ThrowLog log;
  PreparedThrow prepared;

  explicit Observed(int index = 3) : Observed(campaign_design("quick12"), index) {}
  Observed(const CampaignDesign& design, int index)
      : log(with_throw(design, index)), prepared(prepare(log, log.throws[0], "(in memory)")) {}
  static datasets::ThrowLog with_throw(const CampaignDesign& design, int index) {
    datasets::ThrowLog log = campaign_header(design, 1);
    log.throws = {generate_throw(design, 1, index).record};
    return log;
  }
  datasets::Throw& one() { return log.throws[0]; }
  std::vector<Observation> of(Channel channel, const ObservationOptions& options = {}) const {
    std::vector<Observation> out;
    for (const Observation& o : observe(log, log.throws[0], prepared, options).all)
      if (o.channel == channel) out.push_back(o);
    return out;
  }
};

TEST(Observe, FramesThatTheTrackerLostSayNothing) {
  Observed seen;
  const auto before = seen.of(Channel::mocap_x);
  auto& mocap = *seen.one().mocap;
  std::size_t row = 0;
  while (mocap.time(row) != before[before.size() / 2].time) ++row;
  mocap.valid.resize(mocap.time.rows, 1);
  mocap.valid[row] = 0;
  for (std::size_t c = 0; c < 3; ++c) mocap.pose(row, c) = 1e3;
  for (const Channel channel : {Channel::mocap_x, Channel::mocap_z, Channel::mocap_theta}) {
    const auto after = seen.of(channel);
    EXPECT_EQ(after.size(), before.size() - 1);
    for (const Observation& o : after) EXPECT_LT(std::abs(o.value), 100) << to_string(channel);
  }
}

TEST(Observe, WrenchesAreLeftOutWhereTheyJumpAndSettle) {
  const Observed seen;
  ObservationOptions options;
  options.settling = 0.02, options.before_jump = 0.004;
  const auto jumps = seen.prepared.hand.jumps();
  ASSERT_FALSE(jumps.empty());
  const double begin = seen.prepared.hand.begin(), end = seen.prepared.hand.end();
  const auto taken = seen.of(Channel::wrench_fz, options);
  std::size_t expected = 0;
  const auto& time = seen.log.throws[0].ft->time;
  for (std::size_t i = 0; i < time.rows; ++i) {
    const double t = time(i);
    bool settles = t < begin + options.settling;
    for (const double jump : jumps)
      settles = settles || (t >= jump - options.before_jump - 1e-9 && t < jump + options.settling);
    const bool there =
        std::any_of(taken.begin(), taken.end(), [&](const Observation& o) { return o.time == t; });
    EXPECT_EQ(there, t >= begin && t <= end && !settles) << t;
    expected += there;
  }
  EXPECT_EQ(taken.size(), expected);
  EXPECT_GT(expected, 50u);
}

/// σ² is the sensor's beside a share of the whole wrench: of the force, and of the torque at a finger's
/// length.
TEST(Observe, WrenchesAreTrustedToAShareOfTheWhole) {
  const Observed seen;
  ObservationOptions options, exact;
  options.wrench_trust = 0.1, exact.wrench_trust = 0;
  const auto fx = seen.of(Channel::wrench_fx, options), fz = seen.of(Channel::wrench_fz, options),
             tau = seen.of(Channel::wrench_tau, options);
  const auto sensor_fx = seen.of(Channel::wrench_fx, exact), sensor_tau = seen.of(Channel::wrench_tau, exact);
  ASSERT_GT(fx.size(), 50u);
  for (std::size_t i = 0; i < fx.size(); ++i) {
    const double force = std::hypot(fx[i].value, fz[i].value),
                 torque = std::hypot(tau[i].value, contact::kFingerLength * force);
    EXPECT_NEAR(fx[i].sigma, std::hypot(sensor_fx[i].sigma, 0.1 * force), 1e-12);
    EXPECT_NEAR(fz[i].sigma, fx[i].sigma, 0.2 * fx[i].sigma);
    EXPECT_NEAR(tau[i].sigma, std::hypot(sensor_tau[i].sigma, 0.1 * torque), 1e-12);
  }
}

TEST(Observe, TheNormalForceIsReadAfterTheReleaseAlone) {
  const Observed seen;
  const double release = seen.prepared.normal_force->release_time();
  const auto read = seen.of(Channel::normal_force);
  ASSERT_FALSE(read.empty());
  for (const Observation& o : read) EXPECT_GE(o.time, release);
}

TEST(Observe, AnAngleThatWasNotMeasuredIsNone) {
  Observed seen;
  EXPECT_EQ(seen.of(Channel::landing_theta).size(), 1u);
  seen.one().landing->pose.sigma = {1e-3, std::numbers::pi};
  EXPECT_EQ(seen.of(Channel::landing_theta).size(), 0u);
  EXPECT_EQ(seen.of(Channel::landing_x).size(), 1u);
}

/// 1 σ of Gaussian noise on a smooth track, of which nobody says how large it is.
TEST(Observe, AnUndeclaredNoiseIsThatOfTheScatter) {
  CampaignDesign design = testing_support::perfect();
  design.sensors.mocap_rate = 1000;
  Observed seen(design, 3);
  auto& mocap = *seen.one().mocap;
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 2e-3);
  for (std::size_t i = 0; i < mocap.time.rows; ++i) mocap.pose(i, 0) += noise(random);
  mocap.pose.sigma.clear();
  const double sigma = seen.of(Channel::mocap_x).front().sigma;
  // The median of some 600 third differences, of which six share a sample: about 6 %.
  EXPECT_NEAR(sigma, 2e-3, 0.18 * 2e-3);
}

/// Readings on a grid are off by a uniform error beside the sensor's: step/√12.
TEST(Observe, RoundedReadingsAddTheirRounding) {
  Observed seen;
  constexpr double kStep = 1e-3;
  auto& pose = seen.one().mocap->pose;
  const double declared = pose.sigma[0];
  EXPECT_NEAR(seen.of(Channel::mocap_x).front().sigma, declared, 1e-12);
  for (std::size_t i = 0; i < pose.rows; ++i) pose(i, 0) = kStep * std::round(pose(i, 0) / kStep);
  EXPECT_NEAR(seen.of(Channel::mocap_x).front().sigma, std::hypot(declared, kStep / std::sqrt(12.0)), 1e-9);
}

}  // namespace
