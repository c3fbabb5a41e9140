// What the scatter between throws says: closed forms for a mean of n numbers, and for residuals that stay.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numeric>
#include <random>
#include <string>

#include "fitting/misfit.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

TEST(ScatterCovariance, OfAMeanIsTheTextbooks) {
  // Throws that say y_i with information 1 each: the fit is the mean, its variance s^2/n, n - 1 degrees.
  const std::vector<double> y{3, -1, 4, 1, -5, 9, -2, 6};
  const double n = static_cast<double>(y.size()), mean = std::accumulate(y.begin(), y.end(), 0.0) / n;
  NormalEquations equations;
  equations.information = Eigen::MatrixXd::Constant(1, 1, n);
  double square = 0;
  for (const double one : y) {
    ThrowEquations part;
    part.gradient = Eigen::VectorXd::Constant(1, mean - one);
    part.information = Eigen::MatrixXd::Constant(1, 1, 1);
    equations.throws.push_back(part);
    square += (one - mean) * (one - mean);
  }
  const auto found = scatter_covariance(equations, Eigen::MatrixXd::Zero(1, 1));
  EXPECT_NEAR(found.covariance(0, 0), square / (n - 1) / n, 1e-12);
  EXPECT_NEAR(found.degrees_of_freedom[0], n - 1, 1e-9);
}

TEST(ScatterCovariance, AnUnknownOfWhichNothingIsSaidDoesNotTouchTheOthers) {
  // A mean of eight numbers, beside a second unknown without information: the give of pads that have none.
  NormalEquations alone, beside;
  alone.information = Eigen::MatrixXd::Constant(1, 1, 8);
  beside.information = Eigen::MatrixXd::Zero(2, 2);
  beside.information(0, 0) = 8;
  for (const double y : {3, -1, 4, 1, -5, 9, -2, 6}) {
    ThrowEquations part;
    part.gradient = Eigen::VectorXd::Constant(1, 1.875 - y);
    part.information = Eigen::MatrixXd::Constant(1, 1, 1);
    alone.throws.push_back(part);
    part.gradient = Eigen::Vector2d(1.875 - y, 0);
    part.information = Eigen::MatrixXd::Zero(2, 2);
    part.information(0, 0) = 1;
    beside.throws.push_back(part);
  }
  const auto one = scatter_covariance(alone, Eigen::MatrixXd::Zero(1, 1));
  const auto two = scatter_covariance(beside, Eigen::MatrixXd::Zero(2, 2));
  EXPECT_NEAR(two.covariance(0, 0), one.covariance(0, 0), 1e-12);
  EXPECT_NEAR(two.degrees_of_freedom[0], one.degrees_of_freedom[0], 1e-9);
  EXPECT_FALSE(two.covariance(1, 1) < 1e12);
  EXPECT_GE(two.degrees_of_freedom[1], 1);  // a number
}

// The mean of eight conditions of five throws each. Throws scatter as declared, conditions twice as much: by
// conditions the 95 % interval holds, by throws it is a lie; and where conditions do not scatter, the noise
// is known, and the interval not wider than that says.
TEST(ScatterCovariance, RepetitionsThatShareAnErrorAreOneWitness) {
  constexpr int kConditions = 8, kRepeats = 5, kDraws = 2000;
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(1, 1);
  const auto misses = [](const ScatterCovariance& s, double mean) {
    return std::abs(mean) > student_factor(s.degrees_of_freedom[0]) * std::sqrt(s.covariance(0, 0));
  };
  for (const double shared : {0.0, 2.0}) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    int by_conditions = 0, by_throws = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      std::vector<double> said;
      std::vector<std::string> condition;
      for (int c = 0; c < kConditions; ++c) {
        const double of_all = shared * normal(random);
        for (int k = 0; k < kRepeats; ++k) {
          said.push_back(of_all + normal(random));
          condition.push_back(std::to_string(c));
        }
      }
      const double n = kConditions * kRepeats, mean = std::accumulate(said.begin(), said.end(), 0.0) / n;
      NormalEquations equations;
      equations.information = Eigen::MatrixXd::Constant(1, 1, n);
      for (const double one : said) {
        ThrowEquations part;
        part.gradient = Eigen::VectorXd::Constant(1, mean - one);
        part.information = Eigen::MatrixXd::Constant(1, 1, 1);
        equations.throws.push_back(part);
      }
      by_conditions += misses(scatter_covariance(equations, condition, none), mean);
      by_throws += misses(scatter_covariance(equations, none), mean);
    }
    EXPECT_LT(by_conditions, 0.065 * kDraws) << shared;
    EXPECT_GT(by_conditions, 0.015 * kDraws) << shared;
    if (shared > 0) {
      EXPECT_GT(by_throws, 0.3 * kDraws);
    }
  }
}

TEST(ScatterCovariance, UnequalSharesLeaveFewerDegrees) {
  // One throw that holds as much as all others: its residual is half followed, and it speaks for few. As
  // Satterthwaite counts: of a sum of squares of normal numbers with covariance B, (tr B)² / tr B². The
  // residual of a weighted mean from a throw of the share h has the variance (1 − h) of that throw's noise,
  // by which its square is enlarged, and residuals of two throws covary.
  NormalEquations equations;
  equations.information = Eigen::MatrixXd::Constant(1, 1, 20);
  for (int i = 0; i < 11; ++i) {
    ThrowEquations part;
    const double share = i == 0 ? 10 : 1;
    part.gradient = Eigen::VectorXd::Constant(1, 0.1 * share);  // all within the noise
    part.information = Eigen::MatrixXd::Constant(1, 1, share);
    equations.throws.push_back(part);
  }
  Eigen::VectorXd share = Eigen::VectorXd::Constant(11, 1 / 20.0);
  share[0] = 10 / 20.0;
  Eigen::MatrixXd B(11, 11);
  for (int i = 0; i < 11; ++i)
    for (int j = 0; j < 11; ++j)
      B(i, j) = share[i] * ((i == j) - share[j]) / std::sqrt((1 - share[i]) * (1 - share[j]));
  const auto found = scatter_covariance(equations, Eigen::MatrixXd::Zero(1, 1));
  EXPECT_NEAR(found.degrees_of_freedom[0], std::pow(B.trace(), 2) / (B * B).trace(), 1e-9);
}

TEST(ScatterCovariance, ThrowsThatAgreeTooWellAreNotQuiteBelieved) {
  // n throws of information 1 with residuals s, and one more of variance 1.
  constexpr int kThrows = 5;
  for (const double s : {0.0, 0.3, 0.9, 2.0}) {
    NormalEquations equations;
    equations.information = Eigen::MatrixXd::Constant(1, 1, kThrows);
    for (int i = 0; i < kThrows; ++i) {
      ThrowEquations part;
      part.gradient = Eigen::VectorXd::Constant(1, i % 2 ? s : -s);
      part.information = Eigen::MatrixXd::Constant(1, 1, 1);
      equations.throws.push_back(part);
    }
    const double n = kThrows, own = s * s * n / (n - 1);  // the textbook's variance of one throw
    const double expected = own < 1 ? (1 + (n - 1) * own) / n : own;
    const auto found = scatter_covariance(equations, Eigen::MatrixXd::Zero(1, 1));
    EXPECT_NEAR(found.covariance(0, 0), expected / n, 1e-12) << s;
  }
}

// One size from twenty groups, another from one to three, all of which scatter five times as much as their
// noise says: a single one cannot tell that by itself.
// One throw, which the fit follows, does not scatter: what it says is as sure as its noise, and not surer for
// what is known beforehand of something else or of the same. Between that and three throws alike, nothing
// jumps.
TEST(ScatterCovariance, OneThrowAloneIsAsSureAsItsNoise) {
  NormalEquations equations;
  ThrowEquations only;
  only.information = Eigen::Matrix2d{{100, 3}, {3, 4}};
  only.gradient = Eigen::Vector2d::Zero();
  equations.information = only.information;
  equations.throws = {only};
  for (const double known : {0.0, 1e-4, 0.01, 0.1}) {
    const Eigen::MatrixXd prior = Eigen::Vector2d(0, known).asDiagonal();
    const auto found = scatter_covariance(equations, prior);
    const Eigen::Matrix2d noise = (only.information + prior).inverse();
    EXPECT_NEAR(found.covariance(0, 0), noise(0, 0), 0.02 * noise(0, 0)) << known;
    EXPECT_NEAR(found.covariance(1, 1), noise(1, 1), 0.2 * noise(1, 1)) << known;
    EXPECT_LT(found.degrees_of_freedom[0], 2) << known;
  }
}

TEST(ScatterCovariance, FewGroupsBorrowTheScatterOfMany) {
  constexpr int kMany = 20, kDraws = 1000;
  constexpr double kScatter = 5;
  for (const int few : {1, 2, 3}) {
    std::mt19937_64 random(static_cast<std::uint64_t>(few));
    std::normal_distribution<double> normal;
    int misses = 0, misses_of_many = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      std::vector<double> said;
      for (int i = 0; i < kMany + few; ++i) said.push_back(kScatter * normal(random));
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (int i = 0; i < kMany + few; ++i) mean[i < kMany ? 0 : 1] += said[i] / (i < kMany ? kMany : few);
      std::vector<Cluster> groups;
      for (int i = 0; i < kMany + few; ++i) {
        Cluster one{Eigen::Matrix2d::Zero(), Eigen::Vector2d::Zero()};
        const int k = i < kMany ? 0 : 1;
        one.information(k, k) = 1, one.gradient[k] = mean[k] - said[i];
        groups.push_back(one);
      }
      const Eigen::Matrix2d information = Eigen::Vector2d(kMany, few).asDiagonal(),
                            none = Eigen::Matrix2d::Zero();
      const auto outside = [&](const ScatterCovariance& s, int k) {
        return std::abs(mean[k]) > student_factor(s.degrees_of_freedom[k]) * std::sqrt(s.covariance(k, k));
      };
      const auto found = borrowing_scatter(groups, information, none);
      misses += outside(found, 1), misses_of_many += outside(found, 0);
    }
    // 5 % by design; of 1000 draws that scatters by 0.7 %. Borrowed are four degrees, not all nineteen.
    EXPECT_NEAR(misses_of_many, 0.05 * kDraws, 3 * std::sqrt(0.05 * 0.95 * kDraws)) << few;
    EXPECT_LT(misses, 0.08 * kDraws) << few;
    EXPECT_GT(misses, 0.005 * kDraws) << few;
  }
}

// Two unknowns in each of twelve throws: the first is seen well, the second hardly or not at all. Where the
// truth is drawn from the prior, the claimed variance is the one that estimates have.
TEST(ScatterCovariance, APriorIsAMeasurementOfKnownNoise) {
  constexpr int kThrows = 12, kDraws = 2000;
  constexpr double kPrior = 0.2;
  Eigen::Matrix2d prior = Eigen::Matrix2d::Zero();
  prior(1, 1) = 1 / (kPrior * kPrior);
  for (const double seen : {0.0, 0.1, 1.0, 25.0}) {  // of the second, by all throws together
    const Eigen::Matrix2d each = Eigen::Vector2d(1, seen / kThrows).asDiagonal();
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    double claimed = 0, squares = 0, degrees = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      const Eigen::Vector2d truth(0, kPrior * normal(random));
      std::vector<Eigen::Vector2d> said(kThrows);
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      for (auto& one : said) {
        one = each * truth + Eigen::Vector2d(normal(random), std::sqrt(seen / kThrows) * normal(random));
        sum += one;
      }
      NormalEquations equations;
      equations.information = kThrows * each;
      const Eigen::Vector2d found = (equations.information + prior).ldlt().solve(sum);
      for (const auto& one : said) {
        ThrowEquations part;
        part.information = each;
        part.gradient = each * found - one;
        equations.throws.push_back(part);
      }
      const auto scatter = scatter_covariance(equations, prior);
      claimed += scatter.covariance(1, 1) / kDraws;
      degrees += scatter.degrees_of_freedom[1] / kDraws;
      squares += std::pow(found[1] - truth[1], 2) / kDraws;
    }
    // A mean of 2000 squares is known to 3 %.
    EXPECT_NEAR(claimed, squares, 0.1 * squares) << seen;
    if (seen == 0) {
      EXPECT_EQ(degrees, kCertain) << "nothing of it is estimated";
    } else if (seen == 25) {
      EXPECT_NEAR(degrees, 4 * (kThrows - 1), 4) << "half of the variance is";
    }
  }
}

// Eight conditions of twenty throws each: what conditions scatter beyond the noise is known from eight of
// them, the noise from all. Of V = noise + excess, only the excess is uncertain: ν (V/excess)² degrees of
// freedom.
TEST(ScatterCovariance, OnlyWhatExceedsTheNoiseIsUncertain) {
  constexpr int kConditions = 8, kRepeats = 20;
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(1, 1);
  for (const double size : {0.05, 0.3, 0.5, 2.0}) {  // of a condition's error, in sigmas of a throw
    NormalEquations equations;
    equations.information = Eigen::MatrixXd::Constant(1, 1, kConditions * kRepeats);
    std::vector<std::string> condition;
    for (int c = 0; c < kConditions; ++c)
      for (int k = 0; k < kRepeats; ++k) {
        ThrowEquations part;
        part.gradient = Eigen::VectorXd::Constant(1, (c % 2 ? size : -size) + (k % 2 ? 1 : -1));
        part.information = Eigen::MatrixXd::Constant(1, 1, 1);
        equations.throws.push_back(part);
        condition.push_back(std::to_string(c));
      }
    const double noise = 1.0 / (kConditions * kRepeats),
                 scatter = size * size / (kConditions - 1);  // the textbook's variance of a mean of eight
    const auto found = scatter_covariance(equations, condition, none);
    const double variance = std::max(noise, scatter);  // none is surer than noise lets it be
    if (scatter > noise) {
      EXPECT_NEAR(found.covariance(0, 0), variance, 1e-12) << size;
    }
    const double excess = found.covariance(0, 0) - noise, most = kConditions * kRepeats - 1;
    const double expected =
        excess > 0 ? (kConditions - 1) * std::pow(found.covariance(0, 0) / excess, 2) : HUGE_VAL;
    EXPECT_NEAR(found.degrees_of_freedom[0], std::min(expected, most), 1e-6 * most) << size;
  }
}

/// Groups of which each tells one of several unknowns, with information 1 and an error of a given size.
struct Told {
  int groups;
  double size, prior;
};
ScatterCovariance borrowing(const std::vector<Told>& unknowns) {
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n), prior = information;
  std::vector<Cluster> groups;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Told& told = unknowns[static_cast<std::size_t>(k)];
    information(k, k) = told.groups, prior(k, k) = told.prior;
    for (int i = 0; i < told.groups; ++i) {
      Cluster one{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
      one.information(k, k) = 1, one.gradient[k] = i % 2 ? told.size : -told.size;
      groups.push_back(one);
    }
  }
  return borrowing_scatter(groups, information, prior);
}

// An unknown that a prior holds has no scatter of its own to lend, and no need of another's.
TEST(ScatterCovariance, WhatAPriorHoldsNeitherLendsNorBorrows) {
  const Told many{20, 5, 0}, few{2, 3, 0}, held{2, 1, 1e4};
  const auto with = borrowing({many, few, held}), without = borrowing({many, few});
  for (const int k : {0, 1}) {
    EXPECT_NEAR(with.covariance(k, k) / without.covariance(k, k), 1, 1e-9) << k;
    EXPECT_NEAR(with.degrees_of_freedom[k], without.degrees_of_freedom[k], 1e-6) << k;
  }
  EXPECT_NEAR(with.covariance(2, 2) * held.prior, 1, 1e-3);
  // Nor where the prior says but a little more than one group that errs by nothing.
  const Told half{1, 0, 1.1};
  EXPECT_NEAR(borrowing({many, half}).covariance(1, 1) * (half.groups + half.prior), 1, 1e-9);
}

// What is lent is the textbooks' pooled variance of those that have enough groups: sums of squares over the
// sum of the degrees of freedom. It counts as four degrees.
TEST(ScatterCovariance, LendersArePooledByTheirDegrees) {
  const Told lenders[] = {{30, 4, 0}, {8, 9, 0}}, few{2, 3, 0};
  const auto found = borrowing({lenders[0], lenders[1], few});
  double squares = 0, degrees = 0;
  for (const Told& one : lenders) squares += one.groups * one.size * one.size, degrees += one.groups - 1;
  const double own = few.groups * few.size * few.size / (few.groups - 1), pooled = squares / degrees;
  EXPECT_NEAR(found.degrees_of_freedom[2], few.groups - 1 + 4, 1e-9);
  EXPECT_NEAR(found.covariance(2, 2) * few.groups, ((few.groups - 1) * own + 4 * pooled) / (few.groups + 3),
              1e-9);
}

const CampaignProblem& bars() {
  static const CampaignProblem problem(
      experiment::generate_campaign(testing_support::small_design("limit_surface_disc"), 11), "(in memory)",
      {});
  return problem;
}

// Huber's loss of a sample: a square up to five sigmas, beyond it a straight line with the slope there.
TEST(Weighting, ASampleThatIsFarOffPullsAsOneAtTheLimit) {
  const CampaignThrow& thrown = bars().throws().front();
  experiment::Observations one;
  one.all = {{experiment::Channel::mocap_x, thrown.opening - 0.01, 0, 1}};
  const auto weighed = [&](double residual) {
    Linearisation l;
    l.residual = Eigen::VectorXd::Constant(1, residual);
    l.campaign = l.own = Eigen::MatrixXd::Ones(1, 1);
    l.detach = thrown.release;
    weigh(l, one, thrown, Weighting{});
    return l;
  };
  for (const double size : {0.5, 4.9, 5.1, 30.0, 1e3})
    for (const double sign : {-1.0, 1.0}) {
      const auto half = [&](double r) { return 0.5 * weighed(sign * r).residual.squaredNorm(); };
      const Linearisation at = weighed(sign * size);
      const double h = 1e-3, pull = at.campaign(0, 0) * at.residual[0];
      EXPECT_NEAR(pull, sign * std::min(size, 5.0), 1e-9) << size;
      EXPECT_NEAR((half(size + h) - half(size - h)) / (2 * h), sign * pull, 1e-6) << size;
      EXPECT_EQ(at.own(0, 0), at.campaign(0, 0));
    }
}

// Of a throw as well, in its χ²: the gradient is that of half of 2 √(limit χ²).
TEST(Weighting, TheGradientOfAThrowThatIsFarOffIsThatOfHubersLoss) {
  const std::vector<std::size_t> used{0};
  const CampaignThrow& thrown = bars().throws().front();
  const std::vector<double> own(bars().own().size(), 0.0), surely(own.size(), 1e-9);
  Weighting weighting;
  weighting.sample_limit = 1e9;
  auto at = bars().start();
  at[0] *= 1.1;
  const auto chi2 = [&](const std::vector<double>& values) {
    return bars().linearise(thrown, values, own, DerivativesBy::nothing).residual.squaredNorm();
  };
  weighting.throw_limit = 0.1 * chi2(at);
  const auto equations = normal_equations(
      bars(), used, {bars().linearise(thrown, at, own, DerivativesBy::all)}, {own}, surely, weighting, 1);
  for (std::size_t k = 0; k < at.size(); ++k) {
    auto up = at, down = at;
    const double h = 1e-3 * at[k];
    up[k] += h, down[k] -= h;
    const double slope =
        (std::sqrt(weighting.throw_limit * chi2(up)) - std::sqrt(weighting.throw_limit * chi2(down))) /
        (2 * h);
    // Differences over a thousandth, of curves.
    EXPECT_NEAR(equations.throws[0].gradient[static_cast<Eigen::Index>(k)] / slope, 1, 0.01)
        << bars().campaign()[k].name;
  }
}

// A throw's own unknown of a linear model: whatever it is now, one step leads to the same least squares.
TEST(Weighting, WhatIsKnownOfAnOwnUnknownPullsItBack) {
  const Eigen::Vector3d slope(1, -2, 0.5), rest(3, 1, -4);
  const double sigma = 0.4, expected = -slope.dot(rest) / (slope.squaredNorm() + 1 / (sigma * sigma));
  for (const double now : {-2.0, 0.0, expected, 5.0}) {
    const Eigen::VectorXd residual = rest + now * slope;
    const Eigen::MatrixXd gram = throw_gram(slope, residual, {now}, {sigma});
    EXPECT_NEAR(now - gram(0, 1) / gram(0, 0), expected, 1e-12);
    EXPECT_EQ(gram(0, 1), gram(1, 0));
    EXPECT_NEAR(gram(1, 1), residual.squaredNorm() + std::pow(now / sigma, 2), 1e-9);
  }
}

Misfit::Part part_of_residuals(const std::vector<double>& r) {
  Misfit::Part out;
  for (const double x : r) out.n += 1, out.sum += x, out.squares += x * x;
  return out;
}

TEST(Misfit, NoiseCountsAsDeclared) {
  const std::vector<Misfit::Part> noise(10, part_of_residuals({1, -1, 1, -1, 1, -1, 1, -1}));
  EXPECT_EQ(Misfit::factor(noise, Weigh::witnesses), 1);
}

TEST(Misfit, AnErrorThatStaysIsOneWitness) {
  // n residuals of 7 sigma each, in each of k throws: their mean, 7, has the weight of one sample of 7 sigma.
  const double k = 1000, n = 25, size = 7;
  const std::vector<Misfit::Part> stays(
      static_cast<std::size_t>(k), part_of_residuals(std::vector<double>(static_cast<std::size_t>(n), size)));
  const double allowed = 1 + 3 * std::sqrt(2 / k);
  EXPECT_NEAR(Misfit::factor(stays, Weigh::witnesses), std::sqrt(allowed / n) / size, 1e-12);
  EXPECT_NEAR(Misfit::factor(stays, Weigh::variances), std::sqrt(1 + 3 * std::sqrt(2 / (k * n))) / size,
              1e-12);
  // White, and as large: n witnesses.
  std::vector<double> white;
  for (int i = 0; i < static_cast<int>(n) - 1; ++i) white.push_back(i % 2 ? size : -size);
  const std::vector<Misfit::Part> large(static_cast<std::size_t>(k), part_of_residuals(white));
  EXPECT_NEAR(Misfit::factor(large, Weigh::witnesses), std::sqrt(1 + 3 * std::sqrt(2 / (k * (n - 1)))) / size,
              1e-12);
}

TEST(Misfit, OneWildThrowDoesNotSpeak) {
  std::vector<Misfit::Part> parts(10, part_of_residuals({1, -1, 1, -1}));
  parts[3] = part_of_residuals({100, 100, 100, 100});
  EXPECT_EQ(Misfit::factor(parts, Weigh::witnesses), 1);
}

}  // namespace
}  // namespace unhand::fitting
