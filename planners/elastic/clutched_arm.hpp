// A planar arm of three joints whose last one has a spring with clutches: a bi-stiffness actuator.
//
// Coordinates ξ = (θ, ψ, q₁, q₂, q₃) [rad]: the last joint's motor, the far end of its spring, the links.
// Rates in the same order. With all clutches open
//
//   diag(B_θ, B_ψ, M(q) + diag(B₁, B₂, 0)) ξ̈ = (τ_m − s, s, τ₁ − h₁, τ₂ − h₂, −h₃),   s = K (θ − ψ) + D (θ̇ −
//   ψ̇),
//
// h(q, q̇) with Coriolis, gravity and joint friction: [DarkoD46] Eq. 37 with the motor's own line, whose
// torque is limited. An engaged clutch sets a relative velocity to zero, l_p(ξ̇) = 0; since these are
// differences of coordinates, ξ̇ = Z_p ν with a constant Z_p, and Z_pᵀ Π Z_p ν̇ = Z_pᵀ f.
#pragma once

#include <string>

#include "planners/arm/dynamics.hpp"

namespace unhand::planners::elastic {

inline constexpr int kLinks = 3;                 ///< joints of the arm
inline constexpr int kCoordinates = kLinks + 2;  ///< q₁ … q₃ and the spring's two

/// (θ, ψ, q₁, q₂, q₃), or their rates.
template <class S>
using Coordinates = Eigen::Matrix<S, kCoordinates, 1>;
/// (q₁, q₂, q₃), or what belongs to the links.
template <class S>
using Links = Eigen::Matrix<S, kLinks, 1>;
/// Torques of the motors of joint 1, joint 2 and of the last joint's [N m].
template <class S>
using MotorTorques = Eigen::Matrix<S, 3, 1>;

/// Which clutches are engaged.
enum class ClutchMode {
  free,    ///< none: the link swings, the spring's far end oscillates by itself
  hold,    ///< brake: ψ̇ = 0, the link swings
  sea,     ///< link clutch: ψ̇ = q̇₃, a series elastic joint
  brk,     ///< both: ψ̇ = q̇₃ = 0, the motor loads the spring while the link is held
  still,   ///< SEA with the motor held, θ̇ = 0: a passive spring
  locked,  ///< BRK with the motor held: a rigid wrist
  rigid,   ///< motor and link locked across the spring: θ̇ = ψ̇ = q̇₃
};
/// The mode's name, as it is written above.
const char* to_string(ClutchMode);

/// The last joint. Inertias are reflected to the joint.
struct ClutchedJoint {
  double stiffness{};       ///< K [N m/rad], > 0
  double damping{};         ///< D [N m s/rad], >= 0
  double motor_inertia{};   ///< B_θ [kg m²], > 0
  double spring_inertia{};  ///< B_ψ [kg m²], > 0
  double motor_speed{};     ///< largest |θ̇| [rad/s], > 0
  double motor_torque{};    ///< largest |τ_m| [N m], > 0
  double deflection{};      ///< largest |θ − ψ| [rad], > 0
  double brake_torque{};    ///< what the brake can hold [N m], > 0
};

/// An arm with such a last joint.
struct ClutchedArm {
  Chain chain;  ///< three joints about parallel axes; its tip is where the object is held
  Links<double> rotor_inertia{0, 0, 0};  ///< B₁, B₂, and 0: the last joint has its own [kg m²]
  ClutchedJoint last;                    ///< motor, spring and clutches
};

/// Throws std::invalid_argument naming what is wrong: three joints in one vertical plane (axes along −y),
/// finite limits of speed and torque, parameters of the last joint in their ranges.
void validate(const ClutchedArm& arm);

/// From TOML: `chain` (a chain file beside it), `rotor_inertia_kg_m2` (two numbers), the table [last] with
/// the fields of ClutchedJoint. "bsa3" and "vsa_wrist" are arms that come with the library. Throws
/// datasets::TomlError.
ClutchedArm read_clutched_arm(const std::string& name_or_file);

/// The generalized inertia Π(ξ) [kg m²].
template <class S>
Eigen::Matrix<S, kCoordinates, kCoordinates> inertia_of(const ClutchedArm& arm, const Links<S>& q);

/// The right-hand side f with all clutches open [N m].
template <class S>
Coordinates<S> forces_on(const ClutchedArm& arm, const Coordinates<S>& at, const Coordinates<S>& rate,
                         const MotorTorques<S>& torque);

/// Z_p: one column per free velocity.
Eigen::Matrix<double, kCoordinates, Eigen::Dynamic, 0, kCoordinates, kCoordinates> free_velocities(
    ClutchMode mode);

/// ξ̈ in a mode, for rates that obey its clutches.
template <class S>
Coordinates<S> acceleration_in(const ClutchedArm& arm, ClutchMode mode, const Coordinates<S>& at,
                               const Coordinates<S>& rate, const MotorTorques<S>& torque);

/// Rates after the clutches of a mode have closed: an inelastic impact, ξ̇⁺ = Z (Zᵀ Π Z)⁻¹ Zᵀ Π ξ̇⁻. The
/// momentum along the free directions is kept, Zᵀ Π ξ̇⁺ = Zᵀ Π ξ̇⁻; the energy lost is that of the lost
/// velocities, ½ (ξ̇⁻ − ξ̇⁺)ᵀ Π (ξ̇⁻ − ξ̇⁺) (Carnot). Rates that obey the clutches already stay as they are.
template <class S>
Coordinates<S> engage(const ClutchedArm& arm, ClutchMode mode, const Coordinates<S>& at,
                      const Coordinates<S>& rate);

/// Kinetic, gravitational and spring energy [J].
template <class S>
S energy_of(const ClutchedArm& arm, const Coordinates<S>& at, const Coordinates<S>& rate);

/// h(q, q̇) + M(q) q̈ and the joints' friction, with the rotors of joints 1 and 2: what motors or spring must
/// give [N m].
template <class S>
Links<S> joint_torque(const ClutchedArm& arm, const Links<S>& q, const Links<S>& qd, const Links<S>& qdd) {
  const JointVector<S> tau = inverse_dynamics<S>(arm.chain, q, qd, qdd) + friction_torque<S>(arm.chain, qd);
  Links<S> out = tau;
  for (int i = 0; i < kLinks; ++i) out[i] += arm.rotor_inertia[i] * qdd[i];
  return out;
}

/// The tip in the arm's plane: x forward, z up.
template <class S>
struct TipState {
  S x{}, z{}, vx{}, vz{};  ///< m, m/s
};
template <class S>
TipState<S> tip_of(const ClutchedArm& arm, const Links<S>& q, const Links<S>& qd) {
  const ChainFrames<S> frames = frames_of<S>(arm.chain, q);
  TipState<S> out{frames.tip.p[0], frames.tip.p[2], S(0.0), S(0.0)};
  for (int i = 0; i < kLinks; ++i) {  // each joint turns about −y
    out.vx -= qd[i] * (frames.tip.p[2] - frames.links[i].p[2]);
    out.vz += qd[i] * (frames.tip.p[0] - frames.links[i].p[0]);
  }
  return out;
}

// ---------------------------------------------------------------- the same, spelled out

template <class S>
Eigen::Matrix<S, kCoordinates, kCoordinates> inertia_of(const ClutchedArm& arm, const Links<S>& q) {
  Eigen::Matrix<S, kCoordinates, kCoordinates> out;
  out.setZero();
  out(0, 0) = S(arm.last.motor_inertia);
  out(1, 1) = S(arm.last.spring_inertia);
  const JointMatrix<S> M = mass_matrix<S>(arm.chain, q);
  for (int i = 0; i < kLinks; ++i) {
    for (int j = 0; j < kLinks; ++j) out(2 + i, 2 + j) = M(i, j);
    out(2 + i, 2 + i) += arm.rotor_inertia[i];
  }
  return out;
}

template <class S>
Coordinates<S> forces_on(const ClutchedArm& arm, const Coordinates<S>& at, const Coordinates<S>& rate,
                         const MotorTorques<S>& torque) {
  const S spring = arm.last.stiffness * (at[0] - at[1]) + arm.last.damping * (rate[0] - rate[1]);
  const Links<S> q = at.template tail<kLinks>(), qd = rate.template tail<kLinks>();
  const Links<S> h = joint_torque<S>(arm, q, qd, Links<S>::Constant(S(0.0)));
  Coordinates<S> out;
  out << torque[2] - spring, spring, torque[0] - h[0], torque[1] - h[1], -h[2];
  return out;
}

namespace detail {
/// Z (Zᵀ Π Z)⁻¹ Zᵀ y
template <class S>
Coordinates<S> along_free(const ClutchedArm& arm, ClutchMode mode, const Links<S>& q, const Coordinates<S>& y,
                          bool momentum) {
  const auto Z = free_velocities(mode);
  const int n = static_cast<int>(Z.cols());
  const auto P = inertia_of<S>(arm, q);
  JointMatrix<S> reduced(n, n);
  JointVector<S> right(n);
  const Coordinates<S> full = momentum ? Coordinates<S>(P * y) : y;
  for (int i = 0; i < n; ++i) {
    right[i] = S(0.0);
    for (int k = 0; k < kCoordinates; ++k) right[i] += Z(k, i) * full[k];
    for (int j = 0; j < n; ++j) {
      S sum(0.0);
      for (int k = 0; k < kCoordinates; ++k)
        for (int l = 0; l < kCoordinates; ++l)
          if (Z(k, i) != 0 && Z(l, j) != 0) sum += P(k, l);
      reduced(i, j) = sum;
    }
  }
  const JointVector<S> nu = solve_positive<S>(reduced, right);
  Coordinates<S> out;
  for (int k = 0; k < kCoordinates; ++k) {
    out[k] = S(0.0);
    for (int i = 0; i < n; ++i) out[k] += Z(k, i) * nu[i];
  }
  return out;
}
}  // namespace detail

template <class S>
Coordinates<S> acceleration_in(const ClutchedArm& arm, ClutchMode mode, const Coordinates<S>& at,
                               const Coordinates<S>& rate, const MotorTorques<S>& torque) {
  return detail::along_free<S>(arm, mode, at.template tail<kLinks>(), forces_on<S>(arm, at, rate, torque),
                               false);
}

template <class S>
Coordinates<S> engage(const ClutchedArm& arm, ClutchMode mode, const Coordinates<S>& at,
                      const Coordinates<S>& rate) {
  return detail::along_free<S>(arm, mode, at.template tail<kLinks>(), rate, true);
}

template <class S>
S energy_of(const ClutchedArm& arm, const Coordinates<S>& at, const Coordinates<S>& rate) {
  const Links<S> q = at.template tail<kLinks>();
  const Coordinates<S> momentum = inertia_of<S>(arm, q) * rate;
  const S stretch = at[0] - at[1];
  const JointVector<S> still = JointVector<S>::Constant(kLinks, S(0.0));
  return 0.5 * rate.dot(momentum) + 0.5 * arm.last.stiffness * stretch * stretch +
         planners::energy_of<S>(arm.chain, q, still).potential;
}

}  // namespace unhand::planners::elastic
