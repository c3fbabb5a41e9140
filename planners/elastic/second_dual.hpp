// A number with its first and second derivatives: what exact Hessians come from.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

namespace unhand::planners::elastic {

/// A value, its gradient and its Hessian with respect to N variables; the Hessian's lower triangle is packed
/// row by row, (0,0), (1,0), (1,1), (2,0), ...
template <int N>
struct SecondDual {
  static constexpr int kPairs = N * (N + 1) / 2;  ///< entries of the packed triangle

  double a{};                      ///< the value
  std::array<double, N> v{};       ///< the gradient
  std::array<double, kPairs> h{};  ///< the Hessian, packed

  SecondDual() = default;
  SecondDual(double value) : a(value) {}  // NOLINT: a constant is a number
  /// The k-th variable.
  static SecondDual independent(double value, int k) {
    SecondDual out(value);
    out.v[k] = 1;
    return out;
  }

  /// Sum, product and quotient, with both derivatives.
  /// @{
  SecondDual& operator+=(const SecondDual& b) {
    a += b.a;
    for (int i = 0; i < N; ++i) v[i] += b.v[i];
    for (int i = 0; i < kPairs; ++i) h[i] += b.h[i];
    return *this;
  }
  SecondDual& operator-=(const SecondDual& b) {
    a -= b.a;
    for (int i = 0; i < N; ++i) v[i] -= b.v[i];
    for (int i = 0; i < kPairs; ++i) h[i] -= b.h[i];
    return *this;
  }
  SecondDual& operator*=(double b) {
    a *= b;
    for (double& x : v) x *= b;
    for (double& x : h) x *= b;
    return *this;
  }
  SecondDual& operator*=(const SecondDual& b) { return *this = *this * b; }
  SecondDual& operator/=(const SecondDual& b) { return *this = *this / b; }
  /// @}

  /// f(x) from f, f' and f'' at x.
  SecondDual chain(double f, double df, double ddf) const {
    SecondDual out(f);
    for (int i = 0; i < N; ++i) out.v[i] = df * v[i];
    for (int i = 0, k = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j, ++k) out.h[k] = df * h[k] + ddf * v[i] * v[j];
    return out;
  }

  /// Arithmetic, with both derivatives; comparisons look at the value alone.
  /// @{
  friend SecondDual operator+(SecondDual x, const SecondDual& y) { return x += y; }
  friend SecondDual operator-(SecondDual x, const SecondDual& y) { return x -= y; }
  friend SecondDual operator-(SecondDual x) { return x *= -1; }
  friend SecondDual operator*(SecondDual x, double y) { return x *= y; }
  friend SecondDual operator*(double x, SecondDual y) { return y *= x; }
  friend SecondDual operator/(SecondDual x, double y) { return x *= 1 / y; }
  friend SecondDual operator*(const SecondDual& x, const SecondDual& y) {
    SecondDual out(x.a * y.a);
    for (int i = 0; i < N; ++i) out.v[i] = x.a * y.v[i] + x.v[i] * y.a;
    for (int i = 0, k = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j, ++k)
        out.h[k] = x.a * y.h[k] + x.h[k] * y.a + x.v[i] * y.v[j] + x.v[j] * y.v[i];
    return out;
  }
  friend SecondDual operator/(const SecondDual& x, const SecondDual& y) {
    const double r = 1 / y.a;
    return x * y.chain(r, -r * r, 2 * r * r * r);
  }
  friend bool operator<(const SecondDual& x, const SecondDual& y) { return x.a < y.a; }
  friend bool operator>(const SecondDual& x, const SecondDual& y) { return x.a > y.a; }
  friend bool operator==(const SecondDual& x, const SecondDual& y) { return x.a == y.a; }
  /// @}

  /// Functions, with both derivatives.
  /// @{
  friend SecondDual sin(const SecondDual& x) {
    const double s = std::sin(x.a), c = std::cos(x.a);
    return x.chain(s, c, -s);
  }
  friend SecondDual cos(const SecondDual& x) {
    const double s = std::sin(x.a), c = std::cos(x.a);
    return x.chain(c, -s, -c);
  }
  friend SecondDual sqrt(const SecondDual& x) {
    const double r = std::sqrt(x.a);
    return x.chain(r, 0.5 / r, -0.25 / (x.a * r));
  }
  friend SecondDual exp(const SecondDual& x) {
    const double e = std::exp(x.a);
    return x.chain(e, e, e);
  }
  /// @}
};

}  // namespace unhand::planners::elastic

namespace Eigen {

/// Lets Eigen take SecondDual for a scalar.
template <int N>
struct NumTraits<unhand::planners::elastic::SecondDual<N>> : GenericNumTraits<double> {
  /// As Eigen asks.
  /// @{
  using Real = unhand::planners::elastic::SecondDual<N>;
  using NonInteger = Real;
  using Nested = Real;
  /// @}
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = N,
    AddCost = N,
    MulCost = N * N
  };
};
/// Products with constants.
template <int N, class Op>
struct ScalarBinaryOpTraits<unhand::planners::elastic::SecondDual<N>, double, Op> {
  /// As Eigen asks.
  using ReturnType = unhand::planners::elastic::SecondDual<N>;
};
/// Products with constants.
template <int N, class Op>
struct ScalarBinaryOpTraits<double, unhand::planners::elastic::SecondDual<N>, Op> {
  /// As Eigen asks.
  using ReturnType = unhand::planners::elastic::SecondDual<N>;
};

}  // namespace Eigen
