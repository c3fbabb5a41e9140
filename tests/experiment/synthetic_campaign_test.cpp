// Synthetic campaigns: reproducible, in the schema, as designed.
#include "experiment/synthetic_campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>

#include "contact/sliding_pivot.hpp"
#include "tests/support/perfect_campaign.hpp"
#include "tests/support/scratch.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using datasets::ThrowLog;
using testing_support::kSeed;
using testing_support::perfect;
constexpr double kDegree = std::numbers::pi / 180;

TEST(SyntheticCampaign, SameSeedSameLogDifferentSeedAnother) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  EXPECT_EQ(log.throws.size(), 12u);
  EXPECT_TRUE(log == generate_campaign(design, kSeed));
  const ThrowLog other = generate_campaign(design, kSeed + 1);
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    EXPECT_NE(log.throws[i].hand->pose.data, other.throws[i].hand->pose.data) << i;
    EXPECT_NE(log.throws[i].landing->pose.data, other.throws[i].landing->pose.data) << i;
    if (i == 0) continue;
    EXPECT_NE(log.throws[i].ft->normal_force.data, log.throws[i - 1].ft->normal_force.data) << i;
  }
}

/// Angles of landing are counted from the bar hanging straight down, not wrapped.
TEST(SyntheticCampaign, ThrowFlipsLandFromBelowHalfAFlipToBeyondAFullOne) {
  const ThrowLog log = generate_campaign(campaign_design("throw-flip"), kSeed);
  ASSERT_EQ(log.throws.size(), 81u);
  double least = INFINITY, most = -INFINITY;
  for (const auto& one : log.throws) {
    const double turned = one.landing->pose(0, 1) + M_PI / 2;
    least = std::min(least, turned), most = std::max(most, turned);
  }
  EXPECT_LT(least, M_PI);
  EXPECT_GT(most, 2 * M_PI);
}

/// Throws that all are as they were meant.
constexpr ThrowVariation kNone{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};

/// A hand that is turned moves in a direction that is turned as much, and as fast.
TEST(SyntheticCampaign, ATurnedHandMovesInATurnedDirection) {
  CampaignDesign design = testing_support::perfect();
  design.variation = kNone;
  design.variation.hand_angle = 0.02;
  double turned = 0;
  for (int i = 0; i < design.throws(); ++i) {
    const auto motion = generate_throw(design, 3, i).truth.motion;
    bool found = false;
    for (const Posture& posture : design.postures) {
      const double by = motion.pose.theta - posture.hand.theta;
      if (motion.pose.x != posture.hand.x || std::abs(by) > 0.1) continue;
      found = true;
      turned = std::max(turned, std::abs(by));
      EXPECT_NEAR(std::hypot(motion.twist.vx, motion.twist.vz), posture.speed, 1e-12);
      EXPECT_NEAR(std::atan2(motion.twist.vz, motion.twist.vx), posture.elevation + by, 1e-12);
    }
    EXPECT_TRUE(found) << i;
  }
  EXPECT_GT(turned, 0.01);
}

TEST(SyntheticCampaign, FrictionScattersAsTheDesignSays) {
  CampaignDesign design = testing_support::perfect();
  design.variation = kNone;
  design.variation.mu = 0.05;
  double mean = 0, square = 0;
  const int n = design.throws();
  for (int i = 0; i < n; ++i) mean += generate_throw(design, 3, i).truth.patch.mu / design.patch.mu / n;
  for (int i = 0; i < n; ++i)
    square += std::pow(generate_throw(design, 3, i).truth.patch.mu / design.patch.mu - mean, 2) / (n - 1);
  EXPECT_NEAR(mean, 1, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square), 0.05, 4 * 0.05 / std::sqrt(2.0 * n));
}

TEST(SyntheticCampaign, ThrowsDoNotDependOnTheirOrder) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  ThrowLog backwards = campaign_header(design, kSeed);
  for (int i = design.throws(); i-- > 0;)
    backwards.throws.insert(backwards.throws.begin(), generate_throw(design, kSeed, i).record);
  EXPECT_TRUE(log == backwards);
}

TEST(SyntheticCampaign, NoiseChangesNothingButItsChannel) {
  const CampaignDesign design = campaign_design("quick12"), quiet = perfect();
  CampaignDesign other = design;
  other.sensors.wrench_sigma = {};
  for (const int i : {0, 5, 11}) {
    const auto loud = generate_throw(design, kSeed, i), clean = generate_throw(quiet, kSeed, i),
               mixed = generate_throw(other, kSeed, i);
    EXPECT_EQ(loud.truth.landing_pose.x, clean.truth.landing_pose.x);
    EXPECT_EQ(loud.truth.detach_time, clean.truth.detach_time);
    EXPECT_TRUE(loud.record.hand == mixed.record.hand);
    EXPECT_TRUE(loud.record.landing == mixed.record.landing);
    EXPECT_EQ(loud.record.ft->normal_force.data, mixed.record.ft->normal_force.data);
    EXPECT_EQ(mixed.record.ft->wrench.sigma, std::vector<double>{}) << "no noise is none declared";
  }
}

TEST(SyntheticCampaign, KeepsTheRulesAndRoundTrips) {
  const ThrowLog log = generate_campaign(campaign_design("quick12"), kSeed);
  EXPECT_NO_THROW(datasets::validate(log));
  EXPECT_THAT(log.title, testing::HasSubstr("synthetic"));
  EXPECT_THAT(log.source, testing::HasSubstr("synthetic"));
  const support::Scratch scratch;
  const std::string file = scratch / "campaign.h5";
  datasets::write_throw_log(file, log);
  const ThrowLog back = datasets::read_throw_log(file);
  EXPECT_TRUE(log == back);
}

TEST(SyntheticCampaign, SplitsWholeConditionsOfEachObject) {
  const CampaignDesign design = campaign_design("batch180");
  std::map<std::string, std::set<datasets::Split>> splits;
  std::map<std::string, int> repetitions, train;
  const ThrowLog log = generate_campaign(design, kSeed);
  for (const auto& t : log.throws) {
    splits[t.condition].insert(t.split);
    ++repetitions[t.condition];
    train[t.object] += t.split == datasets::Split::train;
  }
  EXPECT_EQ(splits.size(), 36u);
  for (const auto& [condition, seen] : splits) EXPECT_EQ(seen.size(), 1u) << condition;
  for (const auto& [condition, n] : repetitions) EXPECT_EQ(n, 5) << condition;
  for (const auto& [object, n] : train) EXPECT_EQ(n, 45) << object;
}

TEST(SyntheticCampaign, TheLawCanBeChosen) {
  CampaignDesign design = campaign_design("quick12");
  design.contact_model = "sliding_pivot";
  const auto named = generate_throw(design, kSeed, 11);
  EXPECT_EQ(named.truth.contact_model, "sliding_pivot");
  design.contact_factory = [](const contact::Patch<double>& patch, const contact::OpeningProfile<double>&) {
    return std::make_unique<contact::SlidingPivot>(patch);
  };
  const auto made = generate_throw(design, kSeed, 11);
  EXPECT_EQ(named.truth.landing_pose.x, made.truth.landing_pose.x);
  design.contact_factory = [](const auto&, const auto&) { return nullptr; };
  EXPECT_THROW(generate_throw(design, kSeed, 11), std::logic_error);
  design.contact_factory = {};
  design.contact_model = "gripper_delay";
  const auto carried = generate_throw(design, kSeed, 11);
  EXPECT_EQ(carried.truth.pivot, 0.0);
  EXPECT_GT(std::abs(carried.truth.landing_pose.theta - named.truth.landing_pose.theta), 5 * kDegree);
  design.contact_model = "glue";
  EXPECT_THROW(generate_throw(design, kSeed, 0), std::invalid_argument);
}

TEST(SyntheticCampaign, AFailedThrowIsAnErrorThatNamesIt) {
  using testing::AllOf, testing::HasSubstr;
  const auto expect_failure = [](const CampaignDesign& design, const auto& why) {
    const auto names_it =
        AllOf(HasSubstr("campaign quick12, seed 7, throw 001 (bar-com100/pitch-22/acc+8, repetition 1)"),
              HasSubstr("opening time"), HasSubstr("grip force"), HasSubstr("mu 0."));
    EXPECT_THAT([&] { generate_campaign(design, kSeed); },
                testing::ThrowsMessage<std::runtime_error>(AllOf(names_it, why)));
  };
  CampaignDesign high = campaign_design("quick12");
  high.landing_height = 5;
  expect_failure(high, HasSubstr("never reaches the landing height"));
  CampaignDesign slow = campaign_design("quick12");
  slow.opening.opening_time = 1;
  expect_failure(slow, AllOf(HasSubstr("never_separated"), HasSubstr("the pads still press on the object")));
  CampaignDesign weak = campaign_design("quick12");
  weak.opening.grip_force = 3;
  expect_failure(weak, HasSubstr("the grip does not hold"));
  CampaignDesign far = campaign_design("quick12");
  far.postures[0].hand.x = 2;
  expect_failure(far, HasSubstr("out of reach"));
}

TEST(SyntheticCampaign, RefusesWhatMakesNoSense) {
  using testing::AllOf, testing::HasSubstr;
  EXPECT_THAT([] { campaign_design("batch-180"); },
              testing::ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("batch-180"), HasSubstr("did you mean 'batch180'?"))));
  EXPECT_THAT([] { campaign_design("grasps"); }, testing::ThrowsMessage<std::invalid_argument>(
                                                     AllOf(HasSubstr("batch180"), HasSubstr("quick12"))));
  EXPECT_THROW(loaded_bar("too far", 0.3), std::invalid_argument);
  EXPECT_THROW(generate_throw(campaign_design("quick12"), 1, 12), std::out_of_range);
  EXPECT_THROW(generate_throw(campaign_design("quick12"), 1, -1), std::out_of_range);
  CampaignDesign design = campaign_design("quick12");
  design.sensors.mocap_dropout = 1;
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
  design = campaign_design("quick12");
  design.sensors.mocap_sigma[1] = -1;
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
  design = campaign_design("quick12");
  design.objects.clear();
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
}

// The parallel axis theorem for the bar and its cylinder about the pads gives m l² + I.
TEST(LoadedBar, InertiaAboutThePads) {
  for (const double offset : {0.10, 0.16}) {
    const ThrownObject object = loaded_bar("bar", offset);
    EXPECT_NEAR(object.body.mass, 0.246, 1e-15);
    const double slot = (0.246 * offset - 0.092 * 0.15) / 0.154;
    const double bar = 0.092 * (0.32 * 0.32 + 0.03 * 0.03) / 12 + 0.092 * 0.15 * 0.15;
    const double load = 0.154 * (3 * 0.01 * 0.01 + 0.06 * 0.06) / 12 + 0.154 * slot * slot;
    EXPECT_NEAR(object.body.inertia + object.body.mass * offset * offset, bar + load, 1e-16);
  }
}

// Each throw is free as the last of its pads' force goes, which the design says when; it then flies and turns
// as a body without air does. In the hand the bars have turned both ways, as hands that speed up and that
// brake make them, and slipped, by more than a tracker's noise.
TEST(SyntheticCampaign, Batch180IsACampaignOfFlips) {
  const CampaignDesign design = campaign_design("batch180");
  ASSERT_EQ(design.throws(), 180);
  const auto& opening = design.opening;
  const double gone = opening.open_command + opening.dead_time + opening.opening_time;
  const double scatter = std::hypot(design.variation.dead_time, design.variation.opening_time);
  double least_pivot = INFINITY, most_pivot = -INFINITY, most_slip = 0;
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    EXPECT_NEAR(truth.detach_time, gone, 4 * scatter) << record.id;  // of 180, 1 % have one beyond that
    EXPECT_LT(truth.detach_time, design.follow_through) << record.id << ": the arm brakes after the release";
    const double flight = truth.landing_time - truth.detach_time;
    const auto &from = truth.detach_pose, &to = truth.landing_pose;
    const auto& with = truth.detach_twist;
    EXPECT_NEAR(to.x, from.x + with.vx * flight, 1e-9) << record.id;
    EXPECT_NEAR(from.z + (with.vz - 0.5 * design.gravity * flight) * flight, design.landing_height, 1e-9)
        << record.id;
    EXPECT_NEAR(to.theta, from.theta + with.omega * flight, 1e-9) << record.id;
    EXPECT_GT(to.theta - from.theta, 90 * kDegree) << record.id << ": no flip";
    EXPECT_NEAR(record.landing->pose(0, 0), to.x, 6 * design.sensors.landing_sigma[0]) << record.id;
    least_pivot = std::min(least_pivot, truth.pivot), most_pivot = std::max(most_pivot, truth.pivot);
    most_slip = std::max(most_slip, truth.slip);
  }
  EXPECT_LT(least_pivot, -4 * design.sensors.mocap_sigma[2]);
  EXPECT_GT(most_pivot, 4 * design.sensors.mocap_sigma[2]);
  EXPECT_GT(most_slip, 4 * design.sensors.mocap_sigma[0]);
}

}  // namespace
