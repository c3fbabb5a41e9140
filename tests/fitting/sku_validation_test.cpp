// Whether an object that nobody has thrown can be: derivatives, Monte Carlo, and what is assumed.
#include "fitting/sku/sku_validation.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <string>

#include "experiment/outcome_slopes.hpp"
#include "experiment/reference_throw.hpp"
#include "fitting/card.hpp"
#include "fitting/sku/sku_motion.hpp"
#include "fitting/sku/sku_scatter.hpp"
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

// The object itself is another: heavier, harder to turn, or loaded elsewhere.
TEST(SkuValidation, DerivativesAreWhatAnotherObjectLandsLike) {
  const auto landing = [](const datasets::Sku& sku) {
    const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku));
    auto inputs = throw_inputs(sku, card(), "card.json", thrown);
    inputs.model.integrator.tolerances = {1e-11, 1e-13};
    return experiment::predict_channels(thrown, {}, inputs.model,
                                        dynamics::Values<double>(inputs.names, inputs.values))
        .landing.pose;
  };
  const auto sku = bar();
  const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku));
  const auto inputs = throw_inputs(sku, card(), "card.json", thrown);
  const Eigen::MatrixXd slopes =
      experiment::outcome_slopes(thrown, inputs.model, inputs.names, inputs.values).value() * inputs.mixing();
  int found = 0;
  for (std::size_t k = 0; k < inputs.inputs.size(); ++k) {
    const std::string& name = inputs.inputs[k].name;
    const double step = 0.02 * inputs.inputs[k].sigma;
    auto more = sku, less = sku;
    if (name == "mass") {
      more.mass += step, less.mass -= step;
    } else if (name == "inertia") {
      *more.inertia += step, *less.inertia -= step;
    } else if (name == "com_offset") {
      more.com_offset += step, less.com_offset -= step;
    } else {
      continue;
    }
    ++found;
    const auto up = landing(more), down = landing(less);
    const auto column = static_cast<Eigen::Index>(k);
    const double x = (up.x - down.x) / (2 * step), theta = (up.theta - down.theta) / (2 * step);
    EXPECT_NEAR(slopes(experiment::kLandingX, column), x, 5e-3 * std::abs(x)) << name;
    EXPECT_NEAR(slopes(experiment::kLandingTheta, column), theta, 5e-3 * std::abs(theta)) << name;
  }
  EXPECT_EQ(found, 3);
}

/// A log of motions for the bar, and a request to try them.
struct LoggedMotions {
  datasets::ThrowLog log;
  SkuRequest request = quick(100);
  explicit LoggedMotions(int repetitions, const std::string& name = "quick12") {
    auto design = experiment::campaign_design(name);
    design.objects = {experiment::loaded_bar("bar-com100", 0.10)};
    design.repetitions = repetitions;
    log = experiment::generate_campaign(design, 5);
    request.log = &log;
    request.log_file = "synthetic";
  }
};

// One lands in the middle but turned; another a little beside it but straight. In units of the tolerance the
// second is the nearer to the mean, where x is asked for to a metre; and the first, to a millimetre.
TEST(SkuValidation, TheMiddleRepetitionIsNearestInUnitsOfTheTolerance) {
  LoggedMotions m(3);
  LoggedLandings landings(m.log.throws.size());
  std::vector<std::size_t> same;
  for (std::size_t i = 0; i < m.log.throws.size(); ++i)
    if (repeated_motion(m.log.throws[i]) == repeated_motion(m.log.throws.front())) same.push_back(i);
  ASSERT_EQ(same.size(), 3U);
  landings[same[0]] = {0, 0.4}, landings[same[1]] = {0.02, 0}, landings[same[2]] = {-0.02, -0.4};
  const auto tried = [&](double x_tolerance) {
    m.request.tolerance = {x_tolerance, 0.1};
    return motions_of(bar(), card(), "card.json", m.request, landings).front().prepared.id;
  };
  EXPECT_EQ(tried(1), m.log.throws[same[1]].id);
  EXPECT_EQ(tried(1e-3), m.log.throws[same[0]].id);
}

// Where the grip lets the object slip before it opens, no landing is foretold, wherever it would fall.
TEST(SkuValidation, ThrowsThatTheGripLosesLandNowhere) {
  LoggedMotions m(2);
  int lost = 0, held = 0;
  for (const double mu : {0.5, 0.3, 0.2, 0.12, 0.08}) {
    auto gripper = card();
    gripper.parameters["mu"].value = mu;
    const auto landings = logged_landings(bar(), gripper, "card.json", m.request);
    for (const SkuMotion& motion : motions_of(bar(), gripper, "card.json", m.request, {landings})) {
      const ThrowCandidate one = candidate_of(motion);
      const auto at = std::find_if(m.log.throws.begin(), m.log.throws.end(),
                                   [&](const auto& t) { return t.id == motion.prepared.id; });
      ASSERT_NE(at, m.log.throws.end());
      EXPECT_EQ(landings[static_cast<std::size_t>(at - m.log.throws.begin())].has_value(),
                one.held && one.landed)
          << mu;
      lost += one.landed && !one.held, held += one.landed && one.held;
    }
  }
  EXPECT_GT(lost, 0);
  EXPECT_GT(held, 0);
}

// Of two motions, one brings the object more surely to its place and the other turns it more surely: chosen
// is the one that serves the tolerance that is tight.
TEST(SkuValidation, TheMotionIsChosenByTheToleranceThatIsTight) {
  LoggedMotions m(1, "batch180");
  const auto answer = [&](double x, double theta) {
    m.request.tolerance = {x, theta};
    return validate_sku(bar(), card(), "card.json", m.request);
  };
  std::vector<ThrowCandidate> all = answer(100, 0.1).candidates;
  std::erase_if(all, [](const auto& c) { return !c.held || !c.landed; });
  std::string placed, turned;
  for (const auto& a : all)
    for (const auto& b : all)
      if (a.linear.x < 0.95 * b.linear.x && a.linear.theta > 1.05 * b.linear.theta)
        placed = a.condition, turned = b.condition;
  ASSERT_FALSE(placed.empty()) << "of " << all.size();
  std::erase_if(m.log.throws,
                [&](const auto& one) { return one.condition != placed && one.condition != turned; });
  EXPECT_EQ(answer(100, 0.1).reference().condition, turned);
  EXPECT_EQ(answer(0.01, 1000).reference().condition, placed);
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
  for (const int samples : {110, 300, 700}) {
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

  // Hardly any landing is as near as a tenth of a millimetre, as foretold: no contradiction either.
  auto strict = request;
  strict.tolerance.x = 1e-4;
  const auto as_foretold = validate_sku(bar(), gripper, "card.json", strict);
  ASSERT_LT(as_foretold.measured->p_value, 0.05);
  EXPECT_EQ(as_foretold.verdict, SkuVerdict::too_uncertain) << as_foretold.message;

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

/// By name, or none.
const UncertainInput* input_of(const ThrowInputs& of, const std::string& name) {
  const auto found = std::find_if(of.inputs.begin(), of.inputs.end(),
                                  [&](const UncertainInput& one) { return one.name == name; });
  return found == of.inputs.end() ? nullptr : &*found;
}

// An object that is heavier than its file says is that heavier object; of a uniform shape its inertia grows
// with it.
TEST(SkuValidation, AnObjectThatIsHeavierThanItsFileSaysIsTheHeavierObject) {
  for (const bool shaped : {false, true}) {
    auto sku = bar();
    if (shaped) {
      sku.shape = "rod", sku.dims = {{0.3, 0.02, 0.02}};
      sku.inertia = datasets::shape_inertia(*sku.shape, sku.mass, *sku.dims);
    }
    auto heavier = sku;
    heavier.mass *= 1.2;
    if (shaped) heavier.inertia = datasets::shape_inertia(*sku.shape, heavier.mass, *sku.dims);
    const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku)),
               other = experiment::reference_throw(sku.name, datasets::to_object(heavier));
    const auto inputs = throw_inputs(sku, card(), "card.json", thrown),
               as_told = throw_inputs(heavier, card(), "card.json", other);
    Eigen::VectorXd by = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(inputs.inputs.size()));
    by[input_of(inputs, "mass") - inputs.inputs.data()] = 0.2 * sku.mass;
    const auto landing = [](const experiment::PreparedThrow& one, const ThrowInputs& of,
                            const std::vector<double>& values) {
      return experiment::predict_channels(one, {}, of.model, dynamics::Values<double>(of.names, values))
          .landing.pose;
    };
    const auto nominal = landing(thrown, inputs, inputs.values),
               moved = landing(thrown, inputs, inputs.moved(by)),
               heavy = landing(other, as_told, as_told.values);
    const double change = std::abs(heavy.theta - nominal.theta);
    EXPECT_GT(change, 1e-2) << shaped;
    EXPECT_NEAR(moved.theta, heavy.theta, 1e-3 * change) << shaped;
    EXPECT_NEAR(moved.x, heavy.x, 1e-3) << shaped;
    sku.inertia_sigma.reset();
    const AssumedTolerances assumed;
    EXPECT_NEAR(inertia_sigma_of(sku), (shaped ? assumed.shape : assumed.inertia) * *sku.inertia, 1e-15);
  }
}

// Of a card of several objects only what is of this one, or of all: another's drag is not its own, nor is
// what the card's log had declared wrong.
TEST(SkuValidation, WhatACardTellsOfOtherObjectsIsLeftOut) {
  auto gripper = card();
  gripper.covariance.reset();
  gripper.effects = {"flight.quadratic_drag", "sensor.mass"};
  gripper.parameters["flight.quadratic_drag.k[bar-com100]"] = {0.05, 0.01, "1/m"};
  gripper.parameters["flight.quadratic_drag.k[jar]"] = {0.4, 0.01, "1/m"};
  gripper.parameters["sensor.mass.ratio"] = {1.3, 0.01, "-"};
  gripper.parameters["pads"].value = 3;
  const auto thrown = experiment::reference_throw(bar().name, datasets::to_object(bar()));
  const auto inputs = throw_inputs(bar(), gripper, "card.json", thrown);
  EXPECT_EQ(inputs.model.pads, 3);
  const auto value_of = [&](const std::string& name) {
    const auto found = std::find(inputs.names.begin(), inputs.names.end(), name);
    return found == inputs.names.end()
               ? NAN
               : inputs.values[static_cast<std::size_t>(found - inputs.names.begin())];
  };
  EXPECT_EQ(value_of("flight.quadratic_drag.k"), 0.05);
  EXPECT_EQ(value_of("sensor.mass.ratio"), 1) << "another object's";
  EXPECT_NE(input_of(inputs, "flight.quadratic_drag.k[bar-com100]"), nullptr);
  EXPECT_EQ(input_of(inputs, "flight.quadratic_drag.k[jar]"), nullptr);
  EXPECT_THAT(inputs.notes, Contains(HasSubstr("k[jar] is of another object")));
  EXPECT_THAT(inputs.notes, Contains(HasSubstr("sensor.mass.ratio is about what the card's log declared")));
}

TEST(SkuValidation, WhatIsAssumedIsAsWideAsItIsSaid) {
  auto gripper = card();
  gripper.valid_range = {{"grip_force", {20, 40, "N"}}, {"opening_time", {0.05, 0.05, "s"}}};
  AssumedTolerances assumed;
  assumed.other_surface = 0.3;
  auto sku = bar();
  const auto thrown = experiment::reference_throw(sku.name, datasets::to_object(sku));
  const auto inputs = throw_inputs(sku, gripper, "card.json", thrown, assumed);
  ASSERT_NE(input_of(inputs, "grip_force"), nullptr);
  // Any force of the range is as likely as another: 1/√12 of it.
  EXPECT_NEAR(input_of(inputs, "grip_force")->sigma, 20 / std::sqrt(12), 1e-12);
  EXPECT_NEAR(input_of(inputs, "opening_time")->sigma, assumed.opening_time, 1e-15)
      << "one value is no certainty";
  ASSERT_NE(input_of(inputs, "surface"), nullptr);
  EXPECT_NEAR(input_of(inputs, "surface")->sigma, 0.3 * 0.5, 1e-15) << "a share of mu";
  // A force that was measured is no assumption.
  const CampaignProblem measured(testing_support::small_log(), "(in memory)", {});
  EXPECT_EQ(input_of(throw_inputs(sku, gripper, "card.json", measured.throws().front().prepared, assumed),
                     "grip_force"),
            nullptr);
}

TEST(SkuValidation, APlainCardsScatterOfTheDelayIsEveryThrows) {
  datasets::ModelCard delay;
  delay.model = "gripper_delay";
  delay.parameters = {{"delay", {0.05, 0.001, "s"}}, {"delay_sigma", {0.002, {}, "s"}}};
  const auto answer = validate_sku(bar(), delay, "card.json", quick(100));
  const auto line = std::find_if(answer.budget.begin(), answer.budget.end(),
                                 [](const BudgetLine& one) { return one.input.name == "delay_deviation"; });
  ASSERT_NE(line, answer.budget.end());
  EXPECT_EQ(line->input.sigma, 0.002);
}

// A tolerance of the angle alone decides where the place may be anything.
TEST(SkuValidation, PlaceAndAngleMustBothBeWithinTheirTolerances) {
  auto request = quick(300);
  request.tolerance = {50, 1000};
  const auto free = validate_sku(bar(), card(), "card.json", request);
  EXPECT_NEAR(free.within, 1, 1e-9);
  EXPECT_NEAR(free.within_linear, 1, 1e-9);
  for (const bool of_angle : {false, true}) {
    request.tolerance = {of_angle ? 50 : free.linear.x, of_angle ? free.linear.theta : 1000};
    const auto narrow = validate_sku(bar(), card(), "card.json", request);
    // One sigma of a normal distribution; a share of 300 draws is known to 2.7 %.
    EXPECT_NEAR(narrow.within, 0.683, 0.1) << of_angle;
    EXPECT_NEAR(narrow.within_linear, 0.683, 0.1) << of_angle;
    EXPECT_EQ(narrow.verdict, SkuVerdict::too_uncertain);
  }
}

/// Throws of the bar that a log holds, and what is asked about them.
struct LoggedBar {
  datasets::ThrowLog log;
  datasets::ModelCard gripper = card();
  SkuRequest request = quick(200);
};
std::unique_ptr<LoggedBar> logged_bar() {
  auto out = std::make_unique<LoggedBar>();
  auto design = testing_support::small_design("limit_surface_disc");
  design.objects = {experiment::loaded_bar("bar-com100", 0.10)};
  out->log = experiment::generate_campaign(design, 5);
  out->gripper.parameters["mu"].value = design.patch.mu;
  out->gripper.parameters["length"].value = design.patch.length();
  out->request.log = &out->log;
  out->request.log_file = "synthetic";
  return out;
}

TEST(SkuValidation, OfTheLogsMotionsTheOneThatScattersLeastIsChosen) {
  const auto bar_log = logged_bar();
  for (const LandingTolerance tolerance : {LandingTolerance{1e-3, 1000}, LandingTolerance{50, 1e-3}}) {
    bar_log->request.tolerance = tolerance;
    const auto answer = validate_sku(bar(), bar_log->gripper, "card.json", bar_log->request);
    ASSERT_EQ(answer.candidates.size(), 3u);
    for (const ThrowCandidate& one : answer.candidates)
      if (one.held && one.landed) {
        if (tolerance.x < 1) {
          EXPECT_LE(answer.reference().linear.x, one.linear.x * (1 + 1e-6));
        } else {
          EXPECT_LE(answer.reference().linear.theta, one.linear.theta * (1 + 1e-6));
        }
      }
  }
}

// What is foretold of a measured landing's error: the card's scatter, the object's, and the sensor's, which
// are independent of each other; over all of them z² is 1 in the mean where they are right.
TEST(SkuValidation, MeasuredErrorsAreJudgedByAllThatScatters) {
  const auto bar_log = logged_bar();
  auto sure = bar();
  sure.mass_sigma = sure.inertia_sigma = sure.com_offset_sigma = 0;
  const auto verdict = [&](const datasets::Sku& sku) {
    return *validate_sku(sku, bar_log->gripper, "card.json", bar_log->request).measured;
  };
  const auto of_sure = verdict(sure);
  auto told = sure, untold = sure;
  told.com_offset_sigma = bar_log->request.assumed.com_offset;
  untold.com_offset_sigma.reset();
  const auto of_told = verdict(told), of_untold = verdict(untold);
  auto twice = told;
  *twice.com_offset_sigma *= 2;
  const auto of_twice = verdict(twice);
  double squares = 0;
  const auto n = of_sure.throws.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto variance = [&](const MeasuredVerdict& of) { return std::pow(of.throws[i].sigma_theta, 2); };
    const double object = variance(of_told) - variance(of_sure);
    EXPECT_GT(object, 0);
    EXPECT_NEAR(variance(of_twice) - variance(of_sure), 4 * object, 1e-6 * object);
    EXPECT_EQ(variance(of_untold), variance(of_told)) << "what the file does not tell is assumed";
    const MeasuredLanding& one = of_sure.throws[i];
    squares += std::pow(one.error_x / one.sigma_x, 2) + std::pow(one.error_theta / one.sigma_theta, 2);
  }
  EXPECT_NEAR(of_sure.rms_z, std::sqrt(squares / (2 * static_cast<double>(n))), 1e-12);
  // A tracker of landings that is declared three times as noisy.
  const double declared = bar_log->log.throws.front().landing->pose.sigma.at(1);
  for (auto& one : bar_log->log.throws)
    for (double& sigma : one.landing->pose.sigma) sigma *= 3;
  const auto of_noisy = verdict(sure);
  for (std::size_t i = 0; i < n; ++i)
    EXPECT_NEAR(std::pow(of_noisy.throws[i].sigma_theta, 2) - std::pow(of_sure.throws[i].sigma_theta, 2),
                8 * declared * declared, 1e-6 * declared * declared);
}

// Two landings of each of three motions: the pooled variance is the sum of squares over three degrees of
// freedom, and draws that all land on the nominal one lie as far off as the motion's own mean does.
TEST(SkuValidation, RepeatedMotionsScatterAsTheTextbookPoolsThem) {
  datasets::ThrowLog log;
  LoggedLandings landings;
  int place = 0;
  for (const char* condition : {"a", "b", "c"})
    for (const double side : {-1.0, 1.0}) {
      auto& one = log.throws.emplace_back();
      one.object = "bar", one.condition = condition;
      landings.push_back(Eigen::Vector2d(5.0 * place + 0.1 * side, 0.3 * side));
      place += side > 0 ? 1 : 0;
    }
  SkuRequest request = quick(100);
  request.log = &log;
  SkuValidation answer;
  answer.candidates.emplace_back();
  answer.candidates[0].repeats = repeated_motion(log.throws.front());
  answer.candidates[0].landing_x = -0.4, answer.candidates[0].landing_theta = 0.05;
  answer.samples.assign(100, {});
  request.tolerance = {0.4, 10};  // the own motion's mean is just there
  const auto found = repeats_of(request, landings, answer);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->conditions, 3);
  EXPECT_EQ(found->motions, 6);
  EXPECT_NEAR(found->x, std::sqrt(3 * 2 * 0.1 * 0.1 / 3), 1e-12);
  EXPECT_NEAR(found->theta, std::sqrt(3 * 2 * 0.3 * 0.3 / 3), 1e-12);
  EXPECT_NEAR(found->offset_x, 0.4, 1e-12);
  EXPECT_NEAR(found->offset_theta, -0.05, 1e-12);
  EXPECT_NEAR(found->within, 0.5, 0.15) << "of 100 draws about the tolerance's end";
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
