// The costs that a solver sees: what is held at a bound, and what is known beforehand.
#include "fitting/throw_cost.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

// In units of its scale: a range of 1 to 3 is 2 to 6 halves.
TEST(ThrowCost, AnUnknownIsHeldAtABoundThatItsCostFallsBeyond) {
  Unknown u;
  u.low = 1, u.high = 3;
  constexpr double kScale = 0.5;
  for (const double slope : {-1.0, 1.0}) {
    EXPECT_EQ(is_held(2, slope, u, kScale), slope > 0) << "falls below the range";
    EXPECT_EQ(is_held(6, slope, u, kScale), slope < 0) << "falls above the range";
    EXPECT_FALSE(is_held(4, slope, u, kScale));
  }
}

// Without any throw the prior alone speaks, which leads inward from both ends of a range.
TEST(ThrowCost, APriorIsAMeasurementOfItsMean) {
  const CampaignProblem problem(testing_support::small_log(), "(in memory)", {});
  const FitOptions options;
  const std::size_t n = problem.campaign().size();
  Shared shared{problem, options, std::vector<double>(n, 0.1), {}, {}, {}};
  const std::vector<std::size_t> no_throws;
  SimulatedThrows simulated(shared, no_throws);
  const Unknown& mu = problem.campaign().front();
  ASSERT_TRUE(mu.prior_sigma.has_value());
  for (const double value : {mu.low, mu.start, mu.high}) {
    std::vector<double> x(n, 0.5);
    const std::vector<double> own;
    x[0] = value / 0.1;
    AllThrows all(shared, simulated, no_throws, x, own);
    all.PrepareForEvaluation(true, true);
    EXPECT_FALSE(all.holds(0)) << value;
    constexpr double kMean = 4, kSigma = 0.25;
    const PriorCost cost(all, static_cast<int>(n), 0, kMean, kSigma);
    std::vector<double> slope(n, 7.0);
    const double* at = x.data();
    double* slopes = slope.data();
    double here = 0, there = 0;
    ASSERT_TRUE(cost.Evaluate(&at, &here, &slopes));
    EXPECT_NEAR(here, (x[0] - kMean) / kSigma, 1e-12) << "in sigmas";
    x[0] += 0.5;
    ASSERT_TRUE(cost.Evaluate(&at, &there, nullptr));
    EXPECT_NEAR(slope[0], (there - here) / 0.5, 1e-9) << "a straight line";
    for (std::size_t k = 1; k < n; ++k) EXPECT_EQ(slope[k], 0);
  }
}

}  // namespace
}  // namespace unhand::fitting
