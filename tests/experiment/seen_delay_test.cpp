// The delay between command and detach, as the tracker saw it.
#include "experiment/seen_delay.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "experiment/compare.hpp"
#include "experiment/friction_estimate.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::experiment {
namespace {

/// Throws of carried objects without a force sensor, and when the simulation let them go.
struct Campaign {
  datasets::ThrowLog log;
  std::vector<double> delays;  // s
};

Campaign carried(double drag_k = 0) {
  auto design = testing_support::small_design("gripper_delay");
  for (auto& object : design.objects) object.drag_k = drag_k;
  Campaign out{campaign_header(design, 5), {}};
  for (int i = 0; i < design.throws(); ++i) {
    auto [record, truth] = generate_throw(design, 5, i);
    record.ft.reset();
    out.log.throws.push_back(std::move(record));
    out.delays.push_back(truth.detach_time - *out.log.gripper->opening_command_time);
  }
  return out;
}

// 0.2 mm of noise over some sixty samples at speeds that change by 10 m/s² and more: far below 1 ms.
TEST(SeenDelay, IsThatOfTheSimulation) {
  for (const double drag_k : {0.0, 0.5}) {  // 1/m, declared
    const auto [log, delays] = carried(drag_k);
    const auto prepared = prepare_all(log, "(in memory)", 1);
    double mean = 0, n = 0;
    for (std::size_t i = 0; i < prepared.size(); ++i) {
      const auto seen = seen_delay(log, log.throws[i], prepared[i]);
      ASSERT_TRUE(seen.has_value()) << log.throws[i].id;
      EXPECT_NEAR(*seen, delays[i], 1e-3) << log.throws[i].id << ' ' << drag_k;
      if (prepared[i].split == datasets::Split::train) mean += delays[i], n += 1;
    }
    const auto estimate = estimate_friction(log, prepared, "gripper_delay");
    EXPECT_NEAR(estimate.parameters.delay.centre, mean / n, 1e-3) << drag_k;
  }
}

TEST(SeenDelay, IsNoneOfAnObjectThatTheHandKeeps) {
  auto log = carried().log;
  auto& one = log.throws[0];
  const auto prepared = prepare(log, one, "(in memory)");
  auto& mocap = *one.mocap;
  const auto& grasp = prepared.grasp;
  const double end = prepared.hand.end();
  mocap.valid.assign(mocap.time.rows, 0);
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (t > end) continue;
    const auto hand = prepared.hand.at({prepared.hand.begin(), end}, t).pose;
    const double theta = hand.theta + grasp.angle;
    mocap.valid[i] = 1;
    mocap.pose(i, 0) = hand.x + grasp.com_offset * std::cos(theta);
    mocap.pose(i, 1) = hand.z + grasp.com_offset * std::sin(theta);
  }
  EXPECT_FALSE(seen_delay(log, one, prepared).has_value());
}

TEST(SeenDelay, IsNotKnownOfThrowsThatWereNotTrackedInFlight) {
  auto log = carried().log;
  auto& one = log.throws[0];
  one.mocap->valid.assign(one.mocap->time.rows, 1);
  for (std::size_t i = 0; i < one.mocap->time.rows; ++i)
    one.mocap->valid[i] = one.mocap->time(i) < *log.gripper->opening_command_time ? 1 : 0;
  EXPECT_FALSE(seen_delay(log, one, prepare(log, one, "(in memory)")).has_value());
}

}  // namespace
}  // namespace unhand::experiment
