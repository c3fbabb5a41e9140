// Predictions with their uncertainty, cards and what they vouch for, advice.
#include "fitting/evaluate.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

#include "fitting/advice.hpp"
#include "fitting/card.hpp"
#include "fitting/distributions.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using testing::HasSubstr;

const datasets::ThrowLog& log_of_disc() {
  static const auto log =
      experiment::generate_campaign(testing_support::small_design("limit_surface_disc"), 5);
  return log;
}

const CampaignProblem& disc() {
  static const CampaignProblem problem(log_of_disc(), "(in memory)", CampaignOptions{});
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
  }
}

TEST(Evaluate, CrossValidationLeavesConditionsOut) {
  const auto cv = cross_validate(log_of_disc(), "(in memory)", {}, {}, 2);
  EXPECT_EQ(cv.folds, 2);
  EXPECT_TRUE(cv.failed.empty());
  std::size_t train = 0;
  for (const auto& one : log_of_disc().throws) train += one.split == datasets::Split::train;
  EXPECT_EQ(cv.throws.size(), train);
  for (const auto& one : cv.throws)
    EXPECT_EQ(one.comparison.split, datasets::Split::test) << one.comparison.id;
  EXPECT_LT(cv.statistics(2).mae, 0.01);
  auto single = log_of_disc();
  for (auto& one : single.throws) one.condition = "same";
  EXPECT_EQ(cross_validate(single, "(in memory)", {}, {}, 2).folds, 2) << "of two objects: two experiments";
  std::erase_if(single.throws, [&](const auto& one) { return one.object != single.throws.front().object; });
  EXPECT_THROW(cross_validate(single, "(in memory)", {}, {}, 2), std::invalid_argument);
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

  const CampaignProblem problem(log_of_disc(), "(in memory)", options_of(back, "card.json"));
  const auto again = fit_of(back, problem, "card.json");
  EXPECT_EQ(again.values(), fit_of_disc().values());
  EXPECT_EQ(again.covariance, fit_of_disc().covariance);
  EXPECT_EQ(again.own_spread, fit_of_disc().own_spread);
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
  const CampaignProblem again(log_of_disc(), "(in memory)", options);
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

TEST(Card, ChecksumIsTheDocumentedOne) {
  const unhand::support::Scratch scratch;
  const std::string file = scratch / "foobar";
  std::ofstream(file) << "foobar";
  EXPECT_EQ(checksum_of(file), "fnv1a64:85944171f73967e8");  // the test vector of FNV's authors
  EXPECT_FALSE(checksum_of(scratch / "none"));
}

TEST(Advice, NamesWhatWouldFixIt) {
  auto log = log_of_disc();
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
