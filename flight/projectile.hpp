// Free flight without air, in closed form.
#pragma once

#include <cmath>
#include <optional>

#include "dynamics/frames.hpp"
#include "dynamics/scalar.hpp"

namespace unhand::flight {

/// Where the flight ends: on the way down through the landing height.
template <class S>
struct Landing {
  S flight_time{};           ///< from the state given [s]
  dynamics::Pose<S> pose;    ///< θ is not wrapped: it counts the flips
  dynamics::Twist<S> twist;  ///< at the landing [m/s, m/s, rad/s]
};

/// The state of the CoM after `t` [s] under constant gravity [m/s²].
template <class S>
Landing<S> ballistic(const dynamics::Pose<S>& pose, const dynamics::Twist<S>& twist,
                     const dynamics::Vec2<S>& gravity, const S& t) {
  return {t,
          {pose.x + t * (twist.vx + 0.5 * t * gravity.x), pose.z + t * (twist.vz + 0.5 * t * gravity.z),
           pose.theta + t * twist.omega},
          {twist.vx + t * gravity.x, twist.vz + t * gravity.z, twist.omega}};
}

/// t_fly = (vz + sqrt(vz² + 2 g (z − z_land)))/g with g = −gravity.z > 0: the downward passage of
/// `landing_height` [m]. Empty if the flight never reaches that height on its way down: it starts below it
/// and its apex does too, or gravity does not pull down (g <= 0) and it does not fall far enough by itself.
/// Derivatives pass through the landing when S carries them, as dθ/dp = ∂θ/∂p + ω dt_fly/dp with t_fly's from
/// the formula; gravity may be tilted. D4.6 2.1.1, whose printed
/// event function z + max(vz, 0) fires while still rising.
template <class S>
std::optional<Landing<S>> project(const dynamics::Pose<S>& pose, const dynamics::Twist<S>& twist,
                                  const dynamics::Vec2<S>& gravity, const S& landing_height) {
  using dynamics::value_of;
  using std::sqrt;
  const S g = -gravity.z, under_root = twist.vz * twist.vz + 2.0 * g * (pose.z - landing_height);
  if (!(value_of(under_root) >= 0)) return std::nullopt;  // the apex lies below
  // At an apex that just touches the height the landing has no derivative: it is taken as the apex.
  const S root = value_of(under_root) > 0 ? S(sqrt(under_root)) : S(0);
  if (!(value_of(twist.vz) < 0)) {
    if (!(value_of(g) > 0)) return std::nullopt;  // nothing brings it back
    return ballistic(pose, twist, gravity, S((twist.vz + root) / g));
  }
  // Falling: the same root without the difference vz + sqrt(...), which would also divide by a g of zero.
  const S t = 2.0 * (pose.z - landing_height) / (root - twist.vz);
  if (value_of(t) < 0) return std::nullopt;  // already below
  return ballistic(pose, twist, gravity, t);
}

}  // namespace unhand::flight
