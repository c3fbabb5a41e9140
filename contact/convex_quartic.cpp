#include "contact/convex_quartic.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>

#include <stdexcept>

#include "contact/disc_friction.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

constexpr int kExponents[ConvexQuartic::kCoefficients][3] = {
    {4, 0, 0}, {3, 1, 0}, {3, 0, 1}, {2, 2, 0}, {2, 1, 1}, {2, 0, 2}, {1, 3, 0}, {1, 2, 1},
    {1, 1, 2}, {1, 0, 3}, {0, 4, 0}, {0, 3, 1}, {0, 2, 2}, {0, 1, 3}, {0, 0, 4}};

/// powers[i][k] = w_i^k
template <class S>
std::array<std::array<S, 5>, 3> powers_of(const Vec3<S>& w) {
  std::array<std::array<S, 5>, 3> p;
  for (int i = 0; i < 3; ++i) {
    p[i][0] = S(1);
    for (int k = 1; k < 5; ++k) p[i][k] = p[i][k - 1] * w[i];
  }
  return p;
}

/// Directions spread evenly over the half sphere.
Vec3<double> spread(int k, int n) {
  const double z = (k + 0.5) / n, phi = 2.399963229728653 * k, r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace

template <class S>
S ConvexQuartic::value(const Vec3<S>& w) const {
  const auto p = powers_of(w);
  S sum(0);
  for (int k = 0; k < kCoefficients; ++k)
    if (coefficients_[k] != 0)
      sum += coefficients_[k] * (p[0][kExponents[k][0]] * p[1][kExponents[k][1]] * p[2][kExponents[k][2]]);
  return sum;
}

void ConvexQuartic::derivatives(const Vec3<double>& w, Vec3<double>& gradient,
                                std::array<Vec3<double>, 3>& hessian) const {
  const auto p = powers_of(w);
  gradient = {};
  hessian = {};
  for (int k = 0; k < kCoefficients; ++k) {
    const double c = coefficients_[k];
    if (c == 0) continue;
    const int* e = kExponents[k];
    const auto monomial = [&](int a, int b) {  // differentiated by w_a and, unless b < 0, by w_b
      int n[3] = {e[0], e[1], e[2]};
      double factor = c * n[a]--;
      if (n[a] < 0) return 0.0;
      if (b >= 0) {
        factor *= n[b]--;
        if (n[b] < 0) return 0.0;
      }
      return factor * p[0][n[0]] * p[1][n[1]] * p[2][n[2]];
    };
    for (int a = 0; a < 3; ++a) {
      gradient[a] += monomial(a, -1);
      for (int b = a; b < 3; ++b) {
        const double h = monomial(a, b);
        hessian[a][b] += h;
        if (b != a) hessian[b][a] += h;
      }
    }
  }
}

ConvexQuartic::ConvexQuartic(const std::array<double, kCoefficients>& coefficients) : coefficients_(coefficients) {
  constexpr int kPoints = 4000;
  double least = std::numeric_limits<double>::infinity(), largest = 0;
  Vec3<double> where{};
  const auto eigenvalues = [&](const Vec3<double>& w) {
    Vec3<double> gradient;
    std::array<Vec3<double>, 3> h;
    derivatives(w, gradient, h);
    Eigen::Matrix3d H;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) H(i, j) = h[i][j];
    return Eigen::Vector3d(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(H, Eigen::EigenvaluesOnly).eigenvalues());
  };
  for (const double c : coefficients)
    if (!std::isfinite(c)) throw std::invalid_argument(fmt::format("convex quartic: coefficient {} is not finite", c));
  const auto try_at = [&](const Vec3<double>& w) {
    if (!(value(w) > 0))
      throw std::invalid_argument(fmt::format("convex quartic: H = {} is not positive at w = ({}, {}, {})", value(w), w[0], w[1], w[2]));
    const Eigen::Vector3d e = eigenvalues(w);
    largest = std::max(largest, e[2]);
    if (e[0] < least) {
      least = e[0];
      where = w;
    }
  };
  for (int k = 0; k < kPoints; ++k) try_at(spread(k, kPoints));
  for (double reach = 0.03; reach > 1e-6; reach *= 0.5) {
    const Vec3<double> centre = where;
    for (int k = 0; k < 12; ++k) {
      Vec3<double> w = spread(k, 12);
      for (int i = 0; i < 3; ++i) w[i] = centre[i] + (k % 2 == 0 ? reach : -reach) * w[i];
      const double size = std::sqrt(dot3(w, w));
      for (double& x : w) x /= size;
      try_at(w);
    }
  }
  if (least < -1e-9 * largest)
    throw std::invalid_argument(fmt::format(
        "convex quartic: not convex, the Hessian has the eigenvalue {} at w = ({}, {}, {})", least, where[0], where[1], where[2]));
}

ConvexQuartic ConvexQuartic::isotropic_blend(double kappa) {
  if (!(kappa >= 0 && kappa <= 3))
    throw std::invalid_argument(fmt::format("convex quartic: kappa = {} is not in [0, 3]", kappa));
  ConvexQuartic out;
  out.coefficients_ = {1, 0, 0, 2, 0, 2 * kappa, 0, 0, 0, 0, 1, 0, 2 * kappa, 0, 1};
  return out;
}

double ConvexQuartic::kappa_closest_to_disc() {
  static const double kappa = [] {
    double top = 0, bottom = 0;
    constexpr int kPoints = 400;
    for (int k = 0; k < kPoints; ++k) {  // evenly over the angle between spin and slide
      const double angle = 0.5 * M_PI * (k + 0.5) / kPoints;
      const DiscFriction f = disc_friction(std::tan(angle));
      const double F = f.force * f.force, T = 2.25 * f.torque * f.torque;
      top += (1 - F * F - T * T) * (2 * F * T);
      bottom += (2 * F * T) * (2 * F * T);
    }
    return top / bottom;
  }();
  return kappa;
}

ConvexQuartic ConvexQuartic::closest_to_disc() { return isotropic_blend(kappa_closest_to_disc()); }

template <class S>
S ConvexQuartic::gauge(const Vec3<S>& w) const {
  using std::sqrt;
  // Scaled to order one first: the fourth power of a small wrench would underflow.
  const double size = std::sqrt(value_of(dot3(w, w)));
  if (!(size > 0)) return S(0);
  const Vec3<S> unit{w[0] / size, w[1] / size, w[2] / size};
  return size * S(sqrt(S(sqrt(value(unit)))));
}

/// The minimum of the convex H(w) + û · w, that is ∇H(w) = −û, by Newton's method with a line search; the wrench is the
/// point of the surface in that direction.
template <class S>
Vec3<S> ConvexQuartic::resist(const Vec3<S>& u) const {
  const double size = std::sqrt(value_of(dot3(u, u)));
  const Vec3<double> target{value_of(u[0]) / size, value_of(u[1]) / size, value_of(u[2]) / size};
  Vec3<double> w{-0.63 * target[0], -0.63 * target[1], -0.63 * target[2]}, gradient;  // 4^(−1/3): the ellipsoid's
  std::array<Vec3<double>, 3> h;
  Eigen::Matrix3d H;
  double objective = value(w) + dot3(target, w);
  for (int iteration = 0; iteration < 50; ++iteration) {
    derivatives(w, gradient, h);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) H(i, j) = h[i][j];
    const Eigen::Vector3d g(gradient[0] + target[0], gradient[1] + target[1], gradient[2] + target[2]);
    if (g.squaredNorm() < 1e-30) break;
    H.diagonal().array() += 1e-14;  // the Hessian may be flat on the axes (κ = 0)
    const Eigen::Vector3d step = -H.ldlt().solve(g);
    const double slope = g.dot(step);
    if (!(slope < 0)) break;
    Vec3<double> next = w;
    double length = 1, reached = objective;
    for (int halving = 0; halving < 30; ++halving, length *= 0.5) {
      for (int i = 0; i < 3; ++i) next[i] = w[i] + length * step[i];
      reached = value(next) + dot3(target, next);
      if (reached <= objective + 1e-4 * length * slope + 1e-16) break;
    }
    w = next;
    objective = reached;
    if (length * step.norm() < 1e-15) break;
  }
  Vec3<S> out{S(w[0]), S(w[1]), S(w[2])};
  if constexpr (!std::is_same_v<S, double>) {
    derivatives(w, gradient, h);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) H(i, j) = h[i][j];
    H.diagonal().array() += 1e-14;
    Eigen::Matrix<double, 3, dynamics::kDualSize> du;
    for (int i = 0; i < 3; ++i) du.row(i) = u[i].v.transpose() / size;
    const Eigen::Matrix<double, 3, dynamics::kDualSize> dw = -H.ldlt().solve(du);
    for (int i = 0; i < 3; ++i) out[i].v = dw.row(i).transpose();
  }
  const S scale = 1.0 / gauge(out);
  return {scale * out[0], scale * out[1], scale * out[2]};
}

Vec3<double> ConvexQuartic::slip_direction(const Vec3<double>& w) const {
  Vec3<double> gradient;
  std::array<Vec3<double>, 3> hessian;
  derivatives(w, gradient, hessian);
  const double size = std::sqrt(dot3(gradient, gradient));
  return {-gradient[0] / size, -gradient[1] / size, -gradient[2] / size};
}

template Vec3<double> ConvexQuartic::resist(const Vec3<double>&) const;
template Vec3<Dual> ConvexQuartic::resist(const Vec3<Dual>&) const;
template double ConvexQuartic::gauge(const Vec3<double>&) const;
template Dual ConvexQuartic::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
