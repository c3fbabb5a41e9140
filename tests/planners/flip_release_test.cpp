// Model 4: what the physics explains it need not learn, and what it does not explain it learns.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "planners/flip/release_learner.hpp"
#include "planners/flip/session.hpp"
#include "tests/planners/flip_robot.hpp"

namespace unhand::planners::flip {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

const HandLibrary& library() {
  static const HandLibrary it(robot(), robot().bar);  // as fine as that of `unhand plan flip`
  return it;
}
/// The declared arm with pads that obey a card, and states at detach that differ by an offset at the pads.
struct CardPlant {
  ReleaseCard card;
  DetachVector offset{};
  FlipTrial operator()(const TrialRequest& request) const {
    FlipTrial out;
    out.command = request.command;
    const HandLibrary at(robot(), request.bar, 2);
    const auto release = predicted_release(at.simulate(request.command), card, request.bar);
    if (!release) return out.outcome = FlipOutcome::not_let_go, out;
    const double l = request.bar.com_offset;
    DetachVector pads = shifted(release->detach, -l);
    for (std::size_t j = 0; j < 6; ++j) pads[j] += offset[j];
    out.detach = shifted(pads, l);
    out.landing = *fly_flip(out.detach);
    return out;
  }
};
/// Another robot's pads and gripper.
ReleaseCard other_card() {
  ReleaseCard out = prior_card(robot());
  out.mu.value *= 0.88;
  out.length *= 0.9;
  out.dead_time.value += 0.005;
  out.opening_time.value += 0.003;
  return out;
}
double miss(const FlipRelease& a, const FlipTrial& b) {
  return normalized_error(*fly_flip(a.detach), {b.landing});
}

TEST(ReleaseFit, ExplainsThrowsThatItHasNotSeen) {
  const CardPlant plant{other_card()};
  const CommandRange& range = robot().motion.range;
  const auto support = gather(plant, "support", support_simplex(range), 1, robot().bar).data;
  const ReleaseCard prior = prior_card(robot());
  const ReleaseFit fit = fit_release(library(), prior, support);
  EXPECT_LT(fit.cost_after, fit.cost_before);  // what is left is mostly the prior's part
  double before = 0, after = 0;
  for (const FlipCommand& u : {range.at(0.5, 0.5, 0.5), range.at(0.3, 0.8, 0.6), range.at(0.7, 0.2, 0.4)}) {
    const FlipTrial seen = plant({"", 0, u, robot().bar});
    const auto hand = library().simulate(u);
    before += miss(*predicted_release(hand, prior, robot().bar), seen);
    after += miss(*predicted_release(hand, fit.card, robot().bar), seen);
  }
  EXPECT_LT(after, 0.3 * before);
  // Each number goes the right way, and is surer than before.
  EXPECT_LT(fit.card.mu.value * fit.card.length, prior.mu.value * prior.length);
  EXPECT_GT(
      fit.card.dead_time.value + fit.card.opening_time.value,
      prior.dead_time.value + prior.opening_time.value + 0.003);  // of 8 ms; alone they are hard to tell
  EXPECT_LT(fit.card.dead_time.sigma, prior.dead_time.sigma);
}

// Robots that differ from the declared one as much as is said, in pads and gripper and in what the card has
// not: the errors of the fits are as large as their covariances say, and where nothing else differs, so do
// they.
TEST(ReleaseFit, ItsCovarianceIsThatOfItsErrors) {
  const ReleaseCard prior = prior_card(robot());
  const auto commands = support_simplex(robot().motion.range);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kRobots = 16;
  double squares = 0, exact = 0;
  for (int i = 0; i < 2 * kRobots; ++i) {
    const bool differs = i < kRobots;
    CardPlant plant{prior};
    plant.card.mu.value *= std::exp(prior.mu.sigma / prior.mu.value * normal(random));
    plant.card.length *= std::exp(0.15 * normal(random));
    plant.card.dead_time.value =
        std::max(0.0, prior.dead_time.value + prior.dead_time.sigma * normal(random));
    plant.card.opening_time.value += prior.opening_time.sigma * normal(random);
    DetachVector common{};
    for (std::size_t j = 0; j < 6; ++j) common[j] = kDiscrepancy[j] * normal(random);
    std::vector<FlipDatum> data;
    for (const FlipCommand& u : commands) {
      const auto one = mean_of(std::vector{plant({"", 0, u, robot().bar})});
      if (!one) continue;
      data.push_back(*one);
      for (std::size_t j = 0; differs && j < 6; ++j)  // likeness of these commands is 0.75
        data.back().detach[j] +=
            std::sqrt(0.75) * common[j] + std::sqrt(0.25) * kDiscrepancy[j] * normal(random);
    }
    const ReleaseFit fit = fit_release(library(), prior, data);
    const ReleaseCard &is = fit.card, &was = plant.card;
    const Eigen::Vector4d error{is.mu.value - was.mu.value, is.length - was.length,
                                is.dead_time.value - was.dead_time.value,
                                is.opening_time.value - was.opening_time.value};
    (differs ? squares : exact) += error.dot(fit.covariance.inverse() * error) / 4 / kRobots;
    EXPECT_NEAR(std::sqrt(fit.covariance(2, 2)), is.dead_time.sigma, 1e-12);
    if (differs) {
      EXPECT_GT(fit.discrepancy, 0.3);
      EXPECT_LT(fit.discrepancy, 2.0);
      for (const double freedom : fit.degrees_of_freedom) EXPECT_GE(freedom, 1);
    } else {
      EXPECT_LT(fit.discrepancy, 0.3);
    }
  }
  // χ² of 16 x 4 scatters by √(2/64) = 0.18 about 1, and the degrees of freedom of s² are few.
  EXPECT_GT(squares, 0.5);
  EXPECT_LT(squares, 1.8);
  EXPECT_LT(exact, 1.8);
}

TEST(ReleaseFit, CardComesBackAsItWasWritten) {
  ReleaseFit fit{other_card(), 0, 0, 0};
  fit.card.length_sigma = 3e-4;
  fit.covariance.diagonal() << std::pow(fit.card.mu.sigma, 2), 9e-8, std::pow(fit.card.dead_time.sigma, 2),
      std::pow(fit.card.opening_time.sigma, 2);
  fit.degrees_of_freedom = {5, 6, 7, HUGE_VAL};
  const HandLibrary small(robot(), robot().bar, 2);  // the bar is all that is asked of it
  const std::string text = datasets::to_json(model_card_of(fit, small, {}, "robot.toml"));
  const datasets::ModelCard card = datasets::parse_model_card(text);
  EXPECT_EQ(card.covariance->names, (std::vector<std::string>{"mu", "length", "dead_time", "opening_time"}));
  EXPECT_EQ(card.parameters.at("length").degrees_of_freedom, 6);
  EXPECT_FALSE(card.parameters.at("opening_time").degrees_of_freedom) << "the prior's";
  EXPECT_EQ(card.valid_range.at("mass").low, robot().bar.mass);
  EXPECT_EQ(card.own_spreads.at("grasp_angle").sigma, robot().throws.grasp_angle);
  const ReleaseCard back = release_card(card, "card.json");
  EXPECT_EQ(back.model, fit.card.model);
  EXPECT_EQ(back.mu.value, fit.card.mu.value);
  EXPECT_EQ(back.length, fit.card.length);
  EXPECT_EQ(back.dead_time.value, fit.card.dead_time.value);
  EXPECT_EQ(back.opening_time.sigma, fit.card.opening_time.sigma);
  EXPECT_EQ(back.length_sigma, fit.card.length_sigma);
}

// What the physics does not explain makes a fit less sure, by its square; of that part there are as few
// degrees of freedom as residuals tell, and more of the sum of it and of the prior (Welch, Satterthwaite).
TEST(ReleaseFit, WhatIsNotExplainedMakesItLessSure) {
  const HandLibrary small(robot(), robot().bar, 2);
  const CardPlant plant{prior_card(robot())};
  const auto exact = gather(plant, "support", support_simplex(robot().motion.range), 1, robot().bar).data;
  const auto fitted = [&](double size) {
    auto data = exact;
    int sign = 1;
    for (FlipDatum& one : data)
      for (std::size_t j = 0; j < 6; ++j) one.detach[j] += size * (sign = -sign) * kDiscrepancy[j];
    return fit_release(small, prior_card(robot()), data);
  };
  const ReleaseFit none = fitted(0), some = fitted(0.3), more = fitted(0.6);
  // Of friction and length by their logarithms, as they are fitted.
  const auto variance = [](const ReleaseFit& fit, int k) {
    return fit.covariance(k, k) / std::pow(k == 0 ? fit.card.mu.value : k == 1 ? fit.card.length : 1.0, 2);
  };
  for (int k = 0; k < 4; ++k) {
    const double prior = variance(none, k), once = variance(some, k) - prior,
                 twice = variance(more, k) - prior;
    EXPECT_GT(once, 0) << k;
    EXPECT_NEAR(twice, 4 * once, 0.4 * once) << k;
    const auto i = static_cast<std::size_t>(k);
    const double of_some = some.degrees_of_freedom[i] * std::pow(once / (prior + once), 2),
                 of_more = more.degrees_of_freedom[i] * std::pow(twice / (prior + twice), 2);
    EXPECT_NEAR(of_some, of_more, 0.1 * of_more) << k;
    EXPECT_LT(of_more, 24) << "residuals";
  }
}

TEST(LeftOverField, KnowsWhatItSawAndDoubtsTheRest) {
  LeftOverField field;
  field.set({}, {});
  const Bar bar = robot().bar, longer{bar.mass, bar.inertia, 0.18},
            heavier{2 * bar.mass, bar.inertia, bar.com_offset};
  const auto nothing = field.at({0.5, 0.5, 0.5}, bar);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(nothing.mean[j], 0);
    EXPECT_DOUBLE_EQ(nothing.variance[j], kDiscrepancy[j] * kDiscrepancy[j]);
  }
  LeftOver one{{0.5, 0.5, 0.5}, bar, {0.01, -0.01, 0.2, 0.05, -0.05, 1}, 3};
  DetachVector noise{};
  for (double& v : noise) v = 1e-8;
  field.set({one}, noise);
  const auto here = field.at({0.5, 0.5, 0.5}, bar), away = field.at({0.9, 0.1, 0.9}, bar);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(here.mean[j], one.value[j], 1e-3 * std::abs(one.value[j]));
    EXPECT_LT(std::abs(away.mean[j]), std::abs(one.value[j]));
    EXPECT_LT(here.variance[j], 1e-3 * away.variance[j]);
    for (const Bar& other : {longer, heavier}) {
      const auto there = field.at({0.5, 0.5, 0.5}, other);
      EXPECT_NEAR(there.mean[j], 0.8 * one.value[j], 1e-3 * std::abs(one.value[j]));
      EXPECT_GT(there.variance[j], here.variance[j]);
    }
  }
}

TEST(ReleaseLearner, HitsAtOnceWhereThePhysicsIsRight) {
  const CardPlant plant{other_card()};
  for (const FlipPose& pose : {FlipPose{1.2, kTurn / 2}, FlipPose{1.3, 0.9 * kTurn}}) {
    const FlipTarget target{pose};
    ReleaseLearner learner(library(), {plant.card}, {}, scatter_of({}, 0.12), target, 3);
    const LearningPath path = learn(learner, target, {}, robot().bar, plant, {1, 1});
    EXPECT_LT(path.first(), 0.5);
    EXPECT_EQ(path.reached(1), 1);
  }
}

TEST(ReleaseLearner, LearnsWhatThePhysicsLacks) {
  const CardPlant plant{prior_card(robot()), {0, 0, 0.3, 0.15, 0.1, 1.5}};
  const FlipTarget target{{1.3, 0.8 * kTurn}};
  ReleaseLearner learner(library(), {prior_card(robot())}, {}, scatter_of({}, 0.12), target, 3);
  const LearningPath path = learn(learner, target, {}, robot().bar, plant, {4, 1});
  EXPECT_GT(path.first(), 1.5);  // what it does not know yet
  EXPECT_LT(path.minimum(), 0.3);
}

TEST(FlipForecast, ItsProbabilityIsTheShareOfDraws) {
  const FlipTarget target{{1.2, kTurn / 2}};
  const auto within = [](double mean, double sigma, double middle, double half) {
    const auto phi = [&](double x) { return 0.5 * std::erfc((mean - x) / (sigma * std::numbers::sqrt2)); };
    return phi(middle + half) - phi(middle - half);
  };
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (const double unknown : {0.0, 0.3, 3.0, 12.0})  // of the scatter
    for (const double correlation : {0.0, -0.8}) {
      const FlipForecast said{
          {1.23, kTurn / 2 - 0.3}, unknown * 0.02, unknown * 0.2, correlation, 0.02, 0.2, 0};
      // One throw, with x and angle apart: two normal variables.
      if (correlation == 0) {
        const double wide = std::hypot(1, unknown);
        EXPECT_NEAR(
            probability_of_hits(said, target, 1),
            within(1.23, 0.02 * wide, 1.2, 0.05) * within(-0.3, 0.2 * wide, 0, target.tolerance_angle), 1e-4)
            << unknown;
      }
      constexpr int kDraws = 40000, kThrows = 3;
      int all = 0;
      for (int draw = 0; draw < kDraws; ++draw) {
        const double u = normal(random),
                     v = correlation * u + std::sqrt(1 - correlation * correlation) * normal(random);
        int in = 0;
        for (int k = 0; k < kThrows; ++k)
          in += hits({said.mean.x + u * said.sigma_x + 0.02 * normal(random),
                      said.mean.angle + v * said.sigma_angle + 0.2 * normal(random)},
                     target);
        all += in == kThrows;
      }
      const double share = static_cast<double>(all) / kDraws, sigma = std::sqrt(share * (1 - share) / kDraws);
      EXPECT_NEAR(probability_of_hits(said, target, kThrows), share, 4 * sigma + 1e-4)
          << unknown << " " << correlation;
    }
}

// A bar with another centre of mass is another SKU: the forecast is that of the plant with it.
TEST(ReleaseLearner, AnotherBarIsAnotherForecastNotAnotherLesson) {
  Bar bar = robot().bar;
  bar.com_offset = 0.18;
  const CardPlant plant{other_card()};
  const HandLibrary with_bar(robot(), bar, 3);
  const FlipTarget target{{1.4, 0.7 * kTurn}};
  const ReleaseLearner learner(with_bar, {plant.card}, {}, scatter_of({}, 0.18), target, 3);
  const FlipCommand u = robot().motion.range.at(0.4, 0.6, 0.3);
  const auto forecast = learner.forecast(u);
  ASSERT_TRUE(forecast);
  const FlipTrial thrown = plant({"", 0, u, bar});
  EXPECT_NEAR(forecast->mean.x, thrown.landing.x, 1e-9);
  EXPECT_NEAR(forecast->mean.angle, thrown.landing.angle, 1e-9);
}

// The stated uncertainty is worth something: over robots, forecasts of the command that a target gets first
// miss by as much as they say, at each target, and as many throws hit as they say.
TEST(ReleaseLearner, ForecastsAreAsSureAsTheyMayBe) {
  const FlipTarget targets[]{{{1.2, kTurn / 2}}, {{1.2, kTurn}}, {{1.4, kTurn / 2}}, {{1.4, kTurn}}};
  constexpr int kRobots = 12;
  double squares[4]{}, said_to_hit = 0, hit = 0;
  for (std::uint64_t seed = 1; seed <= kRobots; ++seed) {
    const FlipPlant plant(robot(), seed);
    const Thrower thrower = thrower_of(plant, seed);
    const Gathered support =
        gather(thrower, "support", support_simplex(robot().motion.range), 3, robot().bar);
    const ReleaseFit fit = fit_release(library(), prior_card(robot()), support.data);
    const ReleaseLearner any(library(), fit, left_over(library(), fit.card, support.data),
                             scatter_of(support.trials, 0.12), targets[0], 3);
    for (std::size_t k = 0; k < 4; ++k) {
      ReleaseLearner learner = any.aimed_at(targets[k]);
      const auto u = learner.next();
      ASSERT_TRUE(u);
      const auto said = learner.forecast(*u);
      const std::vector<FlipCommand> one{*u};
      const Gathered seen = gather(thrower, "path", one, 3, robot().bar);
      ASSERT_TRUE(said && seen.data.size() == 1);
      const FlipPose& mean = seen.data[0].landing;
      squares[k] +=
          0.5 / kRobots *
          (std::pow((mean.x - said->mean.x) / std::hypot(said->sigma_x, said->scatter_x / std::sqrt(3.0)),
                    2) +
           std::pow((mean.angle - said->mean.angle) /
                        std::hypot(said->sigma_angle, said->scatter_angle / std::sqrt(3.0)),
                    2));
      said_to_hit += said->probability;
      hit += std::all_of(seen.trials.begin(), seen.trials.end(),
                         [&](const FlipTrial& t) { return hits(t.landing, targets[k]); });
    }
  }
  for (std::size_t k = 0; k < 4; ++k) {  // χ² of 24 over 24 is beyond these once in a thousand each
    EXPECT_GT(squares[k], 0.35) << k;
    EXPECT_LT(squares[k], 2.13) << k;
  }
  EXPECT_NEAR(hit, said_to_hit, 3 * std::sqrt(4 * kRobots * 0.25)) << "of " << 4 * kRobots;
}

TEST(HandLibrary, AnswersForItsOwnMeshOnly) {
  const HandLibrary small(robot(), robot().bar, 2);
  EXPECT_THROW(static_cast<void>(small.between({}, {0.5, 0.5, 0.5})), std::invalid_argument);
  const std::vector<std::optional<DetachVector>> ones(small.commands().size(),
                                                      DetachVector{1, 1, 1, 1, 1, 1});
  EXPECT_NEAR((*small.between(ones, {0.2, 0.5, 2}))[5], 1, 1e-14);
  EXPECT_THROW(static_cast<void>(small.between(ones, {0.5, NAN, 0.5})), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(small.hand(99)), std::out_of_range);
  HeldBar held{robot().bar, 0, robot().gripper, robot().pads};
  held.pads.law = "gripper_delay";
  EXPECT_THROW(release_bar(small.hand(0), held), std::invalid_argument);
}

// A pair that differs by 2 d scatters by d²/1 about its mean, beside a prior of four; a bar that is turned
// about its pads scatters at its centre and not between the pads.
TEST(ReleaseLearner, ScatterIsPooledWithItsPrior) {
  const double l = 0.12;
  const DetachVector pads{0.7, 0.5, 0.3, 1.0, 1.2, 6};
  std::vector<FlipTrial> trials(2);
  for (const std::size_t k : {0u, 1u}) {
    DetachVector turned = pads;
    turned[2] += k == 0 ? 0.1 : -0.1;
    trials[k].outcome = FlipOutcome::landed;
    trials[k].command = robot().motion.range.low;
    trials[k].detach = shifted(turned, l);
    trials[k].landing = {k == 0 ? 1.3 : 1.1, k == 0 ? 3.3 : 2.7};
  }
  const ThrowScatter none = scatter_of({}, l), seen = scatter_of(trials, l);
  EXPECT_EQ(seen.freedom, none.freedom + 1);
  const double n = none.freedom;
  EXPECT_NEAR(seen.x * (n + 1), none.x * n + 2 * 0.1 * 0.1, 1e-12);
  EXPECT_NEAR(seen.angle * (n + 1), none.angle * n + 2 * 0.3 * 0.3, 1e-12);
  EXPECT_NEAR(seen.detach[2] * (n + 1), none.detach[2] * n + 2 * 0.1 * 0.1, 1e-12);
  for (const std::size_t still : {0u, 1u, 3u, 4u, 5u})
    EXPECT_NEAR(seen.detach[still] * (n + 1), none.detach[still] * n, 1e-12) << still;
}

// What is left over is told of the point between the pads.
TEST(ReleaseLearner, WhatIsLeftOverIsAtThePads) {
  const HandLibrary small(robot(), robot().bar, 2);
  const DetachVector offset{0.004, -0.003, 0.1, 0.05, -0.04, 0.8};
  const CardPlant plant{prior_card(robot()), offset};
  const std::vector<FlipCommand> one{robot().motion.range.at(0.4, 0.6, 0.3)};
  const auto left = left_over(small, plant.card, gather(plant, "", one, 2, robot().bar).data);
  ASSERT_EQ(left.size(), 1u);
  EXPECT_EQ(left[0].throws, 2);
  for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(left[0].value[j], offset[j], 1e-9) << j;
}

// The mean of four throws is as sure as one throw of a quarter of the variance.
TEST(LeftOverField, MeansAreSurerThanThrows) {
  const DetachVector value{0.01, -0.01, 0.2, 0.05, -0.05, 1};
  DetachVector noise{}, quarter{};
  for (std::size_t j = 0; j < 6; ++j) noise[j] = value[j] * value[j], quarter[j] = noise[j] / 4;
  LeftOverField four, sure, one;
  four.set({{{0.5, 0.5, 0.5}, robot().bar, value, 4}}, noise);
  sure.set({{{0.5, 0.5, 0.5}, robot().bar, value, 1}}, quarter);
  one.set({{{0.5, 0.5, 0.5}, robot().bar, value, 1}}, noise);
  const auto a = four.at({0.4, 0.5, 0.6}, robot().bar), b = sure.at({0.4, 0.5, 0.6}, robot().bar),
             c = one.at({0.5, 0.5, 0.5}, robot().bar);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_DOUBLE_EQ(a.mean[j], b.mean[j]);
    EXPECT_DOUBLE_EQ(a.variance[j], b.variance[j]);
    // Of one sample: s² y/(s² + σ²) and s² σ²/(s² + σ²), whatever s was chosen.
    EXPECT_NEAR(c.variance[j], c.mean[j] / value[j] * noise[j], 1e-9 * noise[j]);
  }
}

// Half the change of the release from −σ to +σ of what differs between throws.
TEST(ReleaseLearner, PredictsHowReleasesScatter) {
  const HandLibrary small(robot(), robot().bar, 2);
  const auto hand = small.simulate(robot().motion.range.at(0.4, 0.6, 0.3));
  const ReleaseCard card = prior_card(robot());
  const ThrowSpread& throws = robot().throws;
  const auto predicted = predicted_detach(hand, {card}, robot().bar, throws);
  ASSERT_TRUE(predicted);
  const auto release = [&](double mu, double dead, double opening, double offset, double angle) {
    Bar bar = robot().bar;
    bar.com_offset += offset;
    return release_bar(
               hand,
               {bar,
                angle,
                {card.grip_force, card.dead_time.value + dead, card.opening_time.value + opening, card.shape},
                {card.model, card.mu.value * (1 + mu), card.length, card.pads, card.law_values}})
        ->detach;
  };
  const double mu = std::hypot(throws.mu, throws.grip_force);  // pads know μ N alone
  const std::array<std::array<double, 5>, 5> sigmas{{{mu, 0, 0, 0, 0},
                                                     {0, throws.dead_time, 0, 0, 0},
                                                     {0, 0, throws.opening_time, 0, 0},
                                                     {0, 0, 0, throws.grasp_offset, 0},
                                                     {0, 0, 0, 0, throws.grasp_angle}}};
  for (std::size_t k = 0; k < 5; ++k) {
    const auto& s = sigmas[k];
    const DetachVector up = release(s[0], s[1], s[2], s[3], s[4]),
                       down = release(-s[0], -s[1], -s[2], -s[3], -s[4]);
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_NEAR(predicted->by[PredictedDetach::kOfCard + k][j], 0.5 * (up[j] - down[j]), 1e-7) << k << j;
  }
  EXPECT_GT(std::abs(predicted->by[8][2]), 0.5 * throws.grasp_angle);
}

// What is not known of the card widens the forecast by what moves with it, place and angle together.
TEST(ReleaseLearner, DoubtsOfTheCardWidenItsForecast) {
  const HandLibrary small(robot(), robot().bar, 2);
  const FlipTarget target{{1.2, kTurn / 2}};
  const FlipCommand u = robot().motion.range.at(0.4, 0.6, 0.3);
  const auto forecast = [&](double change, double sigma) {
    ReleaseFit fit{prior_card(robot())};
    fit.card.dead_time.value += change;
    fit.covariance(2, 2) = sigma * sigma;
    return *ReleaseLearner(small, fit, {}, scatter_of({}, 0.12), target, 3).forecast(u);
  };
  const double sigma = 2e-3;
  const auto sure = forecast(0, 0), doubtful = forecast(0, sigma), early = forecast(-sigma, 0),
             late = forecast(sigma, 0);
  const double dx = 0.5 * (late.mean.x - early.mean.x), da = 0.5 * (late.mean.angle - early.mean.angle);
  const auto cross = [](const FlipForecast& f) { return f.correlation * f.sigma_x * f.sigma_angle; };
  EXPECT_GT(std::abs(dx * da), 0);
  EXPECT_NEAR(doubtful.sigma_x * doubtful.sigma_x - sure.sigma_x * sure.sigma_x, dx * dx, 0.05 * dx * dx);
  EXPECT_NEAR(std::pow(doubtful.sigma_angle, 2) - std::pow(sure.sigma_angle, 2), da * da, 0.05 * da * da);
  EXPECT_NEAR(cross(doubtful) - cross(sure), dx * da, 0.05 * std::abs(dx * da));
}

// How throws scatter differs between commands as the robot declares; over those that were seen it is what was
// seen of them.
TEST(ReleaseLearner, ScattersAsItsKnownCommandsDid) {
  const HandLibrary small(robot(), robot().bar, 2);
  const CommandRange& range = robot().motion.range;
  const std::array<std::array<double, 3>, 2> known{{{0.2, 0.3, 0.2}, {0.8, 0.7, 0.8}}};
  std::vector<LeftOver> nothing_left;
  for (const auto& at : known) nothing_left.push_back({at, robot().bar, {}, 3});
  ThrowScatter seen = scatter_of({}, 0.12);
  seen.x = 0.02 * 0.02, seen.angle = 0.3 * 0.3;
  const ReleaseLearner learner(small, {prior_card(robot())}, nothing_left, seen, {{1.2, kTurn / 2}}, 3);
  double x = 0, angle = 0, most = 0, least = 1;
  for (const auto& at : known) {
    const auto said = learner.forecast(range.at(at[0], at[1], at[2]));
    ASSERT_TRUE(said);
    x += said->scatter_x * said->scatter_x / 2, angle += said->scatter_angle * said->scatter_angle / 2;
    most = std::max(most, said->scatter_angle), least = std::min(least, said->scatter_angle);
  }
  EXPECT_NEAR(x, seen.x, 1e-6 * seen.x);
  EXPECT_NEAR(angle, seen.angle, 1e-6 * seen.angle);
  EXPECT_GT(most, 1.02 * least);
}

// What was seen of a command is what the next forecast of it says.
TEST(ReleaseLearner, TakesInWhatItHasSeen) {
  const HandLibrary small(robot(), robot().bar, 2);
  const CardPlant plant{prior_card(robot()), {0, 0, 0.3, 0.15, 0.1, 1.5}};
  ThrowScatter exact = scatter_of({}, 0.12);
  for (double& v : exact.detach) v *= 1e-6;
  ReleaseLearner learner(small, {plant.card}, {}, exact, {{1.2, kTurn / 2}}, 3);
  const FlipCommand u = robot().motion.range.at(0.4, 0.6, 0.3);
  const FlipTrial seen = plant({"", 0, u, robot().bar});
  const double before = std::abs(learner.forecast(u)->mean.angle - seen.landing.angle);
  learner.observe(std::span(&seen, 1));
  EXPECT_GT(before, 0.3);
  EXPECT_NEAR(learner.forecast(u)->mean.angle, seen.landing.angle, 0.01 * before);
  EXPECT_LT(learner.forecast(u)->sigma_angle, 0.1);
}

// A command that is known to land within the tolerances is thrown again, although of others, which are not
// known as well, one may land in their middle.
TEST(ReleaseLearner, PrefersTheSureHitToTheNearestMean) {
  const HandLibrary small(robot(), robot().bar, 3);
  const FlipCommand known = robot().motion.range.at(0.5, 0.5, 0.5);
  ThrowScatter exact = scatter_of({}, 0.12);
  for (double& v : exact.detach) v *= 1e-6;
  exact.x = 1e-4 * 1e-4, exact.angle = 1e-3 * 1e-3;
  const LeftOver seen{{0.5, 0.5, 0.5}, robot().bar, kDiscrepancy, 3};  // no small one: what is left varies
  const ReleaseLearner any(small, {prior_card(robot())}, {seen}, exact, {{1.2, kTurn / 2}}, 3);
  FlipTarget target{any.forecast(known).value().mean};
  target.pose.x += 0.8 * target.tolerance_x;
  ReleaseLearner learner = any.aimed_at(target);
  const auto next = learner.next();
  ASSERT_TRUE(next);
  const auto sure = learner.forecast(known), taken = learner.forecast(*next);
  ASSERT_TRUE(sure && taken);
  EXPECT_GT(sure->probability, 0.99);
  EXPECT_GT(taken->probability, sure->probability - 0.02);
}

// Friction and the pads' force are known, and scatter, as one product.
TEST(ReleaseFit, ItsCardCountsFrictionWithTheForce) {
  const FlipRobot& r = robot();
  const ReleaseCard prior = prior_card(r);
  EXPECT_NEAR(std::pow(prior.mu.sigma / prior.mu.value, 2),
              r.robots.mu * r.robots.mu + r.robots.grip_force * r.robots.grip_force, 1e-12);
  FlipRobot late = r;
  late.robots.dead_time = 0.007, late.robots.opening_time = 0.011;
  EXPECT_EQ(prior_card(late).dead_time.sigma, 0.007);
  EXPECT_EQ(prior_card(late).opening_time.sigma, 0.011);
  const HandLibrary small(r, r.bar, 2);
  FlipDatum thrown;
  thrown.detach = {0.7, 0.5, 0.3, 3, 4, -6};
  const datasets::ModelCard card = model_card_of({prior}, small, std::vector{thrown}, "robot.toml");
  EXPECT_NEAR(std::pow(card.own_spreads.at("mu_deviation").sigma, 2),
              r.throws.mu * r.throws.mu + r.throws.grip_force * r.throws.grip_force, 1e-12);
  EXPECT_EQ(card.valid_range.at("detach_speed").low, 5);
  EXPECT_EQ(card.valid_range.at("detach_omega").high, -6);
}

}  // namespace
}  // namespace unhand::planners::flip
