// Predictions with their uncertainty, cards and what they vouch for, advice.
#include "fitting/evaluate.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "fitting/advice.hpp"
#include "fitting/before_release.hpp"
#include "fitting/card.hpp"
#include "fitting/distributions.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using testing::HasSubstr;
using testing_support::small_log;

const CampaignProblem& disc() {
  static const CampaignProblem problem(small_log(), "(in memory)", CampaignOptions{});
  return problem;
}

const FitResult& fit_of_disc() {
  static const FitResult result = fit(disc());
  return result;
}

/// A fit that knows everything but how sure it is of one unknown.
FitResult sure_but_for(std::size_t unknown, double sigma) {
  FitResult out = fit_of_disc();
  const std::size_t n = out.campaign.size();
  out.covariance.assign(n * n, 0.0);
  out.covariance[unknown * n + unknown] = sigma * sigma;
  for (std::size_t k = 0; k < out.own_spread.size(); ++k) out.own_spread[k] = 1e-9 * disc().own()[k].scale;
  return out;
}

TEST(Evaluate, SigmaIsTheSlopeTimesSigma) {
  for (std::size_t k = 0; k < 2; ++k) {
    const double sigma = 1e-3 * fit_of_disc().campaign[k].value;
    const FitResult centre = sure_but_for(k, sigma);
    FitResult above = centre, below = centre;
    above.campaign[k].value += sigma;
    below.campaign[k].value -= sigma;
    const std::vector<std::size_t> which{0, 7};
    const auto at = predict_some(disc(), centre, which);
    const auto up = predict_some(disc(), above, which), down = predict_some(disc(), below, which);
    for (std::size_t i = 0; i < which.size(); ++i) {
      const auto &a = up[i].comparison.prediction, &b = down[i].comparison.prediction;
      ASSERT_TRUE(at[i].sigma);
      // Differences of predictions at rtol 1e-6 over 2e-3: some 1e-3 of the slope.
      const auto expect = [&](double difference, double claimed, double least) {
        EXPECT_NEAR(0.5 * std::abs(difference), claimed, 0.02 * claimed + least);
      };
      expect(a.landing.pose.x - b.landing.pose.x, at[i].sigma->landing_x, 1e-6);
      expect(a.landing.pose.theta - b.landing.pose.theta, at[i].sigma->landing_theta, 1e-5);
      expect(a.detach.twist.vx - b.detach.twist.vx, at[i].sigma->detach_vx, 1e-6);
      expect(a.detach.twist.omega - b.detach.twist.omega, at[i].sigma->detach_omega, 1e-5);
      EXPECT_GT(at[i].sigma->landing_x, 0);
    }
  }
}

TEST(Evaluate, AFitOfAnotherProblemAndNoAnswerAreRefused) {
  const CampaignProblem quartic = disc().with("limit_surface_quartic", {});
  FitResult none = fit_of_disc();
  none.outcome = FitOutcome::no_start;
  none.covariance.clear();
  const auto refused = [](const CampaignProblem& problem, const FitResult& fit) {
    EXPECT_THROW(predict_throws(problem, fit), std::invalid_argument);
    EXPECT_THROW(card_of(problem, fit), std::invalid_argument);
  };
  refused(quartic, fit_of_disc());
  refused(disc(), {});
  refused(disc(), none);
  FitResult more = fit_of_disc();
  more.own_spread.push_back(1);
  refused(disc(), more);
  EXPECT_THROW(predict_some(disc(), fit_of_disc(), {disc().throws().size()}), std::invalid_argument);
  EXPECT_THROW(disc().predict(disc().throws().front(), {}, {}), std::invalid_argument);
  EXPECT_EQ(none.correlation(0, 1), 0);
  EXPECT_THROW(fit_of_disc().correlation(0, 2), std::out_of_range);
}

// The friction of each throw is the campaign's times 1 + its own deviation, which the next throw's is drawn
// from: what that is worth where it lands is added to the variance.
TEST(Evaluate, OwnSpreadAddsUncertainty) {
  constexpr double kSpread = 0.02, kStep = 1e-3;
  const FitResult sure = sure_but_for(0, 1e-6);
  ASSERT_EQ(disc().own()[2].name, "mu_deviation");
  ASSERT_EQ(sure.campaign[0].unknown.name, "mu");
  FitResult scattered = sure, above = sure, below = sure;
  scattered.own_spread[2] = kSpread;
  above.campaign[0].value *= 1 + kStep;
  below.campaign[0].value *= 1 - kStep;
  for (const std::size_t i : {0, 4, 7}) {
    const auto a = predict_some(disc(), sure, {i}), b = predict_some(disc(), scattered, {i});
    const auto up = predict_some(disc(), above, {i}), down = predict_some(disc(), below, {i});
    ASSERT_TRUE(a[0].sigma && b[0].sigma);
    const auto expect = [&](double difference, double without, double with, double least) {
      const double worth = kSpread * std::abs(difference) / (2 * kStep);
      EXPECT_NEAR(with, std::hypot(without, worth), 0.02 * with + least) << "throw " << i;
      EXPECT_GT(with, 10 * without) << "throw " << i;
    };
    const auto &p = up[0].comparison.prediction, &m = down[0].comparison.prediction;
    expect(p.landing.pose.x - m.landing.pose.x, a[0].sigma->landing_x, b[0].sigma->landing_x, 1e-6);
    expect(p.landing.pose.theta - m.landing.pose.theta, a[0].sigma->landing_theta, b[0].sigma->landing_theta,
           1e-5);
    expect(p.detach.twist.omega - m.detach.twist.omega, a[0].sigma->detach_omega, b[0].sigma->detach_omega,
           1e-5);
  }
}

TEST(Evaluate, TwistErrorsOfTheBaseModelAreThoseOfCompare) {
  const auto throws = predict_throws(disc(), fit_of_disc(), {false, 0});
  for (std::size_t i = 0; i < throws.size(); ++i) {
    const auto& [id, object, condition, split, p, error] = throws[i].comparison;
    const auto& measured = disc().throws()[i].prepared.measured;
    ASSERT_TRUE(error[0] && error[1] && error[2] && error[3]) << id;
    // The slopes differ by the samples between the release and the force's last 3 sigma.
    EXPECT_NEAR(*error[0], p.detach.twist.vx - measured.detach_twist->vx, 1e-3) << id;
    EXPECT_NEAR(*error[1], (p.detach.twist.omega - measured.detach_twist->omega) * experiment::kDegrees, 0.5)
        << id;
    EXPECT_NEAR(*error[2], p.landing.pose.x - *measured.landing_x, 1e-12) << id;
    EXPECT_NEAR(*error[3], (p.landing.pose.theta - *measured.landing_theta) * experiment::kDegrees, 1e-9)
        << id;
  }
}

TEST(Evaluate, CrossValidationLeavesConditionsOut) {
  const auto cv = cross_validate(small_log(), "(in memory)", {}, {}, 2);
  EXPECT_EQ(cv.folds, 2);
  EXPECT_TRUE(cv.failed.empty());
  std::size_t train = 0;
  for (const auto& one : small_log().throws) train += one.split == datasets::Split::train;
  EXPECT_EQ(cv.throws.size(), train);
  for (const auto& one : cv.throws)
    EXPECT_EQ(one.comparison.split, datasets::Split::test) << one.comparison.id;
  EXPECT_LT(cv.statistics(2).mae, 0.01);
  auto single = small_log();
  for (auto& one : single.throws) one.condition = "same";
  EXPECT_EQ(cross_validate(single, "(in memory)", {}, {}, 2).folds, 2) << "of two objects: two experiments";
  std::erase_if(single.throws, [&](const auto& one) { return one.object != single.throws.front().object; });
  EXPECT_THROW(cross_validate(single, "(in memory)", {}, {}, 2), std::invalid_argument);
}

// A change of the campaign's values changes what the samples before the opening say of the throw's own
// unknowns, too: where it lands moves by both.
TEST(Evaluate, SigmaCountsWhatAnotherValueMakesOfTheGrasp) {
  const std::vector<std::size_t> which{0, 4, 7};
  // Of lengths in motion capture: a longer scale is another place in the hand, and another path from there.
  const auto problem = disc().with("limit_surface_disc", {"sensor.length_scale"});
  FitResult centre = fit_of_disc();
  for (std::size_t k = 2; k < problem.campaign().size(); ++k)
    centre.campaign.push_back({problem.campaign()[k], problem.campaign()[k].start, 0, 0, false});
  const std::size_t n = centre.campaign.size(), k = 2;
  const double sigma = 1e-3;
  centre.covariance.assign(n * n, 0.0);
  const auto own_alone = predict_some(problem, centre, which);
  centre.covariance[k * n + k] = sigma * sigma;
  const auto both = predict_some(problem, centre, which);
  FitResult above = centre, below = centre;
  above.campaign[k].value += sigma, below.campaign[k].value -= sigma;
  const auto up = predict_some(problem, above, which), down = predict_some(problem, below, which);
  for (std::size_t i = 0; i < which.size(); ++i) {
    ASSERT_TRUE(both[i].sigma && own_alone[i].sigma);
    const auto worth = [&](double with, double without) {
      return std::sqrt(with * with - without * without);
    };
    const auto &a = up[i].comparison.prediction.landing.pose, &b = down[i].comparison.prediction.landing.pose;
    const double x = worth(both[i].sigma->landing_x, own_alone[i].sigma->landing_x),
                 theta = worth(both[i].sigma->landing_theta, own_alone[i].sigma->landing_theta);
    EXPECT_NEAR(0.5 * std::abs(a.x - b.x), x, 0.03 * x + 2e-6) << i;
    EXPECT_NEAR(0.5 * std::abs(a.theta - b.theta), theta, 0.03 * theta + 2e-5) << i;
  }
}

// Before the detach the object moves with the hand: what the tracker shows there is no part of the twist that
// it leaves with, also where a model is sure that it had left already.
TEST(Evaluate, TwistErrorsAreOfTheFlightAlone) {
  auto log = small_log();
  for (std::size_t k = 0; k < log.throws.size(); ++k) {
    const CampaignThrow& thrown = disc().throws()[k];
    auto& mocap = *log.throws[k].mocap;
    for (std::size_t i = 0; i < mocap.time.rows; ++i)
      if (mocap.time(i) >= thrown.opening && mocap.time(i) < thrown.release)
        mocap.pose(i, 0) += 0.5 * (mocap.time(i) - thrown.opening);
  }
  CampaignOptions options;
  options.model = "gripper_delay";
  const CampaignProblem bent(log, "(in memory)", options), seen(small_log(), "(in memory)", options);
  FitResult early;
  early.outcome = FitOutcome::converged;
  early.campaign.push_back({seen.campaign()[0], 0.03, 0, 0, false});
  const auto as_bent = predict_throws(bent, early, {false, 0}),
             as_seen = predict_throws(seen, early, {false, 0});
  for (std::size_t i = 0; i < as_seen.size(); ++i) {
    const auto& one = as_seen[i].comparison;
    EXPECT_LT(one.prediction.detach.time, disc().throws()[i].release - 0.01);
    EXPECT_EQ(*as_bent[i].comparison.error[0], *one.error[0]) << one.id;
  }
}

// A spread that a fit or a card does not tell is the prior's.
TEST(Evaluate, AnUntoldSpreadIsThePriors) {
  FitResult untold = fit_of_disc(), told = untold;
  for (std::size_t k = 2; k < told.own_spread.size(); ++k)
    told.own_spread[k] = disc().own()[k].prior_sigma.value();
  untold.own_spread.resize(2);
  const auto a = predict_some(disc(), untold, {0}), b = predict_some(disc(), told, {0});
  EXPECT_EQ(a[0].sigma->landing_theta, b[0].sigma->landing_theta);
}

// Nothing was seen of it while it was held: it is as the spread says.
TEST(BeforeRelease, OfAThrowThatNothingWasSeenOfOnlyTheSpreadIsKnown) {
  CampaignThrow blind = disc().throws().front();
  blind.observed.all.clear();
  const auto found = before_release(disc(), blind, fit_of_disc(), DerivativesBy::all);
  for (std::size_t k = 0; k < found.own.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    EXPECT_EQ(found.own[k], 0);
    EXPECT_NEAR(std::sqrt(found.covariance(i, i)) / fit_of_disc().own_spread[k], 1, 1e-12);
  }
}

TEST(Evaluate, ComparisonsCountWhatDidNotLandAndTheMeanTime) {
  auto throws = predict_some(disc(), fit_of_disc(), {0, 1, 2, 3}, {false, 0});
  for (std::size_t i = 0; i < throws.size(); ++i) {
    throws[i].seconds = 1e-6 * static_cast<double>(i);  // 0, 1, 2 and 3 µs
    const auto modes = disc().predict(disc().throws()[i], fit_of_disc().values(), throws[i].own).modes;
    EXPECT_EQ(throws[i].comparison.prediction.events, static_cast<int>(modes.size()));
  }
  const auto all = comparison_of(disc(), fit_of_disc(), throws);
  EXPECT_EQ(all.failed, 0);
  EXPECT_NEAR(all.microseconds_per_throw, 1.5, 1e-12);
  throws[2].comparison.prediction.release = release::ReleaseOutcome::never_separated;
  EXPECT_EQ(comparison_of(disc(), fit_of_disc(), throws).failed, 1);
}

// Where a condition is left out, so are all of its repetitions: what its landings say is not known to the fit
// that predicts them.
TEST(Evaluate, AConditionThatIsLeftOutSaysNothing) {
  const auto conditions = datasets::conditions_of(small_log(), datasets::Split::train);
  auto other = small_log();
  const auto is_of_it = [&](const auto& one) {
    return one.object == conditions.front().first && one.condition == conditions.front().second;
  };
  for (auto& one : other.throws)
    if (is_of_it(one)) one.landing->pose(0, 1) += 0.5;
  const int all = static_cast<int>(conditions.size());
  FitOptions quickly;
  quickly.rounds = 2;
  const auto a = cross_validate(small_log(), "(in memory)", {}, quickly, all + 3),
             b = cross_validate(other, "(in memory)", {}, quickly, all + 3);
  EXPECT_EQ(a.folds, all) << "no more than there are conditions";
  EXPECT_TRUE(a.failed.empty());
  ASSERT_EQ(a.throws.size(), b.throws.size());
  int left_out = 0;
  for (std::size_t i = 0; i < a.throws.size(); ++i) {
    const auto &one = a.throws[i].comparison, &same = b.throws[i].comparison;
    if (!is_of_it(one)) continue;
    EXPECT_EQ(one.prediction.landing.pose.theta, same.prediction.landing.pose.theta) << one.id;
    ++left_out;
  }
  EXPECT_GT(left_out, 1);
}

// Which force the patch's radius is of would be another one for every reader's guess.
TEST(Card, ASoftPatchWithoutItsForceIsRefused) {
  auto card = card_of(disc(), fit_of_disc());
  card.effects = {"contact.soft_patch_radius"};
  card.parameters["contact.soft_patch_radius.gamma"] = {0.3, {}, "-"};
  EXPECT_NO_THROW(options_of(card, "card.json"));
  card.parameters.erase("reference_force");
  EXPECT_THROW(options_of(card, "card.json"), datasets::CardError);
}

TEST(Card, RoundTripIsExact) {
  auto card = card_of(disc(), fit_of_disc());
  card.log = {"campaign.h5", "a campaign", "fnv1a64:0123456789abcdef"};
  card.library_version = "0.1.0";
  const auto throws = predict_throws(disc(), fit_of_disc(), {true, 0});
  card.errors["train"] = errors_of(comparison_of(disc(), fit_of_disc(), throws), datasets::Split::train);
  const auto back = datasets::parse_model_card(datasets::to_json(card));
  EXPECT_EQ(back, card);

  const CampaignProblem problem(small_log(), "(in memory)", options_of(back, "card.json"));
  const auto again = fit_of(back, problem, "card.json");
  EXPECT_EQ(again.values(), fit_of_disc().values());
  EXPECT_EQ(again.covariance, fit_of_disc().covariance);
  EXPECT_EQ(again.own_spread, fit_of_disc().own_spread);
  for (std::size_t k = 0; k < again.campaign.size(); ++k) {
    const FittedUnknown &is = again.campaign[k], &was = fit_of_disc().campaign[k];
    EXPECT_EQ(is.sigma, was.sigma) << was.unknown.name;
    EXPECT_EQ(is.interval95(), was.interval95()) << was.unknown.name;
    EXPECT_EQ(is.interval_freedom(), was.interval_freedom()) << was.unknown.name;
    EXPECT_EQ(is_determined(again, k), is_determined(fit_of_disc(), k)) << was.unknown.name;
  }
  const auto predicted = predict_some(problem, again, {3});
  EXPECT_EQ(predicted[0].comparison.prediction.landing.pose.x,
            throws[3].comparison.prediction.landing.pose.x);
  EXPECT_EQ(predicted[0].sigma->landing_x, throws[3].sigma->landing_x);
}

TEST(Card, SaysWhichThrowsItIsOf) {
  FitOptions options;
  options.share = Share::test;
  const auto test = card_of(disc(), fit(disc(), options)), train = card_of(disc(), fit_of_disc());
  EXPECT_EQ(train.split, "train");
  EXPECT_EQ(test.split, "test");
  EXPECT_EQ(test.library_version, datasets::library_version());
  EXPECT_NE(train.valid_range.at("detach_omega").low, test.valid_range.at("detach_omega").low);
}

TEST(Card, HoldsEffectsAndRefusesUnknownOnes) {
  const auto problem = disc().with("limit_surface_disc", {"sensor.length_scale"});
  FitResult made = fit_of_disc();
  made.campaign.clear();
  for (const auto& u : problem.campaign())
    made.campaign.push_back({u, u.start, 0.1 * u.scale, 0.1 * u.scale, false});
  made.covariance.assign(made.campaign.size() * made.campaign.size(), 0.0);
  auto card = card_of(problem, made);
  card.log.file = "campaign.h5";
  card.library_version = "0.1.0";
  const auto options = options_of(card, "card.json");
  EXPECT_THAT(options.effects, testing::ElementsAre("sensor.length_scale"));
  const CampaignProblem again(small_log(), "(in memory)", options);
  EXPECT_EQ(fit_of(card, again, "card.json").values(), made.values());

  const auto refusal = [](const datasets::ModelCard& bad) {
    return unhand::support::refusal<datasets::CardError>([&] { options_of(bad, "card.json"); });
  };
  auto bad = card;
  bad.effects.push_back("flight.sorcery");
  EXPECT_THAT(refusal(bad), HasSubstr("card.json: /effects/1: effect \"flight.sorcery\" is unknown"));
  bad = card;
  bad.model = "wishful";
  EXPECT_THAT(refusal(bad), HasSubstr("/model"));
  bad = card;
  bad.effects.clear();
  EXPECT_THAT(refusal(bad), HasSubstr("is no parameter of"));
  bad = card;
  bad.parameters["mu"].unit = "N";
  EXPECT_THAT(refusal(bad), HasSubstr("/parameters/mu/unit"));
  bad = card;
  bad.parameters.erase("mu");
  EXPECT_THROW(fit_of(bad, again, "card.json"), datasets::CardError);
}

TEST(Card, KnowsWhereItHasBeenTried) {
  const auto card = card_of(disc(), fit_of_disc());
  for (const char* name : {"mass", "com_offset", "release_speed", "release_omega", "grip_force",
                           "opening_time", "detach_speed", "detach_omega"})
    EXPECT_TRUE(card.valid_range.contains(name)) << name;
  for (const auto& t : disc().throws())
    if (t.prepared.split == datasets::Split::train) {
      EXPECT_TRUE(outside_range(card, t.prepared).empty());
    }
  auto far = disc().throws()[0].prepared;
  far.body.mass *= 3;
  EXPECT_THAT(reasons_of(outside_range(card, far)), testing::ElementsAre(HasSubstr("mass")));
  far.body.mass = (1 + 0.9 * kRangeMargin) * card.valid_range.at("mass").high;
  EXPECT_THAT(outside_range(card, far), testing::IsEmpty());
  far.body.mass = (1 + 1.1 * kRangeMargin) * card.valid_range.at("mass").high;
  EXPECT_THAT(reasons_of(outside_range(card, far)), testing::ElementsAre(HasSubstr("mass")));
}

// All throws of a log alike make a range without width: as wide as the throws themselves scatter.
TEST(Card, ARangeWithoutWidthIsNoEquality) {
  auto card = card_of(disc(), fit_of_disc());
  auto thrown = disc().throws()[0].prepared;
  const auto outside = [&](double com_offset) {
    thrown.grasp.com_offset = com_offset;
    return !outside_range(card, thrown).empty();
  };
  card.valid_range = {{"com_offset", {0, 0, "m"}}};
  card.own_spreads.erase("grasp_offset");
  EXPECT_FALSE(outside(0.9e-3));
  EXPECT_TRUE(outside(1.1e-3));
  card.own_spreads["grasp_offset"] = {2e-3, "m"};
  EXPECT_FALSE(outside(5.9e-3));
  EXPECT_TRUE(outside(-6.1e-3));
  EXPECT_THAT(reasons_of(outside_range(card, thrown)),
              testing::ElementsAre(HasSubstr("com_offset is -0.0061 m; the card was fitted at 0 m alone")));
}

// What a card tells of its parameters is what predictions are made with, whatever of it there is.
TEST(Card, EveryNumberOfItIsReadBack) {
  auto card = card_of(disc(), fit_of_disc());
  card.parameters["pads"].value = 3;
  card.parameters["reference_force"].value = 33;
  const auto options = options_of(card, "card.json");
  EXPECT_EQ(options.pads, 3);
  EXPECT_EQ(options.reference_force, 33);
  EXPECT_TRUE(options.predict_only);

  card.covariance.reset();
  auto &mu = card.parameters["mu"], &length = card.parameters["length"];
  mu.sigma = 0.02, mu.degrees_of_freedom = 7.3, mu.interval95 = {{0.4, HUGE_VAL}};
  length.sigma.reset(), length.determined = false, length.degrees_of_freedom.reset();
  card.own_spreads["mu_deviation"].sigma = 0;
  const auto one = fit_of(card, disc(), "card.json");
  EXPECT_EQ(one.campaign[0].degrees_of_freedom, 7.3);
  EXPECT_EQ(one.campaign[0].interval95(), (std::array<double, 2>{0.4, HUGE_VAL}));
  EXPECT_EQ(one.campaign[0].data_sigma, 0.02);
  EXPECT_EQ(one.covariance, (std::vector<double>{0.02 * 0.02, 0, 0, 0})) << "variances are sigmas' squares";
  EXPECT_TRUE(std::isinf(one.campaign[1].sigma) && std::isinf(one.campaign[1].data_sigma));
  EXPECT_FALSE(is_determined(one, 1));
  EXPECT_GT(one.own_spread[2], 0) << "a prior has a width";
  length.determined = true;  // known, and nobody says how well
  EXPECT_EQ(fit_of(card, disc(), "card.json").campaign[1].sigma, 0);
  length.sigma = 1e-4, length.determined = false;  // what was known before the log
  EXPECT_EQ(fit_of(card, disc(), "card.json").campaign[1].sigma, 1e-4);
  EXPECT_TRUE(std::isinf(fit_of(card, disc(), "card.json").campaign[1].data_sigma));
}

TEST(Card, NumbersThatMeanNothingAreRefusedByName) {
  const auto card = card_of(disc(), fit_of_disc());
  const auto refusal = [&](auto&& change) {
    auto bad = card;
    change(bad);
    return unhand::support::refusal<datasets::CardError>([&] {
      options_of(bad, "card.json");
      fit_of(bad, disc(), "card.json");
    });
  };
  EXPECT_THAT(refusal([](auto& c) { c.parameters["pads"].value = 2.5; }),
              HasSubstr("/parameters/pads/value"));
  EXPECT_THAT(refusal([](auto& c) { c.parameters["length"].value = 5; }),
              HasSubstr("/parameters/length/value"));
  EXPECT_THAT(refusal([](auto& c) { c.own_spreads["mu_deviation"].unit = "N"; }),
              HasSubstr("/own_spreads/mu_deviation/unit"));
}

// What was held is known as it was given; sigmas that allow for few throws already are as of many.
TEST(Card, TellsOfWhatWasHeldAndOfSigmasThatAllowForFew) {
  FitResult made = fit_of_disc();
  made.campaign[1].sigma = 0;
  made.covariance = {made.covariance[0], 0, 0, 0};
  made.campaign[0].allows_for_few = true;
  const auto card = card_of(disc(), made);
  ASSERT_TRUE(card.covariance);
  EXPECT_THAT(card.covariance->names, testing::ElementsAre("mu"));
  EXPECT_THAT(card.covariance->matrix, testing::ElementsAre(made.covariance[0]));
  EXPECT_EQ(card.parameters.at("length").sigma, 0);
  EXPECT_EQ(card.parameters.at("mu").degrees_of_freedom, kCertain);
  EXPECT_EQ(card_of(disc(), fit_of_disc()).parameters.at("mu").degrees_of_freedom,
            fit_of_disc().campaign[0].degrees_of_freedom);
}

// Friction's spread is a share: the pads of a throw may hold as if they pressed by three of it more.
TEST(Card, AGripBeyondItsRangeIsTriedAsFarAsFrictionScatters) {
  auto card = card_of(disc(), fit_of_disc());
  card.valid_range = {{"grip_force", {20, 20, "N"}}};
  card.own_spreads["mu_deviation"] = {0.1, "-"};
  const auto outside = [&](double force) {
    return !outside_range(card, {{"grip_force", "N", force}}).empty();
  };
  EXPECT_FALSE(outside(20 + 0.99 * 3 * 0.1 * 20));
  EXPECT_TRUE(outside(20 + 1.01 * 3 * 0.1 * 20));
  EXPECT_TRUE(outside(20 - 1.01 * 3 * 0.1 * 20));
}

// One that always falls short has a bias of the other sign than its mean absolute error.
TEST(Card, ErrorsAreTheStatisticsOfTheirSplit) {
  experiment::ModelComparison model;
  for (const double error : {-0.01, -0.03, 0.4}) {
    model.throws.emplace_back();
    model.throws.back().split = error < 0 ? datasets::Split::test : datasets::Split::train;
    model.throws.back().error[2] = error;
  }
  const auto errors = errors_of(model, datasets::Split::test);
  ASSERT_EQ(errors.size(), 1u);
  const auto& landing = errors.at(experiment::kQuantities[2].key);
  EXPECT_EQ(landing.n, 2);
  EXPECT_NEAR(landing.mae, 0.02, 1e-15);
  EXPECT_NEAR(landing.bias, -0.02, 1e-15);
}

// A hand that turns the other way does what no throw of the card did.
TEST(Card, TheHandsTurnHasASign) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.postures[0].omega = -2;
  const CampaignProblem back(experiment::generate_campaign(design, 5), "(in memory)", CampaignOptions{});
  const auto card = card_of(disc(), fit_of_disc());
  std::set<std::string> untried;
  for (const auto& one : outside_range(card, back.throws().front().prepared)) untried.insert(one.condition);
  EXPECT_TRUE(untried.contains("release_omega"));
  for (const auto& is : conditions_of(back.throws().front().prepared))
    if (is.name == "release_omega") {
      EXPECT_NEAR(is.value, design.postures[0].omega, 0.3);
    }
}

TEST(Card, ChecksumIsTheDocumentedOne) {
  const unhand::support::Scratch scratch;
  const std::string file = scratch / "foobar";
  std::ofstream(file) << "foobar";
  EXPECT_EQ(checksum_of(file), "fnv1a64:85944171f73967e8");  // the test vector of FNV's authors
  EXPECT_FALSE(checksum_of(scratch / "none"));
}

TEST(Advice, NamesWhatWouldFixIt) {
  auto log = small_log();
  for (auto& one : log.throws) {
    one.ft.reset();
    one.detach_time = 0.1;
  }
  const CampaignProblem problem(log, "(in memory)", CampaignOptions{});
  OpenDirection open;
  open.direction.assign(problem.campaign().size(), 0.0);
  for (std::size_t k = 0; k < open.direction.size(); ++k)
    if (problem.campaign()[k].name == "mu" || problem.campaign()[k].name == "grip_force")
      open.direction[k] = 0.7;
  EXPECT_THAT(remedy(problem, open), HasSubstr("normal force"));
  FitResult made = fit_of_disc();
  made.covariance = {1, 0.95, 0.95, 1};
  const auto pairs = strong_correlations(made);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].first, "mu");
  EXPECT_NEAR(pairs[0].value, 0.95, 1e-15);
}

TEST(Advice, IntervalsAreStudents) {
  for (const auto& [n, factor] : {std::pair{0.5, 12.7062},
                                  {1.0, 12.7062},
                                  {2.0, 4.3027},
                                  {3.0, 3.1824},
                                  {10.0, 2.2281},
                                  {100.0, 1.9840},
                                  {1e9, kNormal95}})
    EXPECT_NEAR(student_factor(n), factor, 6e-5) << n;  // tables of t
}

}  // namespace
}  // namespace unhand::fitting
