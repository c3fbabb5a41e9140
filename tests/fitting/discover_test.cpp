// The loop on synthetic campaigns whose missing effect is known.
#include "fitting/discovery/discover.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "experiment/synthetic_campaign.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/stage.hpp"
#include "tests/fitting/found_size.hpp"
#include "tests/fitting/loop_campaign.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::fitting {
namespace {

using support::found_in;
using support::named;

/// What was accepted comes before every other fate; other candidates keep that of their refit.
TEST(Fates, AreTheAnswers) {
  AcceptedEffect accepted;
  accepted.id = "a";
  accepted.equivalent = {{"b", 0.99}, {"c", 0.99}};
  std::vector<Ranked> ranking;
  for (const char* id : {"a", "b", "c", "d", "e"}) ranking.push_back(Ranked{id});
  ranking.back().fate = Fate::too_small;
  tell_fates(std::vector{accepted}, std::vector<std::string>{"a", "d"}, std::vector<std::string>{"c"},
             ranking);
  const std::vector<Fate> told{Fate::accepted, Fate::another_name, Fate::another_name, Fate::withdrawn,
                               Fate::too_small};
  for (std::size_t k = 0; k < told.size(); ++k) EXPECT_EQ(ranking[k].fate, told[k]) << ranking[k].id;
}

// A log in memory was checked by no reader.
TEST(Discovery, ALogThatBreaksTheRulesIsRefused) {
  auto log = support::loop_campaign({});
  for (auto& one : log.throws) one.split = datasets::Split::train;
  log.throws[2].hand->twist = {};
  EXPECT_THROW(discover(log, "synthetic", support::loop_options()), datasets::LogError);
}

/// How far a footprint is from the base model's residual: the mean of |log(rms / rms)| over the bins that are
/// ten times above the noise and more, where noise plays no part.
double unlike_the_residual(const Discovery& found, const FootprintTrace& footprint) {
  double sum = 0, n = 0;
  EXPECT_EQ(footprint.bins.size(), found.before.residual.size());
  for (std::size_t k = 0; k < footprint.bins.size(); ++k) {
    const ResidualBin &left = found.before.residual[k], &would = footprint.bins[k];
    EXPECT_EQ(would.channel, left.channel);
    EXPECT_EQ(would.time, left.time);
    if (left.rms > 10) sum += std::abs(std::log(std::max(would.rms, 1e-3) / left.rms)), n += 1;
  }
  EXPECT_GT(n, 20);
  return sum / n;
}

TEST(DiscoverOptions, ThatMeanNothingAreRefused) {
  const auto complaint = [](auto change) {
    DiscoverOptions options;
    change(options);
    return unhand::support::refusal([&] { validate(options); });
  };
  EXPECT_EQ(complaint([](auto&) {}), "accepted");
  EXPECT_EQ(complaint([](auto& o) { o.forget = {"flight.wind", "contact.law:limit_surface"}; }), "accepted");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(complaint([&](auto& o) { o.family_wise_level = nan; }),
            "family_wise_level = nan is not in (0, 1)");
  EXPECT_EQ(complaint([](auto& o) { o.family_wise_level = -1; }), "family_wise_level = -1 is not in (0, 1)");
  EXPECT_EQ(complaint([&](auto& o) { o.matters = nan; }), "matters = nan is not in (0, inf)");
  EXPECT_EQ(complaint([](auto& o) { o.refits = -1; }), "refits = -1 is not in [1, inf)");
  EXPECT_NE(complaint([](auto& o) { o.forget = {"flight.quadratic_drga"}; }).find("flight.quadratic_drag"),
            std::string::npos);
  EXPECT_NE(complaint([](auto& o) { o.laws = {"gripper_delay"}; }).find("gripper_delay"), std::string::npos);
}

TEST(Discovery, NothingIsFoundWhereNothingIsMissing) {
  const Discovery found = found_in(support::loop_campaign({}));
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_TRUE(found.effects.empty());
  EXPECT_FALSE(found.unexplained.has_value());
}

TEST(Discovery, DragIsFoundWithItsSize) {
  constexpr double kDrag = 0.05;  // 1/m: a few centimetres over a throw of two metres
  const Discovery found = found_in(support::loop_campaign({{"flight.quadratic_drag.k", kDrag}}));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "flight.quadratic_drag");
  EXPECT_TRUE(found.effects.front().equivalent.empty()) << "a wind needs a drag to act through";
  EXPECT_EQ(found.silent, std::vector<std::string>{"flight.wind"}) << "none was declared";
  EXPECT_EQ(found.first.phase, Phase::flight) << "drag acts in flight, and first there";
  support::expect_size(found, "flight.quadratic_drag", kDrag);
  EXPECT_LT(found.after.test.trajectory_rms.value(), 0.5 * found.before.test.trajectory_rms.value());

  // What is missing has the residual's shape at every time; what imitates it has not.
  ASSERT_EQ(found.footprints.size(), 4u);
  EXPECT_EQ(found.footprints.front().id, "flight.quadratic_drag");
  for (const FootprintTrace& footprint : found.footprints) {
    const double off = unlike_the_residual(found, footprint);
    if (&footprint == &found.footprints.front())
      EXPECT_LT(off, 0.05);
    else
      EXPECT_GT(off, 0.5) << footprint.id;
  }
}

TEST(Discovery, AClockThatIsLateIsFoundAlreadyInTheGrasp) {
  constexpr double kOffset = 0.004;
  const Discovery found = found_in(support::loop_campaign({{"sensor.mocap_time_offset.offset", kOffset}}));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.first.phase, Phase::grasped);
  support::expect_size(found, "sensor.mocap_time_offset", kOffset);
}

// What a tracker rounds its readings to is noise beside the declared one: no misfit of its own, and an effect
// is seen through it.
TEST(Discovery, ReadingsThatAreRoundedHaveTheNoiseOfTheirGridToo) {
  constexpr double kGrid = 1e-3, kTilt = 0.02;  // m; rad
  const auto rounded = [](datasets::ThrowLog log) {
    for (auto& thrown : log.throws)
      for (double& reading : thrown.mocap->pose.data) reading = kGrid * std::round(reading / kGrid);
    return found_in(log);
  };
  const Discovery none = rounded(support::loop_campaign({}));
  EXPECT_EQ(none.verdict, Verdict::no_missing_effect);
  const Discovery tilt = rounded(support::loop_campaign({{"flight.gravity_tilt.angle", kTilt}}));
  support::expect_size(tilt, "flight.gravity_tilt", kTilt);
  EXPECT_EQ(tilt.effects.size(), 1u);
}

// A bias of the sensor is a force that does not turn with the hand. In one component of the wrench another
// mass does nearly the same (gravity and the hand's acceleration are much the same in all throws), and lowers
// its misfit on held-out throws fourfold. But conditions do not agree on that mass, and the rest stays.
TEST(Discovery, WhatImitatesAForgottenEffectInTheWrenchIsWithdrawn) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {
      {"sensor.ft_bias.fx", 0.25}, {"sensor.ft_bias.fz", -0.18}, {"sensor.ft_bias.tau", 4.5e-3}};
  const Discovery found = found_in(experiment::generate_campaign(design, 4), {"sensor.ft_bias"});
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::grasped) << "the bias is there from the beginning";
  EXPECT_TRUE(is_wrench(found.unexplained->channel)) << to_string(found.unexplained->channel);
}

// A patch that grows with the force is not friction that falls with speed. Stribeck's law brings the flight
// to its noise, where it was seen most, and leaves the torque of the release at many times its own.
TEST(Discovery, AnEffectOnThePadsAnswersForTheHandWhereverItWasSeen) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.soft_patch_radius.gamma", 0.25}};
  const Discovery found = found_in(experiment::generate_campaign(design, 4), {"contact.soft_patch_radius"});
  EXPECT_EQ(named(found, "contact.stribeck"), nullptr);
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_TRUE(found.unexplained->phase == Phase::release || found.unexplained->phase == Phase::grasped);
}

// The landing times of this campaign's held-out throws scatter by 2.2 times their variance. No effect has to
// do with that: the train throws do not show it.
TEST(Discovery, AChanceMisfitElsewhereDoesNotWithdrawAnEffect) {
  experiment::CampaignDesign design = experiment::random_campaign(2018);
  design.effects = {{"contact.pressure_profile.s", 0.5136}, {"sensor.normal_force_bias.bias", 0.7581}};
  const Discovery found = found_in(experiment::generate_campaign(design, 2018));
  EXPECT_GT(misfit_in(found.before.held_out, experiment::Channel::landing_time, Phase::landing), 1.7);
  EXPECT_LT(misfit_in(found.before.fit.misfit, experiment::Channel::landing_time, Phase::landing), 1.5);
  support::expect_size(found, "sensor.normal_force_bias", 0.7581);
}

// Pads that open late and a force/torque sensor that is early put the same force on the object. What tells
// them apart is the wrench, which follows the pads or goes with the sensor's clock.
TEST(Discovery, ALateForceSensorIsNotALateOpening) {
  const Discovery clock = found_in(support::loop_campaign({{"sensor.ft_time_offset.offset", -1e-3}}));
  support::expect_size(clock, "sensor.ft_time_offset", -1e-3);
  EXPECT_EQ(clock.effects.size(), 1u);
  const Discovery opening = found_in(support::loop_campaign({{"release.opening_delay.delay", 2e-3}}));
  support::expect_size(opening, "release.opening_delay", 2e-3);
  EXPECT_EQ(opening.effects.size(), 1u);
}

TEST(Discovery, TwoEffectsAtOnceAreBothFound) {
  const Discovery found = found_in(support::loop_campaign(
      {{"flight.gravity_tilt.angle", 0.02}, {"sensor.mocap_time_offset.offset", 0.005}}));
  support::expect_size(found, "flight.gravity_tilt", 0.02);
  support::expect_size(found, "sensor.mocap_time_offset", 0.005);
  EXPECT_EQ(found.effects.size(), 2u);
}

TEST(Discovery, OfTheWrongLawTheRightOneIsMissing) {
  const Discovery found =
      discover(support::loop_campaign({}), "synthetic", support::loop_options("sliding_pivot"));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "contact.law:limit_surface_disc");
  EXPECT_EQ(found.model, "limit_surface_disc");
  EXPECT_FALSE(found.unexplained.has_value());
}

// A delay knows nothing of pads: its throws have other unknowns of their own than those of a law.
TEST(Discovery, OfThePureDelayALawIsMissing) {
  const Discovery found =
      discover(support::loop_campaign({}), "synthetic", support::loop_options("gripper_delay"));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "contact.law:limit_surface_disc");
  EXPECT_FALSE(found.unexplained.has_value());
}

// Friction that grows by half with the slip's speed: refitted, it hides below the noise of every channel, and
// still all of a throw's errors add up in its prediction.
TEST(Discovery, WhatMattersToThePredictionAloneIsFound) {
  constexpr double kViscous = 5;  // s/m
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.viscous.1/v_0", kViscous}};
  const Discovery found = found_in(experiment::generate_campaign(design, 4));
  EXPECT_FALSE(found.first.any) << "no channel alone would show it";
  support::expect_size(found, "contact.viscous", kViscous);
  EXPECT_THAT(named(found, "contact.viscous")->why, testing::HasSubstr("predicted before the throw"));
  EXPECT_LT(found.after.test.trajectory_rms.value(), 0.7 * found.before.test.trajectory_rms.value());
}

// Pads that stick let go later than the normal force does, and so do pads that open later: the delay brings
// every channel to its noise. But it is later by the same time in every condition, and sticking pads are not.
TEST(Discovery, WhatLeavesPredictionsOffByConditionIsWithdrawn) {
  experiment::CampaignDesign design = experiment::random_campaign(3024);
  design.effects = {{"contact.adhesion.f_adh", 0.2226}, {"contact.adhesion.parting_time", 0.003}};
  const Discovery found = found_in(experiment::generate_campaign(design, 3024), {"contact.adhesion"});
  EXPECT_EQ(named(found, "release.opening_delay"), nullptr);
  ASSERT_EQ(found.imitations.size(), 1u);
  EXPECT_EQ(found.imitations[0].id, "release.opening_delay");
  EXPECT_EQ(found.imitations[0].why, "it leaves what predictions lack");
  EXPECT_LT(found.imitations[0].delta_bic, -10);
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::release) << "flights lack no acceleration";
  EXPECT_TRUE(found.unexplained->description.starts_with("in release, seen in mocap."))
      << found.unexplained->description;
  EXPECT_NE(found.unexplained->description.find(" in flight: "), std::string::npos);
}

// The same friction beside a tilt: once that is found, no channel shows it.
TEST(Discovery, ASecondEffectIsLookedForWhereNoChannelShowsIt) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.viscous.1/v_0", 5}, {"flight.gravity_tilt.angle", 0.02}};
  const Discovery found = found_in(experiment::generate_campaign(design, 4));
  ASSERT_EQ(found.effects.size(), 2u) << to_string(found.verdict);
  EXPECT_EQ(found.effects.front().id, "flight.gravity_tilt");
  support::expect_size(found, "contact.viscous", 5);
  support::expect_size(found, "flight.gravity_tilt", 0.02);
}

// And like another limit surface, for which half a per cent of the held-out misfit is enough. It is no answer
// where friction that is too small to matter is likelier.
TEST(Discovery, ALawIsNoAnswerWhereASmallEffectIsLikelier) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.viscous.1/v_0", 8}};
  const Discovery found = found_in(experiment::generate_campaign(design, 23));
  for (const AcceptedEffect& effect : found.effects) EXPECT_EQ(effect.id, "contact.viscous");
  if (!found.effects.empty()) return;
  ASSERT_TRUE(found.small.has_value());
  EXPECT_EQ(found.small->id, "contact.viscous");
}

// Below what one reading of the sensor tells, an error that repetitions share is nobody's concern.
TEST(Discovery, PredictionsLackNothingThatTheSensorDoesNotResolve) {
  constexpr double kResolution = 2e-4;  // m
  const LackOfFit clear{1e-10, 1.1 * kResolution * kResolution, 1e-4};
  const LackOfFit slight{1e-10, 0.9 * kResolution * kResolution, 1e-4};
  EXPECT_TRUE(is_lacking({Outcome::position, clear, kResolution}, 0.01));
  EXPECT_FALSE(is_lacking({Outcome::position, slight, kResolution}, 0.01));
}

TEST(Discovery, LogsWithChannelsMissingAreAnswered) {
  for (const char* missing : {"ft", "mocap", "landing"}) {
    experiment::CampaignDesign design = experiment::campaign_design("quick12");
    design.repetitions = 4;
    const std::string without(missing);
    design.sensors.ft = without != "ft";
    design.sensors.mocap = without != "mocap";
    design.sensors.landing = without != "landing";
    const Discovery found = found_in(experiment::generate_campaign(design, 5));
    EXPECT_EQ(found.verdict, Verdict::no_missing_effect) << missing;
  }
}

}  // namespace
}  // namespace unhand::fitting
