// The loop on synthetic campaigns whose pads give a little, whatever else they lack.
#include "fitting/discovery/discover.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "experiment/synthetic_campaign.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "tests/fitting/found_size.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

using support::found_in;

// Pads of the sliding pivot cannot give: of ones that do, it lacks another law, and in that their give.
TEST(PadsThatGive, AGiveIsFoundBehindALawWhosePadsCannot) {
  constexpr double kGive = 2e-5;  // m/N
  const Discovery found = discover(support::loop_campaign({{"contact.pad_compliance.compliance", kGive}}),
                                   "synthetic", support::loop_options("sliding_pivot"));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "contact.law:limit_surface_disc");
  support::expect_size(found, "contact.pad_compliance", kGive);
  EXPECT_EQ(found.effects.size(), 2u);
  EXPECT_FALSE(found.unexplained.has_value());
}

// Pads that give by three micrometres, which no pads are without, are no missing effect and no unexplained
// one either: the answer's model has them, and predicts the better for it.
TEST(PadsThatGive, TheGiveOfAnyPadsIsFittedAlongAndNoPartOfTheAnswer) {
  experiment::CampaignDesign design = support::loop_design();
  constexpr double kGive = 3e-6;  // m, at the friction limit of two pads
  design.effects = {
      {"contact.pad_compliance.compliance", kGive / (2 * design.patch.mu * design.opening.grip_force)}};
  const Discovery found = found_in(experiment::generate_campaign(design, 6));
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_EQ(found.along, std::vector<std::string>{"contact.pad_compliance"});
  EXPECT_FALSE(found.unexplained.has_value());
  EXPECT_LT(found.after.test.trajectory_rms.value(), found.before.test.trajectory_rms.value());
}

// Four micrometres that explain the torque of the slipping pads so well that they would convince as an
// effect.
TEST(PadsThatGive, TheGiveOfAnyPadsIsNoPartOfTheAnswerWhereAChannelShowsIt) {
  experiment::CampaignDesign design = experiment::random_campaign(9307);
  design.effects = {{"contact.pad_compliance.compliance", 1.7e-7}};
  const Discovery found = found_in(experiment::generate_campaign(design, 9307));
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_EQ(found.along, std::vector<std::string>{"contact.pad_compliance"});
  EXPECT_FALSE(found.unexplained.has_value());
  const auto torque = [](const std::vector<ChannelMisfit>& misfit) {
    return misfit_in(misfit, experiment::Channel::wrench_tau, Phase::release);
  };
  EXPECT_GT(torque(found.before.held_out) - torque(found.after.held_out), DiscoverOptions().wrench_matters);
}

// A micrometre, and a robot that repeats itself: to first order no effect explains anything, but predictions
// are off by condition more than repetitions scatter by. It is the pads' give.
TEST(PadsThatGive, TheGiveOfAnyPadsIsFittedAlongWhereOnlyPredictionsShowIt) {
  experiment::CampaignDesign design = experiment::campaign_design("batch180");
  design.repetitions = 2;
  design.variation = {1e-4, 6e-4, 1e-3, 0.03, 2e-3, 3e-3, 0, 1e-4, 1e-4, 0};
  design.effects = {
      {"contact.pad_compliance.compliance", 1e-6 / (2 * design.patch.mu * design.opening.grip_force)}};
  const Discovery found = found_in(experiment::generate_campaign(design, 6));
  const LackOfFit before = lack_in(found.before.train, Outcome::orientation).fit;
  const LackOfFit after = lack_in(found.after.train, Outcome::orientation).fit;
  EXPECT_GT(before.ratio(), 2);
  EXPECT_LT(after.shared, 0.1 * before.shared);
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_EQ(found.along, std::vector<std::string>{"contact.pad_compliance"});
}

// Friction that grows with the slip bends the fit like pads that give a little, at first with more evidence;
// but held-out throws are predicted the worse for that give. Without it the friction is likelier than the
// give was.
TEST(PadsThatGive, AGiveThatPredictsNothingDoesNotHideWhatItStoodFor) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  constexpr double kViscous = 5;
  design.effects = {{"contact.viscous.1/v_0", kViscous}};
  const Discovery found = found_in(experiment::generate_campaign(design, 3));
  EXPECT_TRUE(found.along.empty());
  ASSERT_EQ(found.effects.size(), 1u) << to_string(found.verdict);
  EXPECT_EQ(found.effects.front().id, "contact.viscous");
  support::expect_size(found, "contact.viscous", kViscous);
}

// Friction that falls with the slip, beside pads that give by four micrometres. The held-out conditions slip
// slowly: their torque is no misfit, and without the give nothing there speaks for Stribeck's friction.
TEST(PadsThatGive, WhatTheTrainThrowsSettleIsConfirmedBesideTheGiveOfThePads) {
  experiment::CampaignDesign design = experiment::random_campaign(9205);
  constexpr double kRatio = 1.5;
  design.effects = {{"contact.stribeck.mu_s/mu_k", kRatio}, {"contact.pad_compliance.compliance", 1.2e-7}};
  const Discovery found = found_in(experiment::generate_campaign(design, 9205));
  const auto torque = [](const std::vector<ChannelMisfit>& misfit) {
    return misfit_in(misfit, experiment::Channel::wrench_tau, Phase::release);
  };
  EXPECT_GT(torque(found.before.fit.misfit), 3);
  EXPECT_LT(torque(found.before.held_out), 1.5);
  ASSERT_EQ(found.effects.size(), 1u) << to_string(found.verdict);
  EXPECT_EQ(found.effects.front().id, "contact.stribeck");
  support::expect_size(found, "contact.stribeck", kRatio, 1);
  EXPECT_EQ(found.along, std::vector<std::string>{"contact.pad_compliance"});
  EXPECT_LT(found.after.test.trajectory_rms.value(), 0.75 * found.before.test.trajectory_rms.value());
}

// Pads that give by a millimetre bend a base with rigid ones until it slips in the firm grasp, at less than
// half of its friction: a search that starts there does not find back.
TEST(PadsThatGive, PadsThatBendTheBaseFarAreFound) {
  experiment::CampaignDesign design = experiment::random_campaign(144);
  constexpr double kCompliance = 4.08e-5;  // m/N
  design.effects = {{"contact.pad_compliance.compliance", kCompliance}};
  const Discovery found = found_in(experiment::generate_campaign(design, 144));
  EXPECT_LT(found.before.fit.campaign.front().value, 0.6 * design.patch.mu) << "of the base";
  support::expect_size(found, "contact.pad_compliance", kCompliance);
}

}  // namespace
}  // namespace unhand::fitting
