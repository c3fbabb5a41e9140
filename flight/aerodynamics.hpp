// What the air does to a flying object.
#pragma once

#include "dynamics/frames.hpp"
#include "dynamics/scalar.hpp"
#include "flight/vec3.hpp"

namespace unhand::flight {

/// Quadratic drag, a = −k |v| v, in still air; k = ρ c_d A/(2 m) [1/m], v [m/s]. Returns m/s².
template <class S>
dynamics::Vec2<S> quadratic_drag(const S& k, const dynamics::Vec2<S>& v) {
  using std::sqrt;
  const S squared = dot(v, v);
  if (dynamics::value_of(squared) == 0) return {S(0), S(0)};
  return (-k * S(sqrt(squared))) * v;
}

/// Magnus lift in the plane, a = k_m ω J v: k_m [-], ω [rad/s] of the object, v [m/s] against the air.
/// Returns m/s².
template <class S>
dynamics::Vec2<S> magnus_lift(const S& k_m, const S& omega, const dynamics::Vec2<S>& v) {
  const S rate = k_m * omega;
  return {-rate * v.z, rate * v.x};
}

/// Quadratic drag in space.
template <class S>
Vec3<S> quadratic_drag(const S& k, const Vec3<S>& v) {
  using std::sqrt;
  const S squared = dot(v, v);
  if (dynamics::value_of(squared) == 0) return {S(0), S(0), S(0)};
  return scaled(S(-k * S(sqrt(squared))), v);
}

}  // namespace unhand::flight
