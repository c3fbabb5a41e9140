// The loop on synthetic campaigns with throws that went wrong, and with grasps that scatter.
#include "fitting/discovery/discover.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "tests/fitting/found_size.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

using support::found_in;

/// The tracker took another marker from the middle of a throw on.
void jump(datasets::Throw& one) {
  for (std::size_t i = one.mocap->pose.rows / 2; i < one.mocap->pose.rows; ++i) {
    one.mocap->pose(i, 0) += 0.05;
    one.mocap->pose(i, 1) += 0.04;
  }
}

/// The cable of the force sensor was touched.
void pull(datasets::Throw& one) {
  for (std::size_t i = 0; i < one.ft->wrench.rows; ++i)
    one.ft->wrench(i, 0) += 1.5 * std::sin(40 * one.ft->time(i));
}

// A throw that errs as no other does hides neither an effect nor that there is none, fitted or held out.
TEST(WildThrows, AWildThrowIsSetAsideAndNamed) {
  const auto clean = support::loop_campaign({{"flight.quadratic_drag.k", 0.01}}),
             null = support::loop_campaign({});
  for (const auto& [split, spoil] :
       {std::pair(datasets::Split::train, &jump), std::pair(datasets::Split::test, &pull)}) {
    std::size_t k = 5;
    while (clean.throws[k].split != split) ++k;
    auto log = clean;
    spoil(log.throws[k]);
    const Discovery found = found_in(log);
    ASSERT_EQ(found.skipped.size(), 1U);
    EXPECT_EQ(found.skipped.front().first, log.throws[k].id);
    EXPECT_EQ(found.effects.size(), 1U);
    support::expect_size(found, "flight.quadratic_drag", 0.01);
    EXPECT_FALSE(found.unexplained.has_value());
    log = null;
    spoil(log.throws[k]);
    const Discovery nothing = found_in(log);
    EXPECT_EQ(nothing.verdict, Verdict::no_missing_effect);
    EXPECT_EQ(nothing.skipped.size(), 1U);
  }
}

// With them the log shows an own unknown (where across its axis the pads hold an object) that it does not
// show without.
TEST(WildThrows, RobotsThatStoodStillAreSetAside) {
  auto log = support::loop_campaign({{"flight.quadratic_drag.k", 0.01}});
  for (const std::size_t k : {4U, 9U}) {
    datasets::HandLog& hand = *log.throws[k].hand;
    for (std::size_t i = 0; i < hand.pose.rows; ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        hand.pose(i, c) = hand.pose(0, c);
        hand.twist(i, c) = hand.acceleration(i, c) = 0;
      }
  }
  const Discovery found = found_in(log);
  EXPECT_EQ(found.skipped.size(), 2U);
  EXPECT_EQ(found.effects.size(), 1U);
  support::expect_size(found, "flight.quadratic_drag", 0.01);
}

// Repetitions that the pads hold at other places across the object's axis: each throw is fitted its own.
TEST(WildThrows, AGraspThatScattersAcrossThePadsHidesNothing) {
  const auto found_with = [](const experiment::EffectSettings& effects) {
    experiment::CampaignDesign design = support::loop_design();
    design.effects = effects;
    design.variation.grasp_across = 0.5e-3;
    return found_in(experiment::generate_campaign(design, 3));
  };
  const Discovery nothing = found_with({});
  EXPECT_EQ(nothing.verdict, Verdict::no_missing_effect);
  ASSERT_EQ(nothing.notes.size(), 1U);
  EXPECT_NE(nothing.notes.front().find("grasp_across"), std::string::npos) << nothing.notes.front();
  EXPECT_TRUE(found_in(support::loop_campaign({})).notes.empty()) << "these are all held on the axis";
  const Discovery found = found_with({{"release.opening_delay.delay", 0.002}});
  EXPECT_EQ(found.effects.size(), 1U);
  support::expect_size(found, "release.opening_delay", 0.002);
  EXPECT_FALSE(found.unexplained.has_value());
}

// Half of the throws are no strays.
TEST(WildThrows, ManyWildThrowsAreUnexplained) {
  auto log = support::loop_campaign({});
  for (std::size_t k = 0; k < log.throws.size(); k += 2) jump(log.throws[k]);
  const Discovery found = found_in(log);
  EXPECT_TRUE(found.skipped.empty());
  EXPECT_EQ(found.verdict, Verdict::unexplained);
}

}  // namespace
}  // namespace unhand::fitting
