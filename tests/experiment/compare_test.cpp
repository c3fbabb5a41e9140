// What a comparison says in numbers: its statistics by hand, its scatter of repetitions by the pooled
// variance, and the parameters that it takes from a log against those that made it.
#include "experiment/compare.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "contact/contact_model.hpp"
#include "contact/patch.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using testing::HasSubstr, testing::ThrowsMessage;

using namespace unhand;
using namespace unhand::experiment;
using datasets::Split;
using testing_support::kSeed;

TEST(ErrorStatistics, OfThreeErrorsByHand) {
  const auto three = statistics_of({1, -2, 3});
  EXPECT_EQ(three.n, 3);
  EXPECT_NEAR(three.mae, 2, 1e-15);         // rounding
  EXPECT_NEAR(three.bias, 2.0 / 3, 1e-15);  // of the errors with their signs
  EXPECT_NEAR(three.std, 1, 1e-15);         // of 1, 2, 3, with n − 1
  const auto one = statistics_of({-4});
  EXPECT_EQ(one.n, 1);
  EXPECT_EQ(one.mae, 4);
  EXPECT_EQ(one.bias, -4);
  EXPECT_EQ(one.std, 0);
  EXPECT_EQ(statistics_of({}).n, 0);
}

/// A campaign of perfect sensors with what made its throws.
struct Known {
  datasets::ThrowLog log;
  std::vector<PreparedThrow> prepared;
  std::vector<ThrowTruth> truth;

  explicit Known(const CampaignDesign& design) : log(campaign_header(design, kSeed)) {
    for (int i = 0; i < design.throws(); ++i) {
      auto made = generate_throw(design, kSeed, i);
      log.throws.push_back(std::move(made.record));
      truth.push_back(std::move(made.truth));
    }
    prepared = prepare_all(log, "(in memory)", 1);
  }
  /// The mean of a number of each training throw.
  template <class Of>
  double train_mean(Of&& of) const {
    double sum = 0;
    int n = 0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      if (log.throws[i].split == Split::train) sum += of(i), ++n;
    return sum / n;
  }
};

TEST(RepetitionScatter, PoolsTheVarianceOfTheConditions) {
  const Known known(testing_support::perfect());
  const PreparedThrow& any = known.prepared.front();
  std::vector<PreparedThrow> throws;
  const auto lands = [&](const char* object, const char* condition, double x, double theta) {
    throws.push_back(any);
    throws.back().object = object, throws.back().condition = condition;
    throws.back().measured.landing_x = x, throws.back().measured.landing_theta = theta;
  };
  lands("bar", "slow", 1, 0.1);  // squares about the mean: 2, of one degree of freedom
  lands("bar", "slow", 3, 0.3);
  lands("bar", "fast", 1, 0.4);  // 14, of two
  lands("bar", "fast", 2, 0.5);
  lands("bar", "fast", 6, 0.9);
  lands("box", "fast", 100, 9);  // another object's, alone
  throws.push_back(any);         // not seen to land
  throws.back().object = "bar", throws.back().condition = "slow";
  throws.back().measured.landing_x.reset(), throws.back().measured.landing_theta.reset();
  const auto scatter = compare(known.log, throws, {}).repetitions;
  EXPECT_EQ(scatter.conditions, 2);
  EXPECT_NEAR(scatter.landing_x.value(), std::sqrt(16.0 / 3), 1e-14);  // rounding
  EXPECT_NEAR(scatter.landing_theta.value(), 0.1 * std::sqrt(16.0 / 3) * 180 / M_PI, 1e-13);
  for (auto& one : throws) one.measured.landing_theta.reset();  // by a ruler
  const auto ruler = compare(known.log, throws, {}).repetitions;
  EXPECT_EQ(ruler.landing_x, scatter.landing_x);
  EXPECT_FALSE(ruler.landing_theta);
}

// Two objects may be thrown under conditions of one name; each has its own errors.
TEST(Conditions, OfTwoObjectsAreNotPooled) {
  const Known known(testing_support::perfect());
  std::vector<PreparedThrow> throws;
  const auto misses = [&](const char* object, const char* condition, double by) {
    throws.push_back(known.prepared.front());
    throws.back().object = object, throws.back().condition = condition;
    throws.back().measured.landing_x = *throws.back().measured.landing_x + by;
  };
  misses("bar", "slow", 0);
  misses("bar", "fast", 0);
  misses("box", "fast", 0.5);
  CompareOptions options;
  options.models = {"gripper_delay"};
  options.parameters["gripper_delay"] = {};
  const Comparison out = compare(known.log, throws, options);
  ASSERT_EQ(out.conditions.size(), 3u);
  EXPECT_EQ(out.conditions[0].label, "slow");
  EXPECT_EQ(out.conditions[1].label, "bar, fast");
  EXPECT_EQ(out.conditions[2].label, "box, fast");
  constexpr int kLandingX = 2;  // of kQuantities
  const auto& model = out.models.front();
  const auto bar = model.of_condition(kLandingX, out.conditions[1]),
             box = model.of_condition(kLandingX, out.conditions[2]);
  EXPECT_EQ(bar.n, 1);
  EXPECT_EQ(box.n, 1);
  EXPECT_NEAR(box.bias - bar.bias, -0.5, 1e-12);  // predicted less measured
}

TEST(Judge, ErrorsArePredictedLessMeasuredInDegrees) {
  PreparedThrow prepared = Known(testing_support::perfect()).prepared.front();
  prepared.measured.detach_twist = dynamics::Twist<double>{1.5, 0.3, 4};
  prepared.measured.landing_x = 1.2, prepared.measured.landing_theta = 2;
  Prediction prediction;
  prediction.release = release::ReleaseOutcome::detached;
  prediction.detach.twist = {1.4, 0, 4.5};
  prediction.landing.pose = {1.3, 0, 1.9};
  EXPECT_FALSE(judge(prepared, prediction).error[2]) << "it does not land";
  prediction.flight = flight::FlightOutcome::landed;
  const auto judged = judge(prepared, prediction);
  constexpr double kDegree = 180 / 3.14159265358979;
  EXPECT_NEAR(*judged.error[0], -0.1, 1e-12);
  EXPECT_NEAR(*judged.error[1], 0.5 * kDegree, 1e-9);
  EXPECT_NEAR(*judged.error[2], 0.1, 1e-12);
  EXPECT_NEAR(*judged.error[3], -0.1 * kDegree, 1e-9);
}

TEST(Compare, CountsTheThrowsThatTheModelDoesNotLand) {
  Known known(testing_support::perfect());
  CompareOptions options;
  options.models = {"gripper_delay"};
  options.parameters["gripper_delay"] = {};
  EXPECT_EQ(compare(known.log, known.prepared, options).models.front().failed, 0);
  known.prepared[1].landing_height = known.prepared[4].landing_height = 1e3;
  EXPECT_EQ(compare(known.log, known.prepared, options).models.front().failed, 2);
}

TEST(FrictionEstimate, KnowsNothingOfTheTestThrows) {
  Known known(testing_support::perfect());
  const auto before = estimate_friction(known.log, known.prepared, "limit_surface_disc");
  int held_out = 0;
  for (auto& one : known.log.throws)
    if (one.split == datasets::Split::test) {
      for (double& x : one.ft->wrench.data) x *= 2;
      ++held_out;
    }
  ASSERT_GT(held_out, 0);
  const auto after = estimate_friction(known.log, known.prepared, "limit_surface_disc");
  EXPECT_EQ(after.parameters.mu, before.parameters.mu);
  EXPECT_EQ(after.samples, before.samples);
}

TEST(FrictionEstimate, OfOneWrenchDirectionIsNoPatch) {
  FrictionEstimate estimate;
  estimate.samples = 24;
  EXPECT_NO_THROW(require_patch(estimate, "limit_surface"));
  estimate.parameters.length = 4e10;  // all torque and no force
  EXPECT_NO_THROW(require_patch(estimate, "gripper_delay")) << "which has no pads";
  EXPECT_THAT([&] { require_patch(estimate, "limit_surface"); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("does not determine the length")));
}

TEST(FrictionEstimate, OfTheTrueLawIsTheTrueFriction) {
  for (const double variation : {0.0, 0.02}) {
    CampaignDesign design = testing_support::perfect();
    design.variation.mu = variation;
    const Known known(design);
    const auto found = estimate_friction(known.log, known.prepared, "limit_surface_disc").parameters;
    const double mu = known.train_mean([&](std::size_t i) { return known.truth[i].patch.mu; });
    // One friction: every slipping wrench lies on its surface, but for the smoothed normal force. Where every
    // throw has its own, they do not say their mean with equal weights: as far off as they differ, and μ and
    // L the other way round.
    EXPECT_NEAR(found.mu / mu, 1, variation > 0 ? 0.03 : 1e-4) << variation;
    EXPECT_NEAR(found.length / design.patch.length(), 1, variation > 0 ? 0.05 : 1e-4) << variation;
    EXPECT_EQ(found.pads, design.patch.pads);
  }
}

// Objects held near their centre of mass stick until almost nothing presses; their samples lie far inside the
// surface. Once half of all samples on the last fifth of the grip did so, which made L three times too long.
TEST(FrictionEstimate, ObjectsThatStickLongDoNotCount) {
  for (const std::uint64_t seed : {21u, 22u, 52u}) {
    const CampaignDesign design = random_campaign(seed);
    const Known known(design);
    for (const char* model : {"limit_surface_disc", "limit_surface_quartic", "limit_surface"}) {
      const auto found = estimate_friction(known.log, known.prepared, model);
      EXPECT_NO_THROW(require_patch(found, model)) << seed;
      // The ellipsoid is another surface than the disc that made the throws: μ and L differ, by less than
      // the two surfaces do.
      EXPECT_NEAR(found.parameters.mu / design.patch.mu, 1, 0.15) << seed << model;
      EXPECT_NEAR(found.parameters.length / design.patch.length(), 1, 0.15) << seed << model;
    }
  }
}

TEST(FrictionEstimate, NothingThatSlipsDeterminesNothing) {
  Known known(testing_support::perfect());
  for (std::size_t i = 0; i < known.log.throws.size(); ++i) {
    auto& ft = *known.log.throws[i].ft;  // what the pads would carry if they held to the end
    const PreparedThrow& p = known.prepared[i];
    for (std::size_t k = 0; k < ft.time.rows; ++k) {
      contact::Scene<double> scene;
      const double t = std::clamp(ft.time(k), p.hand.begin(), p.hand.end());
      const auto hand = p.hand.at({p.hand.begin(), p.hand.end()}, t);
      scene.hand = hand.pose, scene.hand_twist = hand.twist, scene.hand_acceleration = hand.acceleration;
      scene.body = p.body, scene.gravity = p.gravity;
      const auto wrench = contact::sticking_wrench(
          scene, contact::Relative<double>{{p.grasp.com_offset, 0}, p.grasp.angle, {}, 0});
      const auto force = dynamics::rotate(-hand.pose.theta, wrench.force());
      ft.wrench(k, 0) = force.x / 2, ft.wrench(k, 1) = force.z / 2, ft.wrench(k, 2) = wrench.tau / 2;
    }
  }
  EXPECT_THAT([&] { estimate_friction(known.log, known.prepared, "limit_surface_disc"); },
              ThrowsMessage<std::invalid_argument>(HasSubstr("--fit")));
}

TEST(FrictionEstimate, OfADoubtfulPatchPointsToTheFit) {
  const auto expect_refused = [](const FrictionEstimate& estimate, const char* why) {
    EXPECT_THAT([&] { require_patch(estimate, "limit_surface"); },
                ThrowsMessage<std::invalid_argument>(testing::AllOf(HasSubstr(why), HasSubstr("--fit"))));
  };
  FrictionEstimate good;
  good.pad_radius = 0.0105, good.scatter = 0.03, good.mu_sigma = good.length_sigma = 0.01;
  EXPECT_NO_THROW(require_patch(good, "limit_surface"));
  FrictionEstimate bad = good;
  bad.scatter = 0.5;
  expect_refused(bad, "scatter by 50 %");
  bad = good, bad.parameters.length = 0.03;
  expect_refused(bad, "more than a pad of the declared radius");
  bad.pad_radius.reset();
  EXPECT_NO_THROW(require_patch(bad, "limit_surface")) << "nothing is declared";
  bad = good, bad.length_sigma = 0.3;
  expect_refused(bad, "uncertain by 30 %");
}

TEST(FrictionEstimate, OfASlidingPivotKnowsThatItsLimitsAreApart) {
  CampaignDesign design = testing_support::perfect();
  design.contact_model = "sliding_pivot";
  design.variation.mu = 0;
  const Known known(design);
  const auto found = estimate_friction(known.log, known.prepared, "sliding_pivot").parameters;
  EXPECT_NEAR(found.mu / design.patch.mu, 1, 1e-4);
  EXPECT_NEAR(found.length / design.patch.length(), 1, 1e-4);
}

// Pads that obey the sliding pivot turn at their limit of torque under any force below its own limit. A disc
// can only follow with a μ without end; the declared radius gives it one.
TEST(FrictionEstimate, OfPadsThatObeyAnotherLawTakesTheDeclaredRadius) {
  CampaignDesign design = campaign_design("quick12");
  design.release_accelerations = {3, -4, -9, -14};
  design.contact_model = "sliding_pivot";
  Known known(design);
  const auto found = estimate_friction(known.log, known.prepared, "limit_surface_disc");
  EXPECT_NO_THROW(require_patch(found, "limit_surface_disc"));
  EXPECT_NEAR(found.parameters.length, contact::kUniformDisc * *known.log.gripper->pad_radius, 1e-15);
  EXPECT_NEAR(found.parameters.mu / design.patch.mu, 1, 0.25) << "force and torque share what they had apart";
  EXPECT_NE(found.method.find("pad_radius"), std::string::npos) << found.method;
  known.log.gripper->pad_radius.reset();
  EXPECT_THROW(
      require_patch(estimate_friction(known.log, known.prepared, "limit_surface_disc"), "limit_surface_disc"),
      std::invalid_argument);
}

TEST(FrictionEstimate, OfADelayIsTheMeanFromTheCommandToTheDetach) {
  const CampaignDesign design = testing_support::perfect();
  const Known known(design);
  const auto found = estimate_friction(known.log, known.prepared, contact::kGripperDelay).parameters.delay;
  const auto delay = [&](std::size_t i) { return known.truth[i].detach_time - design.opening.open_command; };
  const double mean = known.train_mean(delay);
  const double square = known.train_mean([&](std::size_t i) { return std::pow(delay(i) - mean, 2); });
  // The ramp of a force without noise ends where its samples say: to a thousandth of their distance.
  EXPECT_NEAR(found.centre, mean, 1e-6);
  const auto n = static_cast<double>(
      std::count_if(known.log.throws.begin(), known.log.throws.end(),
                    [](const datasets::Throw& one) { return one.split == datasets::Split::train; }));
  EXPECT_NEAR(found.spread, std::sqrt(square * n / (n - 1)), 1e-6) << "their mean was estimated, too";
  EXPECT_GT(square, 1e-8) << "else the mean is any throw's";
}

}  // namespace
