#include "contact/convex_quartic.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <numbers>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "contact/disc_friction.hpp"
#include "dynamics/dense_solve.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

constexpr int kPower[ConvexQuartic::kCoefficients][3] = {
    {4, 0, 0}, {3, 1, 0}, {3, 0, 1}, {2, 2, 0}, {2, 1, 1}, {2, 0, 2}, {1, 3, 0}, {1, 2, 1},
    {1, 1, 2}, {1, 0, 3}, {0, 4, 0}, {0, 3, 1}, {0, 2, 2}, {0, 1, 3}, {0, 0, 4}};

Vec3<double> times(const Mat3& a, const Vec3<double>& x) {
  return {dot3(a[0], x), dot3(a[1], x), dot3(a[2], x)};
}

// The solution of A x = b, A symmetric and positive semidefinite, by LDLᵀ; a pivot below 1e-13 of the trace
// is raised to it, so that a singular A gives a long but finite x.
struct Factored {
  double d0, d1, d2, l10, l20, l21;

  explicit Factored(const Mat3& a) {
    const double least = 1e-13 * (a[0][0] + a[1][1] + a[2][2]);
    d0 = std::max(a[0][0], least);
    l10 = a[1][0] / d0;
    l20 = a[2][0] / d0;
    d1 = std::max(a[1][1] - l10 * a[1][0], least);
    l21 = (a[2][1] - l10 * a[2][0]) / d1;
    d2 = std::max(a[2][2] - l20 * a[2][0] - l21 * l21 * d1, least);
  }
  Vec3<double> solve(const Vec3<double>& b) const {
    const double y1 = b[1] - l10 * b[0], y2 = b[2] - l20 * b[0] - l21 * y1;
    const double x2 = y2 / d2, x1 = y1 / d1 - l21 * x2;
    return {b[0] / d0 - l10 * x1 - l20 * x2, x1, x2};
  }
};

// Directions spread evenly over the half sphere, by the golden angle.
Vec3<double> spread(int k, int count) {
  const double z = (k + 0.5) / count, r = std::sqrt(1.0 - z * z);
  const double phi = k * std::numbers::pi * (3.0 - std::sqrt(5.0));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

[[noreturn]] void refuse(const char* what, double value, const Vec3<double>& w) {
  throw std::invalid_argument(
      fmt::format("convex quartic: {} = {} at w = ({:.6g}, {:.6g}, {:.6g}); it must not be negative, and H "
                  "must be positive",
                  what, value, w[0], w[1], w[2]));
}

}  // namespace

ConvexQuartic::ConvexQuartic(const std::array<double, kCoefficients>& coefficients, Unchecked)
    : coefficients_(coefficients) {
  constexpr double kFactorial[5] = {1, 1, 2, 6, 24};
  for (int k = 0; k < kCoefficients; ++k) {
    const int* n = kPower[k];
    tensor_[k] =
        0.5 * kFactorial[n[0]] * kFactorial[n[1]] * kFactorial[n[2]] * coefficients[k];  // 12/multinomial
  }
}

ConvexQuartic::ConvexQuartic(const std::array<double, kCoefficients>& coefficients)
    : ConvexQuartic(coefficients, Unchecked{}) {
  for (int k = 0; k < kCoefficients; ++k) {
    if (!std::isfinite(coefficients[k])) {
      throw std::invalid_argument(
          fmt::format("convex quartic: coefficient of w_x^{} w_z^{} w_tau^{} = {} is not finite",
                      kPower[k][0], kPower[k][1], kPower[k][2], coefficients[k]));
    }
  }
  const auto spectrum = [this](const Vec3<double>& x) {
    const Mat3 h = hessian(x);
    return dynamics::spectrum_of(Eigen::Map<const Eigen::Matrix3d>(h[0].data()));
  };
  constexpr int kDirections = 600, kLowest = 24, kTurns = 60;
  std::vector<std::pair<double, Vec3<double>>> found;
  double largest = 0.0;
  for (int k = 0; k < kDirections; ++k) {
    const Vec3<double> x = spread(k, kDirections);
    const Eigen::VectorXd values = spectrum(x).values;
    largest = std::max(largest, values[2]);
    found.emplace_back(values[0], x);
  }
  if (!(largest > 0.0)) refuse("the largest eigenvalue of the Hessian", largest, found[0].second);
  std::partial_sort(found.begin(), found.begin() + kLowest, found.end(),
                    [](const auto& a, const auto& b) { return a.first < b.first; });
  for (int k = 0; k < kLowest; ++k) {
    Vec3<double> x = found[k].second;
    for (int turn = 0; turn < kTurns; ++turn) {
      const auto [values, vectors] = spectrum(x);
      if (values[0] < -1e-10 * largest) refuse("the least eigenvalue of the Hessian", values[0], x);
      x = {vectors(0, 0), vectors(1, 0), vectors(2, 0)};
      // A convex H vanishes only along a line on which its Hessian vanishes too: the least eigenvector of any
      // place.
      const double value = dot3(x, times(hessian(x), x)) / 12.0;
      if (!(value > 1e-12 * largest)) refuse("H", value, x);
    }
  }
}

ConvexQuartic ConvexQuartic::isotropic_blend(double kappa) {
  if (!(kappa >= 0.0 && kappa <= 3.0)) {
    throw std::invalid_argument(fmt::format("convex quartic: kappa = {} is not in [0, 3]", kappa));
  }
  return {{1, 0, 0, 2, 0, 2 * kappa, 0, 0, 0, 0, 1, 0, 2 * kappa, 0, 1}, Unchecked{}};
}

double ConvexQuartic::kappa_closest_to_disc() {
  static const double kappa = [] {
    double top = 0.0, bottom = 0.0;
    constexpr int kPoints = 400;
    for (int k = 0; k < kPoints; ++k) {
      const DiscFriction f = disc_friction(std::tan(0.5 * std::numbers::pi * (k + 0.5) / kPoints));
      const double a2 = f.force * f.force, b2 = 2.25 * f.torque * f.torque, cross = 2.0 * a2 * b2;
      top += (1.0 - a2 * a2 - b2 * b2) * cross;  // H − 1 = κ cross − (1 − a⁴ − b⁴)
      bottom += cross * cross;
    }
    return top / bottom;
  }();
  return kappa;
}

ConvexQuartic ConvexQuartic::closest_to_disc() { return isotropic_blend(kappa_closest_to_disc()); }

// ∇²H(w); by Euler's theorem ∇H = ∇²H w/3 and H = wᵀ∇²H w/12.
Mat3 ConvexQuartic::hessian(const Vec3<double>& w) const {
  const auto& t = tensor_;
  const double xx = w[0] * w[0], zz = w[1] * w[1], ss = w[2] * w[2];
  const double xz = 2.0 * w[0] * w[1], xs = 2.0 * w[0] * w[2], zs = 2.0 * w[1] * w[2];
  const auto entry = [&](int a, int b, int c, int d, int e, int f) {
    return (t[a] * xx + t[b] * xz + t[c] * xs) + (t[d] * zz + t[e] * zs + t[f] * ss);
  };
  const double h01 = entry(1, 3, 4, 6, 7, 8), h02 = entry(2, 4, 5, 7, 8, 9), h12 = entry(4, 7, 8, 11, 12, 13);
  return {Vec3<double>{entry(0, 1, 2, 3, 4, 5), h01, h02}, Vec3<double>{h01, entry(3, 6, 7, 10, 11, 12), h12},
          Vec3<double>{h02, h12, entry(5, 8, 9, 12, 13, 14)}};
}

template <class S>
S ConvexQuartic::gauge(const Vec3<S>& w) const {
  const double scale = scale_of(w);
  if (scale == 0.0) return S(0.0);
  const Vec3<double> v{value_of(w[0]) / scale, value_of(w[1]) / scale, value_of(w[2]) / scale};
  const Vec3<double> third = times(hessian(v), v);  // 3 ∇H
  const double g = std::sqrt(std::sqrt(dot3(third, v) / 12.0));
  if constexpr (std::is_same_v<S, double>) {
    return scale * g;
  } else {
    const double k = 1.0 / (12.0 * g * g * g);
    return S(scale * g, k * (third[0] * w[0].v + third[1] * w[1].v + third[2] * w[2].v));
  }
}

// φ(w) = H(w) + û·w, û = u/|u|, is convex with its least value where ∇H(w) = −û. Newton's method from the
// ellipsoid's direction with backtracking on φ: at most 50 steps, some 5 in general; then w/gauge(w). In
// Dual, the implicit function theorem at the solution: dw = −(∇²H)⁻¹ dû, and the radial part of it does not
// count.
template <class S>
Vec3<S> ConvexQuartic::resist(const Vec3<S>& u) const {
  const double scale = scale_of(u);
  if (scale == 0.0) return {S(0.0), S(0.0), S(0.0)};
  Vec3<double> d{value_of(u[0]) / scale, value_of(u[1]) / scale, value_of(u[2]) / scale};
  const double size = std::sqrt(dot3(d, d));
  for (double& entry : d) entry /= size;

  Mat3 h = hessian(d);
  Vec3<double> w = d, third = times(h, d);                // third = 3 ∇H
  const double start = -std::cbrt(3.0 / dot3(third, d));  // least φ along the ray: 4 t³ H(û) = −1
  const double square = start * start;
  for (int i = 0; i < 3; ++i) {
    w[i] *= start;
    third[i] *= square * start;
    for (double& entry : h[i]) entry *= square;
  }
  double phi = dot3(third, w) / 12.0 + dot3(d, w);
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Vec3<double> residual{third[0] / 3.0 + d[0], third[1] / 3.0 + d[1], third[2] / 3.0 + d[2]};
    const Vec3<double> step = Factored(h).solve(residual);  // downhill is −step
    const double slope = dot3(residual, step);
    if (!(slope > 0.0)) break;
    if (slope < 1e-28) {  // nothing left for φ to show: one full step more, and it is over
      for (int i = 0; i < 3; ++i) w[i] -= step[i];
      h = hessian(w);
      break;
    }
    double length = 1.0, reached = phi;
    Vec3<double> next = w;
    for (int halving = 0; halving < 30; ++halving, length *= 0.5) {
      for (int i = 0; i < 3; ++i) next[i] = w[i] - length * step[i];
      h = hessian(next);
      third = times(h, next);
      reached = dot3(third, next) / 12.0 + dot3(d, next);
      if (reached <= phi - 1e-4 * length * slope + 1e-15) break;
    }
    w = next;
    phi = reached;
  }
  third = times(h, w);
  const double inverse = 1.0 / std::sqrt(std::sqrt(dot3(third, w) / 12.0));
  for (double& entry : w) entry *= inverse;
  if constexpr (std::is_same_v<S, double>) {
    return w;
  } else {
    // With w on the surface now: n = ∇gauge = ∇H/(4 gauge³), and dw → (1 − w nᵀ) dw/gauge.
    Vec3<double> n;
    for (int i = 0; i < 3; ++i) n[i] = third[i] * inverse * inverse * inverse / 12.0;
    const Factored factored(h);
    Mat3 jacobian;
    for (int j = 0; j < 3; ++j) {
      Vec3<double> unit{};
      unit[j] = -inverse / (size * scale);
      const Vec3<double> column = factored.solve(unit);
      const double radial = dot3(n, column);
      for (int i = 0; i < 3; ++i) jacobian[i][j] = column[i] - w[i] * radial;
    }
    return chain3(u, w, jacobian);
  }
}

Vec3<double> ConvexQuartic::slip_direction(const Vec3<double>& w) const {
  const double scale = scale_of(w);
  if (scale == 0.0) return {0.0, 0.0, 0.0};
  const Vec3<double> v{w[0] / scale, w[1] / scale, w[2] / scale};
  Vec3<double> n = times(hessian(v), v);  // 3 ∇H
  const double inverse = 1.0 / std::sqrt(dot3(n, n));
  for (double& entry : n) entry *= -inverse;
  return n;
}

template Vec3<double> ConvexQuartic::resist(const Vec3<double>&) const;
template Vec3<Dual> ConvexQuartic::resist(const Vec3<Dual>&) const;
template double ConvexQuartic::gauge(const Vec3<double>&) const;
template Dual ConvexQuartic::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
