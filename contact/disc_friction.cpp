#include "contact/disc_friction.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace unhand::contact {
namespace {

constexpr int kTerms = 64;  // terms of a power series on [0, 1/2]: the rest is below 2⁻⁶⁴
constexpr int kEconomy = 20;  // terms once economised: the Chebyshev coefficients fall as (3+√8)⁻ᵏ, to 5e-16

using Power = std::array<long double, kTerms>;
using Economy = std::array<double, kEconomy>;

// Σ cₙ mⁿ on [0, 1/2] as a shorter polynomial in x = 4m − 1 ∈ [−1, 1]: written in Chebyshev polynomials, cut,
// and written in powers of x again.
constexpr Economy economise(const Power& c) {
  Power cheb{};
  for (int n = kTerms; n-- > 0;) {  // Horner: cheb ← cheb (1 + x)/4 + cₙ, with x Tₖ = (Tₖ₊₁ + T|ₖ₋₁|)/2
    Power next{};
    for (int k = 0; k < kTerms; ++k) {
      next[k] += cheb[k] / 4;
      if (k == 0) {
        next[1] += cheb[0] / 4;
      } else {
        next[k - 1] += cheb[k] / 8;
        if (k + 1 < kTerms) next[k + 1] += cheb[k] / 8;
      }
    }
    next[0] += c[n];
    cheb = next;
  }
  std::array<long double, kEconomy> sum{}, last{}, now{};  // last, now: Tₖ₋₁ and Tₖ in powers of x
  last[0] = 1;
  now[1] = 1;
  sum[0] = cheb[0];
  for (int k = 1; k < kEconomy; ++k) {
    std::array<long double, kEconomy> next{};
    for (int i = 0; i < kEconomy; ++i) {
      sum[i] += cheb[k] * now[i];
      if (i > 0) next[i] = 2 * now[i - 1];
      next[i] -= last[i];
    }
    last = now;
    now = next;
  }
  Economy out{};
  for (int i = 0; i < kEconomy; ++i) out[i] = static_cast<double>(sum[i]);
  return out;
}

// Polynomials side by side, so that their evaluation overlaps.
template <int kCount>
struct Bundle {
  std::array<std::array<double, kCount>, kEconomy> c{};

  constexpr explicit Bundle(const std::array<Economy, kCount>& p) {
    for (int n = 0; n < kEconomy; ++n) {
      for (int j = 0; j < kCount; ++j) c[n][j] = p[j][n];
    }
  }

  // Horner in x⁴ on four interleaved quarters: a quarter of the latency.
  std::array<double, kCount> operator()(double x) const {
    const double x2 = x * x, x4 = x2 * x2;
    std::array<std::array<double, kCount>, 4> part{c[kEconomy - 4], c[kEconomy - 3], c[kEconomy - 2],
                                                   c[kEconomy - 1]};
    for (int n = kEconomy - 8; n >= 0; n -= 4) {
      for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < kCount; ++j) part[i][j] = part[i][j] * x4 + c[n + i][j];
      }
    }
    std::array<double, kCount> out;
    for (int j = 0; j < kCount; ++j) {
      out[j] = (part[0][j] + part[2][j] * x2) + x * (part[1][j] + part[3][j] * x2);
    }
    return out;
  }
};

constexpr long double kPi = std::numbers::pi_v<long double>;

// m ≤ 1/2: with aₙ = (π/2) ((1/2)ₙ/n!)², the coefficients of K:  B: aₙ/(2n+2),  C: aₙ₊₁ (n+1)/(n+2).
constexpr Bundle<2> small_tables() {
  Power b{}, c{};
  long double a = kPi / 2;
  for (int n = 0; n < kTerms; ++n) {
    const long double ratio = (2 * n + 1) / (2.0L * n + 2);
    b[n] = a / (2 * n + 2);
    a *= ratio * ratio;
    c[n] = a * (n + 1) / (n + 2);
  }
  return Bundle<2>({economise(b), economise(c)});
}

// m ≥ 1/2, in μ = 1 − m:  K = Σ aₙ μⁿ (dₙ − ½ ln μ),  E = 1 + Σ ½ (1/2)ₙ(3/2)ₙ/((2)ₙ n!) μⁿ⁺¹ (dₙ −
// 1/((2n+1)(2n+2)) − ½ ln μ), d₀ = ln 4, dₙ₊₁ = dₙ − 2/((2n+1)(2n+2)). Of these m B = E − μK and m μD = μ(K −
// E); dividing a series by m = 1 − μ is a running sum of its coefficients. Order: B, μD, and their factors of
// ln μ.
constexpr Bundle<4> large_tables() {
  Power k{}, e{}, k_log{}, e_log{};
  e[0] = 1;
  long double a = 1, q = 0.5L, d = 2 * std::numbers::ln2_v<long double>;
  for (int n = 0; n < kTerms; ++n) {
    const long double odd = 2 * n + 1, even = 2 * n + 2;
    k[n] = a * d;
    k_log[n] = -a / 2;
    if (n + 1 < kTerms) {
      e[n + 1] = q * (d - 1 / (odd * even));
      e_log[n + 1] = -q / 2;
    }
    a *= (odd / even) * (odd / even);
    q *= (odd / 2) * ((odd + 2) / 2) / ((n + 2.0L) * (n + 1.0L));
    d -= 2 / (odd * even);
  }
  Power b{}, y{}, b_log{}, y_log{};
  long double b_sum = 0, y_sum = 0, b_log_sum = 0, y_log_sum = 0;
  for (int n = 0; n < kTerms; ++n) {
    b[n] = b_sum += e[n] - (n ? k[n - 1] : 0);
    y[n] = y_sum += n ? k[n - 1] - e[n - 1] : 0;
    b_log[n] = b_log_sum += e_log[n] - (n ? k_log[n - 1] : 0);
    y_log[n] = y_log_sum += n ? k_log[n - 1] - e_log[n - 1] : 0;
  }
  return Bundle<4>({economise(b), economise(y), economise(b_log), economise(y_log)});
}

constexpr Bundle<2> kSmall = small_tables();
constexpr Bundle<4> kLarge = large_tables();

constexpr double kThird = 4.0 / (3.0 * std::numbers::pi), kNinth = 4.0 / (9.0 * std::numbers::pi);

}  // namespace

DiscProfile disc_profile(double m) {
  const double rest = 1.0 - m;  // μ
  if (m <= 0.5) {
    const auto [b, c] = kSmall(4.0 * m - 1.0);
    const double d = b + m * c, y = rest * d;
    return {kThird * (2.0 * b + y), 0.5 * kThird * (c - d), kNinth * ((3.0 - m) * b + (3.0 - 2.0 * m) * y),
            kNinth * (c + 3.0 * b - d)};
  }
  const double log =
      rest > 0.0 ? std::log(rest) : 0.0;  // both logarithms have a factor that vanishes at μ = 0
  const auto [b0, y0, b_log, y_log] = kLarge(4.0 * rest - 1.0);
  const double b = b0 + b_log * log, y = y0 + y_log * log;
  return {kThird * (2.0 * b + y), 0.5 * kThird * (y - b) / m, kNinth * ((3.0 - m) * b + (3.0 - 2.0 * m) * y),
          kNinth * ((3.0 * m - 1.0) * b + y) / m};
}

DiscFriction disc_friction(double epsilon) {
  const double e = std::abs(epsilon);
  if (e <= 1.0) {
    const double m = e * e;
    const DiscProfile p = disc_profile(m);
    return {epsilon * p.slide, p.spin, p.slide + 2.0 * m * p.dslide};
  }
  const double delta = 1.0 / e, m = delta * delta;
  const DiscProfile p = disc_profile(m);
  return {std::copysign(p.slide, epsilon), delta * p.arm, -2.0 * delta * m * p.dslide};
}

}  // namespace unhand::contact
