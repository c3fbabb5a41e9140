// Tails of the distributions that tests refer to.
#pragma once

#include <algorithm>
#include <cmath>

namespace unhand::fitting {

/// P(|N(0, 1)| > |z|).
inline double normal_two_sided(double z) { return std::erfc(std::abs(z) / std::sqrt(2.0)); }

/// I_x(a, b), the regularised incomplete beta function, by Lentz's continued fraction.
inline double incomplete_beta(double a, double b, double x) {
  if (!(x > 0)) return 0;
  if (!(x < 1)) return 1;
  if (x > (a + 1) / (a + b + 2)) return 1 - incomplete_beta(b, a, 1 - x);
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x)) /
      a;
  constexpr double tiny = 1e-300;
  double f = 1, c = 1, d = 0;
  for (int i = 0; i <= 400; ++i) {
    const double m = i / 2;
    const double term = i == 0       ? 1.0
                        : i % 2 == 0 ? m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
                                     : -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / std::max(std::abs(1 + term * d), tiny) * ((1 + term * d) < 0 ? -1 : 1);
    c = 1 + term / c;
    if (std::abs(c) < tiny) c = tiny;
    f *= c * d;
    if (std::abs(1 - c * d) < 1e-13) break;
  }
  return std::clamp(front * (f - 1), 0.0, 1.0);
}

/// P(F > x) for Fisher's F with (p, q) degrees of freedom.
inline double f_tail(double x, double p, double q) {
  if (!(x > 0)) return 1;
  return incomplete_beta(0.5 * q, 0.5 * p, q / (q + p * x));
}

}  // namespace unhand::fitting
