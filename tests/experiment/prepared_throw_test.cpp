// What a logged throw is measured to have done.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <utility>

#include "experiment/observations.hpp"
#include "experiment/prepared_throw.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "experiment/throw_prediction.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;

/// One more sample of a planar track.
void track(datasets::MocapLog& mocap, double t, const dynamics::Pose<double>& pose) {
  mocap.time.data.push_back(t);
  mocap.pose.data.insert(mocap.pose.data.end(), {pose.x, pose.z, pose.theta});
  mocap.valid.push_back(1);
  ++mocap.time.rows, ++mocap.pose.rows;
}

/// A tracker goes on after the object has come down: what lies on the floor is no flight, nor what somebody
/// picks up again and lifts above all that was thrown, whether the landing was logged or not.
TEST(PreparedThrow, TheTwistAtDetachKnowsNothingOfTheFloor) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  const auto [record, truth] = generate_throw(design, 1, 3);
  log.throws = {record};
  datasets::Throw lying = record;
  for (int k = 0; k < 120; ++k) {  // a quarter of a second, rolled on by a centimetre, a millimetre below
    const double lifted = k < 60 ? -1e-3 : 0.05 * (k - 60);
    track(*lying.mocap, truth.landing_time + (k + 1) / 240.0,
          {truth.landing_pose.x + 0.01, log.landing_height + lifted, truth.landing_pose.theta});
  }
  datasets::Throw unlogged = lying;
  unlogged.landing.reset();
  const auto clean = prepare(log, record, "(in memory)").measured.detach_twist;
  ASSERT_TRUE(clean);
  // A fit of some 80 samples of 0.2 mm and 0.2 degrees over 0.35 s: 1 σ of 0.2 mm/s and 0.2 deg/s.
  EXPECT_NEAR(clean->vx, truth.detach_twist.vx, 2e-3);
  const auto tracked = [&](const datasets::Throw& one) {
    const auto all = observe(log, one, prepare(log, one, "(in memory)")).all;
    return std::count_if(all.begin(), all.end(), [](const auto& o) { return o.channel == Channel::mocap_z; });
  };
  for (const datasets::Throw* one : {&lying, &unlogged}) {
    EXPECT_LE(std::abs(tracked(*one) - tracked(record)), 1);  // the same
    const auto twist = prepare(log, *one, "(in memory)").measured.detach_twist;
    ASSERT_TRUE(twist);
    EXPECT_NEAR(twist->vx, clean->vx, 1e-3);  // a last sample of noise more or less
    EXPECT_NEAR(twist->vz, clean->vz, 1e-3);
    EXPECT_NEAR(twist->omega, clean->omega, 0.02);
  }
}

/// A force sensor goes on for three seconds: of its noise one sample in 740 is above 3 σ, which is no grip.
TEST(PreparedThrow, ALongTailOfTheForceHidesNoFlight) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  for (int index = 0; index < 4; ++index) {
    const auto [record, truth] = generate_throw(design, 1, index);
    datasets::Throw longer = record;
    datasets::FtLog& ft = *longer.ft;
    const double step = ft.time(1) - ft.time(0), last = ft.time(ft.time.rows - 1);
    std::mt19937_64 random(7 + index);
    std::normal_distribution<double> noise;
    for (int k = 0; k < 3 / step; ++k) {
      ft.time.data.push_back(last + (k + 1) * step);
      for (std::size_t c = 0; c < 3; ++c) ft.wrench.data.push_back(ft.wrench.sigma[c] * noise(random));
      ft.normal_force.data.push_back(ft.normal_force.sigma[0] * noise(random));
      ++ft.time.rows, ++ft.wrench.rows, ++ft.normal_force.rows;
    }
    log.throws = {record};
    for (const datasets::Throw* one : {&std::as_const(record), &std::as_const(longer)}) {
      const auto measured = prepare(log, *one, "(in memory)").measured;
      ASSERT_TRUE(measured.detach_twist);
      EXPECT_NEAR(measured.detach_twist->vx, truth.detach_twist.vx, 2e-3) << index;
      EXPECT_NEAR(measured.detach_twist->omega, truth.detach_twist.omega, 0.02) << index;
    }
  }
}

/// A declared free flight ends where it says, also of a throw from a hand: what it bounces off is no flight.
TEST(PreparedThrow, AFlightEndsWhereItIsDeclaredTo) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  const auto [record, truth] = generate_throw(design, 1, 3);
  log.throws = {record};
  datasets::Throw bounced = record;
  bounced.landing.reset();
  bounced.free_flight = {truth.detach_time, truth.landing_time - 0.01};
  for (int k = 0; k < 120; ++k) {  // back up at once, turning the other way
    const double since = k / 240.0;
    track(*bounced.mocap, truth.landing_time + 1e-3 + since,
          {truth.landing_pose.x - since, log.landing_height + 2 * since - 4.905 * since * since,
           truth.landing_pose.theta - 5 * since});
  }
  const auto twist = prepare(log, bounced, "(in memory)").measured.detach_twist;
  ASSERT_TRUE(twist);
  EXPECT_NEAR(twist->vx, truth.detach_twist.vx, 2e-3);
  EXPECT_NEAR(twist->omega, truth.detach_twist.omega, 0.02);
  for (const auto& seen : observe(log, bounced, prepare(log, bounced, "(in memory)")).all)
    EXPECT_LT(seen.time, truth.landing_time);
}

/// A shelf above the hand: the object is below it when it is let go, and lands on it from above.
TEST(PreparedThrow, AFlightToAShelfAboveTheHandIsSeen) {
  CampaignDesign design = campaign_design("quick12");
  const ThrowTruth on_ground = generate_throw(design, 1, 3).truth;
  const double rise = on_ground.detach_twist.vz, top = on_ground.detach_pose.z + rise * rise / (2 * 9.81);
  ASSERT_GT(rise, 0.5);
  design.landing_height = 0.5 * (on_ground.detach_pose.z + top);
  const datasets::ThrowLog log = campaign_header(design, 1);
  const auto [logged, truth] = generate_throw(design, 1, 3);
  ASSERT_GT(log.landing_height, truth.detach_pose.z);
  datasets::Throw unlogged = logged;
  unlogged.landing.reset();
  for (const datasets::Throw* one : {&logged, const_cast<const datasets::Throw*>(&unlogged)}) {
    const PreparedThrow prepared = prepare(log, *one, "(in memory)");
    int flown = 0, lying = 0;
    for (const auto& o : observe(log, *one, prepared).all) {
      if (o.channel != Channel::mocap_z) continue;
      flown += o.time > truth.detach_time && o.time < truth.landing_time;
      lying += o.time > truth.landing_time + 2 / 240.0;
    }
    EXPECT_NEAR(flown, 240 * (truth.landing_time - truth.detach_time), 5);  // but for what is lost
    EXPECT_EQ(lying, 0);
    ASSERT_TRUE(prepared.measured.detach_twist);
    // some 30 samples of 0.2 mm over an eighth of a second: 1 σ of 1 mm/s
    EXPECT_NEAR(prepared.measured.detach_twist->vx, truth.detach_twist.vx, 5e-3);
  }
}

/// One throw of perfect sensors, of objects with this declared drag [1/m].
struct PerfectThrow {
  datasets::ThrowLog log;
  SyntheticThrow made;

  PerfectThrow(int index, double drag) {
    CampaignDesign design = testing_support::perfect();
    for (auto& object : design.objects) object.drag_k = drag;
    log = campaign_header(design, testing_support::kSeed);
    made = generate_throw(design, testing_support::kSeed, index);
  }
  PreparedThrow prepared() const { return prepare(log, made.record, "(in memory)"); }
};

TEST(PreparedThrow, TheStateAtDetachIsTheTrueOne) {
  for (const double drag : {0.0, 0.05, 0.3})
    for (const int index : {0, 5, testing_support::kThrow}) {
      const PerfectThrow one(index, drag);
      const auto measured = one.prepared().measured;
      const ThrowTruth& truth = one.made.truth;
      // Without drag the flight is a polynomial that the samples lie on: rounding. With it the iteration
      // ends where the twist has settled, and flights are integrated to 1e-8.
      const double tolerance = drag > 0 ? 1e-7 : 1e-9;
      EXPECT_NEAR(*measured.detach_time, truth.detach_time, 1e-9);
      EXPECT_NEAR(measured.detach_pose->x, truth.detach_pose.x, tolerance) << drag;
      EXPECT_NEAR(measured.detach_pose->z, truth.detach_pose.z, tolerance) << drag;
      EXPECT_NEAR(measured.detach_pose->theta, truth.detach_pose.theta, 1e-9);
      EXPECT_NEAR(measured.detach_twist->vx, truth.detach_twist.vx, tolerance) << drag;
      EXPECT_NEAR(measured.detach_twist->vz, truth.detach_twist.vz, tolerance) << drag;
      EXPECT_NEAR(measured.detach_twist->omega, truth.detach_twist.omega, 1e-9);
    }
}

// Motion capture before the gripper opens says how the object is held, and wins over what the log declares.
TEST(PreparedThrow, TheGraspIsWhatMotionCaptureSaw) {
  for (const int index : {0, testing_support::kThrow}) {
    PerfectThrow one(index, 0);
    datasets::Throw& record = one.made.record;
    datasets::Object& object = one.log.objects.at(record.object);
    const double offset = *object.com_offset;
    record.grasp_angle = 1;
    // the object is held still while some twelve samples see it: what the hand's spline leaves
    EXPECT_NEAR(one.prepared().grasp.angle, one.made.truth.grasp_angle, 1e-9);
    EXPECT_EQ(one.prepared().grasp.com_offset, offset) << "as declared";
    object.com_offset.reset();
    EXPECT_NEAR(one.prepared().grasp.com_offset, offset, 1e-9);
    object.com_offset = offset;
    record.mocap.reset();
    EXPECT_EQ(one.prepared().grasp.angle, 1) << "there is nothing else";
  }
}

/// An object whose x axis points backwards lies behind the pads along it.
TEST(PreparedThrow, ACentreOfMassBehindThePadsIsSeenThere) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  log.throws = {generate_throw(design, 1, 3).record};
  for (auto& [name, object] : log.objects) object.com_offset.reset();
  const auto ahead = prepare(log, log.throws[0], "(in memory)").grasp;
  auto& pose = log.throws[0].mocap->pose;
  for (std::size_t i = 0; i < pose.rows; ++i) pose(i, 2) += 3.14159265358979312;
  const auto behind = prepare(log, log.throws[0], "(in memory)").grasp;
  EXPECT_GT(ahead.com_offset, 0.05);
  EXPECT_NEAR(behind.com_offset, -ahead.com_offset, 1e-12);
  EXPECT_NEAR(behind.angle, ahead.angle + 3.14159265358979312, 1e-12);
}

/// Where the track goes on after the landing, frames that may be after it, by 3 σ of its time, are no flight.
TEST(PreparedThrow, AFlightEndsBeforeItsLandingMayHaveBeen) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  auto [record, truth] = generate_throw(design, 1, 3);
  const double landed = record.mocap->time(record.mocap->time.rows - 1);
  record.landing->time.data = {landed}, record.landing->time.sigma = {0.004};
  EXPECT_NEAR(flight_end(log, record, 0), landed, 1e-6) << "nothing comes after it";
  track(*record.mocap, landed + 0.02, {0, log.landing_height + 1, 0});
  EXPECT_NEAR(flight_end(log, record, 0), landed - 3 * 0.004, 1e-6);
  record.landing->time.sigma.clear();
  EXPECT_NEAR(flight_end(log, record, 0), landed, 1e-6);
}

/// A sensor that was not tared reads an eighth of the grip after the pads have parted. That they have, only
/// the rest of the log can tell.
TEST(PreparedThrow, TheReleaseInAnUntaredForceIsSeenWhereTheObjectFlew) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  auto [record, truth] = generate_throw(design, 1, 3);
  const double release = truth.opening.open_command + truth.opening.dead_time + truth.opening.opening_time;
  for (double& f : record.ft->normal_force.data) f += truth.opening.grip_force / 8;
  log.throws = {record};
  datasets::Throw tracked = record, silent = record;
  tracked.landing.reset();
  silent.landing.reset(), silent.mocap.reset(), silent.grasp_angle = 0.0;
  for (const datasets::Throw* one : {&record, &tracked})
    EXPECT_NEAR(prepare(log, *one, "(in memory)").normal_force->release_time(), release, 5e-4);
  EXPECT_TRUE(std::isinf(prepare(log, silent, "(in memory)").normal_force->release_time()));
}

/// The object is free from the start, and the tracker's clock asks for poses before it: held in the hand.
TEST(PreparedThrow, APadThatNeverPressesIsNoReasonToFail) {
  const CampaignDesign design = campaign_design("quick12");
  datasets::ThrowLog log = campaign_header(design, 1);
  auto [record, truth] = generate_throw(design, 1, 3);
  for (double& f : record.ft->normal_force.data) f = 0;
  log.throws = {record};
  PreparedThrow prepared = prepare(log, record, "(in memory)");
  EXPECT_FALSE(prepared.normal_force) << "a dead sensor";
  prepared.told_force.emplace(contact::OpeningProfile<double>{prepared.start - 1, 1.0, 0.0, 0.1, 1.0});
  const Observations observed = observe(log, record, prepared);
  EXPECT_EQ(std::count(observed.dead.begin(), observed.dead.end(), Channel::normal_force), 1);
  const std::vector<std::string> names{"sensor.mocap_time_offset.offset"};
  const std::vector<double> late{0.01};
  const auto predicted = predict_channels(prepared, observed, {design.contact_model, 2, 20, {}},
                                          dynamics::Values<double>(names, late));
  ASSERT_EQ(predicted.channels.size(), observed.all.size());
  for (const double x : predicted.channels) ASSERT_TRUE(std::isfinite(x));
  const auto first =
      static_cast<std::size_t>(std::find_if(observed.all.begin(), observed.all.end(),
                                            [](const auto& o) { return o.channel == Channel::mocap_theta; }) -
                               observed.all.begin());
  ASSERT_LT(observed.all[first].time - late[0], prepared.start);
  EXPECT_NEAR(predicted.channels[first], observed.all[first].value, 0.05);
}

}  // namespace
