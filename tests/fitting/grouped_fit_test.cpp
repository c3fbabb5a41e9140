// Least squares over groups with robust weights: it ends at the minimum, whatever it started from.
#include "fitting/measured/grouped_fit.hpp"
#include "fitting/measured/effect_trial.hpp"

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
  explicit Parabolas(double far_off, double sigma = 1, const std::vector<double>& slopes = {}) {
    channels_ = {"y"};
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise;
    for (int g = 0; g < kGroups; ++g) {
      Group group{"g" + std::to_string(g), "object", "", datasets::Split::train, {}, {0.0}, {}};
      std::vector<double> y;
      for (int i = 0; i < kSamples; ++i) {
        const double x = at(i), wild = i % 10 == g % 10 ? far_off * (1 + i % 3) : 0;
        group.rows.push_back({0, x});
        y.push_back((slopes.empty() ? 3 : slopes[static_cast<std::size_t>(g)]) * x + 2 * x * x + 0.5 * g +
                    wild + sigma * noise(random));
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

// Without noise, groups of one design that differ in slope: its variance is that of a mean.
TEST(GroupedFit, CovarianceIsThatOfTheMeanOfGroups) {
  const std::vector<double> slopes{3.1, 2.5, 4.2, 3.3, 1.9, 2.8, 3.6, 3.0, 2.2, 4.0, 3.4, 2.6};
  double mean = 0, squares = 0;
  for (const double a : slopes) mean += a / kGroups;
  for (const double a : slopes) squares += (a - mean) * (a - mean);
  GroupedFitOptions options;
  options.robust = false;
  const Parabolas problem(0, 0, slopes);
  const auto fit =
      fit_groups(problem, datasets::Split::train, parameters(100), Eigen::VectorXd::Zero(2), options);
  ASSERT_TRUE(fit.solved);
  EXPECT_NEAR(fit.values[0], mean, 1e-9);
  // beside the range of 200, which counts as a measurement of σ = 200/√12
  EXPECT_NEAR(fit.sigma(0), std::sqrt(squares / (kGroups * (kGroups - 1.0))), 1e-5);
  // The other is the same in all groups: it is known no better than the declared noise allows.
  double xx = 0, xy = 0, yy = 0, x = 0, y = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double at = Parabolas::at(i);
    x += at / kSamples, y += at * at / kSamples;
  }
  for (int i = 0; i < kSamples; ++i) {
    const double u = Parabolas::at(i) - x, v = std::pow(Parabolas::at(i), 2) - y;
    xx += u * u, xy += u * v, yy += v * v;
  }
  EXPECT_NEAR(fit.sigma(1), 1 / std::sqrt(kGroups * (yy - xy * xy / xx)), 1e-6);
}

// Student's t of nine degrees of freedom is beyond 2.262157 in one of twenty cases, and in half of them on
// the side on which a bounded parameter can be.
TEST(Wald, IsStudentsTOfOneParameterAndHalfOfItOnABound) {
  GroupedFit fit;
  fit.used = 10;
  const Eigen::VectorXd away = Eigen::VectorXd::Constant(1, 3 * 2.262157);
  const Eigen::MatrixXd variance = Eigen::MatrixXd::Constant(1, 1, 9);
  const Eigen::VectorXd nine = Eigen::VectorXd::Constant(1, 9.0);
  EXPECT_NEAR(wald_of(away, variance, nine, {0}).p_value(fit), 0.05, 1e-6);
  EXPECT_NEAR(wald_of(away, variance, nine, {1}).p_value(fit), 0.025, 1e-6);
  EXPECT_NEAR(wald_of(away, variance, nine, {0}).delta_bic(fit), std::log(10) - 2.262157 * 2.262157, 1e-9);
}

// Hotelling: T² (n − p)/(p (n − 1)) is F of p and n − p; F_{2,8} exceeds 4.458970 in one of twenty cases. Of
// the two ways to look, all parameters and the largest alone, the surer one counts twice.
TEST(Wald, IsHotellingsTOfTwo) {
  GroupedFit fit;
  fit.used = 10;
  const double size = 4.458970 * 2 * 9 / 8;  // T²
  Eigen::Vector2d away(std::sqrt(size / 2), std::sqrt(size / 2));
  const auto wald = [&](double freedom) {
    return wald_of(away, Eigen::Matrix2d::Identity(), Eigen::Vector2d::Constant(freedom), {0, 0});
  };
  EXPECT_NEAR(wald(9).p_value(fit), 0.1, 1e-6);
  fit.used = 3;  // of two parameters' scatter these say nothing
  EXPECT_GT(wald(2).p_value(fit), 0.1);
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
