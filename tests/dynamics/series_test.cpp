// Small tools on series: the straight line, the quintic, and the noise on a smooth quantity.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "dynamics/quintic.hpp"
#include "dynamics/straight_line.hpp"
#include "dynamics/white_noise.hpp"

namespace {

using namespace unhand::dynamics;

TEST(StraightLine, MinimisesTheSquares) {
  const std::vector<double> t{0.1, 0.4, 0.5, 1.2}, y{1, 3, 2, 5};
  const StraightLine line = fit_line(t, y);
  double sum = 0, moment = 0;  // the residuals are orthogonal to 1 and t
  for (std::size_t i = 0; i < t.size(); ++i) {
    sum += y[i] - line.at(t[i]);
    moment += (y[i] - line.at(t[i])) * t[i];
  }
  EXPECT_NEAR(sum, 0, 1e-14);
  EXPECT_NEAR(moment, 0, 1e-14);
  EXPECT_NEAR(line.at(1) - line.at(0), line.slope, 1e-14);
}

TEST(Quintic, MeetsBothStates) {
  const std::array<double, 3> first{0.3, -2, 7}, last{1.1, 0.5, -40};
  const double h = 0.25;
  const auto c = quintic_between(first, last, h);
  std::array<double, 3> begin{}, end{};  // each derivative of the sum, term by term
  for (int k = 0; k < 6; ++k) {
    double factor = c[k];
    for (int d = 0; d < 3 && d <= k; ++d) {
      begin[d] += k == d ? factor : 0;
      end[d] += factor * std::pow(h, k - d);
      factor *= k - d;
    }
  }
  for (int d = 0; d < 3; ++d) {
    EXPECT_DOUBLE_EQ(begin[d], first[d]);
    EXPECT_NEAR(end[d], last[d], 1e-12);  // terms of some 1e3 cancel
  }
}

TEST(WhiteNoise, IsToldFromASmoothMotionWithAJump) {
  constexpr double kSigma = 0.01;
  constexpr int kCount = 4000;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, kSigma);
  std::vector<double> both;  // two columns: noisy, and not
  for (int i = 0; i < kCount; ++i) {
    const double t = 1e-3 * i, smooth = std::sin(5 * t) + (t > 2 ? 1 : 0);
    both.push_back(smooth + noise(random));
    both.push_back(smooth);
  }
  // The median of n correlated differences is known to some 2/sqrt(n).
  EXPECT_NEAR(white_noise(both, 0, 2), kSigma, 3 * 2 / std::sqrt(kCount) * kSigma);
  EXPECT_LT(white_noise(both, 1, 2), 1e-6 * kSigma);
  EXPECT_EQ(white_noise(std::vector<double>{1, 2, 3, 4}), 0);
}

TEST(WhiteNoise, TrimmedIsSurerAndForgivesSpikes) {
  constexpr double kSigma = 0.01;
  constexpr int kCount = 400, kRuns = 400;
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0, kSigma);
  double trimmed = 0, middle = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> y;
    for (int i = 0; i < kCount; ++i) y.push_back((i > 200 ? 1 : 0) + noise(random));
    trimmed += std::pow(trimmed_white_noise(y) / kSigma - 1, 2) / kRuns;
    middle += std::pow(white_noise(y) / kSigma - 1, 2) / kRuns;
    for (int i = 10; i < kCount; i += 100) y[i] += 1;  // 1 % of the samples, 5 % of the differences
    EXPECT_NEAR(trimmed_white_noise(y), kSigma, 5 * 1.15 / std::sqrt(kCount) * kSigma);
  }
  EXPECT_NEAR(std::sqrt(trimmed), 1.15 / std::sqrt(kCount), 0.15 * 1.15 / std::sqrt(kCount));
  EXPECT_LT(trimmed, 0.6 * middle);
  EXPECT_EQ(trimmed_white_noise(std::vector<double>{1, 2, 3, 4}), 0);
}

}  // namespace
