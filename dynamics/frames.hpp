// Planar frames: poses, twists, accelerations and wrenches in the x-z plane of a throw, with the kinematics
// of one rigid body seen from another.
//
// World W: x forward [m], z up [m]; angles θ counter-clockwise from +x to +z [rad], never wrapped. J =
// [[0,-1],[1,0]]. H is the hand frame (midway between the pads), O the object's centre of mass, C the contact
// patch (at the pads, so at the hand's origin). r = p_WO − p_WH = (x_r, z_r) [m].
#pragma once

#include <cmath>

namespace unhand::dynamics {

/// A vector of the vertical plane, x forward and z up; the unit is that of what it stands for.
template <class S>
struct Vec2 {
  S x{}, z{};  ///< components along the axes of the frame it is given in
};

/// Componentwise sum; both in one frame.
template <class S>
Vec2<S> operator+(const Vec2<S>& a, const Vec2<S>& b) {
  return {a.x + b.x, a.z + b.z};
}
/// Componentwise difference; both in one frame.
template <class S>
Vec2<S> operator-(const Vec2<S>& a, const Vec2<S>& b) {
  return {a.x - b.x, a.z - b.z};
}
/// k a
template <class S>
Vec2<S> operator*(const S& k, const Vec2<S>& a) {
  return {k * a.x, k * a.z};
}
/// a · b
template <class S>
S dot(const Vec2<S>& a, const Vec2<S>& b) {
  return a.x * b.x + a.z * b.z;
}
/// |a|. Its derivative at a = 0 is not finite: compare squares there.
template <class S>
S norm(const Vec2<S>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}
/// J a: a turned by +90 degrees.
template <class S>
Vec2<S> perp(const Vec2<S>& a) {
  return {-a.z, a.x};
}
/// R(θ) a: a, given in a frame at angle θ, expressed in the world.
template <class S>
Vec2<S> rotate(const S& theta, const Vec2<S>& a) {
  using std::cos;
  using std::sin;
  const S c = cos(theta), s = sin(theta);
  return {c * a.x - s * a.z, s * a.x + c * a.z};
}

/// Position [m, m] and angle [rad].
template <class S>
struct Pose {
  S x{}, z{}, theta{};  ///< m, m; rad, counter-clockwise, not wrapped
  /// (x, z) [m]
  Vec2<S> position() const { return {x, z}; }
};

/// Linear velocity of the frame's origin [m/s] and angular velocity [rad/s], in the world.
template <class S>
struct Twist {
  S vx{}, vz{}, omega{};  ///< m/s, m/s; rad/s, counter-clockwise
  /// (vx, vz) [m/s]
  Vec2<S> linear() const { return {vx, vz}; }
};

/// Linear acceleration of the frame's origin [m/s²] and angular acceleration [rad/s²], in the world.
template <class S>
struct Acceleration {
  S ax{}, az{}, alpha{};  ///< m/s², m/s²; rad/s², counter-clockwise
  /// (ax, az) [m/s²]
  Vec2<S> linear() const { return {ax, az}; }
};

/// Force [N] and torque about the named point [N m], in the world.
template <class S>
struct Wrench {
  S fx{}, fz{}, tau{};  ///< N, N; N m, counter-clockwise
  /// (fx, fz) [N]
  Vec2<S> force() const { return {fx, fz}; }
};

/// Twist of the object's material point at the patch, v_C = G(r) v_O = (vx + ω z_r, vz − ω x_r, ω).
/// [LiuBillard2025] Eq. 11-13.
template <class S>
Twist<S> twist_at_patch(const Twist<S>& object, const Vec2<S>& r) {
  return {object.vx + object.omega * r.z, object.vz - object.omega * r.x, object.omega};
}

/// The inverse, G(r)⁻¹ = G(−r): twist of the CoM from the twist of the material point at the patch.
template <class S>
Twist<S> twist_at_com(const Twist<S>& patch, const Vec2<S>& r) {
  return {patch.vx - patch.omega * r.z, patch.vz + patch.omega * r.x, patch.omega};
}

/// Acceleration of the object's material point at the patch, a_C = a_O + (α z_r + ω² x_r, −α x_r + ω² z_r,
/// 0). [LiuBillard2025] Eq. 16 prints both terms with the opposite sign; a finite difference of any moving
/// rigid body decides for the sign used here (tests/dynamics/frames_test.cpp).
template <class S>
Acceleration<S> acceleration_at_patch(const Acceleration<S>& object, const S& omega, const Vec2<S>& r) {
  return {object.ax + object.alpha * r.z + omega * omega * r.x,
          object.az - object.alpha * r.x + omega * omega * r.z, object.alpha};
}

/// The inverse: acceleration of the CoM from that of the material point at the patch; with the hand's
/// acceleration this is the sticking acceleration of [LiuBillard2025] Eq. 19 (sign corrected as above).
template <class S>
Acceleration<S> acceleration_at_com(const Acceleration<S>& patch, const S& omega, const Vec2<S>& r) {
  return {patch.ax - patch.alpha * r.z - omega * omega * r.x,
          patch.az + patch.alpha * r.x - omega * omega * r.z, patch.alpha};
}

/// Wrench about the CoM from one about the patch, f_O = Gᵀ(r) f_C: τ_O = τ_C + z_r fx − x_r fz.
/// [LiuBillard2025] Eq. 14.
template <class S>
Wrench<S> wrench_at_com(const Wrench<S>& patch, const Vec2<S>& r) {
  return {patch.fx, patch.fz, patch.tau + r.z * patch.fx - r.x * patch.fz};
}

/// Wrench about the patch from one about the CoM, f_C = Gᵀ(−r) f_O.
template <class S>
Wrench<S> wrench_at_patch(const Wrench<S>& com, const Vec2<S>& r) {
  return {com.fx, com.fz, com.tau - r.z * com.fx + r.x * com.fz};
}

}  // namespace unhand::dynamics
