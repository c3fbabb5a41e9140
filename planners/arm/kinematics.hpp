// Kinematics of a serial chain: where its tip is, and how it moves.
//
// All functions are templated on their scalar: double, Dual, or any other dynamics::DualOf. Those of double
// and Dual are compiled once, in kinematics.cpp. They throw std::invalid_argument for vectors that have not
// one number for each joint of the chain; what the numbers are, and whether the chain is one (validate), is
// the caller's to check.
#pragma once

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <stdexcept>

#include "planners/arm/chain.hpp"

namespace unhand::planners {

/// Throws std::invalid_argument unless each of `x` has one number for each joint.
template <class... Vectors>
void require_sizes(const Chain& chain, const char* of, const Vectors&... x) {
  for (const Eigen::Index size : {static_cast<Eigen::Index>(x.size())...})
    if (size != chain.size())
      throw std::invalid_argument(fmt::format("{}: a vector of {} is not one of {} joints, as the chain has",
                                              of, size, chain.size()));
}

/// a × b; of mixed scalars.
template <class A, class B>
auto cross(const Vector3<A>& a, const Vector3<B>& b) {
  using S = decltype(a[0] * b[0]);
  return Vector3<S>(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

/// R Rot_z(q): the rotation of a joint's link against the link before.
template <class S>
Matrix3<S> joint_rotation(const Eigen::Matrix3d& R, const S& q) {
  using std::cos, std::sin;
  const S c = cos(q), s = sin(q);
  Matrix3<S> out;
  for (int i = 0; i < 3; ++i) {
    out(i, 0) = c * R(i, 0) + s * R(i, 1);
    out(i, 1) = c * R(i, 1) - s * R(i, 0);
    out(i, 2) = S(R(i, 2));
  }
  return out;
}

/// The frames of all links and of the tip, seen from the base.
template <class S>
struct ChainFrames {
  std::array<Transform<S>, kMaxJoints> links;  ///< m
  Transform<S> tip;                            ///< m
};
/// From the base outwards at q [rad].
template <class S>
ChainFrames<S> frames_of(const Chain& chain, const JointVector<S>& q);

/// The tip's frame, seen from the base.
template <class S>
Transform<S> forward_kinematics(const Chain& chain, const JointVector<S>& q) {
  return frames_of(chain, q).tip;
}

/// Height of the lowest joint origin beyond the second, or of the tip [m].
double lowest_height(const Chain& chain, const ChainFrames<double>& frames);

/// Geometric Jacobian of the tip, (v, ω) = J(q) q̇: column i is (z_i × (p − o_i), z_i).
template <class S>
Jacobian<S> jacobian(const Chain& chain, const JointVector<S>& q);
/// The same from frames at hand.
template <class S>
Jacobian<S> jacobian(const Chain& chain, const ChainFrames<S>& frames);

/// The tip's frame, twist and acceleration, in the base's axes.
template <class S>
struct TipMotion {
  Transform<S> frame;              ///< m
  Vector3<S> velocity, omega;      ///< m/s, rad/s
  Vector3<S> acceleration, alpha;  ///< m/s², rad/s²
};
/// At (q, q̇, q̈) [rad, rad/s, rad/s²].
template <class S>
TipMotion<S> tip_motion(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                        const JointVector<S>& qdd);

// ---------------------------------------------------------------- the same, spelled out

template <class S>
ChainFrames<S> frames_of(const Chain& chain, const JointVector<S>& q) {
  require_sizes(chain, "frames of a chain", q);
  ChainFrames<S> out;
  Transform<S> at;
  for (int i = 0; i < chain.size(); ++i) {
    const Transform<double>& origin = chain.joints[i].origin;
    at.p += at.R * origin.p;
    at.R = (at.R * joint_rotation(origin.R, q[i])).eval();
    out.links[i] = at;
  }
  out.tip = {at.R * chain.tip.R, at.R * chain.tip.p + at.p};
  return out;
}

template <class S>
Jacobian<S> jacobian(const Chain& chain, const ChainFrames<S>& frames) {
  Jacobian<S> out(6, chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const Vector3<S> z = frames.links[i].R.col(2), arm = frames.tip.p - frames.links[i].p;
    out.col(i).template head<3>() = cross(z, arm);
    out.col(i).template tail<3>() = z;
  }
  return out;
}

template <class S>
Jacobian<S> jacobian(const Chain& chain, const JointVector<S>& q) {
  return jacobian(chain, frames_of(chain, q));
}

template <class S>
TipMotion<S> tip_motion(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                        const JointVector<S>& qdd) {
  require_sizes(chain, "motion of the tip", q, qd, qdd);
  const ChainFrames<S> frames = frames_of(chain, q);
  const Vector3<S> zero = Vector3<S>::Zero();
  TipMotion<S> m{frames.tip, zero, zero, zero, zero};
  Vector3<S> at = zero;
  const auto carry = [&](const Vector3<S>& to) {  // along the rigid link to its next point
    const Vector3<S> arm = to - at, swing = cross(m.omega, arm);
    m.acceleration += cross(m.alpha, arm) + cross(m.omega, swing);
    m.velocity += swing;
    at = to;
  };
  for (int i = 0; i < chain.size(); ++i) {
    carry(frames.links[i].p);
    const Vector3<S> z = frames.links[i].R.col(2), spin = qd[i] * z;
    m.alpha += qdd[i] * z + cross(m.omega, spin);
    m.omega += spin;
  }
  carry(frames.tip.p);
  return m;
}

extern template ChainFrames<double> frames_of(const Chain&, const JointVector<double>&);
extern template ChainFrames<Dual> frames_of(const Chain&, const JointVector<Dual>&);
extern template Jacobian<double> jacobian(const Chain&, const ChainFrames<double>&);
extern template Jacobian<Dual> jacobian(const Chain&, const ChainFrames<Dual>&);
extern template Jacobian<double> jacobian(const Chain&, const JointVector<double>&);
extern template Jacobian<Dual> jacobian(const Chain&, const JointVector<Dual>&);
extern template TipMotion<double> tip_motion(const Chain&, const JointVector<double>&,
                                             const JointVector<double>&, const JointVector<double>&);
extern template TipMotion<Dual> tip_motion(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&,
                                           const JointVector<Dual>&);

}  // namespace unhand::planners
