// The test for lack of fit against hand arithmetic and against chance.
#include "fitting/discovery/lack_of_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace unhand::fitting {
namespace {

// Two conditions of two repetitions: 1 and 3, −2 and −4. About their means 2 and −3 they leave 1 each, so
// that repetitions scatter by 4/(4 − 2) = 2; the mean square of all is 30/4.
TEST(LackOfFit, SplitsErrorsIntoWhatRepetitionsShareAndWhatNot) {
  const LackOfFit fit = lack_of_fit({{1, 0}, {3, 0}, {-2, 0}, {-4, 0}}, {0, 0, 1, 1});
  EXPECT_DOUBLE_EQ(fit.repetitions, 2.0);
  EXPECT_DOUBLE_EQ(fit.shared, 7.5 - 2.0);
  EXPECT_DOUBLE_EQ(fit.ratio(), 7.5 / 2);
  // Both conditions agree with themselves as much as signs allow: a quarter of all.
  EXPECT_NEAR(fit.p_value, 0.25, 4 * std::sqrt(0.25 * 0.75 / 20000));
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

// Conditions differ in how much they scatter (one is thirty times as sensitive to the friction of the throw):
// chance is called by its share all the same, and an error that repetitions share is seen.
TEST(LackOfFit, ChanceIsCalledByItsShareAndASharedErrorIsSeen) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise;
  const int campaigns = 200;
  int by_chance = 0, seen = 0;
  for (int c = 0; c < campaigns; ++c) {
    std::vector<std::array<double, 2>> error, off;
    std::vector<int> condition;
    for (int k = 0; k < 6; ++k) {
      const double scatter = k == 0 ? 30 : 1, shared = 2 * scatter * noise(random);
      for (int i = 0; i < 4; ++i) {
        error.push_back({scatter * noise(random), scatter * noise(random)});
        off.push_back({shared + scatter * noise(random), 0});
        condition.push_back(k);
      }
    }
    by_chance += lack_of_fit(error, condition).p_value < 0.05;
    seen += lack_of_fit(off, condition).p_value < 0.05;
  }
  EXPECT_NEAR(by_chance, 0.05 * campaigns, 4 * std::sqrt(0.05 * 0.95 * campaigns));
  EXPECT_GT(seen, 0.85 * campaigns) << "twice the scatter, shared by four repetitions";
}

}  // namespace
}  // namespace unhand::fitting
