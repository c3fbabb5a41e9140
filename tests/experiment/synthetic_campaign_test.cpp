// Synthetic campaigns: reproducible, in the schema, as designed.
#include "experiment/synthetic_campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>

#include "contact/sliding_pivot.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using datasets::ThrowLog;
using testing_support::kSeed;
using testing_support::perfect;
constexpr double kDegree = std::numbers::pi / 180;

/// NaN is unequal to itself: lost mocap samples become zeros, so that logs compare with ==.
ThrowLog comparable(ThrowLog log) {
  for (auto& t : log.throws)
    for (double& x : t.mocap->pose.data)
      if (std::isnan(x)) x = 0;
  return log;
}

TEST(SyntheticCampaign, SameSeedSameLogDifferentSeedAnother) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  EXPECT_EQ(log.throws.size(), 12u);
  EXPECT_TRUE(comparable(log) == comparable(generate_campaign(design, kSeed)));
  const ThrowLog other = generate_campaign(design, kSeed + 1);
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    EXPECT_NE(log.throws[i].hand->pose.data, other.throws[i].hand->pose.data) << i;
    EXPECT_NE(log.throws[i].landing->pose.data, other.throws[i].landing->pose.data) << i;
    if (i == 0) continue;
    EXPECT_NE(log.throws[i].ft->normal_force.data, log.throws[i - 1].ft->normal_force.data) << i;
  }
}

/// Angles of landing are counted from the bar hanging straight down, not wrapped.
TEST(SyntheticCampaign, ThrowFlipsLandBetweenHalfAFlipAndAFullOne) {
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

TEST(SyntheticCampaign, ThrowsDoNotDependOnTheirOrder) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  ThrowLog backwards = campaign_header(design, kSeed);
  for (int i = design.throws(); i-- > 0;)
    backwards.throws.insert(backwards.throws.begin(), generate_throw(design, kSeed, i).record);
  EXPECT_TRUE(comparable(log) == comparable(backwards));
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
  const auto file = std::filesystem::temp_directory_path() / "unhand_synthetic_campaign_test.h5";
  datasets::write_throw_log(file, log);
  const ThrowLog back = datasets::read_throw_log(file);
  std::filesystem::remove(file);
  EXPECT_TRUE(comparable(log) == comparable(back));
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

std::string failure(const CampaignDesign& design) {
  try {
    generate_campaign(design, kSeed);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

TEST(SyntheticCampaign, AFailedThrowIsAnErrorThatNamesIt) {
  using testing::AllOf, testing::HasSubstr;
  const auto names_it =
      AllOf(HasSubstr("campaign quick12, seed 7, throw 001 (bar-com100/pitch-22/acc+8, repetition 1)"),
            HasSubstr("opening time"), HasSubstr("grip force"), HasSubstr("mu 0."));
  CampaignDesign high = campaign_design("quick12");
  high.landing_height = 5;
  EXPECT_THAT(failure(high), AllOf(names_it, HasSubstr("never reaches the landing height")));
  CampaignDesign slow = campaign_design("quick12");
  slow.opening.opening_time = 1;
  EXPECT_THAT(failure(slow),
              AllOf(names_it, HasSubstr("never_separated"), HasSubstr("the pads still press on the object")));
  CampaignDesign weak = campaign_design("quick12");
  weak.opening.grip_force = 3;
  EXPECT_THAT(failure(weak), AllOf(names_it, HasSubstr("the grip does not hold")));
  CampaignDesign far = campaign_design("quick12");
  far.postures[0].hand.x = 2;
  EXPECT_THAT(failure(far), AllOf(names_it, HasSubstr("out of reach")));
}

TEST(SyntheticCampaign, RefusesWhatMakesNoSense) {
  using testing::AllOf, testing::HasSubstr;
  try {
    campaign_design("batch-180");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("batch-180"), HasSubstr("batch180"), HasSubstr("quick12")));
  }
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

// What the campaign is like: printed, and bounded loosely, so that a change of the design shows.
TEST(SyntheticCampaign, Batch180IsACampaignOfFlips) {
  const CampaignDesign design = campaign_design("batch180");
  ASSERT_EQ(design.throws(), 180);
  struct Range {
    double low = 1e300, high = -1e300;
    void add(double x) { low = std::min(low, x), high = std::max(high, x); }
  } detach, x, turned, spin, pivot, slip, flight;
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    detach.add(truth.detach_time);
    x.add(truth.landing_pose.x);
    turned.add((truth.landing_pose.theta - truth.detach_pose.theta) / kDegree);
    spin.add(truth.detach_twist.omega / kDegree);
    pivot.add(truth.pivot / kDegree);
    slip.add(truth.slip * 1e3);
    flight.add(truth.landing_time - truth.detach_time);
    EXPECT_LT(truth.detach_time, design.follow_through) << record.id << ": the arm brakes after the release";
    // the noise is 1 mm: the landing is where the truth is
    EXPECT_NEAR(record.landing->pose(0, 0), truth.landing_pose.x, 6e-3);
  }
  std::printf(
      "detach %.4f..%.4f s, flight %.3f..%.3f s, landing x %.3f..%.3f m, turned in flight %.0f..%.0f deg\n",
      detach.low, detach.high, flight.low, flight.high, x.low, x.high, turned.low, turned.high);
  std::printf("spin %.0f..%.0f deg/s, pivot in the hand %.2f..%.2f deg, slip %.2f..%.2f mm\n", spin.low,
              spin.high, pivot.low, pivot.high, slip.low, slip.high);
  EXPECT_GT(detach.low, 0.09);
  EXPECT_LT(detach.high, 0.12);
  EXPECT_GT(x.low, 0.9);
  EXPECT_LT(x.high, 2.4);
  EXPECT_GT(x.high - x.low, 0.8);
  EXPECT_GT(spin.low, 100);
  EXPECT_LT(spin.high, 700);
  EXPECT_LT(pivot.low, -1);
  EXPECT_GT(pivot.high, 10);
  EXPECT_LT(pivot.high, 40);
  EXPECT_GT(slip.high, 2);
  EXPECT_LT(slip.high, 10);
}

}  // namespace
