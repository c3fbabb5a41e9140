// What the loop is made of: misfits, improvements, footprints, intervals, experiments.
#include "fitting/discovery/stage.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>
#include <random>
#include <string>
#include <utility>

#include "experiment/random_stream.hpp"
#include "fitting/before_release.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/discrepancy.hpp"
#include "fitting/discovery/footprints.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/pads_give.hpp"
#include "fitting/discovery/residuals.hpp"
#include "fitting/discovery/selection.hpp"
#include "fitting/discovery/separating.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/withdrawal.hpp"
#include "fitting/distributions.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

// Without a tracker only the product of its scale's error and the landing's share of it shows. At the share
// that the footprint's grid gave, the error is known; free, the share would leave it open.
TEST(Stage, AShapeThatTheLogLeavesOpenIsHeldAndTheSizeIsKnownForIt) {
  constexpr double kScale = 1.017;
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.sensors.mocap = false;
  design.effects = {{"sensor.length_scale.scale", kScale}, {"sensor.length_scale.landing_share", 1}};
  DiscoverOptions options = support::loop_options();
  options.campaign.effects = {"sensor.length_scale"};
  const auto log = experiment::generate_campaign(design, 8);
  Stage stage{CampaignProblem(log, "synthetic", options.campaign), {}, {}, {}};
  auto start = stage.problem.start();
  for (std::size_t k = 0; k < start.size(); ++k)
    if (stage.problem.campaign()[k].name == "sensor.length_scale.landing_share") start[k] = 1;
  solve(stage, options, start);
  ASSERT_EQ(stage.fit.outcome, FitOutcome::converged);
  for (const auto& u : stage.fit.campaign) {
    if (u.unknown.name == "sensor.length_scale.landing_share") {
      EXPECT_EQ(u.value, 1);
    }
    if (u.unknown.name == "sensor.length_scale.scale") {
      EXPECT_NEAR(u.value, kScale, 4 * u.sigma);
      EXPECT_LT(u.sigma, 0.5 * (kScale - 1));
    }
  }
  EXPECT_LT(wald_p_value(stage.fit, find_effect("sensor.length_scale")), 1e-3);
}

// From another law back to the one that the loop began with: that is no effect.
TEST(Selection, TheBaseLawIsNoEffect) {
  const auto log = support::loop_campaign({});  // of the disc
  DiscoverOptions options = support::loop_options();
  options.refits = 1;
  const std::string other = std::string(kLaw) + "sliding_pivot";
  auto wrong = options.campaign;
  wrong.model = "sliding_pivot";
  Stage stage{CampaignProblem(log, "synthetic", wrong), {}, {}, {other}};
  solve(stage, options, {});
  ASSERT_TRUE(stage.solved());
  Discovery out;
  out.model = options.campaign.model;
  out.before.fit = stage.fit, out.before.held_out = stage.held_out.misfit;
  out.effects.emplace_back().id = other;
  options.laws = {"limit_surface_disc"};
  const auto next = forward(stage, options, out);
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(next->problem.options().model, "limit_surface_disc");
  EXPECT_TRUE(next->ids.empty());
  EXPECT_TRUE(out.effects.empty());
}

// Every sample is in one phase, the same one for the misfit that the loop begins with and for the structure
// it shows; where no sensor saw the release, the predicted one divides them.
TEST(Stage, StructureAndMisfitHaveTheSamePhasesWithoutAMeasuredRelease) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.sensors.ft = false;
  auto log = experiment::generate_campaign(design, 8);
  for (auto& thrown : log.throws) thrown.detach_time.reset();
  CampaignOptions options;
  options.model = "limit_surface_disc";
  const CampaignProblem problem(log, "synthetic", options);
  const FitResult fitted = fit(problem);
  ASSERT_TRUE(fitted.is_answer());
  const auto residuals = residuals_of(problem, fitted, 0);
  int released = 0;
  const auto all = structures(problem, fitted, residuals);
  for (const ChannelMisfit& m : fitted.misfit) {
    const auto same = std::find_if(all.begin(), all.end(), [&](const ChannelStructure& s) {
      return s.channel == m.channel && s.phase == m.phase;
    });
    ASSERT_NE(same, all.end()) << to_string(m.channel) << " in " << to_string(m.phase);
    EXPECT_EQ(same->structure.n, m.n) << to_string(m.channel) << " in " << to_string(m.phase);
    released += m.phase == Phase::release ? m.n : 0;
  }
  EXPECT_GT(released, 0);
}

// Fits that are compared must be of the same throws: one that cannot be simulated is named, not left out.
TEST(Stage, AThrowThatMustTakePartIsNotLeftOut) {
  auto log = experiment::generate_campaign(experiment::campaign_design("quick12"), 8);
  CampaignOptions options;
  options.model = "limit_surface_disc";
  CampaignProblem problem(log, "synthetic", options);
  FitOptions some;
  some.throws.assign(log.throws.size(), true);
  some.throws[1] = false;
  const FitResult without_one = fit(problem, some);
  ASSERT_TRUE(without_one.is_answer());
  for (std::size_t i = 0; i < log.throws.size(); ++i)
    EXPECT_EQ(without_one.throws[i].used, i != 1 && log.throws[i].split == datasets::Split::train) << i;

  // The recording of one ends before the gripper opens: in no model is it let go.
  auto& held = log.throws[0];
  held.split = datasets::Split::train;
  held.landing.reset();
  held.detach_time.reset();
  const auto cut = [](const datasets::Series& time, std::initializer_list<datasets::Series*> tables) {
    std::size_t n = 0;
    while (n < time.rows && time(n) <= 0.02) ++n;
    for (datasets::Series* table : tables) {
      table->rows = n;
      table->data.resize(n * table->cols);
    }
  };
  const datasets::Series ft = held.ft->time, mocap = held.mocap->time;
  cut(ft, {&held.ft->time, &held.ft->wrench, &held.ft->normal_force});
  cut(mocap, {&held.mocap->time, &held.mocap->pose});
  if (!held.mocap->valid.empty()) held.mocap->valid.resize(held.mocap->time.rows);
  problem = CampaignProblem(log, "synthetic", options);
  const FitResult left_out = fit(problem);
  ASSERT_TRUE(left_out.is_answer());
  EXPECT_FALSE(left_out.throws[0].used);
  some.throws.assign(log.throws.size(), true);
  const FitResult asked_for = fit(problem, some);
  EXPECT_EQ(asked_for.outcome, FitOutcome::no_start);
  EXPECT_NE(asked_for.message.find(held.id), std::string::npos) << asked_for.message;
}

// What was not measured has no error; it is not zero.
TEST(Stage, ErrorsOfWhatWasNotMeasuredAreNone) {
  PredictedOutcome thrown;
  thrown.error[2] = -0.02;  // landing x
  const OutcomeErrors landed = outcome_errors({thrown});
  EXPECT_EQ(landed.n, 1);
  EXPECT_DOUBLE_EQ(landed.landing_x_mae.value(), 0.02);
  EXPECT_FALSE(landed.landing_theta_mae || landed.detach_vx_mae || landed.detach_omega_mae ||
               landed.trajectory_rms);
  thrown.error[2] = 0.01;
  const OutcomeErrors better = outcome_errors({thrown});
  EXPECT_DOUBLE_EQ(error_ratio(landed, better).value(), 0.5);
  thrown.error[2].reset();
  EXPECT_FALSE(error_ratio(landed, outcome_errors({thrown}))) << "after, nothing is predicted to land";
}

// Of m independent sizes that may only grow, estimates at neutral count for nothing: the sum of the squares
// of the positive ones of m normal numbers.
TEST(Stage, SizesAtTheEndOfTheirRangeHaveTheMixedDistribution) {
  EXPECT_DOUBLE_EQ(chi_bar_tail(3.0, 2, 0), chi2_tail(3.0, 2));
  EXPECT_DOUBLE_EQ(chi_bar_tail(3.0, 0, 1), 0.5 * chi2_tail(3.0, 1));
  constexpr int kDraws = 40000;
  for (const auto& [free, bounded] : {std::pair{0, 3}, std::pair{1, 2}})
    for (const double x : {1.0, 4.0}) {
      experiment::RandomStream random(3, 1, experiment::Purpose::effect);
      int beyond = 0;
      for (int k = 0; k < kDraws; ++k) {
        double sum = 0;
        for (int j = 0; j < free + bounded; ++j) {
          const double z = random.normal(0, 1);
          if (j < free || z > 0) sum += z * z;
        }
        beyond += sum > x;
      }
      const double p = chi_bar_tail(x, free, bounded);
      EXPECT_NEAR(beyond / double{kDraws}, p, 4 * std::sqrt(p * (1 - p) / kDraws)) << free << " " << bounded;
    }
}

// Hotelling's T²: of one size Student's t, of many degrees of freedom χ², of two sizes a power.
TEST(Wald, TailsOfFewDegreesOfFreedomAreHeavier) {
  for (const double n : {1.0, 3.1, 12.0}) {
    EXPECT_NEAR(hotelling_bar_tail(std::pow(student_factor(n), 2), 1, 0, n), 0.05, 1e-9) << n;
    EXPECT_NEAR(hotelling_bar_tail(std::pow(student_factor(n), 2), 0, 1, n), 0.025, 1e-9) << n;
    if (n > 1) {
      EXPECT_NEAR(hotelling_bar_tail(7, 2, 0, n), std::pow(1 + 7 / n, -(n - 1) / 2), 1e-9) << n;
    }
  }
  EXPECT_NEAR(hotelling_bar_tail(4, 1, 2, 1e9), chi_bar_tail(4, 1, 2), 1e-6);
  EXPECT_EQ(hotelling_bar_tail(1e9, 3, 0, 2), 1) << "two degrees of freedom know no covariance of three";
}

// A fit to few throws knows its covariance to a few degrees of freedom.
TEST(Wald, AFewThrowsAreNoCertainty) {
  const auto fit_of = [](const std::string& id, double sigmas, double n) {
    FitResult out;
    for (const auto& p : find_effect(id).parameters) {
      FittedUnknown u;
      u.unknown.name = id + "." + p.name;
      u.sigma = 0.01, u.value = p.neutral + sigmas * u.sigma, u.degrees_of_freedom = n;
      out.campaign.push_back(u);
    }
    const std::size_t width = out.campaign.size();
    out.covariance.assign(width * width, 0.0);
    for (std::size_t k = 0; k < width; ++k) out.covariance[k * width + k] = 1e-4;
    return out;
  };
  const dynamics::Effect mass = find_effect("sensor.mass"), bias = find_effect("sensor.ft_bias");
  const double t = student_factor(3);  // 3.18
  EXPECT_NEAR(wald_p_value(fit_of(mass.id, t, 3), mass), 0.05, 1e-9);
  EXPECT_FALSE(is_told_from_none(fit_of(mass.id, 0.99 * t, 3), mass, 0.05));
  EXPECT_TRUE(is_told_from_none(fit_of(mass.id, 1.01 * t, 3), mass, 0.05));
  EXPECT_NEAR(wald_p_value(fit_of(mass.id, 3, 1e9), mass), normal_two_sided(3), 1e-6);
  // Three sizes that such a covariance says next to nothing of together are certain each by itself.
  EXPECT_LT(wald_p_value(fit_of(bias.id, 60, 3), bias), 1e-4);
  EXPECT_NEAR(wald_p_value(fit_of(bias.id, 3, 1e9), bias), 2 * chi2_tail(27, 3), 1e-6);
}

// Pads that give by something, with a loss time that nobody knows, give: a size is tested with its shape as
// it was fitted, for each shape that was tried.
TEST(Wald, AnOpenShapeDoesNotHideASize) {
  const dynamics::Effect give = find_effect("contact.pad_compliance");
  constexpr double kTogether = 0.99, kSigmas = 2, kDegrees = 8;
  FitResult fit;
  for (const auto& p : give.parameters) {
    FittedUnknown u;
    u.unknown.name = give.full_name(p);
    u.sigma = 1, u.value = p.neutral + kSigmas, u.degrees_of_freedom = kDegrees;
    fit.campaign.push_back(u);
  }
  fit.covariance = {1, kTogether, kTogether, 1};
  const double z2 = kSigmas * kSigmas / (1 - kTogether * kTogether);
  const double shapes = static_cast<double>(give.parameters[1].grid.size());
  EXPECT_NEAR(wald_p_value(fit, give), shapes * hotelling_bar_tail(z2, 0, 1, kDegrees - 1), 1e-12);
  EXPECT_TRUE(is_told_from_none(fit, give, 0.05));
  fit.covariance = {1, 0, 0, 1};
  EXPECT_FALSE(is_told_from_none(fit, give, 0.05));
  fit.covariance = {1, 0, 0, 0};  // the shape was not fitted
  EXPECT_NEAR(wald_p_value(fit, give), shapes * hotelling_bar_tail(kSigmas * kSigmas, 0, 1, kDegrees), 1e-12);
}

// What is left of a misfit tells whether an effect explains it.
TEST(Misfit, IsExplainedWhereMostOfItGoes) {
  const auto misfit = [](double per_sample) {
    return ChannelMisfit{experiment::Channel::mocap_x, Phase::grasped, 100, 100 * per_sample};
  };
  EXPECT_TRUE(explains_most(misfit(1116), {misfit(5077)}));
  EXPECT_FALSE(explains_most(misfit(636), {misfit(693)}));
  EXPECT_FALSE(explains_most(misfit(3), {})) << "nothing was left there without it";
}

// A law that was accepted in the company of a lift which turns out to be none, on throws of another law: once
// the lift is withdrawn, nothing speaks for the law, and it goes, too.
TEST(Selection, WhatHasNoEvidenceWithoutWhatIsWithdrawnGoesWithIt) {
  const auto log = support::loop_campaign({});  // of the disc
  DiscoverOptions options = support::loop_options();
  Stage base{CampaignProblem(log, "synthetic", options.campaign), {}, {}, {}};
  solve(base, options, {});
  const std::string law = std::string(kLaw) + "limit_surface", lift = "flight.magnus_lift";
  Stage stage{base.problem.with("limit_surface", {lift}), {}, {}, {law, lift}};
  solve(stage, options, {});
  ASSERT_TRUE(base.solved() && stage.solved());
  ASSERT_GT(stage.bic(), base.bic());
  Discovery out;
  out.model = options.campaign.model;
  out.before.fit = base.fit, out.before.held_out = base.held_out.misfit;
  for (const std::string& id : stage.ids) {
    AcceptedEffect effect;
    effect.id = id;
    effect.phase = id == lift ? Phase::flight : Phase::release;
    out.effects.push_back(effect);
  }
  withdraw(stage, options, out);
  EXPECT_TRUE(out.effects.empty()) << out.effects.front().id;
  ASSERT_EQ(out.imitations.size(), 2u);
  EXPECT_EQ(out.imitations[0].id, lift);
  EXPECT_EQ(out.imitations[1].id, law);
  EXPECT_GT(out.imitations[1].delta_bic, -10);
  EXPECT_EQ(stage.problem.options().model, options.campaign.model);
  EXPECT_NEAR(stage.bic(), base.bic(), 1);
}

/// The base model's fit, and the loop before its first step.
std::pair<Stage, Discovery> begun(const datasets::ThrowLog& log, const DiscoverOptions& options) {
  Stage base{CampaignProblem(log, "synthetic", options.campaign), {}, {}, {}};
  solve(base, options, {});
  EXPECT_TRUE(base.solved());
  Discovery out;
  out.model = options.campaign.model;
  out.before.fit = base.fit, out.before.held_out = base.held_out.misfit;
  return {std::move(base), std::move(out)};
}

// A delay was accepted over rigid pads; the give that is then fitted along takes its part.
TEST(Selection, AnEffectIsJudgedAgainBesideTheGiveThatWasFittedAlong) {
  const auto log = support::loop_campaign({{"contact.pad_compliance.compliance", 4e-7}});  // some 20 um
  const std::string delay = "release.opening_delay";
  DiscoverOptions options = support::loop_options();
  auto [base, out] = begun(log, options);
  Stage stage{base.problem.with(options.campaign.model, {delay}), {}, {}, {delay}};
  solve(stage, options, {});
  ASSERT_TRUE(stage.solved());
  AcceptedEffect effect;
  effect.id = delay;
  effect.phase = Phase::release;
  out.effects = {effect};
  fit_give_along(stage, options);
  ASSERT_TRUE(gives_along(stage));
  backward(stage, options, out);
  EXPECT_TRUE(out.effects.empty());
  EXPECT_TRUE(stage.ids.empty());
  EXPECT_EQ(stage.problem.options().effects, std::vector<std::string>{kPads});
}

// Fitted along while something else was missing, a give may end at none, where no derivative leads away from.
TEST(Selection, AGiveThatIsStuckAtNoneBeginsAnew) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.pad_compliance.compliance", 1.5e-7}};
  const auto log = experiment::generate_campaign(design, 1);
  DiscoverOptions options = support::loop_options();
  options.campaign.effects = {kPads};
  Stage stage{CampaignProblem(log, "synthetic", options.campaign), {}, {}, {}};
  EXPECT_FALSE(stage.is_fitted());
  DiscoverOptions without_give = options;
  std::vector<double> start = stage.problem.start();
  for (std::size_t k = 0; k < start.size(); ++k)
    if (const std::string& name = stage.problem.campaign()[k].name; name.starts_with(kPads)) {
      without_give.fit.fixed.push_back(name);
      if (name.ends_with("compliance")) start[k] = 0;
    }
  solve(stage, without_give, start);
  ASSERT_TRUE(stage.solved());
  ASSERT_EQ(give_of(stage), 0);
  fit_give_along(stage, options);
  const double give = 2 * design.patch.mu * design.opening.grip_force * 1.5e-7;
  EXPECT_NEAR(give_of(stage), give, 0.3 * give);
}

// Pads that stick and pads that open late differ by less than what all pads give.
TEST(Selection, StickingPadsAndLateOnesAreToldApartBesidePadsThatGive) {
  const std::string adhesion = "contact.adhesion", delay = "release.opening_delay";
  for (const auto& is : {adhesion, delay}) {
    experiment::EffectSettings effects{{"contact.pad_compliance.compliance", 4e-7}};
    if (is == delay) effects["release.opening_delay.delay"] = 0.003;
    if (is == adhesion)
      effects["contact.adhesion.f_adh"] = 0.8, effects["contact.adhesion.parting_time"] = 0.003;
    const DiscoverOptions options = support::loop_options();
    const Discovery found = discover(support::loop_campaign(effects), "synthetic", options);
    ASSERT_EQ(found.effects.size(), 1u) << is;
    EXPECT_EQ(found.effects[0].id, is);
    EXPECT_EQ(found.along, std::vector<std::string>{kPads});
    for (const auto& u : found.after.fit.campaign) {
      if (u.unknown.name == "release.opening_delay.delay") {
        EXPECT_NEAR(u.value, 0.003, 4 * u.sigma);
      }
      if (u.unknown.name == "contact.adhesion.f_adh") {
        EXPECT_NEAR(u.value, 0.8, 4 * u.sigma);
      }
    }
  }
}

// A base whose pads do not give bends their friction to twice its size, and a late opening that is fitted
// from there ends in another minimum, where an adhesion seems likelier by 148 in Bayes' criterion. From where
// the adhesion ended the two fit alike.
TEST(Selection, StickingPadsAreNotSurerThanLateOnesThatWereFittedBadly) {
  experiment::CampaignDesign design = experiment::random_campaign(9106);
  design.effects = {{"release.opening_delay.delay", 0.002}, {"contact.pad_compliance.compliance", 1.5e-7}};
  const DiscoverOptions options = support::loop_options();
  const Discovery found = discover(experiment::generate_campaign(design, 9106), "synthetic", options);
  ASSERT_EQ(found.effects.size(), 1u);
  EXPECT_EQ(found.effects[0].id, "release.opening_delay");
  for (const auto& [name, correlation] : found.effects[0].equivalent) EXPECT_EQ(name, "contact.adhesion");
  EXPECT_NEAR(found.effects[0].parameters.at(0).value, 0.002, 3 * found.effects[0].parameters.at(0).sigma);
}

// Thirty landings whose chi-square is 1.78 per sample: one in two hundred by chance, and a log has 22 such
// series to look at.
TEST(Misfit, IsJudgedByItsChanceAndByTheSeriesThatAreLookedAt) {
  const DiscoverOptions options;
  const auto misfit = [&](experiment::Channel channel, Phase phase, int n, double per_sample) {
    ChannelMisfit m;
    m.channel = channel, m.phase = phase, m.n = n, m.chi2 = n * per_sample;
    return is_misfit(m, options);
  };
  EXPECT_FALSE(misfit(experiment::Channel::landing_time, Phase::landing, 30, 1.78));
  EXPECT_TRUE(misfit(experiment::Channel::landing_time, Phase::landing, 30, 2.3));
  EXPECT_TRUE(misfit(experiment::Channel::landing_time, Phase::landing, 90, 1.78));
  // A firm grasp has no friction law that could be off; slipping pads do.
  EXPECT_TRUE(misfit(experiment::Channel::wrench_fx, Phase::grasped, 1000, 1.9));
  EXPECT_FALSE(misfit(experiment::Channel::wrench_fx, Phase::release, 1000, 1.9));
}

// The torque of slipping pads is trusted to 4 % of its size, which is most of its variance: a model that errs
// by as much as the trust has a misfit of 1, and one that does not, of much less.
class WrenchImprovement : public testing::Test {
 protected:
  static FitResult torque(double per_sample, Phase phase = Phase::release) {
    FitResult out;
    auto& m = out.misfit.emplace_back();
    m.channel = experiment::Channel::wrench_tau, m.phase = phase, m.n = 500, m.chi2 = 500 * per_sample;
    return out;
  }
  bool matters(double was, double is, const std::vector<ChannelMisfit>& settled = {}) const {
    return improvement(torque(was), torque(is), {}, options, settled).matters >= 1;
  }
  const DiscoverOptions options;
};

TEST_F(WrenchImprovement, MattersByHowMuchItFellWhereItVanishes) {
  EXPECT_TRUE(matters(1.26, 0.16));
  EXPECT_FALSE(matters(1.26, 0.4)) << "a fall of less than wrench_matters";
  EXPECT_FALSE(matters(2.6, 1.4)) << "slipping pads leave as much under any law";
  EXPECT_TRUE(matters(4.5, 1.4)) << "more than slipping pads leave";
}

// What the train throws settle the held-out ones need only confirm, whose slips may be too slow to show it.
TEST_F(WrenchImprovement, MattersByItsShareWhereTheTrainThrowsSettleIt) {
  const auto settled = [&](double was, double is, Phase phase = Phase::release) {
    return settled_wrenches(torque(was, phase), torque(is, phase), options);
  };
  EXPECT_EQ(settled(4, 0.9).size(), 1u);
  EXPECT_TRUE(settled(4, 1.2).empty()) << "more than a hundredth is left";
  EXPECT_TRUE(settled(2.5, 0.5).empty()) << "slipping pads leave as much under any law";
  EXPECT_TRUE(settled(4, 0.9, Phase::grasped).empty()) << "no friction law takes part";
  EXPECT_TRUE(matters(1.3, 0.6, settled(4, 0.9)));
  EXPECT_FALSE(matters(1.3, 1.1, settled(4, 0.9))) << "a fall of less than kWrenchShare";
  EXPECT_FALSE(matters(3.5, 2.7, settled(4, 0.9))) << "most of it stays";
}

/// A laboratory's law is not this library's: intervals must know.
TEST(Discrepancy, IntervalsStayOnGoodCampaignsAndWidenWhereSensorsDisagree) {
  CampaignOptions options;
  options.effects = {"sensor.inertia"};
  options.integrator.tolerances = {1e-5, 1e-8};
  const auto widened = [&](const experiment::EffectSettings& effects) {
    const CampaignProblem problem(support::loop_campaign(effects), "synthetic", options);
    FitResult result = fit(problem);
    std::vector<double> before;
    for (const auto& u : result.campaign) before.push_back(u.sigma);
    count_discrepancy(problem, result, 0);
    double most = 0;
    for (std::size_t k = 0; k < before.size(); ++k) {
      EXPECT_GE(result.campaign[k].sigma, before[k]);
      EXPECT_NEAR(result.covariance[k * before.size() + k], std::pow(result.campaign[k].sigma, 2),
                  1e-9 * std::pow(result.campaign[k].sigma, 2));
      most = std::max(most, result.campaign[k].sigma / before[k]);
    }
    return most;
  };
  const double good = widened({});
  // Six conditions: Student's factor is 1.3, and a jackknife of six scatters by a third.
  EXPECT_LT(good, 4);
  // Friction that falls with the slip bends what the wrenches say of mu, and what the motion says of the
  // inertia.
  EXPECT_GT(widened({{"contact.stribeck.mu_s/mu_k", 1.5}, {"contact.stribeck.v_s", 0.02}}), good);
}

// The samples before the opening find a throw's own unknowns however far they are from none: here a clock of
// the cameras that is 30 ms late, which takes the grasp's angle with it.
TEST(BeforeRelease, FindsAGraspThatIsFarFromWhatTheLogSays) {
  CampaignOptions options;
  options.effects = {"sensor.mocap_time_offset"};
  options.integrator.tolerances = {1e-5, 1e-8};
  auto design = experiment::random_campaign(5);
  design.effects = {{"sensor.mocap_time_offset.offset", 0.03}};
  const CampaignProblem problem(experiment::generate_campaign(design, 5), "synthetic", options);
  const FitResult result = fit(problem);
  ASSERT_TRUE(result.is_answer()) << result.message;
  int seen = 0;
  for (std::size_t i = 0; i < problem.throws().size(); ++i) {
    if (!result.throws[i].used) continue;
    const auto before = before_release(problem, problem.throws()[i], result, DerivativesBy::own);
    for (std::size_t k = 0; k < before.own.size(); ++k)
      if (problem.own()[k].name == "grasp_angle") {
        EXPECT_NEAR(
            before.own[k], result.throws[i].own[k],
            5 * std::sqrt(before.covariance(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k))))
            << i;
        seen += std::abs(result.throws[i].own[k]) > 0.05;
      }
  }
  EXPECT_GT(seen, 5) << "grasps that are far from what the log says";
}

// The drag of an object that was thrown under one condition, by flights that each condition bends otherwise:
// nothing says how sure it is but the drag of the other object.
TEST(Discrepancy, ASizeFromOneConditionIsNoSurerThanItsNeighbours) {
  CampaignOptions options;
  options.effects = {"flight.quadratic_drag"};
  options.integrator.tolerances = {1e-5, 1e-8};
  options.check_units = false;
  datasets::ThrowLog log = support::loop_campaign({{"flight.quadratic_drag.k", 0.1}});
  std::map<std::string, double> bends;  // m/s² along x, by condition
  std::string only;
  std::mt19937_64 random(4);
  std::normal_distribution<double> draught(0, 0.1);
  for (const auto& one : log.throws)
    if (one.object == log.throws.back().object && only.empty()) only = one.condition;
  std::erase_if(log.throws, [&](const auto& one) {
    return one.object == log.throws.back().object && one.condition != only;
  });
  for (auto& one : log.throws) {
    one.split = datasets::Split::train;
    const double a = bends.try_emplace(one.object + one.condition, draught(random)).first->second;
    constexpr double detach = 0.13;  // s, about
    const auto off = [&](double t) { return t > detach ? 0.5 * a * (t - detach) * (t - detach) : 0; };
    for (std::size_t i = 0; i < one.mocap->time.rows; ++i)
      one.mocap->pose.data[3 * i] += off(one.mocap->time.data[i]);
    one.landing->pose.data[0] += off(one.landing->time.data[0]);
  }
  const CampaignProblem problem(log, "synthetic", options);
  FitOptions as_loop;
  as_loop.weigh = Weigh::variances;
  FitResult result = fit(problem, as_loop);
  ASSERT_TRUE(result.is_answer()) << result.message;
  std::vector<double> noise;
  for (const auto& u : result.campaign) noise.push_back(u.data_sigma);
  count_discrepancy(problem, result, 0);
  double often = 0, once = 0;
  for (std::size_t k = 0; k < noise.size(); ++k) {
    const std::string& name = result.campaign[k].unknown.name;
    if (!name.starts_with("flight.quadratic_drag")) continue;
    (name.ends_with("[" + log.throws.back().object + "]") ? once : often) =
        result.campaign[k].sigma / noise[k];
  }
  EXPECT_GT(often, 5) << "conditions disagree";
  EXPECT_GE(once, 0.99 * often);
}

// Two columns that pull in opposite ways on one residual: only the one whose parameter may be positive can
// explain it, and they are no names of each other.
TEST(Footprints, ASizeThatThereIsNotExplainsNothing) {
  Footprints f;
  Eigen::MatrixXd columns(4, 3);  // two candidates, and the residual
  columns << 1, -1, -2, 2, -2, -4, 0, 0.1, 0, 1, -1, -2;
  f.gram = columns.transpose() * columns;
  f.candidates = {{"grows", {"a"}, {0}, {}, {1}}, {"shrinks", {"b"}, {1}, {}, {1}}};
  const auto all = scores(f);
  EXPECT_NEAR(all[0].step.front(), 2, 1e-9);
  EXPECT_NEAR(all[0].gain, 24, 1e-9);
  EXPECT_EQ(all[1].step.front(), 0);
  EXPECT_EQ(all[1].gain, 0);
  EXPECT_EQ(between(f, f.candidates[0], all[0].step, f.candidates[1]), 0);
  f.candidates[1].sides = {0};
  EXPECT_GT(between(f, f.candidates[0], all[0].step, f.candidates[1]), 0.99);
}

// A clock of the cameras that is early shifts the motion as no lag of the hand behind its log can.
TEST(Footprints, AClockThatIsOffTheOtherWayIsNoLagOfTheHand) {
  CampaignOptions options;
  options.effects = {"sensor.mocap_time_offset"};
  options.integrator.tolerances = {1e-5, 1e-8};
  for (const double offset : {-4e-3, 4e-3}) {
    const CampaignProblem problem(support::loop_campaign({{"sensor.mocap_time_offset.offset", offset}}),
                                  "synthetic", options);
    const FitResult result = fit(problem);
    const Footprints f = footprints(problem, result, {"release.hand_tracking_lag"}, {}, 0);
    Eigen::VectorXd contribution = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(f.fitted));
    for (std::size_t k = 0; k < f.fitted; ++k)
      if (result.campaign[k].unknown.name == "sensor.mocap_time_offset.offset")
        contribution[static_cast<Eigen::Index>(k)] = result.campaign[k].value;
    const double r = correlation(f, contribution, f.candidates.front());
    if (offset < 0) {
      EXPECT_LT(r, 0.5);
    } else {
      EXPECT_GT(r, 0.9);
    }
  }
}

// The quartic has an unknown that the ellipsoid has not, and the other way round.
TEST(Separating, ALawIsToldFromAnEffectByExperiments) {
  for (const char* law : {"limit_surface", "limit_surface_quartic"}) {
    DiscoverOptions options = support::loop_options(law);
    options.campaign.effects = {"contact.viscous"};
    Stage stage{CampaignProblem(support::loop_campaign({{"contact.viscous.1/v_0", 2}}), "synthetic",
                                options.campaign),
                {},
                {},
                {"contact.viscous"}};
    ASSERT_TRUE(solve_train(stage, options, {}));
    AcceptedEffect accepted;
    accepted.id = "contact.viscous";
    for (const char* other : {"contact.law:limit_surface_quartic", "contact.law:limit_surface",
                              "contact.law:limit_surface_disc"}) {
      if (other == std::string(kLaw) + law) continue;
      const auto experiments = separating_experiments(stage, accepted, other, options);
      ASSERT_FALSE(experiments.empty()) << law << " against " << other;
      if (experiments.front().before > 0) {
        EXPECT_LT(experiments.front().after, experiments.front().before) << law << " against " << other;
      }
      double last = 0;  // the most telling first
      for (const auto& e : experiments) {
        EXPECT_EQ(e.before, experiments.front().before) << "of one log";
        EXPECT_GE(e.before, 0);
        EXPECT_LE(e.before, 1);
        EXPECT_GE(e.after, last) << e.what;
        EXPECT_LE(e.after, 1);
        EXPECT_EQ(e.separates, e.after < options.equivalent);
        last = e.after;
      }
    }
  }
}

// What an experiment would bring is what the log says once it has been made: ten more throws of one object,
// moved as the other was, which the design's campaigns have.
TEST(Separating, AnExperimentBringsWhatItPromised) {
  experiment::CampaignDesign design = support::loop_design();
  design.effects = {{"sensor.mocap_time_offset.offset", 0.004}};
  DiscoverOptions options = support::loop_options();
  options.campaign.effects = {"sensor.mocap_time_offset"};
  AcceptedEffect accepted;
  accepted.id = "sensor.mocap_time_offset";
  const auto asked = [&](const datasets::ThrowLog& log) {
    Stage stage{CampaignProblem(log, "synthetic", options.campaign), {}, {}, options.campaign.effects};
    EXPECT_TRUE(solve_train(stage, options, {}));
    return separating_experiments(stage, accepted, "sensor.length_scale", options);
  };
  datasets::ThrowLog log = experiment::generate_campaign(design, 3);
  const auto experiments = asked(log);
  const std::string words = "10 throws of bar-com100 moved as bar-com160, condition bar-com160/";
  const auto promise = std::find_if(experiments.begin(), experiments.end(),
                                    [&](const auto& e) { return e.what.starts_with(words); });
  ASSERT_NE(promise, experiments.end());
  ASSERT_LT(promise->after, 0.7 * promise->before);
  const std::string condition = "bar-com100/" + promise->what.substr(words.size());
  std::erase_if(log.throws, [&](const auto& one) { return one.condition == condition; });
  design.repetitions = 10;
  for (datasets::Throw& one : experiment::generate_campaign(design, 4).throws)
    if (one.condition == condition) {
      one.id = "more-" + one.id, one.split = datasets::Split::train;
      log.throws.push_back(std::move(one));
    }
  const auto then = asked(log);
  ASSERT_FALSE(then.empty());
  EXPECT_NEAR(then.front().before, promise->after, 0.2 * (promise->before - promise->after));
}

/// A fit that leaves χ² of so much per sample, of n samples each.
struct Left {
  experiment::Channel channel;
  Phase phase;
  double per_sample;
};
FitResult leaving(std::initializer_list<Left> channels, int n = 1000) {
  FitResult out;
  for (const auto& [channel, phase, per_sample] : channels) {
    auto& m = out.misfit.emplace_back();
    m.channel = channel, m.phase = phase, m.n = n, m.chi2 = n * per_sample;
  }
  return out;
}

/// Whether an effect spoils a channel of an answer.
bool spoilt(const AcceptedEffect& by, const FitResult& base, const FitResult& train,
            const FitResult& held_out) {
  Discovery so_far;
  so_far.before.fit = base, so_far.before.held_out = base.misfit;
  const CampaignProblem problem(support::loop_campaign({}), "synthetic", {});
  return spoils(by, Stage{problem, train, held_out, {}}, so_far, {});
}

// A drag and a wind that together pass for a third law of the air bend the motion in the hand; a mass that
// takes in a torque's gain makes the forces noisier, far below what they are trusted to. A drag that does so
// frees friction of what had bent it. What only one half of the throws shows is not spoilt, nor what chance
// moves.
TEST(Spoils, IsAChannelThatTheAnswerLeavesNoisier) {
  const auto misfit = [](double grasped, double flight, int n = 1000) {
    constexpr auto z = experiment::Channel::mocap_z;
    return leaving({{z, Phase::grasped, grasped}, {z, Phase::flight, flight}}, n);
  };
  AcceptedEffect drag, mass;
  drag.id = "flight.quadratic_drag", drag.phase = Phase::flight;
  mass.id = "sensor.mass", mass.phase = Phase::grasped;
  EXPECT_TRUE(spoilt(drag, misfit(1.1, 9000), misfit(3, 17), misfit(3, 17)));
  EXPECT_FALSE(spoilt(drag, misfit(1.1, 9000), misfit(1.1, 17), misfit(1.1, 17)));
  EXPECT_FALSE(spoilt(drag, misfit(2.5, 9000), misfit(3, 17), misfit(3, 17)));
  EXPECT_FALSE(spoilt(drag, misfit(1.1, 9000), misfit(3, 17), misfit(1, 17)));
  EXPECT_TRUE(spoilt(mass, misfit(0.2, 9), misfit(0.4, 1), misfit(0.35, 1)));
  EXPECT_FALSE(spoilt(drag, misfit(0.2, 9), misfit(0.4, 1), misfit(0.35, 1)));
  EXPECT_FALSE(spoilt(mass, misfit(1.1, 9000), misfit(1.6, 17, 30), misfit(1.6, 17, 30)));
}

// Landings alone: without the drag the grasps seem to scatter so widely that every throw's own takes its
// angle at landing up. With it they do no more, and the angles scatter by what they are read to, or less. A
// landing that is left beyond its noise is spoilt here, too.
TEST(Spoils, NoLandingThatIsWithinItsNoise) {
  const auto misfit = [](double x, double theta) {
    return leaving({{experiment::Channel::landing_x, Phase::landing, x},
                    {experiment::Channel::landing_theta, Phase::landing, theta}},
                   21);
  };
  AcceptedEffect drag;
  drag.id = "flight.quadratic_drag", drag.phase = Phase::landing;
  const FitResult base = misfit(543, 0.04), within = misfit(0.6, 0.6), beyond = misfit(0.6, 3);
  EXPECT_FALSE(spoilt(drag, base, within, within));
  EXPECT_TRUE(spoilt(drag, base, beyond, beyond));
}

// Under a law that brings the wrench to its noise, held-out poses stay off by a third of what the base left.
// If it left as much in the train throws, the law imitates what it was fitted to; if those never showed it
// (as throws on which pads that give are not stretched), the held-out ones show something else.
TEST(Withdrawal, IsNotForWhatOnlyTheHeldOutThrowsShow) {
  using experiment::Channel;
  const auto misfit = [](double wrench, double pose) {
    return leaving({{Channel::wrench_tau, Phase::release, wrench}, {Channel::mocap_x, Phase::release, pose}});
  };
  AcceptedEffect law;
  law.id = "contact.law:sliding_pivot", law.phase = Phase::release;
  const auto why = [&](const FitResult& base) {
    Discovery so_far;
    so_far.before.fit = base, so_far.before.held_out = misfit(9, 3.4).misfit;
    const Stage stage{CampaignProblem(support::loop_campaign({}), "synthetic", {}),
                      misfit(0.3, 1.05),
                      misfit(1.4, 1.9),
                      {}};
    return why_imitation(law, stage, {}, stage.fit, false, so_far, {});
  };
  EXPECT_EQ(why(misfit(24, 3.4)),
            "it leaves mocap.x in release at 1.9 times the noise on the held-out throws");
  EXPECT_EQ(why(misfit(24, 1.2)), "");
}

// Landings alone leave fewer numbers than a throw has unknowns. A law that takes a thousandth off does not
// matter then either.
TEST(Improvement, OfALawIsJudgedWithoutDegreesOfFreedom) {
  const DiscoverOptions options;
  const auto landings = [](double per_sample) {
    FitResult out;
    auto& m = out.misfit.emplace_back();
    m.channel = experiment::Channel::landing_x, m.phase = Phase::landing, m.n = 40, m.chi2 = 40 * per_sample;
    out.samples = 40, out.degrees_of_freedom = -10, out.chi2 = m.chi2;
    return out;
  };
  EXPECT_FALSE(landings(1).chi2_per_dof());
  EXPECT_LT(law_improvement(landings(2), landings(1.998), {}, options).matters, 1);
  EXPECT_NEAR(law_improvement(landings(2), landings(1.9), {}, options).matters, 0.05 / options.law_matters,
              1e-9);
}

// What an effect contributes is how far its sizes are from none, which is one for a ratio and zero for a
// drag; a shape contributes nothing.
TEST(Footprints, WhatAnEffectContributesIsCountedFromNone) {
  FitResult fit;
  for (const auto& [name, value] : {std::pair{"mu", 0.4},
                                    {"contact.stribeck.mu_s/mu_k", 1.3},
                                    {"contact.stribeck.v_s", 0.02},
                                    {"flight.quadratic_drag.k[a]", 0.1}}) {
    auto& u = fit.campaign.emplace_back();
    u.unknown.name = name, u.value = value;
  }
  const auto of = [&](const char* id) { return contribution_of(fit, find_effect(id)); };
  EXPECT_LT((of("contact.stribeck") - Eigen::Vector4d(0, 0.3, 0, 0)).norm(), 1e-12);
  EXPECT_LT((of("flight.quadratic_drag") - Eigen::Vector4d(0, 0, 0, 0.1)).norm(), 1e-12);
  fit.campaign[1].value = 1;
  EXPECT_EQ(of("contact.stribeck").norm(), 0);
}

// An error that ends with the release ends at time zero, in all throws together, and not as the pads begin to
// open.
TEST(Residuals, TimeIsCountedFromEachThrowsRelease) {
  const CampaignProblem problem(support::loop_campaign({}), "synthetic", {});
  FitResult result;
  std::vector<Eigen::VectorXd> residuals;
  for (std::size_t i = 0; i < problem.throws().size(); ++i) {
    const CampaignThrow& thrown = problem.throws()[i];
    const double held = 0.02 + 0.002 * static_cast<double>(i);  // s, where no sensor saw the release
    result.throws.emplace_back().detach = thrown.opening + held;
    const double release = thrown.release_or(result.throws.back().detach);
    auto& r = residuals.emplace_back(static_cast<Eigen::Index>(thrown.observed.all.size()));
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j)
      r[static_cast<Eigen::Index>(j)] = thrown.observed.all[j].time < release ? -3 : 2;
  }
  int samples = 0;
  for (const ResidualBin& bin : residual_over_time(problem, result, residuals)) {
    EXPECT_EQ(bin.mean, bin.time < 0 ? -3 : 2) << bin.time;
    EXPECT_EQ(bin.rms, std::abs(bin.mean)) << bin.time;
    samples += bin.n;
  }
  int flown = 0;
  for (const CampaignThrow& thrown : problem.throws())
    for (const auto& o : thrown.observed.all)
      flown += phase_of(o, thrown.opening, HUGE_VAL) != Phase::landing;
  EXPECT_EQ(samples, flown);
}

TEST(Footprints, TheStepOfTheTrueEffectIsItsSizeToFirstOrder) {
  constexpr double kTilt = 0.01;
  CampaignOptions options;
  options.integrator.tolerances = {1e-5, 1e-8};
  const CampaignProblem problem(support::loop_campaign({{"flight.gravity_tilt.angle", kTilt}}), "synthetic",
                                options);
  const FitResult base = fit(problem);
  const Footprints f = footprints(problem, base, {"flight.gravity_tilt", "flight.wind"}, {}, 0);
  for (const Score& score : scores(f)) {
    if (f.candidates[score.candidate].id == "flight.gravity_tilt") {
      EXPECT_NEAR(score.step.front(), kTilt, 0.1 * kTilt);
    } else {
      EXPECT_FALSE(score.visible) << "no drag is declared, so wind leaves no footprint";
    }
  }
}

}  // namespace
}  // namespace unhand::fitting
