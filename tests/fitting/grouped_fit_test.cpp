// Least squares over groups with robust weights: it ends at the minimum, whatever it started from.
#include "fitting/measured/grouped_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/residual_tests.hpp"
#include "fitting/measured/wild_groups.hpp"

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

/// Groups of one channel at the times 0, 1, 2, ... with σ = 1: y = c + slope a t, c of the group, a of all.
class Lines final : public GroupedProblem {
 public:
  explicit Lines(std::vector<std::vector<double>> measured, double slope = 1)
      : measured_(std::move(measured)), slope_(slope) {
    channels_ = {"y"};
    for (std::size_t g = 0; g < measured_.size(); ++g) {
      Group group{"g" + std::to_string(g), "object", "", datasets::Split::train, {}, {0.0}, {}};
      for (std::size_t i = 0; i < measured_[g].size(); ++i) group.rows.push_back({0, static_cast<double>(i)});
      groups_.push_back(std::move(group));
    }
  }
  Group& group(std::size_t g) { return groups_[g]; }
  std::vector<dynamics::Effect> effects() const override { return {}; }
  GroupEquations equations(std::size_t group, std::span<const std::string>, std::span<const double> values,
                           const Eigen::VectorXd& own, Derivatives derivatives) const override {
    const auto residual = [&]<class S>(const std::vector<S>& shared, const std::vector<S>& offset) {
      std::vector<S> out;
      for (std::size_t i = 0; i < measured_[group].size(); ++i) {
        out.push_back(offset[0] - measured_[group][i]);
        if (!shared.empty()) out.back() += shared[0] * (slope_ * static_cast<double>(i));
      }
      return out;
    };
    return swept({values.begin(), values.end()}, own, derivatives, residual);
  }

 private:
  std::vector<std::vector<double>> measured_;
  double slope_;
};

GroupedFit fit_line(const GroupedProblem& problem, bool robust = false) {
  GroupedFitOptions options;
  options.robust = robust;
  return fit_groups(problem, datasets::Split::train, {parameters(100).front()}, Eigen::VectorXd::Zero(1),
                    options);
}

TEST(GroupedFit, GroupsThatAreSetAsideTakeNoPart) {
  Lines problem({{0, 50, 100}, {1, 2, 3}, {4, 5, 6}, {0, 1, 2}});
  problem.set_aside({0});
  const auto fit = fit_line(problem);
  EXPECT_EQ(fit.used, 3);
  EXPECT_NEAR(fit.values[0], 1, 1e-9);
  EXPECT_NEAR(fit.chi2, 0, 1e-9);
  // Three numbers of each group, less one for each and one for all.
  EXPECT_EQ(fit.samples, 9);
  EXPECT_EQ(fit.degrees_of_freedom, 9 - 3 - 1);
}

// In the place of a held-out group that is set aside, one of its own condition is held out: until that is
// taken back.
TEST(GroupedFit, AHeldOutGroupThatIsSetAsideIsReplacedByOneOfItsCondition) {
  using datasets::Split;
  Lines problem(std::vector<std::vector<double>>(5, {0, 1, 2}));
  for (const std::size_t g : {0, 3}) problem.group(g).condition = "a";
  for (const std::size_t g : {1, 2, 4}) problem.group(g).condition = "b";
  problem.group(0).split = Split::test;
  const auto held_out = [&] {
    std::string out;
    for (const Group& g : problem.groups()) out += g.set_aside ? "-" : g.split == Split::test ? "1" : "0";
    return out;
  };
  problem.set_aside({0});
  EXPECT_EQ(held_out(), "-0010");
  problem.set_aside({2});
  EXPECT_EQ(held_out(), "10-00");
  problem.set_aside({});
  EXPECT_EQ(held_out(), "10000");
}

// Of what no group sees nothing is known but its range, over which it is spread evenly.
TEST(GroupedFit, WhatNoGroupSeesIsAsUncertainAsItsRange) {
  const auto fit = fit_line(Lines(std::vector<std::vector<double>>(6, {0, 1, 2}), 0));
  EXPECT_NEAR(fit.sigma(0), 200 / std::sqrt(12), 1e-6);
}

// One that errs as no other does counts less, and its scatter with it.
TEST(GroupedFit, AGroupThatCountsLessScattersLess) {
  std::vector<std::vector<double>> measured;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int g = 0; g < 30; ++g) {
    auto& y = measured.emplace_back();
    for (int i = 0; i < 20; ++i) y.push_back((g == 0 ? 5 : 1) * i + normal(random));
  }
  const Lines problem(measured);
  const auto plain = fit_line(problem), robust = fit_line(problem, true);
  ASSERT_LT(robust.weights.group[0], 0.1);
  EXPECT_LT(robust.sigma(0), 0.3 * plain.sigma(0));
}

// Noise of three times what was declared, of which neighbours correlate by 0.6: the mean of many samples is
// as uncertain as that of a quarter of them, so that what was known before counts 3 √4 times as much.
TEST(GroupedFit, WhatIsKnownBeforehandCountsMoreBesideNoiseThatStays) {
  constexpr double kScatter = 3, kAlike = 0.6;
  std::vector<std::vector<double>> measured;
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  for (int g = 0; g < 20; ++g) {
    auto& y = measured.emplace_back();
    double noise = kScatter * normal(random);
    for (int i = 0; i < 300; ++i) {
      y.push_back(noise);
      noise = kAlike * noise + std::sqrt(1 - kAlike * kAlike) * kScatter * normal(random);
    }
  }
  const auto fit = fit_line(Lines(measured), true);
  EXPECT_NEAR(fit.weights.channel_scale[0], kScatter, 0.1 * kScatter);
  EXPECT_NEAR(fit.weights.prior, kScatter * std::sqrt((1 + kAlike) / (1 - kAlike)), 0.6);
}

/// Whose derivative has the wrong sign: every step leads uphill.
class Misled final : public GroupedProblem {
 public:
  Misled() {
    channels_ = {"y"};
    groups_.push_back({"g", "object", "", datasets::Split::train, {{0, 0}, {0, 1}}, {0.0}, {}});
  }
  std::vector<dynamics::Effect> effects() const override { return {}; }
  GroupEquations equations(std::size_t, std::span<const std::string>, std::span<const double> values,
                           const Eigen::VectorXd& own, Derivatives) const override {
    return {true, Eigen::Vector2d(own[0], own[0] + values[0] - 3), Eigen::Vector2d(0, -1),
            Eigen::Vector2d(1, 1)};
  }
};

TEST(GroupedFit, StepsThatLeadUphillAreTakenBack) {
  const auto fit = fit_line(Misled());
  EXPECT_EQ(fit.values[0], 0);
}

TEST(GroupedFit, AGroupReadsTheParametersOfItsOwnObject) {
  const std::vector<std::string> all{"g", "k[ball]", "k[box]", "m[boxer]", "n[box]"};
  const OwnNames box(all, "box");
  EXPECT_EQ(box.names, (std::vector<std::string>{"g", "k", "n"}));
  EXPECT_EQ(box.values(std::vector<double>{1, 2, 3, 4, 5}), (std::vector<double>{1, 3, 5}));
}

// The residuals of one group are five times those of the others: it errs 25 times as much, however little it
// counted for in the fit.
TEST(WildGroups, ErrByWhatTheyAreOffAndNotByWhatTheyCountFor) {
  std::vector<std::vector<double>> measured(20, {1, -1, 1, -1, 1, -1, 1, -1});
  for (double& y : measured[7]) y *= 5;
  const auto wild = wild_groups(Lines(measured, 0), {}, {});
  ASSERT_EQ(wild.size(), 1U);
  EXPECT_EQ(wild.front().group, 7U);
  EXPECT_NEAR(wild.front().times, 25, 1e-6);
  EXPECT_NEAR(wild.front().apart, 25, 1e-6);
}

// A fit of an offset to four samples leaves neighbours against each other: of white noise that is no
// correlation.
TEST(ResidualTests, WhiteNoiseDoesNotCorrelateHoweverFewSamplesAGroupHas) {
  std::vector<std::vector<double>> measured;
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (int g = 0; g < 3000; ++g) {
    auto& y = measured.emplace_back();
    for (int i = 0; i < 4; ++i) y.push_back(normal(random));
  }
  const Lines problem(measured, 0);
  GroupedFitOptions options;
  options.robust = false;
  const auto fit = fit_groups(problem, datasets::Split::train, {}, Eigen::VectorXd(), options);
  const auto found = autocorrelation(problem, fit);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found.front().lag1, 0, 0.04);  // of 9000 pairs: 0 ± 0.011
}

// Three groups that are 1, 2 and 3 σ off: their mean is 2 ± 1/√3.
TEST(ResidualTests, AProfileIsAsSureAsItsGroupsAgree) {
  const Lines problem({{0, 0}, {0, 0}, {0, 0}});
  GroupedFit fit;
  for (const double off : {1.0, 2.0, 3.0}) {
    GroupFit& g = fit.groups.emplace_back();
    g.used = g.solved = true;
    g.residual = Eigen::Vector2d(off, -1);
  }
  const auto profile = residual_profile(problem, fit, 2);
  ASSERT_EQ(profile.size(), 2U);
  EXPECT_NEAR(profile[0].mean, 2, 1e-12);
  EXPECT_NEAR(profile[0].rms, std::sqrt(14.0 / 3), 1e-12);
  EXPECT_NEAR(profile[0].z, 2 * std::sqrt(3.0), 1e-12);
  EXPECT_EQ(profile[1].mean, -1);
}

// Five samples whose squares sum to 16 beside their mean, which has taken one of them: 4 of each degree of
// freedom.
TEST(ResidualTests, WhatIsLeftIsCountedPerDegreeOfFreedom) {
  std::vector<double> y;
  for (int k = 0; k < 6; ++k) y.insert(y.end(), {3, -1, 3, -1, 1});
  const Lines problem(std::vector<std::vector<double>>(10, y), 0);
  GroupedFitOptions options;
  options.robust = false;
  const auto fit = fit_groups(problem, datasets::Split::train, {}, Eigen::VectorXd(), options);
  const LeavesNoise found = leaves_noise(problem, fit, 1.5, 1);
  ASSERT_TRUE(found.any && found.at_once);
  EXPECT_NEAR(found.time, 0.15 * 29, 1e-9);  // the first five
  EXPECT_NEAR(found.chi2_per_dof, 4, 1e-9);
}

}  // namespace
}  // namespace unhand::fitting
