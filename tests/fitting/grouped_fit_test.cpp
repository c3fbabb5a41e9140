// Least squares over groups with robust weights: it ends at the minimum, whatever it started from.
#include "fitting/measured/grouped_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace unhand::fitting {
namespace {

constexpr int kGroups = 12, kSamples = 40;

/// y = a x + b x² + an offset of each group, measured with σ = 1; some samples are far off.
class Parabolas final : public GroupedProblem {
 public:
  explicit Parabolas(double far_off) {
    channels_ = {"y"};
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise;
    for (int g = 0; g < kGroups; ++g) {
      Group group{"g" + std::to_string(g), "object", "", datasets::Split::train, {}, {0.0}, {}};
      std::vector<double> y;
      for (int i = 0; i < kSamples; ++i) {
        const double x = at(i), wild = i % 10 == g % 10 ? far_off * (1 + i % 3) : 0;
        group.rows.push_back({0, x});
        y.push_back(3 * x + 2 * x * x + 0.5 * g + wild + noise(random));
      }
      groups_.push_back(std::move(group));
      measured_.push_back(std::move(y));
    }
  }
  static double at(int i) { return i / 10.0 - 2; }
  double measured(int group, int i) const { return measured_[group][i]; }
  std::vector<dynamics::Effect> effects() const override { return {}; }
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives derivatives) const override {
    EXPECT_EQ(names.size(), 2u);
    const auto residual = [&]<class S>(const std::vector<S>& shared, const std::vector<S>& offset) {
      std::vector<S> out;
      for (int i = 0; i < kSamples; ++i)
        out.push_back(shared[0] * at(i) + shared[1] * (at(i) * at(i)) + offset[0] - measured_[group][i]);
      return out;
    };
    return swept({values.begin(), values.end()}, own, derivatives, residual);
  }

 private:
  std::vector<std::vector<double>> measured_;
};

std::vector<SharedParameter> parameters(double most_a) {
  return {{"a", "line", "a", "", 0, -100, most_a, 1, false}, {"b", "line", "b", "", 0, -100, 100, 1, false}};
}

// Huber's loss is smooth: at its minimum the clipped residuals are orthogonal to what every unknown does.
TEST(GroupedFit, SamplesThatAreFarOffDoNotStopItShortOfTheMinimum) {
  const Parabolas problem(400);
  const GroupedFitOptions options;
  const auto fit = fit_groups(problem, datasets::Split::train, parameters(100), Eigen::VectorXd::Zero(2));
  ASSERT_TRUE(fit.solved);
  const double limit = options.sample_limit * fit.weights.channel_scale[0];
  Eigen::Vector2d shared = Eigen::Vector2d::Zero();
  int beyond = 0;
  for (int g = 0; g < kGroups; ++g) {
    double own = 0;
    for (int i = 0; i < kSamples; ++i) {
      const double x = Parabolas::at(i), r = fit.values[0] * x + fit.values[1] * x * x +
                                             fit.groups[g].own[0] - problem.measured(g, i);
      EXPECT_NEAR(r, fit.groups[g].residual[i], 1e-9);
      beyond += std::abs(r) > limit;
      const double clipped = fit.weights.group[g] * std::clamp(r, -limit, limit);
      own += clipped;
      shared += clipped * Eigen::Vector2d(x, x * x);
    }
    EXPECT_NEAR(own, 0, 0.02) << g;  // of 40 samples, some of which pull with the limit
  }
  EXPECT_GT(beyond, kGroups * kSamples / 25);
  EXPECT_LT(shared.cwiseAbs().maxCoeff(), 0.1);
}

TEST(GroupedFit, WhereOneParameterEndsAtItsRangeTheOthersAreAtTheirBestBesideIt) {
  const Parabolas problem(0);
  GroupedFitOptions options;
  options.robust = false;
  const double most = 2.5;
  const auto fit =
      fit_groups(problem, datasets::Split::train, parameters(most), Eigen::VectorXd::Zero(2), options);
  ASSERT_TRUE(fit.solved);
  EXPECT_EQ(fit.values[0], most);
  // Linear least squares with a given: b, and an offset of each group.
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(kGroups * kSamples, 1 + kGroups);
  Eigen::VectorXd y(A.rows());
  for (int g = 0; g < kGroups; ++g)
    for (int i = 0; i < kSamples; ++i) {
      const int row = g * kSamples + i;
      const double x = Parabolas::at(i);
      A(row, 0) = x * x, A(row, 1 + g) = 1;
      y[row] = problem.measured(g, i) - most * x;
    }
  const Eigen::VectorXd best = A.householderQr().solve(y);
  EXPECT_NEAR(fit.values[1], best[0], 1e-9);
  for (int g = 0; g < kGroups; ++g) EXPECT_NEAR(fit.groups[g].own[0], best[1 + g], 1e-9) << g;
}

TEST(GroupedFit, IsTheSameFromWhereAnotherFitEnded) {
  const Parabolas problem(400);
  const auto other = fit_groups(problem, datasets::Split::train, parameters(1), Eigen::VectorXd::Zero(2));
  const auto far = fit_groups(problem, datasets::Split::train, parameters(100), Eigen::VectorXd::Zero(2));
  const auto near = fit_groups(problem, datasets::Split::train, parameters(100), other.values, {}, &other);
  ASSERT_TRUE(far.solved && near.solved);
  for (int k = 0; k < 2; ++k) EXPECT_NEAR(near.values[k], far.values[k], 1e-3 * far.sigma(k)) << k;
  EXPECT_NEAR(near.chi2, far.chi2, 1e-6 * far.chi2);
}

/// y = a x + b (x + e x²) + an offset of each group: for a small e, a and b do nearly the same.
class NearlyTheSame final : public GroupedProblem {
 public:
  explicit NearlyTheSame(double e) : e_(e) {
    channels_ = {"y"};
    std::mt19937_64 random(6);
    std::normal_distribution<double> noise;
    for (int g = 0; g < kGroups; ++g) {
      Group group{"g" + std::to_string(g), "object", "", datasets::Split::train, {}, {0.0}, {}};
      std::vector<double> y;
      for (int i = 0; i < kSamples; ++i) {
        group.rows.push_back({0, Parabolas::at(i)});
        y.push_back(noise(random));
      }
      groups_.push_back(std::move(group));
      measured_.push_back(std::move(y));
    }
  }
  std::vector<dynamics::Effect> effects() const override { return {}; }
  GroupEquations equations(std::size_t group, std::span<const std::string>, std::span<const double> values,
                           const Eigen::VectorXd& own, Derivatives derivatives) const override {
    const auto residual = [&]<class S>(const std::vector<S>& shared, const std::vector<S>& offset) {
      std::vector<S> out;
      for (int i = 0; i < kSamples; ++i) {
        const double x = Parabolas::at(i);
        out.push_back(shared[0] * x + shared[1] * (x + e_ * x * x) + offset[0] - measured_[group][i]);
      }
      return out;
    };
    return swept({values.begin(), values.end()}, own, derivatives, residual);
  }

 private:
  double e_;
  std::vector<std::vector<double>> measured_;
};

// A card's reader refuses any other.
TEST(GroupedFit, TheCovarianceOfParametersThatAreNearlyTheSameIsOne) {
  for (const double e : {1e-3, 1e-4, 1e-5, 1e-6}) {
    const NearlyTheSame problem(e);
    auto wide = parameters(1e9);
    for (auto& p : wide) p.low = -1e9, p.high = 1e9;
    const auto fit = fit_groups(problem, datasets::Split::train, wide, Eigen::VectorXd::Zero(2));
    ASSERT_TRUE(fit.solved) << e;
    const Eigen::MatrixXd& C = fit.covariance;
    const double scale = std::sqrt(C(0, 0) * C(1, 1));
    EXPECT_GT(C(0, 0), 0) << e;
    EXPECT_GT(C(1, 1), 0) << e;
    EXPECT_LE(std::abs(C(0, 1) - C(1, 0)), 1e-12 * scale) << e;
    EXPECT_LE(std::abs(C(0, 1)), (1 + 1e-12) * scale) << e;
  }
}

}  // namespace
}  // namespace unhand::fitting
