// How a slip sets out: the acceleration of an object that a limit surface can no longer hold.
#pragma once

#include <Eigen/Dense>
#include <cmath>

#include "contact/contact_model.hpp"
#include "contact/friction_limits.hpp"
#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// resist, gauge and slip_direction in the world; shapes with directions of their own live in the hand's
/// frame.
template <class Shape, class S, class Function>
Vec3<S> in_hand_frame(const S& hand_angle, const Vec3<S>& world, Function&& function) {
  if constexpr (Shape::isotropic) {
    return function(world);
  } else {
    const Vec2<S> xz = dynamics::rotate(S(-hand_angle), Vec2<S>{world[0], world[1]});
    const Vec3<S> there = function(Vec3<S>{xz.x, xz.z, world[2]});
    const Vec2<S> back = dynamics::rotate(hand_angle, Vec2<S>{there[0], there[1]});
    return {back.x, back.z, there[2]};
  }
}

/// The wrench [-] that opposes the slip u, both in the world and normalised.
template <class Shape, class S>
Vec3<S> resist(const Shape& shape, const Scene<S>& scene, const Vec3<S>& u) {
  return in_hand_frame<Shape, S>(scene.hand.theta, u, [&](const Vec3<S>& x) { return shape.resist(x); });
}
/// The unit slip that the wrench w opposes, both in the world and normalised.
template <class Shape>
Vec3<double> slip_direction(const Shape& shape, const Scene<double>& scene, const Vec3<double>& w) {
  return in_hand_frame<Shape, double>(scene.hand.theta, w,
                                      [&](const Vec3<double>& x) { return shape.slip_direction(x); });
}
/// The shape's gauge of the wrench w [-], given in the world: above 1 the patch cannot hold it.
template <class Shape, class S>
S gauge(const Shape& shape, const Scene<S>& scene, const Vec3<S>& w) {
  if constexpr (Shape::isotropic) {
    return shape.gauge(w);
  } else {
    const Vec2<S> xz = dynamics::rotate(S(-scene.hand.theta), Vec2<S>{w[0], w[1]});
    return shape.gauge(Vec3<S>{xz.x, xz.z, w[2]});
  }
}

/// The slip's normalised acceleration under a wrench: (a_C − a_H, L (α_O − α_H)).
template <class S>
Vec3<S> normalised_acceleration(const Scene<S>& scene, const Relative<S>& y, const Wrench<S>& wrench,
                                const S& length) {
  const Vec2<S> r = lever(scene, y);
  const S omega = scene.hand_twist.omega + y.spin;
  const Acceleration<S> com = dynamics::acceleration_under(scene.body, wrench, r, scene.gravity);
  const Acceleration<S> point = dynamics::acceleration_at_patch(com, omega, r);
  return {point.ax - scene.hand_acceleration.ax, point.az - scene.hand_acceleration.az,
          length * (point.alpha - scene.hand_acceleration.alpha)};
}

/// W⁻¹ in normalised coordinates: diag(1,1,1/L) W⁻¹ diag(1,1,1/L), with W⁻¹ = Gᵀ(−r) M G(−r).
template <class S>
std::array<Vec3<S>, 3> normalised_inertia(const Scene<S>& scene, const Vec2<S>& r, const S& length) {
  const auto& [m, I] = scene.body;
  const S zx = -m * r.z / length, zz = m * r.x / length;
  return {{{m, S(0), zx}, {S(0), m, zz}, {zx, zz, (I + m * dot(r, r)) / (length * length)}}};
}

/// A x, A given by rows.
template <class S>
Vec3<S> times(const std::array<Vec3<S>, 3>& A, const Vec3<S>& x) {
  return {dot3(A[0], x), dot3(A[1], x), dot3(A[2], x)};
}

/// The Jacobian of resist at u.
template <class Shape>
Eigen::Matrix3d resist_jacobian(const Shape& shape, const Scene<double>& scene, const Vec3<double>& u) {
  Eigen::Matrix3d J;
  if constexpr (requires { shape.resist_jacobian(u); }) {  // shapes that carry derivatives of their own
    const Mat3 given = shape.resist_jacobian(u);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) J(i, j) = given[i][j];
  } else {
    Scene<Dual> lifted;
    lifted.hand.theta = Dual(scene.hand.theta);
    Vec3<Dual> x;
    for (int i = 0; i < 3; ++i) x[i] = dynamics::independent(u[i], i);
    const Vec3<Dual> w = resist(shape, lifted, x);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) J(i, j) = w[i].v[j];
  }
  return J;
}

/// Minimises φ(a) = ½ (a − b)ᵀ A (a − b) + k σ(a), σ(a) = −resist(a)·a, by Newton's method with a line search
/// on φ. φ is strictly convex and smooth but at a = 0, which is not the minimum when the sticking wrench is
/// outside.
template <class Shape>
Vec3<double> minimise(const Shape& shape, const Scene<double>& scene, const std::array<Vec3<double>, 3>& A,
                      double k, const Vec3<double>& b, Vec3<double> a) {
  const auto phi = [&](const Vec3<double>& x) {
    const Vec3<double> d{x[0] - b[0], x[1] - b[1], x[2] - b[2]};
    return 0.5 * dot3(d, times(A, d)) - k * dot3(resist(shape, scene, x), x);
  };
  Eigen::Matrix3d metric;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) metric(i, j) = A[i][j];
  double value = phi(a);
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Vec3<double> w = resist(shape, scene, a), d{a[0] - b[0], a[1] - b[1], a[2] - b[2]},
                       Ad = times(A, d);
    const Eigen::Vector3d gradient(Ad[0] - k * w[0], Ad[1] - k * w[1], Ad[2] - k * w[2]);
    const Eigen::Matrix3d hessian = metric - k * resist_jacobian(shape, scene, a);
    const Eigen::Vector3d step = hessian.ldlt().solve(-gradient);
    const double slope = gradient.dot(step);
    if (!std::isfinite(slope) || !(slope < 0)) break;
    double length = 1;
    Vec3<double> next;
    double next_value = value;
    for (int halving = 0; halving < 40; ++halving, length *= 0.5) {
      for (int i = 0; i < 3; ++i) next[i] = a[i] + length * step[i];
      next_value = phi(next);
      if (next_value <= value + 1e-4 * length * slope + 1e-14 * std::abs(value)) break;
    }
    const double moved = length * step.norm(), size = std::sqrt(dot3(next, next));
    if (!(next_value < value) && length < 1) break;
    a = next;
    value = next_value;
    if (moved <= 1e-8 * size) break;  // converging quadratically: what is left is of relative size 1e-16
  }
  return a;
}

/// a = W (f* − f_p) in normalised coordinates, f* the projection of the sticking wrench f_p onto the limit
/// set in the metric of W; zero if f_p is inside.
template <class Shape, class S>
Vec3<S> slip_acceleration(const Shape& shape, const FrictionLimits<S>& limits, const Scene<S>& scene,
                          const Relative<S>& y) {
  const S length = limits.length(scene.normal_force), f_max = limits.held(scene.normal_force);
  const Vec3<S> b = normalised_acceleration(scene, y, Wrench<S>{}, length);
  if (!(dynamics::value_of(f_max) > 0)) return b;
  const Wrench<S> demand = sticking_wrench(scene, y);
  const Vec3<S> w{demand.fx / f_max, demand.fz / f_max, demand.tau / (f_max * length)};
  const S excess = gauge(shape, scene, w) - 1.0;
  if (!(dynamics::value_of(excess) > 0)) return {S(0), S(0), S(0)};

  const auto A = normalised_inertia(scene, lever(scene, y), length);
  // Just outside, the slip leaves along the surface's normal: a guess whose size is right to first order.
  const Scene<double> scene_value = values(scene);
  Vec3<double> w_value, b_value, guess;
  std::array<Vec3<double>, 3> A_value;
  for (int i = 0; i < 3; ++i) {
    w_value[i] = dynamics::value_of(w[i]);
    b_value[i] = dynamics::value_of(b[i]);
    for (int j = 0; j < 3; ++j) A_value[i][j] = dynamics::value_of(A[i][j]);
  }
  const Vec3<double> n = slip_direction(shape, scene_value, w_value);
  const double outside = dynamics::value_of(excess), size = outside * dynamics::value_of(f_max) *
                                                            -dot3(n, w_value) / (1 + outside) /
                                                            dot3(n, times(A_value, n));
  for (int i = 0; i < 3; ++i) guess[i] = size * n[i];
  const Vec3<double> a = minimise(shape, scene_value, A_value, dynamics::value_of(f_max), b_value, guess);
  if constexpr (std::is_same_v<S, double>) {
    return a;
  } else {
    // One Newton step in dual arithmetic with the real Hessian: the implicit function theorem.
    Vec3<S> at{S(a[0]), S(a[1]), S(a[2])};
    const Vec3<S> force = resist(shape, scene, at),
                  Ad = times(A, Vec3<S>{at[0] - b[0], at[1] - b[1], at[2] - b[2]});
    Eigen::Matrix3d hessian = -f_max.a * resist_jacobian(shape, scene_value, a);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) hessian(i, j) += A_value[i][j];
    const Eigen::LDLT<Eigen::Matrix3d> factor(hessian);
    Eigen::Matrix<double, 3, dynamics::kDualSize> gradient;
    for (int i = 0; i < 3; ++i) gradient.row(i) = (Ad[i] - f_max * force[i]).v.transpose();
    const Eigen::Matrix<double, 3, dynamics::kDualSize> shift = factor.solve(gradient);
    for (int i = 0; i < 3; ++i) at[i].v -= shift.row(i).transpose();
    return at;
  }
}

}  // namespace unhand::contact
