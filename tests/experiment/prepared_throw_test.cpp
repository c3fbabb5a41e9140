// What a logged throw is measured to have done.
#include <gtest/gtest.h>

#include "experiment/prepared_throw.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;

/// A tracker goes on after the object has come down: what lies on the floor is no flight, whether the landing
/// was logged or not.
TEST(PreparedThrow, TheTwistAtDetachKnowsNothingOfTheFloor) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  const auto [record, truth] = generate_throw(design, 1, 3);
  log.throws = {record};
  datasets::Throw lying = record;
  datasets::MocapLog& mocap = *lying.mocap;
  for (int k = 0; k < 120; ++k) {  // half a second, rolled on by a centimetre, a millimetre below
    mocap.time.data.push_back(truth.landing_time + (k + 1) / 240.0);
    mocap.pose.data.insert(mocap.pose.data.end(), {truth.landing_pose.x + 0.01, log.landing_height - 1e-3,
                                                   truth.landing_pose.theta});
    mocap.valid.push_back(1);
    ++mocap.time.rows, ++mocap.pose.rows;
  }
  datasets::Throw unlogged = lying;
  unlogged.landing.reset();
  const auto clean = prepare(log, record, "(in memory)").measured.detach_twist;
  ASSERT_TRUE(clean);
  // A fit of some 80 samples of 0.2 mm and 0.2 degrees over 0.35 s: 1 σ of 0.2 mm/s and 0.2 deg/s.
  EXPECT_NEAR(clean->vx, truth.detach_twist.vx, 2e-3);
  for (const datasets::Throw* one : {&lying, &unlogged}) {
    const auto twist = prepare(log, *one, "(in memory)").measured.detach_twist;
    ASSERT_TRUE(twist);
    EXPECT_NEAR(twist->vx, clean->vx, 1e-3);  // a last sample of noise more or less
    EXPECT_NEAR(twist->vz, clean->vz, 1e-3);
    EXPECT_NEAR(twist->omega, clean->omega, 0.02);
  }
}

}  // namespace
