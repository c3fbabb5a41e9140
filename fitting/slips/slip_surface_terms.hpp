// H and ∇H of the fitted surfaces, templated on the scalar of their parameters. Private.
#pragma once

#include <array>
#include <cmath>

namespace unhand::fitting {

using Wrench = std::array<double, 3>;

template <class T>
struct SurfaceValue {
  T h{};
  std::array<T, 3> gradient{};
};

/// wᵀ A w with A = diag(e^(2 p_i)), p (3).
struct AxisTerms {
  static constexpr int parameters = 3, degree = 2;
  template <class T>
  static SurfaceValue<T> at(const T* p, const Wrench& w) {
    using std::exp;
    SurfaceValue<T> out;
    out.h = T(0);
    for (std::size_t i = 0; i < 3; ++i) {
      const T a = exp(2.0 * p[i]);
      out.gradient[i] = 2.0 * w[i] * a;
      out.h += w[i] * w[i] * a;
    }
    return out;
  }
};

/// |Bw|², B upper triangular: p = B_xx, B_xy, B_xτ, B_yy, B_yτ, B_ττ.
struct FullTerms {
  static constexpr int parameters = 6, degree = 2;
  template <class T>
  static SurfaceValue<T> at(const T* p, const Wrench& w) {
    const T x = p[0] * w[0] + p[1] * w[1] + p[2] * w[2], y = p[3] * w[1] + p[4] * w[2], z = p[5] * w[2];
    return {x * x + y * y + z * z,
            {2.0 * p[0] * x, 2.0 * (p[1] * x + p[3] * y), 2.0 * (p[2] * x + p[4] * y + p[5] * z)}};
  }
};

/// The six products of w, and their derivatives: wᵀ A w = a · q(w) with a = (A_xx, A_yy, A_ττ, √2 A_xy, √2
/// A_xτ, √2 A_yτ).
struct Products {
  std::array<double, 6> q{};
  std::array<Wrench, 6> dq{};

  explicit Products(const Wrench& w) {
    const double r = std::sqrt(2.0), x = w[0], y = w[1], z = w[2];
    q = {x * x, y * y, z * z, r * x * y, r * x * z, r * y * z};
    dq = {Wrench{2 * x, 0, 0},     Wrench{0, 2 * y, 0},     Wrench{0, 0, 2 * z},
          Wrench{r * y, r * x, 0}, Wrench{r * z, 0, r * x}, Wrench{0, r * z, r * y}};
  }
};

/// Σ_k (a_k · q(w))²: p holds the six a_k (6), one after another. A triangular set would do, but the way to
/// the least then leads through zeros of its diagonal, where descent sticks.
struct QuarticTerms {
  static constexpr int parameters = 36, degree = 4;
  template <class T>
  static SurfaceValue<T> at(const T* p, const Wrench& w) {
    const Products products(w);
    SurfaceValue<T> out{T(0), {T(0), T(0), T(0)}};
    for (std::size_t k = 0; k < 6; ++k) {
      T sum = T(0);
      std::array<T, 3> slope{T(0), T(0), T(0)};
      for (std::size_t i = 0; i < 6; ++i, ++p) {
        sum += *p * products.q[i];
        for (std::size_t j = 0; j < 3; ++j)
          if (products.dq[i][j] != 0) slope[j] += *p * products.dq[i][j];
      }
      out.h += sum * sum;
      for (std::size_t j = 0; j < 3; ++j) out.gradient[j] += 2.0 * sum * slope[j];
    }
    return out;
  }
};

/// Σ_k adj(A_k) of those a_k: xx, xy, xτ, yy, yτ, ττ.
template <class T>
std::array<T, 6> adjugate_sum(const T* p) {
  std::array<T, 6> out{T(0), T(0), T(0), T(0), T(0), T(0)};
  const double r = std::sqrt(0.5);
  for (std::size_t k = 0; k < 6; ++k) {
    std::array<T, 6> a;
    for (std::size_t i = 0; i < 6; ++i, ++p) a[i] = i < 3 ? *p : r * *p;
    const auto& [xx, yy, zz, xy, xz, yz] = a;
    out[0] += yy * zz - yz * yz;
    out[1] += xz * yz - xy * zz;
    out[2] += xy * yz - xz * yy;
    out[3] += xx * zz - xz * xz;
    out[4] += xy * xz - xx * yz;
    out[5] += xx * yy - xy * xy;
  }
  return out;
}

/// A quartic by its 15 coefficients in the order of contact::ConvexQuartic.
template <class Coefficients>
SurfaceValue<double> quartic_value(const Coefficients& c, const Wrench& w) {
  std::array<Wrench, 5> power;  // power[n][j] = w_j^n
  power[0] = {1, 1, 1};
  for (std::size_t n = 1; n < 5; ++n)
    for (std::size_t j = 0; j < 3; ++j) power[n][j] = power[n - 1][j] * w[j];
  SurfaceValue<double> out;
  std::size_t at = 0;
  for (std::size_t x = 5; x-- > 0;)
    for (std::size_t y = 5 - x; y-- > 0; ++at) {
      const std::array<std::size_t, 3> n{x, y, 4 - x - y};
      out.h += c[at] * power[n[0]][0] * power[n[1]][1] * power[n[2]][2];
      for (std::size_t j = 0; j < 3; ++j) {
        if (n[j] == 0) continue;
        double slope = c[at] * static_cast<double>(n[j]);
        for (std::size_t i = 0; i < 3; ++i) slope *= power[i == j ? n[i] - 1 : n[i]][i];
        out.gradient[j] += slope;
      }
    }
  return out;
}

}  // namespace unhand::fitting
