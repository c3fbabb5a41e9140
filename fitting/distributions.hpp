// Tails of the distributions that tests refer to, by Boost.Math.
#pragma once

#include <array>

namespace unhand::fitting {

/// Half the width of a normal distribution's 95 % interval [standard deviations].
inline constexpr double kNormal95 = 1.959963984540054;

/// Degrees of freedom of a variance that rests on declarations alone.
inline constexpr double kCertain = 1e9;

/// Half the width of a 95 % interval in sigmas: t₀.₉₇₅ of Student's t for n degrees of freedom; one where n
/// is less.
double student_factor(double n);

/// value ± student_factor(n) sigma.
inline std::array<double, 2> student_interval(double value, double sigma, double n) {
  const double half = student_factor(n) * sigma;
  return {value - half, value + half};
}

/// P(|N(0, 1)| > |z|).
double normal_two_sided(double z);

/// P(χ²_k > x). 1, no evidence, where k < 1 or x is no positive number.
double chi2_tail(double x, int k);

/// P(χ̄² > x) of a gain that `bounded` parameters share which may only go one way from where they are none,
/// and `free` ones that go both ways: Σ_j C(bounded, j) 2^-bounded P(χ²_{free + j} > x), Chernoff's mixture
/// [SelfLiang1987]. Exact for one bounded parameter beside free ones, and for several that do not correlate,
/// as sizes of different objects. 1, no evidence, where x is no positive number or there are no parameters.
double chi_bar_tail(double x, int free, int bounded);

/// The same where the covariance of the gain comes from n degrees of freedom: Hotelling's T² in place of χ²,
/// P(T²_{k,n} > x) = P(F_{k,n−k+1} > x (n − k + 1)/(n k)); 1, no evidence, where n − k + 1 <= 0.
double hotelling_bar_tail(double x, int free, int bounded, double n);

/// P(at most k of n succeed) where each does with probability p in [0, 1]; 1, no evidence, where n < 1.
double binomial_tail(int k, int n, double p);

/// P(F_{p,q} > x), Fisher's F. 1, no evidence, where p or q or x is no positive number.
double f_tail(double x, double p, double q);

}  // namespace unhand::fitting
