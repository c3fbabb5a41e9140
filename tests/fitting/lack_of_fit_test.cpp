// The test for lack of fit against hand arithmetic and against chance.
#include "fitting/discovery/lack_of_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fitting/distributions.hpp"

namespace unhand::fitting {
namespace {

// Two conditions of two repetitions: 1 and 3, −2 and −4. About their means 2 and −3 they leave 1 each, so
// that repetitions scatter by 4/(4 − 2) = 2; the mean square of all is 30/4.
TEST(LackOfFit, SplitsErrorsIntoWhatRepetitionsShareAndWhatNot) {
  const LackOfFit fit = lack_of_fit({{1, 0}, {3, 0}, {-2, 0}, {-4, 0}}, {0, 0, 1, 1});
  EXPECT_DOUBLE_EQ(fit.repetitions, 2.0);
  EXPECT_DOUBLE_EQ(fit.shared, 7.5 - 2.0);
  EXPECT_DOUBLE_EQ(fit.ratio(), 7.5 / 2);
  EXPECT_DOUBLE_EQ(fit.p_value, f_tail((26.0 / 2) / 2.0, 2, 2));  // Σ n mean² = 2·4 + 2·9
}

TEST(LackOfFit, TurnsWithItsAxes) {
  const double c = std::cos(0.7), s = std::sin(0.7);
  const std::vector<std::array<double, 2>> error{{1, 2}, {3, 1}, {-2, 0.5}, {-4, -1}, {0.2, 3}};
  std::vector<std::array<double, 2>> turned;
  for (const auto& e : error) turned.push_back({c * e[0] - s * e[1], s * e[0] + c * e[1]});
  const std::vector<int> condition{0, 0, 1, 1, 1};
  const LackOfFit a = lack_of_fit(error, condition), b = lack_of_fit(turned, condition);
  EXPECT_NEAR(a.repetitions, b.repetitions, 1e-14);
  EXPECT_NEAR(a.shared, b.shared, 1e-14);
  EXPECT_NEAR(a.p_value, b.p_value, 1e-14);
}

TEST(LackOfFit, SaysNothingWithoutRepetitions) {
  const LackOfFit fit = lack_of_fit({{5, 0}, {-7, 0}, {9, 0}, {9.1, 0}}, {0, 1, 2, 2});
  EXPECT_EQ(fit.p_value, 1);
  EXPECT_EQ(fit.ratio(), 1);
  EXPECT_EQ(lack_of_fit({}, {}).p_value, 1);
  EXPECT_EQ(lack_of_fit({{0, 0}, {0, 0}, {0, 0}}, {0, 0, 0}).p_value, 1) << "no scatter, no floor";
}

// Chance alone: p is uniform for one component, and rarer than that for two, which count as one witness.
TEST(LackOfFit, ChanceIsCalledByItsShareAndASharedErrorIsSeen) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise;
  const int campaigns = 4000;
  int one = 0, two = 0, seen = 0;
  for (int c = 0; c < campaigns; ++c) {
    std::vector<std::array<double, 2>> a, b, off;
    std::vector<int> condition;
    for (int k = 0; k < 6; ++k) {
      const double shared = 2 * noise(random);
      for (int i = 0; i < 4; ++i) {
        a.push_back({noise(random), 0});
        b.push_back({noise(random), noise(random)});
        off.push_back({shared + noise(random), 0});
        condition.push_back(k);
      }
    }
    one += lack_of_fit(a, condition).p_value < 0.05;
    two += lack_of_fit(b, condition).p_value < 0.05;
    seen += lack_of_fit(off, condition).p_value < 0.05;
  }
  EXPECT_NEAR(one, 0.05 * campaigns, 4 * std::sqrt(0.05 * 0.95 * campaigns));
  EXPECT_LT(two, one);
  EXPECT_GT(seen, 0.95 * campaigns) << "twice the scatter, shared by four repetitions";
}

}  // namespace
}  // namespace unhand::fitting
