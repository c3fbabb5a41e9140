#include "fitting/distributions.hpp"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

namespace unhand::fitting {
namespace {

using Policy = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
using Students = boost::math::students_t_distribution<double, Policy>;
using ChiSquared = boost::math::chi_squared_distribution<double, Policy>;
using Binomial = boost::math::binomial_distribution<double, Policy>;
using FisherF = boost::math::fisher_f_distribution<double, Policy>;
constexpr double kLargest = std::numeric_limits<double>::max();

}  // namespace

double student_factor(double n) { return quantile(Students(std::max(1.0, n)), 0.975); }

double normal_two_sided(double z) { return std::erfc(std::abs(z) / std::sqrt(2.0)); }

double chi2_tail(double x, int k) {
  if (!(x > 0) || k < 1) return 1;
  return cdf(complement(ChiSquared(k), std::min(x, kLargest)));
}

namespace {

/// Chernoff's mixture of the tails of k parameters.
template <class Tail>
double mixed_tail(double x, int free, int bounded, const Tail& tail) {
  if (!(x > 0) || free + bounded < 1) return 1;
  double out = 0, weight = std::ldexp(1.0, -bounded);
  for (int j = 0; j <= bounded; ++j) {
    if (free + j > 0) out += weight * tail(free + j);  // with none, all of it is at 0
    weight *= static_cast<double>(bounded - j) / (j + 1);
  }
  return out;
}

}  // namespace

double chi_bar_tail(double x, int free, int bounded) {
  return mixed_tail(x, free, bounded, [x](int k) { return chi2_tail(x, k); });
}

double hotelling_bar_tail(double x, int free, int bounded, double n) {
  return mixed_tail(x, free, bounded,
                    [x, n](int k) { return f_tail(x * (n - k + 1) / (n * k), k, n - k + 1); });
}

double binomial_tail(int k, int n, double p) {
  if (n < 1 || k >= n) return 1;
  return k < 0 ? 0 : cdf(Binomial(n, p), k);
}

double f_tail(double x, double p, double q) {
  if (!(x > 0) || !(p > 0) || !(q > 0)) return 1;
  return cdf(complement(FisherF(p, q), std::min(x, kLargest)));
}

}  // namespace unhand::fitting
