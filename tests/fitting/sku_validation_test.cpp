// Whether an object that nobody has thrown can be: derivatives, Monte Carlo, and what is assumed.
#include "fitting/sku/sku_validation.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include "experiment/outcome_slopes.hpp"
#include "experiment/reference_throw.hpp"
#include "fitting/card.hpp"
#include "tests/support/scratch.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// The bar of the synthetic campaigns, as its SKU file would tell it.
datasets::Sku bar(double com_offset = 0.10) {
  const auto truth = experiment::loaded_bar("bar-com100", com_offset);
  datasets::Sku sku;
  sku.name = truth.name;
  sku.mass = truth.body.mass;
  sku.mass_sigma = 1e-3;
  sku.inertia = truth.body.inertia;
  sku.inertia_sigma = 0.01 * truth.body.inertia;
  sku.com_offset = com_offset;
  sku.com_offset_sigma = 1e-3;
  sku.surface = "printed plastic";
  return sku;
}

/// A gripper as `unhand fit` knows one.
datasets::ModelCard card() {
  datasets::ModelCard out;
  out.model = "limit_surface_disc";
  out.parameters = {{"mu", {0.5, 0.005, "-"}}, {"length", {7e-3, 7e-5, "m"}}, {"pads", {2, {}, "-"}}};
  out.covariance = {{"length", "mu"}, {4.9e-9, -2.1e-7, -2.1e-7, 2.5e-5}};
  out.own_spreads = {{"mu_deviation", {0.01, "-"}}, {"grasp_angle", {0.01, "rad"}}};
  out.log.title = "a test's";
  return out;
}

SkuRequest quick(int samples = 400) {
  SkuRequest request;
  request.samples = samples;
  return request;
}

TEST(SkuValidation, DerivativesAreTheCentralDifferenceInEveryInput) {
  const auto sku = bar();
  const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku));
  const auto inputs = throw_inputs(sku, card(), "card.json", thrown);
  const Eigen::MatrixXd slopes =
      experiment::outcome_slopes(thrown, inputs.model, inputs.names, inputs.values).value() * inputs.mixing();
  ASSERT_EQ(slopes.cols(), static_cast<Eigen::Index>(inputs.inputs.size()));
  // A tighter integration than the model's for the differences: its noise over the step is their error.
  auto model = inputs.model;
  model.integrator.tolerances = {1e-11, 1e-13};
  for (Eigen::Index k = 0; k < slopes.cols(); ++k) {
    double best = HUGE_VAL;
    for (const double share : {1e-1, 1e-2, 1e-3}) {
      Eigen::VectorXd by = Eigen::VectorXd::Zero(slopes.cols());
      by[k] = share * inputs.inputs[static_cast<std::size_t>(k)].sigma;
      const auto landing = [&](const Eigen::VectorXd& moved) {
        const auto values = inputs.moved(moved);
        return experiment::predict_channels(thrown, {}, model, dynamics::Values<double>(inputs.names, values))
            .landing.pose;
      };
      const auto up = landing(by), down = landing(-by);
      const double x = (up.x - down.x) / (2 * by[k]), theta = (up.theta - down.theta) / (2 * by[k]);
      best = std::min(best, std::hypot((x - slopes(experiment::kLandingX, k)) / std::abs(x),
                                       (theta - slopes(experiment::kLandingTheta, k)) / std::abs(theta)));
    }
    // The derivatives run at the card's tolerance, 1e-6, which slip that creeps amplifies.
    EXPECT_LT(best, 2e-3) << inputs.inputs[static_cast<std::size_t>(k)].name;
  }
}

TEST(SkuValidation, MonteCarloAndDerivativesAgreeOnAPreciseObject) {
  const auto answer = validate_sku(bar(), card(), "card.json", quick(1000));
  EXPECT_TRUE(answer.agree) << answer.disagreement;
  EXPECT_EQ(answer.lost, 0);
  // Of the same inputs, 1000 draws: a sigma is known to 1/√2000 = 2.2 %; five of these.
  EXPECT_NEAR(answer.monte_carlo.x / answer.linear.x, 1, 0.11);
  EXPECT_NEAR(answer.monte_carlo.theta / answer.linear.theta, 1, 0.11);
  EXPECT_EQ(answer.verdict, SkuVerdict::throwable) << answer.message;
}

TEST(SkuValidation, SaysWhereItsDrawsCannotTellTheShareFromWhatIsAsked) {
  auto request = quick(1000);
  request.tolerance.x = 1.5 * validate_sku(bar(), card(), "card.json", request).monte_carlo.x;
  const double share = validate_sku(bar(), card(), "card.json", request).within;
  ASSERT_GT(share, 0.6);
  ASSERT_LT(share, 0.95);
  const auto asked = [&](double confidence) {
    request.confidence = confidence;
    return validate_sku(bar(), card(), "card.json", request).message;
  };
  const double sigma = std::sqrt(share * (1 - share) / 1000);
  EXPECT_THAT(asked(share + sigma), HasSubstr("hardly tell"));
  EXPECT_THAT(asked(share + 3 * sigma), Not(HasSubstr("hardly tell")));
}

TEST(SkuValidation, SaysWhereTheyDoNotAgree) {
  auto sku = bar();
  sku.com_offset_sigma = 0.04;  // the object may hang from the pads or hardly load them
  const auto answer = validate_sku(sku, card(), "card.json", quick());
  EXPECT_FALSE(answer.agree);
  EXPECT_THAT(answer.disagreement, HasSubstr("com_offset"));
  EXPECT_EQ(answer.budget.front().input.name, "com_offset");
  EXPECT_EQ(answer.gains.front().measurement, "balance the object on an edge: its centre of mass");
  EXPECT_EQ(answer.verdict, SkuVerdict::too_uncertain) << answer.message;
}

TEST(SkuValidation, SharesAddToOneAndKnowingAnInputTakesItsVarianceOff) {
  const auto sku = bar();
  const auto answer = validate_sku(sku, card(), "card.json", quick());
  double sum = 0;
  for (const auto& line : answer.budget) sum += line.share;
  EXPECT_NEAR(sum, 1, 1e-12);
  const auto offset = std::find_if(answer.budget.begin(), answer.budget.end(),
                                   [](const BudgetLine& l) { return l.input.name == "com_offset"; });
  const auto gain = std::find_if(answer.gains.begin(), answer.gains.end(), [](const MeasurementGain& g) {
    return g.inputs == std::vector<std::string>{"com_offset"};
  });
  ASSERT_TRUE(offset != answer.budget.end() && gain != answer.gains.end());
  // It is correlated with nothing: what knowing it takes off is its share.
  EXPECT_NEAR(gain->share, offset->share, 1e-12);
  auto known = sku;
  known.com_offset_sigma = 0;
  const auto& tolerance = SkuRequest{}.tolerance;
  const auto variance = [&](const SkuValidation& a) {
    return std::pow(a.linear.x / tolerance.x, 2) + std::pow(a.linear.theta / tolerance.theta, 2);
  };
  const auto less = validate_sku(known, card(), "card.json", quick());
  EXPECT_NEAR(variance(less) / variance(answer), 1 - gain->share, 1e-9);
}

TEST(SkuValidation, AnswersDoNotDependOnThreads) {
  auto one = quick(200), two = quick(200);
  one.threads = 1;
  two.threads = 2;
  const auto a = validate_sku(bar(), card(), "card.json", one),
             b = validate_sku(bar(), card(), "card.json", two);
  EXPECT_EQ(a.monte_carlo.x, b.monte_carlo.x);
  EXPECT_EQ(a.monte_carlo.theta, b.monte_carlo.theta);
  EXPECT_EQ(a.within, b.within);
}

TEST(SkuValidation, AnObjectTooHeavyForTheGripIsToldWhatWouldHoldIt) {
  auto sku = bar();
  sku.mass *= 4;
  *sku.inertia *= 4;
  auto gripper = card();
  const auto answer = validate_sku(sku, gripper, "card.json", quick());
  ASSERT_EQ(answer.verdict, SkuVerdict::cannot_be_held) << answer.message;
  ASSERT_TRUE(answer.needed_grip_force);
  EXPECT_THAT(answer.samples, IsEmpty());
  // With a little more than that it is held, with a little less it is not.
  for (const double factor : {0.99, 1.01}) {
    const double force = factor * *answer.needed_grip_force;
    gripper.valid_range["grip_force"] = {force, force, "N"};
    EXPECT_EQ(validate_sku(sku, gripper, "card.json", quick()).reference().held, factor > 1) << factor;
  }
}

// A grip that holds most draws: nothing bends the landing, and the answer does not say so.
TEST(SkuValidation, DrawsThatTheGripLosesAreNoCurvature) {
  auto sku = bar();
  sku.mass *= 4;
  *sku.inertia *= 4;
  sku.com_offset_sigma = 1e-4;
  auto gripper = card();
  const double needed = validate_sku(sku, gripper, "card.json", quick()).needed_grip_force.value();
  gripper.valid_range["grip_force"] = {1.03 * needed, 1.03 * needed, "N"};  // its sigma is some 2 %
  const auto answer = validate_sku(sku, gripper, "card.json", quick());
  EXPECT_GT(answer.lost, 0);
  EXPECT_FALSE(answer.agree);
  EXPECT_THAT(answer.disagreement, HasSubstr("slip out of the grip"));
  EXPECT_THAT(answer.disagreement, testing::Not(HasSubstr("not linear")));
}

// A log without a normal force knows the product of friction and grip force, and neither of them: the landing
// scatters as with a card that knows the force and has the product's spread on its friction.
TEST(SkuValidation, FrictionAndForceScatterAsTheirProductDoes) {
  constexpr double kProduct = 0.01, kEach = 0.4;  // relative sigmas
  auto known = card();
  known.covariance.reset();
  known.parameters["grip_force"] = {50, {}, "N"};
  known.parameters["mu"].sigma = kProduct * 0.5;
  auto ridge = known;
  const double mu = kEach * 0.5, force = kEach * 50, length = *known.parameters["length"].sigma;
  ridge.parameters["mu"] = {0.5, mu, "-", false};
  ridge.parameters["grip_force"] = {50, force, "N", false};
  // var(ln mu + ln F) = 2 kEach² (1 + rho)
  const double rho = kProduct * kProduct / (2 * kEach * kEach) - 1;
  ridge.covariance = {
      {"grip_force", "length", "mu"},
      {force * force, 0, rho * mu * force, 0, length * length, 0, rho * mu * force, 0, mu * mu}};
  const auto a = validate_sku(bar(), known, "card.json", quick(1000)),
             b = validate_sku(bar(), ridge, "card.json", quick(1000));
  EXPECT_NEAR(b.linear.theta / a.linear.theta, 1, 0.02);
  EXPECT_EQ(a.lost, b.lost);
  // Two samples of 1000: a sigma is known to 2.2 %; four of √2 of these.
  EXPECT_NEAR(b.monte_carlo.x / a.monte_carlo.x, 1, 0.13);
  EXPECT_NEAR(b.monte_carlo.theta / a.monte_carlo.theta, 1, 0.13);
  EXPECT_THAT(b.disagreement, Not(HasSubstr("believe the Monte Carlo")));
}

// Of draws that all land within a wide tolerance the share is one: neither less by rounding nor more.
TEST(SkuValidation, SharesAreOfWholeDraws) {
  for (const int samples : {99, 300, 700}) {
    auto request = quick(samples);
    request.tolerance = {5, 30};
    const auto answer = validate_sku(bar(), card(), "card.json", request);
    EXPECT_EQ(answer.within, 1) << samples;
    EXPECT_EQ(answer.within_linear, 1) << samples;
    EXPECT_EQ(answer.lost, 0) << samples;
  }
}

// A rigid carriage is sure of an object that turns in the pads, and wrong.
TEST(SkuValidation, APureDelayCannotVouchForAnObjectOnALever) {
  datasets::ModelCard delay;
  delay.model = "gripper_delay";
  delay.parameters = {{"delay", {0.05, 0.001, "s"}}, {"delay_sigma", {0.002, {}, "s"}}};
  auto request = quick(200);
  request.tolerance = {0.5, 3};
  const auto answer = validate_sku(bar(), delay, "card.json", request);
  EXPECT_GE(answer.within, request.confidence);
  EXPECT_EQ(answer.verdict, SkuVerdict::beyond_the_model) << answer.message;
  EXPECT_THAT(answer.message, HasSubstr("hangs 0.1 m from the pads and turns in them"));
  auto held_there = bar();
  held_there.com_offset = 0;
  const auto central = validate_sku(held_there, delay, "card.json", request);
  EXPECT_EQ(central.verdict, SkuVerdict::throwable) << central.message;
}

TEST(SkuValidation, AssumesWhatTheSkuDoesNotTell) {
  auto sku = bar();
  sku.mass_sigma = sku.inertia_sigma = sku.com_offset_sigma = std::nullopt;
  const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku));
  const auto inputs = throw_inputs(sku, card(), "card.json", thrown);
  const auto assumed = [](const ThrowInputs& of) {
    std::set<std::string> out;
    for (const auto& input : of.inputs)
      if (input.source == InputSource::assumed) out.insert(input.name);
    return out;
  };
  // The card's parameters say nothing of the gripper.
  const std::set<std::string> gripper{"grip_force", "opening_time",
                                      "dead_time"};  // nor of its shape: no sigma
  std::set<std::string> all = gripper;
  all.insert({"mass", "inertia", "com_offset"});
  EXPECT_EQ(assumed(inputs), all);
  EXPECT_EQ(assumed(throw_inputs(bar(), card(), "card.json", thrown)), gripper);
  auto seen = card();
  seen.valid_range = {{"grip_force", {24, 26, "N"}},
                      {"opening_time", {0.05, 0.05, "s"}},
                      {"dead_time", {0.004, 0.004, "s"}},
                      {"shape", {1.5, 1.5, "-"}}};
  const auto told = throw_inputs(bar(), seen, "card.json", thrown);
  EXPECT_TRUE(assumed(told).empty());
  const auto value_of = [&](const std::string& name) {
    return told.values[static_cast<std::size_t>(std::find(told.names.begin(), told.names.end(), name) -
                                                told.names.begin())];
  };
  EXPECT_EQ(value_of("dead_time"), 0.004);
  EXPECT_EQ(value_of("shape"), 1.5);
}

TEST(SkuValidation, MeasuredThrowsConfirmTheRightSkuAndContradictAWrongOne) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.objects = {experiment::loaded_bar("bar-com100", 0.10)};
  const auto log = experiment::generate_campaign(design, 5);
  auto gripper = card();
  gripper.parameters["mu"].value = design.patch.mu;
  gripper.parameters["length"].value = design.patch.length();
  gripper.own_spreads["mu_deviation"].sigma = design.variation.mu;
  auto request = quick(200);
  request.log = &log;
  request.log_file = "synthetic";
  const auto right = validate_sku(bar(), gripper, "card.json", request);
  ASSERT_TRUE(right.measured);
  EXPECT_EQ(right.measured->throws.size(), log.throws.size());
  EXPECT_TRUE(right.measured->confirmed) << right.measured->rms_z << " " << right.measured->within;
  EXPECT_EQ(right.verdict, SkuVerdict::throwable) << right.message;
  EXPECT_EQ(right.candidates.size(), 3u);  // the design's release accelerations

  // One throw of them beyond the tolerance is what a share of nine in ten leads to expect.
  double most = 0;
  for (const auto& one : right.measured->throws) most = std::max(most, std::abs(one.error_x));
  auto narrow = request;
  narrow.tolerance.x = 0.999 * most;
  narrow.confidence = 0.8;
  const auto chance = validate_sku(bar(), gripper, "card.json", narrow);
  const auto n = static_cast<double>(chance.measured->throws.size());
  EXPECT_NEAR(chance.measured->within, 1 - 1 / n, 1e-12);
  EXPECT_NEAR(chance.measured->p_value, 1 - std::pow(0.8, n), 1e-12);
  narrow.confidence = 1 - 0.5 / n;  // more than lie within, and still no contradiction
  const auto close = validate_sku(bar(), gripper, "card.json", narrow);
  EXPECT_FALSE(close.measured->confirmed);
  EXPECT_NE(close.verdict, SkuVerdict::contradicted) << close.message;

  auto wrong = bar();
  wrong.com_offset = 0.07;  // thirty of its sigmas off
  const auto answer = validate_sku(wrong, gripper, "card.json", request);
  ASSERT_TRUE(answer.measured);
  EXPECT_FALSE(answer.measured->confirmed);
  EXPECT_GT(answer.measured->rms_z, 2 * right.measured->rms_z);
  EXPECT_EQ(answer.verdict, SkuVerdict::contradicted) << answer.message;
  EXPECT_THAT(answer.message, HasSubstr("measured throws"));

  // So far beyond the pads that the card lets go of it before the throw: measured landings that are foretold
  // not to be count against it.
  auto far = bar();
  far.com_offset = 1.9;
  const auto never = validate_sku(far, gripper, "card.json", request);
  ASSERT_TRUE(never.measured);
  EXPECT_EQ(never.measured->throws.size() + static_cast<std::size_t>(never.measured->never_lands),
            log.throws.size());
  EXPECT_FALSE(never.measured->confirmed);

  request.condition = "no such";
  EXPECT_THROW(validate_sku(bar(), gripper, "card.json", request), std::invalid_argument);
}

// The log's own landings scatter about their conditions' means as its motions are foretold to bring the same
// object down; a robot that repeats nothing exactly is believed less.
TEST(SkuValidation, HowWellTheRobotRepeatsIsReadOffTheLog) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.objects = {experiment::loaded_bar("bar-com100", 0.10)};
  design.repetitions = 6;
  design.variation.hand_speed = 0.03;
  const auto log = experiment::generate_campaign(design, 5);
  std::map<std::string, std::vector<double>> measured;
  for (const auto& one : log.throws) measured[one.condition].push_back(one.landing->pose(0, 0));
  double square = 0, freedom = 0;
  for (const auto& [condition, x] : measured) {
    if (condition != log.throws.front().condition) continue;  // that the answer is about
    const double mean = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
    for (const double one : x) square += (one - mean) * (one - mean);
    freedom += static_cast<double>(x.size()) - 1;
  }
  const double scatter = std::sqrt(square / freedom);
  auto request = quick(500);
  request.log = &log;
  request.log_file = "synthetic";
  request.tolerance.x = scatter;
  auto gripper = card();
  gripper.parameters["mu"].value = design.patch.mu;
  gripper.parameters["length"].value = design.patch.length();
  request.condition = log.throws.front().condition;
  const auto answer = validate_sku(bar(), gripper, "card.json", request);
  ASSERT_TRUE(answer.repeats);
  EXPECT_EQ(answer.repeats->conditions, 1);
  EXPECT_EQ(answer.repeats->motions, design.repetitions);
  EXPECT_NEAR(answer.repeats->x / scatter, 1, 0.3);
  const auto& own = measured.at(*request.condition);
  const double mean = std::accumulate(own.begin(), own.end(), 0.0) / static_cast<double>(own.size());
  EXPECT_NEAR(answer.reference().landing_x + answer.repeats->offset_x, mean, 0.3 * scatter);
  EXPECT_LT(answer.repeats->within, 0.8) << "of normal draws 68 % lie within one sigma";
  EXPECT_GT(answer.within, 0.95) << "of the motion as it was logged";
  EXPECT_EQ(answer.verdict, SkuVerdict::too_uncertain) << answer.message;
}

// Throws that a card was fitted to say nothing of how well it foretells.
TEST(SkuValidation, ItsOwnLogConfirmsACardByTheHeldOutThrowsAlone) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.objects = {experiment::loaded_bar("bar-com100", 0.10)};
  const auto log = experiment::generate_campaign(design, 5);
  const unhand::support::Scratch scratch;
  const std::string file = scratch / "own.h5";
  datasets::write_throw_log(file, log);
  auto gripper = card();
  auto request = quick(100);
  request.log = &log;
  request.log_file = file;
  const auto test =
      static_cast<std::size_t>(std::count_if(log.throws.begin(), log.throws.end(), [](const auto& one) {
        return one.split == datasets::Split::test;
      }));
  const auto other = validate_sku(bar(), gripper, "card.json", request);
  gripper.log.checksum = checksum_of(file);
  const auto own = validate_sku(bar(), gripper, "card.json", request);
  ASSERT_TRUE(other.measured);
  EXPECT_EQ(other.measured->throws.size(), log.throws.size());
  EXPECT_FALSE(other.measured->held_out);
  EXPECT_THAT(own.notes, Contains(HasSubstr("the log is the card's own")));
  EXPECT_EQ(own.measured ? own.measured->throws.size() : 0, test);
}

TEST(SkuValidation, EveryObjectOfTheCatalogueIsAnswered) {
  namespace fs = std::filesystem;
  int n = 0;
  double mass = 0;
  for (const auto& entry : fs::directory_iterator(UNHAND_SOURCE_DIR "/datasets/catalogue/darko-d4.6")) {
    const auto sku = datasets::read_sku(entry.path());
    EXPECT_EQ(sku.name, entry.path().stem());
    EXPECT_THAT(sku.source.value(), HasSubstr("Table 5"));
    const auto answer = validate_sku(sku, card(), "card.json", quick(100));
    // Held at its centre of mass, nothing turns it in the grip: the hand's spin alone goes with it.
    EXPECT_TRUE(answer.reference().held && answer.reference().landed) << sku.name << ": " << answer.message;
    mass += sku.mass;
    ++n;
  }
  EXPECT_EQ(n, 18);
  EXPECT_NEAR(mass, 1.126, 1e-12);  // the table's column, added up by hand
}

TEST(SkuValidation, WrongRequestsAreNamed) {
  auto sku = bar();
  sku.inertia.reset();
  EXPECT_THROW(validate_sku(sku, card(), "card.json"), std::invalid_argument);
  auto request = quick();
  request.tolerance.x = -1;
  EXPECT_THROW(validate_sku(bar(), card(), "card.json", request), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::fitting
