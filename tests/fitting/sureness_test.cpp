// How sure a fit says it is: of what the log leaves open, at the ends of ranges, and of how it ended.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "fitting/fit.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

const datasets::ThrowLog& log_of_bars() {
  static const auto log =
      experiment::generate_campaign(testing_support::small_design("limit_surface_disc"), 11);
  return log;
}

/// A campaign whose wrenches and poses are declared so many times as noisy as they are.
CampaignProblem as_of_noisy_sensors(double factor) {
  auto log = log_of_bars();
  for (auto& one : log.throws)
    for (auto* series : {&one.ft->wrench, &one.mocap->pose})
      for (double& sigma : series->sigma) sigma *= factor;
  CampaignOptions options;
  options.observations.normal_force = options.observations.landing = false;
  return CampaignProblem(log, "(in memory)", options);
}

TEST(Sureness, OfALogThatSaysNothingIsThePriors) {
  const auto result = fit(as_of_noisy_sensors(1e4));
  ASSERT_TRUE(result.is_answer()) << result.message;
  int held = 0;
  for (const auto& u : result.campaign) {
    if (!u.unknown.prior_sigma) continue;
    const double prior = *u.unknown.prior_sigma;
    EXPECT_GT(u.data_sigma, 10 * prior) << u.unknown.name;
    // The log takes a hundredth off at most.
    EXPECT_NEAR(u.sigma / prior, 1, 0.02) << u.unknown.name;
    EXPECT_NEAR(u.value, u.unknown.start, 0.1 * prior) << u.unknown.name;
    ++held;
  }
  EXPECT_GT(held, 0);
}

// The least that the log knows is of a direction no worse than its projections on the axes together, and no
// better than the worst of them.
TEST(Sureness, ADirectionIsOpenFromThreeScalesOn) {
  int open = 0, nearly = 0;
  FitOptions quickly;
  quickly.rounds = 2;
  for (double factor = 20; factor < 600; factor *= 1.5) {
    const auto result = fit(as_of_noisy_sensors(factor), quickly);
    double most = 0, all = 0;
    for (const auto& u : result.campaign) {
      most = std::max(most, u.data_sigma / u.unknown.scale);
      all = std::hypot(all, u.data_sigma / u.unknown.scale);
    }
    if (most >= 3) {
      ASSERT_FALSE(result.open.empty()) << most;
      EXPECT_GE(result.open.back().sigma, 3);
      ++open;
    } else if (all < 3) {
      EXPECT_TRUE(result.open.empty()) << most;
      nearly += all > 1.5;
    }
  }
  EXPECT_GT(open, 0);
  EXPECT_GT(nearly, 0);
}

// Pads of twice the friction at half the force are the same pads.
TEST(Sureness, WhatIsOpenKeepsTheProductOfFrictionAndForce) {
  auto log = log_of_bars();
  for (auto& one : log.throws) one.ft.reset();
  const auto result = fit(CampaignProblem(log, "(in memory)", {}));
  ASSERT_EQ(result.open.size(), 1u);
  double relative = 0, size = 0;  // of the product, and of its factors, along the direction
  std::istringstream words(result.open.front().meaning);
  for (std::string word; words >> word;)
    for (const auto& u : result.campaign)
      if (word == u.unknown.name && (word == "mu" || word == "grip_force")) {
        double by = 0;
        ASSERT_TRUE(words >> by) << result.open.front().meaning;
        relative += by / u.value, size += std::abs(by / u.value);
      }
  EXPECT_GT(size, 0.05) << result.open.front().meaning;
  EXPECT_LT(std::abs(relative), 0.05 * size) << result.open.front().meaning;
  EXPECT_THAT(result.open.front().meaning, testing::MatchesRegex("mu [^ ]+ with grip_force [^ ]+ N"))
      << "friction has no unit";
}

TEST(Sureness, AnUnknownAtEitherEndOfItsRangeIsSaidToBe) {
  const CampaignProblem problem(log_of_bars(), "(in memory)", {});
  ASSERT_EQ(problem.campaign()[1].name, "length");
  FitOptions options;
  options.rounds = options.iterations = 1;
  options.start = problem.start();
  options.fixed = {"length"};
  for (const double length :
       {problem.campaign()[1].low, problem.campaign()[1].start, problem.campaign()[1].high}) {
    options.start[1] = length;
    const auto result = fit(problem, options);
    ASSERT_TRUE(result.is_answer()) << result.message;
    EXPECT_EQ(result.campaign[1].at_bound, length != problem.campaign()[1].start) << length;
    EXPECT_FALSE(result.campaign[0].at_bound);
    EXPECT_TRUE(result.open.empty()) << "nobody asked for the length";
  }
}

TEST(Sureness, AFitThatWasCutShortIsNotSaidToHaveConverged) {
  const CampaignProblem problem(log_of_bars(), "(in memory)", {});
  FitOptions options;
  options.start = problem.start();
  options.start[0] *= 0.7;
  EXPECT_EQ(fit(problem, options).outcome, FitOutcome::converged);
  options.rounds = options.iterations = 1;
  const auto result = fit(problem, options);
  EXPECT_EQ(result.outcome, FitOutcome::iterations_spent);
  // Spreads are learned between rounds.
  for (std::size_t k = 0; k < result.own_spread.size(); ++k)
    EXPECT_EQ(result.own_spread[k], problem.own()[k].prior_sigma.value()) << problem.own()[k].name;
}

// Of a law that misses some channels: whatever these count for in the fit, their residuals are what they are.
TEST(Sureness, ChiSquareIsOfTheResidualsAsDeclaredAndHasAllSamplesLessAllUnknowns) {
  CampaignOptions campaign;
  campaign.model = "sliding_pivot";
  const CampaignProblem problem(log_of_bars(), "(in memory)", campaign);
  FitOptions options;
  for (const std::size_t fixed : {0, 1, 2}) {
    if (fixed > 0) options.fixed.push_back(problem.campaign()[fixed - 1].name);
    const auto result = fit(problem, options);
    double chi2 = 0, least = 1;
    long samples = 0, throws = 0;
    for (std::size_t i = 0; i < result.throws.size(); ++i) {
      if (!result.throws[i].used) continue;
      const auto l = problem.linearise(problem.throws()[i], result.values(), result.throws[i].own,
                                       DerivativesBy::nothing);
      chi2 += l.residual.squaredNorm();
      samples += l.residual.size();
      ++throws;
    }
    for (const auto& m : result.misfit) least = std::min(least, m.weight);
    EXPECT_LT(least, 0.5) << "some channel counts less";
    EXPECT_NEAR(result.chi2 / chi2, 1, 1e-9);
    const auto own = static_cast<long>(problem.own().size());
    EXPECT_EQ(result.samples, samples);
    EXPECT_EQ(result.degrees_of_freedom, samples - throws * own - 2 + static_cast<long>(fixed));
  }
}

TEST(Sureness, TheReleaseBeginsWithTheOpeningAndTheFlightWithTheDetach) {
  constexpr double kOpening = 1, kDetach = 1.5;
  const auto phase = [&](experiment::Channel channel, double time) {
    return phase_of({channel, time, 0, 1}, kOpening, kDetach);
  };
  using experiment::Channel;
  EXPECT_EQ(phase(Channel::mocap_x, 0.999), Phase::grasped);
  EXPECT_EQ(phase(Channel::mocap_x, kOpening), Phase::release);
  EXPECT_EQ(phase(Channel::wrench_fx, 1.499), Phase::release);
  EXPECT_EQ(phase(Channel::wrench_fx, kDetach), Phase::flight);
  EXPECT_EQ(phase(Channel::landing_time, 0), Phase::landing);
}

// Of normal residuals with the variance that they show, but for what all models share: n ln 2π.
TEST(Sureness, TheDevianceIsThatOfNormalResiduals) {
  const std::vector<double> wide{3, -4, 5, -2, 1}, narrow{0.5, -0.5, 0.1};
  FitResult result;
  double expected = 0;
  for (const auto* residuals : {&wide, &narrow}) {
    ChannelMisfit m;
    for (const double r : *residuals) m.n += 1, m.chi2 += r * r;
    const double sigma = residuals == &wide ? std::sqrt(55.0 / 5) : 1;  // no less than declared
    for (const double r : *residuals)
      expected -= 2 * std::log(std::exp(-0.5 * std::pow(r / sigma, 2)) / sigma);
    result.misfit.push_back(m);
  }
  EXPECT_NEAR(result.deviance(), expected, 1e-12);
}

TEST(Sureness, CorrelationIsCovarianceOverBothSigmas) {
  FitResult result;
  result.campaign.resize(3);
  result.covariance = {4, 1, -3, 1, 9, 0, -3, 0, 25};
  EXPECT_NEAR(result.correlation(0, 1), 1 / (2.0 * 3), 1e-15);
  EXPECT_NEAR(result.correlation(2, 0), -3 / (2.0 * 5), 1e-15);
  EXPECT_EQ(result.correlation(1, 2), 0);
  EXPECT_EQ(result.correlation(1, 1), 1);
}

TEST(Sureness, TheMostFrequentReasonIsGiven) {
  FitResult result;
  for (const char* why : {"it spins", "it slips", "", "it slips", "a wall"}) {
    result.throws.emplace_back();
    result.throws.back().why_not = why;
  }
  EXPECT_EQ(result.why_not(), "it slips (2 throws)");
}

}  // namespace
}  // namespace unhand::fitting
