// The loop on synthetic campaigns whose missing effect is known.
#include "fitting/discovery/discover.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/stage.hpp"
#include "tests/fitting/found_size.hpp"
#include "tests/fitting/loop_campaign.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::fitting {
namespace {

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

Discovery found_in(const datasets::ThrowLog& log, std::vector<std::string> forget = {}) {
  DiscoverOptions options = support::loop_options();
  options.forget = std::move(forget);
  options.refits = 3;
  return discover(log, "synthetic", options);
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

TEST(Discovery, AnEffectThatTheCatalogueForgetsIsUnexplainedWithAReadableCandidate) {
  constexpr double kLift = 0.03;
  const Discovery found =
      found_in(support::loop_campaign({{"flight.magnus_lift.k_m", kLift}}), {"flight.magnus_lift"});
  EXPECT_EQ(named(found, "flight.magnus_lift"), nullptr);
  EXPECT_EQ(found.first.phase, Phase::flight);
  ASSERT_TRUE(found.unexplained.has_value()) << to_string(found.verdict);
  EXPECT_EQ(found.unexplained->phase, Phase::flight);
  ASSERT_TRUE(found.unexplained->missing.has_value());
  const MissingEstimate& missing = *found.unexplained->missing;
  ASSERT_FALSE(missing.candidate.terms.empty()) << found.unexplained->description;
  EXPECT_EQ(missing.candidate.terms.front().name, "omega J v") << found.unexplained->description;
  EXPECT_NE(missing.correction, Correction::withheld);
  EXPECT_LT(missing.error_after.value(), 0.7 * missing.error_before.value())
      << "on throws that it has not seen";
}

/// The answer must be `unexplained` in flight, in words that ask for one term, of this size.
void asks_for(const Discovery& found, const std::string& term, double size, double within) {
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  ASSERT_TRUE(found.unexplained);
  ASSERT_TRUE(found.unexplained->missing) << found.unexplained->description;
  EXPECT_EQ(found.unexplained->phase, Phase::flight);
  const std::string& words = found.unexplained->description;
  EXPECT_NE(words.find(") " + term + " ["), std::string::npos) << words;
  const MissingCandidate& candidate = found.unexplained->missing->candidate;
  ASSERT_FALSE(candidate.terms.empty()) << words;
  EXPECT_EQ(candidate.terms.front().name, term) << candidate.in_words();
  EXPECT_NEAR(candidate.terms.front().coefficient, size, within) << candidate.in_words();
}

// Quadratic drag takes all but a few thousandths of it, as speeds do not differ by much. But the laws of
// flight are exact: what is left says that something else acts, and a drag of another power explains it all.
TEST(Discovery, ADragThatNoEffectHasIsNotTakenForTheNearestOne) {
  const double c = 0.3;  // 1/s
  asks_for(found_in(support::loop_campaign_in_drag([&](double) { return c; })), "v", -c, 0.1 * c);
  const double weak = 0.02;  // no channel leaves its noise beside a quadratic drag
  asks_for(found_in(support::loop_campaign_in_drag([&](double) { return weak; })), "v", -weak, 0.1 * weak);
  const double cubic = 0.01;  // s/m²
  asks_for(found_in(support::loop_campaign_in_drag([&](double v) { return cubic * v * v; })), "|v|^2 v",
           -cubic, 0.1 * cubic);
}

// A camera of 119.5 frames a second whose stamps count 120: flights fall at g / (1 + r)^2 by its clock.
TEST(Discovery, AClockOfTheTrackerThatRunsFastIsNoEffectButIsTold) {
  constexpr double kFast = 0.004;
  auto log = support::loop_campaign({});
  for (auto& one : log.throws) {
    ASSERT_TRUE(one.mocap);
    const double first = one.mocap->time(0);
    for (double& t : one.mocap->time.data) t = first + (1 + kFast) * (t - first);
  }
  const Discovery found = found_in(std::move(log));
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  ASSERT_TRUE(found.unexplained);
  const std::string& words = found.unexplained->description;
  const std::string told = "a clock of the tracker that runs fast by ";
  const auto at = words.find(told);
  ASSERT_NE(at, std::string::npos) << words;
  EXPECT_NEAR(std::stod(words.substr(at + told.size())), 100 * kFast, 5 * kFast) << words;
}

// A tracked frame that is off its CoM across the pads, along which no effect moves it, turns about the CoM.
// Listed effects, a tilt of gravity and a lift say, may take that down to the noise of every channel.
TEST(Discovery, AFrameThatIsOffAcrossThePadsIsNoTiltAndNoLift) {
  constexpr double kOff = 0.001;  // m
  datasets::ThrowLog log = support::loop_campaign({});
  for (auto& thrown : log.throws) {
    const auto shift = [&](double theta, double& x, double& z) {
      x -= kOff * std::sin(theta), z += kOff * std::cos(theta);
    };
    for (std::size_t k = 0; k < thrown.mocap->time.rows; ++k) {
      auto& pose = thrown.mocap->pose;
      shift(pose(k, 2), pose(k, 0), pose(k, 1));
    }
  }
  asks_for(found_in(log), "omega^2 along the object's z", -kOff, 0.15 * kOff);  // towards the CoM
}

// A push along x that only flights feel, a draught say, is in flight just what a tilted gravity is: that one,
// though, acts in the hand as well, and the wrench before the detach knows nothing of it.
TEST(Discovery, APushThatTheHandDoesNotFeelIsNoTiltedGravity) {
  constexpr double kPush = -0.2;  // [m/s^2]
  const experiment::CampaignDesign design = support::loop_design();
  datasets::ThrowLog log = experiment::campaign_header(design, 3);
  for (int i = 0; i < design.throws(); ++i) {
    auto [record, truth] = experiment::generate_throw(design, 3, i);
    const auto moved = [&, from = truth.detach_time](double t) {
      return t > from ? 0.5 * kPush * (t - from) * (t - from) : 0.0;
    };
    for (std::size_t k = 0; k < record.mocap->time.rows; ++k)
      record.mocap->pose(k, 0) += moved(record.mocap->time(k));
    record.landing->pose(0, 0) += moved(truth.landing_time);
    log.throws.push_back(std::move(record));
  }
  const Discovery found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_EQ(named(found, "flight.gravity_tilt"), nullptr);
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::flight);
}

// A drag of the catalogue beside a push that is not in it: the rest is unexplained, and the drag stays.
TEST(Discovery, AListedEffectBesideAnUnlistedOneStays) {
  const Discovery found =
      found_in(support::loop_campaign({{"flight.quadratic_drag.k", 0.05}, {"flight.magnus_lift.k_m", 0.02}}),
               {"flight.magnus_lift"});
  const AcceptedEffect* drag = named(found, "flight.quadratic_drag");
  ASSERT_NE(drag, nullptr) << to_string(found.verdict);
  // Of what size cannot be known beside what is not listed; that it brakes can.
  for (const auto& p : drag->parameters) EXPECT_GT(p.value, 4 * p.sigma) << p.name;
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::flight);
}

// Gravity that is declared wrong by little bends flights as no effect does. A lift imitates it down to the
// noise of every channel, and through the lift a wind, though no object has a drag.
TEST(Discovery, GravityDeclaredWrongIsNoLiftAndNoWind) {
  datasets::ThrowLog log = experiment::generate_campaign(experiment::random_campaign(2), 2);
  log.gravity -= 0.03;
  const Discovery found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_TRUE(found.effects.empty());
  ASSERT_TRUE(found.unexplained && found.unexplained->missing);
  EXPECT_TRUE(found.unexplained->description.starts_with("mocap.z in flight: "));
  const MissingCandidate& form = found.unexplained->missing->candidate;
  ASSERT_EQ(form.terms.size(), 1u);
  EXPECT_EQ(form.terms[0].name, "1 along z");
  EXPECT_NEAR(form.terms[0].coefficient, -0.03, 0.003);
}

// Noise that is declared too small leaves the noise in every phase, by the same factor.
TEST(Discovery, ASigmaThatIsTooSmallIsSaidToDo) {
  constexpr double kFactor = 1.6;
  auto log = support::loop_campaign({});
  for (auto& t : log.throws)
    for (double& sigma : t.mocap->pose.sigma) sigma /= kFactor;
  const Discovery found = found_in(log);
  ASSERT_TRUE(found.unexplained.has_value()) << to_string(found.verdict);
  const std::string& words = found.unexplained->description;
  EXPECT_TRUE(words.find("white and alike in all phases: a sigma too small by 1.6 would do") !=
                  std::string::npos ||
              words.find("too small by 1.5 would do") != std::string::npos)
      << words;  // what is fitted takes up some of it
  EXPECT_EQ(words.find("nearest footprint"), std::string::npos) << words;
}

// What is wrong in some throws only is no effect, and not nothing: the answer names them, in either half.
TEST(Discovery, WhatIsWrongInOneConditionIsUnexplainedAndNamesIt) {
  for (const auto half : {datasets::Split::train, datasets::Split::test}) {
    auto log = support::loop_campaign({});
    const auto first =
        std::find_if(log.throws.begin(), log.throws.end(), [&](const auto& t) { return t.split == half; });
    ASSERT_NE(first, log.throws.end());
    const std::string object = first->object, condition = first->condition;
    for (auto& t : log.throws)
      if (t.object == object && t.condition == condition && t.split == half)
        for (std::size_t k = 0; k < t.mocap->time.rows; ++k) t.mocap->pose(k, 0) += 0.01;
    const Discovery found = found_in(log);
    EXPECT_EQ(found.verdict, Verdict::unexplained);
    ASSERT_TRUE(found.unexplained.has_value());
    EXPECT_NE(found.unexplained->description.find(first->id), std::string::npos)
        << found.unexplained->description;
    EXPECT_NE(found.unexplained->description.find(half == datasets::Split::train ? "train" : "held-out"),
              std::string::npos)
        << found.unexplained->description;
  }
}

TEST(Discovery, OneLandingThatIsOffIsNamed) {
  auto log = support::loop_campaign({});
  const auto bad = std::find_if(log.throws.begin(), log.throws.end(),
                                [](const auto& t) { return t.split == datasets::Split::test; });
  ASSERT_NE(bad, log.throws.end());
  bad->landing->pose(0, 0) += 0.5;
  const Discovery found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  ASSERT_EQ(found.skipped.size(), 1U);
  const auto& [id, why] = found.skipped.front();
  EXPECT_EQ(id, bad->id);
  EXPECT_NE(why.find(to_string(experiment::Channel::landing_x)), std::string::npos) << why;
}

// A tracker that smooths its poses is late wherever the motion is even, and takes a late clock's place in the
// air; in the grasp, where the hand's acceleration changes, a fifth of the misfit stays.
TEST(Discovery, ATrackerThatSmoothsIsNotTakenForALateClock) {
  constexpr double kTau = 0.01;  // [s], of a first-order low-pass
  auto log = support::loop_campaign({});
  for (auto& thrown : log.throws) {
    const datasets::Series& time = thrown.mocap->time;
    datasets::Series& pose = thrown.mocap->pose;
    std::size_t last = pose.rows;  // none yet
    for (std::size_t k = 0; k < pose.rows; ++k) {
      if (!thrown.mocap->valid.empty() && thrown.mocap->valid[k] == 0) continue;  // lost: NaN
      for (std::size_t c = 0; last < pose.rows && c < pose.cols; ++c)
        pose(k, c) =
            pose(last, c) - std::expm1(-(time(k) - time(last)) / kTau) * (pose(k, c) - pose(last, c));
      last = k;
    }
  }
  const Discovery found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_EQ(named(found, "sensor.mocap_time_offset"), nullptr);
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

// The friction coefficient falls as the pads press harder: f_N is logged as the 1.15th power of what friction
// goes with. A patch that widened as it is let go would describe that well; there is none.
TEST(Discovery, FrictionThatIsNotProportionalToTheForceIsNoSoftPatch) {
  datasets::ThrowLog log = experiment::generate_campaign(experiment::campaign_design("quick12"), 4);
  for (datasets::Throw& thrown : log.throws) {
    std::vector<double>& force = thrown.ft->normal_force.data;
    const double grip = force.front();
    for (double& f : force)
      if (f > 0) f = grip * std::pow(f / grip, 1.15);
  }
  const Discovery found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::release) << "in the grasp the pads do not slip";
}

// The landing times of this campaign's held-out throws scatter by 2.2 times their variance. No effect has to
// do with that: the train throws do not show it.
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
TEST(Discovery, AWildThrowIsSetAsideAndNamed) {
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

// Repetitions that the pads hold at other places across the object's axis: each throw is fitted its own.
TEST(Discovery, AGraspThatScattersAcrossThePadsHidesNothing) {
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
TEST(Discovery, ManyWildThrowsAreUnexplained) {
  auto log = support::loop_campaign({});
  for (std::size_t k = 0; k < log.throws.size(); k += 2) jump(log.throws[k]);
  const Discovery found = found_in(log);
  EXPECT_TRUE(found.skipped.empty());
  EXPECT_EQ(found.verdict, Verdict::unexplained);
}

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

// Pads of the sliding pivot cannot give: of ones that do, it lacks another law, and in that their give.
TEST(Discovery, AGiveIsFoundBehindALawWhosePadsCannot) {
  constexpr double kGive = 2e-5;  // m/N
  const Discovery found = discover(support::loop_campaign({{"contact.pad_compliance.compliance", kGive}}),
                                   "synthetic", support::loop_options("sliding_pivot"));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "contact.law:limit_surface_disc");
  support::expect_size(found, "contact.pad_compliance", kGive);
  EXPECT_EQ(found.effects.size(), 2u);
  EXPECT_FALSE(found.unexplained.has_value());
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

// Not listed, no name can be right; that predictions could be better is told without one: repetitions scatter
// by far less than conditions are off.
TEST(Discovery, WhatMattersToThePredictionAloneIsUnexplainedWhereTheCatalogueForgetsIt) {
  experiment::CampaignDesign design = experiment::random_campaign(3017);  // conditions five times
  design.effects = {{"sensor.inertia.ratio", 1.11}};
  const Discovery found = found_in(experiment::generate_campaign(design, 3017), {"sensor.inertia"});
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  EXPECT_FALSE(found.first.any) << "no channel alone would show it";
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::release);
  EXPECT_GT(found.unexplained->chi2_per_dof, 2) << found.unexplained->description;
}

// The fit follows the train throws as far as it can: what predictions lack then shows on the held-out ones.
TEST(Discovery, WhatTheFitFollowsIsUnexplainedOnHeldOutThrows) {
  experiment::CampaignDesign design = experiment::random_campaign(97003);
  design.effects = {{"sensor.inertia.ratio", 0.88}};
  const Discovery found = found_in(experiment::generate_campaign(design, 97003), {"sensor.inertia"});
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(found.unexplained->phase, Phase::release);
  EXPECT_NE(found.unexplained->description.find("on held-out throws"), std::string::npos)
      << found.unexplained->description;
  EXPECT_GT(found.unexplained->chi2_per_dof, 4);
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

// Pads that give by three micrometres, which no pads are without, are no missing effect and no unexplained
// one either: the answer's model has them, and predicts the better for it.
TEST(Discovery, TheGiveOfAnyPadsIsFittedAlongAndNoPartOfTheAnswer) {
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
TEST(Discovery, TheGiveOfAnyPadsIsNoPartOfTheAnswerWhereAChannelShowsIt) {
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
TEST(Discovery, TheGiveOfAnyPadsIsFittedAlongWhereOnlyPredictionsShowIt) {
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
TEST(Discovery, AGiveThatPredictsNothingDoesNotHideWhatItStoodFor) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.effects = {{"contact.viscous.1/v_0", 5}};
  const Discovery found = found_in(experiment::generate_campaign(design, 3));
  EXPECT_TRUE(found.along.empty());
  ASSERT_TRUE(found.small.has_value());
  EXPECT_EQ(found.small->id, "contact.viscous");
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

// Friction that falls with the slip, beside pads that give by four micrometres. The held-out conditions slip
// slowly: their torque is no misfit, and without the give nothing there speaks for Stribeck's friction.
TEST(Discovery, WhatTheTrainThrowsSettleIsConfirmedBesideTheGiveOfThePads) {
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
TEST(Discovery, PadsThatBendTheBaseFarAreFound) {
  experiment::CampaignDesign design = experiment::random_campaign(144);
  constexpr double kCompliance = 4.08e-5;  // m/N
  design.effects = {{"contact.pad_compliance.compliance", kCompliance}};
  const Discovery found = found_in(experiment::generate_campaign(design, 144));
  EXPECT_LT(found.before.fit.campaign.front().value, 0.6 * design.patch.mu) << "of the base";
  support::expect_size(found, "contact.pad_compliance", kCompliance);
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
