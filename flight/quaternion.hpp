// Unit quaternions as orientations.
#pragma once

#include <algorithm>
#include <cmath>

#include "flight/vec3.hpp"

namespace unhand::flight {

/// The rotation from body to world, (w, x, y, z) with w first [1]; q and −q are the same orientation.
template <class S>
struct Quaternion {
  S w{1.0}, x{0.0}, y{0.0}, z{0.0};  ///< unit length
};

/// Hamilton's product: first b, then a.
template <class S>
Quaternion<S> operator*(const Quaternion<S>& a, const Quaternion<S>& b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
          a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
/// The inverse of a unit quaternion.
template <class S>
Quaternion<S> conjugate(const Quaternion<S>& q) {
  return {q.w, -q.x, -q.y, -q.z};
}
/// q/|q|, whose size may lie anywhere in the range of double; q = 0 gives NaN.
template <class S>
Quaternion<S> normalised(const Quaternion<S>& q) {
  using dynamics::value_of;
  using std::sqrt;
  const double size = std::max(
      {std::abs(value_of(q.w)), std::abs(value_of(q.x)), std::abs(value_of(q.y)), std::abs(value_of(q.z))});
  if (size > 0 && std::isfinite(size) && !(size > 1e-100 && size < 1e100))  // its square may be no number
    return normalised(Quaternion<S>{q.w / size, q.x / size, q.y / size, q.z / size});
  const S k = 1.0 / sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return {k * q.w, k * q.x, k * q.y, k * q.z};
}

/// R(q) a: a, given in the body, expressed in the world.
template <class S>
Vec3<S> rotate(const Quaternion<S>& q, const Vec3<S>& a) {
  const Vec3<S> v{q.x, q.y, q.z};
  const Vec3<S> t = scaled(S(2.0), cross(v, a));
  return sum(sum(a, scaled(q.w, t)), cross(v, t));
}

/// The quaternion of a rotation vector θ [rad] (axis times angle): (cos |θ|/2, sin(|θ|/2) θ/|θ|). Analytic
/// everywhere, so near zero its series is used: there |θ| has no derivative.
template <class S>
Quaternion<S> exp(const Vec3<S>& theta) {
  using std::cos, std::sin, std::sqrt;
  const S square = dot(theta, theta);
  S w, k;                                   // k = sin(|θ|/2)/|θ|
  if (dynamics::value_of(square) < 1e-4) {  // the first term left out is below 1e-16
    w = 1.0 - square / 8.0 * (1.0 - square / 48.0 * (1.0 - square / 120.0));
    k = 0.5 - square / 48.0 * (1.0 - square / 80.0 * (1.0 - square / 168.0));
  } else {
    const S angle = sqrt(square);
    w = cos(0.5 * angle);
    k = sin(0.5 * angle) / angle;
  }
  return {w, k * theta[0], k * theta[1], k * theta[2]};
}

/// The shortest rotation vector of a unit quaternion, |θ| <= π [rad]; at π, where two are as short, one of
/// them. Its derivatives are exact from zero up to π.
template <class S>
Vec3<S> log(const Quaternion<S>& q) {
  using std::atan2, std::sqrt;
  const bool turn = dynamics::value_of(q.w) < 0;  // −q is the shorter way
  const S w = turn ? S(-q.w) : q.w;
  const Vec3<S> v{q.x, q.y, q.z};
  const S square = dot(v, v);
  S k;  // |θ|/|v|
  if (dynamics::value_of(square) < 1e-4) {
    const S t = square / (w * w);
    k = 2.0 / w * (1.0 - t * (1.0 / 3 - t * (1.0 / 5 - t * (1.0 / 7 - t / 9.0))));
  } else {
    const S n = sqrt(square);
    k = 2.0 * atan2(n, w) / n;
  }
  return scaled(turn ? S(-k) : k, v);
}

/// What turns `from` into `to`, as a rotation vector in the body frame of `from` [rad].
template <class S>
Vec3<S> rotation_between(const Quaternion<S>& from, const Quaternion<S>& to) {
  return log(conjugate(from) * to);
}

}  // namespace unhand::flight
