// A serial chain of revolute joints: where its frames are, what its links weigh, and what its joints can do.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "dynamics/scalar.hpp"

namespace unhand::planners {

using dynamics::Dual;

/// Most joints of a chain; what is sized by the joints needs no heap.
inline constexpr int kMaxJoints = 8;

/// Three components along the axes of a frame.
template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
/// A rotation, or an inertia.
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;
/// One number per joint, in the chain's order.
template <class S>
using JointVector = Eigen::Matrix<S, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;
/// One row and one column per joint.
template <class S>
using JointMatrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;
/// Rows vx, vy, vz [m/rad], ωx, ωy, ωz [-] of the tip, in the base's axes; one column per joint.
template <class S>
using Jacobian = Eigen::Matrix<S, 6, Eigen::Dynamic, 0, 6, kMaxJoints>;

/// A frame B seen from a frame A: p_A = R p_B + p, p [m].
template <class S>
struct Transform {
  Matrix3<S> R = Matrix3<S>::Identity();  ///< rotation, B's axes as columns
  Vector3<S> p = Vector3<S>::Zero();      ///< B's origin [m]
};
/// B seen from A, then C seen from B: C seen from A.
template <class S>
Transform<S> operator*(const Transform<S>& a, const Transform<S>& b) {
  return {a.R * b.R, a.R * b.p + a.p};
}
/// A seen from B.
template <class S>
Transform<S> inverse(const Transform<S>& a) {
  return {a.R.transpose(), -(a.R.transpose() * a.p)};
}

/// Modified Denavit-Hartenberg parameters, T = Rot_x(α) Trans_x(a) Rot_z(θ) Trans_z(d) [Craig2005]: the fixed
/// part (θ = 0), in m and rad. Sines and cosines below 1e-15 are zeros: quarter turns are exact.
Transform<double> modified_dh(double a, double alpha, double d);

/// A rigid body seen from a frame: mass [kg], centre of mass [m], inertia about the centre of mass in the
/// frame's axes [kg m²].
struct Inertia {
  double mass{};                                        ///< kg
  Eigen::Vector3d com = Eigen::Vector3d::Zero();        ///< m
  Eigen::Matrix3d about_com = Eigen::Matrix3d::Zero();  ///< kg m²
};
/// (xx, yy, zz, xy, xz, yz) as a symmetric matrix.
Eigen::Matrix3d symmetric(double xx, double yy, double zz, double xy, double xz, double yz);
/// The same body seen from another frame, in which its own frame is `at`.
Inertia seen_from(const Transform<double>& at, const Inertia& body);
/// Both bodies as one, seen from the same frame.
Inertia together(const Inertia& a, const Inertia& b);
/// Whether a body of positive density could have it: mass > 0 and principal moments that obey the triangle
/// inequality, I₁ + I₂ >= I₃.
bool is_feasible(const Inertia& body);

/// What a joint can do. Infinite: unlimited, or not known.
struct JointLimits {
  static constexpr double kNone = std::numeric_limits<double>::infinity();  ///< no limit
  double lower{-kNone}, upper{kNone};                                       ///< rad
  double velocity{kNone}, acceleration{kNone}, jerk{kNone};                 ///< rad/s, rad/s², rad/s³
  double torque{kNone};                                                     ///< N m
};

/// Friction of a joint, τ = φ₁/(1 + exp(−φ₂ (q̇ + φ₃))) − φ₁/(1 + exp(−φ₂ φ₃)) against the motion
/// [Gaz2019]; φ₁ [N m], φ₂ [s/rad], φ₃ [rad/s]. Zeros: none.
struct JointFriction {
  double phi1{}, phi2{}, phi3{};  ///< N m, s/rad, rad/s
};

/// A revolute joint, and the link that it moves. The link's frame turns about its own z axis; at q = 0 it
/// lies at `origin` in the frame of the link before (in the base for the first).
struct Joint {
  std::string name;          ///< for messages
  Transform<double> origin;  ///< at q = 0 [m]
  Inertia link;              ///< in the link's frame
  JointLimits limits;        ///< of this joint
  JointFriction friction{};  ///< of this joint
};

/// A serial chain of revolute joints, from its base to its tip.
struct Chain {
  std::string name;                  ///< for messages
  std::vector<Joint> joints;         ///< from the base outwards
  Transform<double> tip;             ///< in the last link's frame: the flange, or the tool on it
  std::vector<std::string> notes{};  ///< what a file says that the chain leaves out
  JointVector<double> home{};        ///< where it rests [rad]; empty: not told

  /// How many joints there are.
  int size() const { return static_cast<int>(joints.size()); }
};

/// Throws std::invalid_argument, naming joint, value and accepted range: 1 to 8 joints, rotations that are
/// ones, masses >= 0 with feasible inertias, limits > 0 with lower < upper, a home within them.
void validate(const Chain& chain);

/// The chain with its tip moved on to `tool`, seen from the tip that it had.
Chain with_tool(Chain chain, const Transform<double>& tool);
/// The chain carrying a body, seen from its tip.
Chain with_payload(Chain chain, const Inertia& body);
/// The chain with a gripper on its flange: its tip is the middle of the pads, `length` [m] along the flange's
/// z. The mass [kg] (0: none; an object may count) is a block 0.1 m wide and as long as the gripper.
Chain with_gripper(const Chain& chain, double length, double mass);

/// One limit of every joint, as a vector.
JointVector<double> limits_of(const Chain& chain, double JointLimits::*which);

}  // namespace unhand::planners
