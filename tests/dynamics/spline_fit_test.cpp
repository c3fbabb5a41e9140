// Piecewise polynomials inside windows, and the smoothing splines that make them.
#include "dynamics/spline_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace {

using namespace unhand::dynamics;
using Path = PiecewisePolynomial<1, 5>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Window kAlways{-kInfinity, kInfinity};

Path::Coefficients coefficients(std::array<double, 6> c) {
  Path::Coefficients out{};
  for (int k = 0; k < 6; ++k) out[k][0] = c[k];
  return out;
}

TEST(PiecewisePolynomial, TakesTheBranchOfTheWindow) {
  const Path f({0.0, 1.0, 2.0, 5.0}, {coefficients({1}), coefficients({2}), coefficients({3})});
  EXPECT_EQ(f.value(Window{0.0, 1.0}, 1.0)[0], 1.0);  // limit from the left
  EXPECT_EQ(f.value(Window{1.0, 2.0}, 1.0)[0], 2.0);  // limit from the right
  EXPECT_EQ(f.value(Window{1.0, 2.0}, 2.0)[0], 2.0);
  EXPECT_EQ(f.value(Window{2.0, 5.0}, 2.0)[0], 3.0);
  EXPECT_EQ(f.value(kAlways, 1.0)[0], 2.0);
  // rounding beyond a limit of the window, and a window that ends a rounding error from the break
  EXPECT_EQ(f.value(Window{1.0, 2.0}, 1.0 - 1e-15)[0], 2.0);
  EXPECT_EQ(f.value(Window{1.0, 2.0}, 2.0 + 1e-15)[0], 2.0);
  EXPECT_EQ(f.value(Window{1.0 - 1e-13, 2.0 + 1e-13}, 1.0 - 1e-13)[0], 2.0);
  EXPECT_EQ(f.value(Window{1.0 - 1e-13, 2.0 + 1e-13}, 2.0 + 1e-13)[0], 2.0);
  EXPECT_EQ(f.value(Window{2.0 - 1e-10, 2.0}, 2.0)[0], 2.0);  // shorter than the snap
  EXPECT_EQ(f.value(Window{2.0, 2.0 + 1e-10}, 2.0)[0], 3.0);
  // outside, the outermost pieces go on
  EXPECT_EQ(f.value(kAlways, -7.0)[0], 1.0);
  EXPECT_EQ(f.value(kAlways, 70.0)[0], 3.0);
}

TEST(PiecewisePolynomial, FindsEveryPieceOfAnUnevenGrid) {
  std::vector<double> breaks;
  std::vector<Path::Coefficients> pieces;
  for (int i = 0; i <= 40; ++i) breaks.push_back(std::expm1(0.2 * i));
  for (int i = 0; i < 40; ++i) pieces.push_back(coefficients({static_cast<double>(i)}));
  const Path f(breaks, pieces);
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(f.value(kAlways, breaks[i])[0], i);
    EXPECT_EQ(f.value(kAlways, 0.5 * (breaks[i] + breaks[i + 1]))[0], i);
  }
}

TEST(PiecewisePolynomial, DerivativesAreThoseOfTheValue) {
  const Path f({0.0, 1.0}, {coefficients({0.3, -1.0, 2.0, 0.7, -1.1, 0.4})});
  const double t = 0.63;
  const auto j = f.at(kAlways, independent(t, 2));
  // each derivative channel is the Dual derivative of the one before it
  EXPECT_NEAR(j.value[0].v[2], j.first[0].a, 1e-14);
  EXPECT_NEAR(j.first[0].v[2], j.second[0].a, 1e-14);
  EXPECT_NEAR(j.second[0].v[2], 6 * 0.7 - 24 * 1.1 * t + 60 * 0.4 * t * t, 1e-13);
  EXPECT_EQ(j.value[0].v[0], 0.0);
  const auto d = f.at(kAlways, t);
  EXPECT_EQ(d.value[0], j.value[0].a);
  EXPECT_EQ(d.second[0], j.second[0].a);
  EXPECT_EQ(f.value(kAlways, t)[0], d.value[0]);
}

TEST(PiecewisePolynomial, RejectsBreaksThatDoNotIncrease) {
  EXPECT_THROW(Path({0.0, 0.0}, {coefficients({1})}), std::invalid_argument);
  EXPECT_THROW(Path({0.0, NAN}, {coefficients({1})}), std::invalid_argument);
  EXPECT_THROW(Path({0.0, 1.0, 2.0}, {coefficients({1})}), std::invalid_argument);
}

std::vector<double> ticks(double from, double step, int n) {
  std::vector<double> t(n);
  for (int i = 0; i < n; ++i) t[i] = from + step * i;
  return t;
}

TEST(SplineFit, ReproducesAQuinticFromAnyOfItsDerivatives) {
  // A quintic on [0, 0.3] with every term of order one at the end, far from t = 0 as on a robot's clock.
  const double t0 = 1000.0;
  const auto f = [&](double t, int order) {
    const double x = (t - t0) / 0.3;
    if (order == 0) return 1 + x - 2 * x * x + x * x * x + 0.5 * std::pow(x, 4) - std::pow(x, 5);
    if (order == 1) return (1 - 4 * x + 3 * x * x + 2 * std::pow(x, 3) - 5 * std::pow(x, 4)) / 0.3;
    return (-4 + 6 * x + 6 * x * x - 20 * x * x * x) / 0.09;
  };
  const auto t = ticks(t0, 1e-3, 301);
  std::array<std::vector<double>, 3> y;
  for (double x : t)
    for (int k = 0; k < 3; ++k) y[k].push_back(f(x, k));
  for (int intervals : {1, 7, 40}) {
    SplineProblem<1, 5> problem;
    problem.begin = t.front();
    problem.end = t.back();
    // equal sigma in SI units: the second derivative weighs 1/h² more, the hardest case for the conditioning
    for (int k = 0; k < 3; ++k) problem.observations.push_back({k, t, y[k], {1e-6}});
    for (int k = 1; k < intervals; ++k) problem.breaks.push_back({t0 + 0.3 * k / intervals, 4});
    const auto fit = fit_spline(problem);
    for (double x = t.front(); x < t.back(); x += 0.7e-3) {
      const auto j = fit.polynomial.at(kAlways, x);
      EXPECT_NEAR(j.value[0], f(x, 0), 2e-11) << intervals;  // times near 1000 s round to 1e-13 s
      EXPECT_NEAR(j.first[0], f(x, 1), 1e-10) << intervals;
      EXPECT_NEAR(j.second[0], f(x, 2), 1e-8) << intervals;
    }
    EXPECT_EQ(fit.summary.knots, intervals - 1) << "a fit without residual must not be refined";
  }
}

TEST(SplineFit, KeepsTheContinuityAskedFor) {
  const auto t = ticks(0.0, 1e-3, 200);
  std::vector<double> y;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (double x : t) y.push_back(std::abs(x - 0.1) + 1e-3 * normal(random));
  for (int continuity : {0, 1, 4}) {
    SplineProblem<1, 5> problem;
    problem.begin = t.front();
    problem.end = t.back();
    for (double b : {0.03, 0.07, 0.1, 0.13, 0.17}) problem.breaks.push_back({b, b == 0.1 ? continuity : 4});
    problem.observations = {{0, t, y, {1e-3}}};
    problem.end_value = {0.25};
    const auto fit = fit_spline(problem);
    EXPECT_NEAR(fit.polynomial.value(kAlways, t.back())[0], 0.25, 1e-12);
    for (double b : fit.polynomial.breaks()) {
      if (b == t.front() || b == t.back()) continue;
      const auto left = fit.polynomial.at(Window{0.0, b}, b), right = fit.polynomial.at(Window{b, 0.2}, b);
      const int smooth = b == 0.1 ? continuity : 4;
      EXPECT_NEAR(left.value[0], right.value[0], 1e-13);
      if (smooth >= 1) {
        EXPECT_NEAR(left.first[0], right.first[0], 1e-11);
      }
      if (smooth >= 2) {
        EXPECT_NEAR(left.second[0], right.second[0], 1e-8);
      }
      if (smooth == 0) {
        EXPECT_GT(right.first[0] - left.first[0], 1.0);
      }
    }
  }
}

TEST(SplineFit, AddsKnotsUntilTheResidualIsNoiseAndNoMore) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto t = ticks(0.0, 1e-3, 300);
  const auto truth = [](double x) { return std::sin(2 * std::numbers::pi * 10.0 * x); };
  double total = 0.0, error = 0.0;
  int knots = 0;
  constexpr int kRuns = 50;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> y;
    for (double x : t) y.push_back(truth(x) + 0.05 * normal(random));
    SplineProblem<1, 5> problem;
    problem.begin = t.front();
    problem.end = t.back();
    problem.observations = {{0, t, y, {0.05}}};
    const auto fit = fit_spline(problem);
    EXPECT_TRUE(fit.summary.noise_reached);
    EXPECT_EQ(fit.summary.knots + 2u, fit.polynomial.breaks().size());
    total += fit.summary.chi2_per_dof;
    knots = std::max(knots, fit.summary.knots);
    for (double x : t) error += std::pow(fit.polynomial.value(kAlways, x)[0] - truth(x), 2);
  }
  EXPECT_NEAR(total / kRuns, 1.0,
              0.1);      // a χ² of 300 has a scatter of 0.08, and bias up to the target is accepted
  EXPECT_LE(knots, 15);  // three periods of ten hertz: a knot every tenth of a period at most
  EXPECT_LT(std::sqrt(error / kRuns / 300), 0.05 / 2.5);  // about 10 to 20 parameters for 300 samples
}

TEST(SplineFit, RejectsWhatItCannotSolve) {
  const auto t = ticks(0.0, 1e-3, 10);
  std::vector<double> y(10, 1.0);
  SplineProblem<1, 5> problem;
  problem.begin = 0.0;
  problem.end = 9e-3;
  problem.observations = {{0, t, y, {0.0}}};
  EXPECT_THROW(fit_spline(problem), std::invalid_argument);  // sigma
  problem.observations = {{0, t, y, {1.0}}};
  problem.breaks = {{8.5e-3, 0}};
  EXPECT_THROW(fit_spline(problem), std::invalid_argument);  // one sample for five unknowns
  problem.breaks = {{0.5, 0}};
  EXPECT_THROW(fit_spline(problem), std::invalid_argument);  // outside
  problem.breaks.clear();
  y[3] = NAN;
  EXPECT_THROW(fit_spline(problem), std::invalid_argument);
}

}  // namespace
