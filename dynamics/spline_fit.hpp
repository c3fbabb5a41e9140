// Smoothing splines for logged series: weighted least squares with a B-spline basis, on as few knots as the
// declared noise allows.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "dynamics/piecewise_polynomial.hpp"

namespace unhand::dynamics {

/// Measured values of one derivative of all channels: y_n = d^derivative f(t_n) + noise, row-major N ×
/// Channels.
template <int Channels>
struct SplineObservations {
  int derivative{};                      ///< 0, 1 or 2
  std::span<const double> time;          ///< s, increasing; values outside [begin, end] are not used
  std::span<const double> value;         ///< u, u/s or u/s²
  std::array<double, Channels> sigma{};  ///< noise, 1 σ, in the units of `value`; > 0
};

/// An interior break of a spline that is less smooth than an ordinary knot.
struct SplineBreak {
  double time{};     ///< s
  int continuity{};  ///< derivatives that are continuous: 0 a kink of the value, 1 a jump of the second
                     ///< derivative
};

/// Which spline on [begin, end] [s]: pieces of degree `Degree`, Degree − 1 times continuously differentiable
/// except at `breaks`. A sample exactly at a break belongs to the piece on its right.
template <int Channels, int Degree>
struct SplineProblem {
  double begin{}, end{};            ///< s
  std::vector<SplineBreak> breaks;  ///< increasing, strictly inside (begin, end)
  std::vector<SplineObservations<Channels>>
      observations;  ///< one per measured derivative; all are fitted together
  std::optional<std::array<double, Channels>> end_value{};  ///< value prescribed at `end`, if any
};

/// How a spline was found, and how well it follows its samples.
template <int Channels>
struct SplineSummary {
  /// Mean square of residual/σ per observed series (in the order given) and channel.
  std::vector<std::array<double, Channels>> chi2;
  double chi2_per_dof{};  ///< of everything together; 0 where nothing is left over
  int knots{};            ///< breaks strictly inside (begin, end)
  bool noise_reached{};   ///< no interval has a certain misfit (4.5 standard deviations)
};

/// A smoothing spline and its summary.
template <int Channels, int Degree>
struct SplineFit {
  PiecewisePolynomial<Channels, Degree> polynomial;  ///< on [begin, end] of the problem
  SplineSummary<Channels> summary;                   ///< residuals and knots
};

/// Minimises Σ ((f^(k)(t_n) − y_n)/σ)² over the splines of the problem. Knots: each stretch between breaks
/// begins as one interval; those are halved in which the residual of some series is not noise (its χ² exceeds
/// 1.1 per degree of freedom by more than three standard deviations, or its neighbours are correlated by more
/// than three), until none is left, halving no longer pays, or fewer than three samples would be in one.
/// Solved by banded Householder QR in time relative to `begin`, so that σ of very different size do not
/// square the condition number.
///
/// Instantiated for <1,5> and <3,5>. Throws std::invalid_argument for a malformed problem, or for
/// observations that do not determine the spline.
template <int Channels, int Degree>
SplineFit<Channels, Degree> fit_spline(const SplineProblem<Channels, Degree>& problem);

}  // namespace unhand::dynamics
