// Vectors in space.
#pragma once

#include <array>
#include <cmath>

#include "dynamics/scalar.hpp"

namespace unhand::flight {

using dynamics::is_zero;

/// World: x forward, y to the left, z up.
template <class S>
using Vec3 = std::array<S, 3>;

/// a + b, componentwise.
template <class S>
Vec3<S> sum(const Vec3<S>& a, const Vec3<S>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
/// a − b, componentwise.
template <class S>
Vec3<S> difference(const Vec3<S>& a, const Vec3<S>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
/// k a
template <class S>
Vec3<S> scaled(const S& k, const Vec3<S>& a) {
  return {k * a[0], k * a[1], k * a[2]};
}
/// a · b
template <class S>
S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/// a × b, right-handed.
template <class S>
Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// Its derivative does not exist at zero.
template <class S>
S norm(const Vec3<S>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}

}  // namespace unhand::flight
