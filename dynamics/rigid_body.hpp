// A planar rigid body and the wrench that gives it an acceleration.
#pragma once

#include "dynamics/frames.hpp"

namespace unhand::dynamics {

/// Mass m [kg] and moment of inertia I about the CoM, out of the plane [kg m²]; both > 0.
template <class S>
struct RigidBody {
  S mass{}, inertia{};  ///< kg; kg m²
};

/// The gravity vector of a level base: (0, −g) [m/s²].
template <class S>
Vec2<S> level_gravity(const S& g) {
  return {S(0), -g};
}

/// M a_O = Gᵀ f_C + m g: acceleration of the CoM under the wrench `patch` about the patch [N, N, N m] and
/// gravity [m/s²]. [LiuBillard2025] Eq. 18, whose printed gravity entry −g is, as a wrench, −m g.
template <class S>
Acceleration<S> acceleration_under(const RigidBody<S>& body, const Wrench<S>& patch, const Vec2<S>& r,
                                   const Vec2<S>& gravity) {
  const Wrench<S> com = wrench_at_com(patch, r);
  return {com.fx / body.mass + gravity.x, com.fz / body.mass + gravity.z, com.tau / body.inertia};
}

/// The wrench about the patch that gives the CoM the acceleration `object`: f_p = Gᵀ(−r)(M a_O − m g).
/// [LiuBillard2025] Eq. 20.
template <class S>
Wrench<S> required_wrench(const RigidBody<S>& body, const Acceleration<S>& object, const Vec2<S>& r,
                          const Vec2<S>& gravity) {
  const Wrench<S> com{body.mass * (object.ax - gravity.x), body.mass * (object.az - gravity.z),
                      body.inertia * object.alpha};
  return wrench_at_patch(com, r);
}

}  // namespace unhand::dynamics
