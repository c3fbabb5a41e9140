// Rotation of a rigid body that nothing turns.
#pragma once

#include <vector>

#include "dynamics/integrator.hpp"
#include "flight/quaternion.hpp"

namespace unhand::flight {

/// Orientation (body to world) and angular velocity in body axes [rad/s].
template <class S>
struct RotationState {
  Quaternion<S> attitude;  ///< body to world
  Vec3<S> omega{};         ///< body axes [rad/s]
};

/// Torque-free rotation in the principal axes of the body,
///
///   I₁ ω̇₁ = (I₂ − I₃) ω₂ ω₃ and so on in turn,   q̇ = ½ q ⊗ (0, ω),
///
/// with inertia I = (I₁, I₂, I₃) about the CoM; only ratios of I matter, so any unit will do. With I₁ = I₂ =
/// I₃ the closed form q(t) = q₀ exp(ω t) answers, otherwise the integrator; the quaternion returned has unit
/// length.
///
/// `times` [s] count from `start` and are >= 0 (in any order). Throws std::invalid_argument when an input is
/// not finite, a time is negative, the attitude is zero or a moment of inertia is not > 0, and
/// std::runtime_error when the integrator stops. Instantiated for double and Dual.
template <class S>
std::vector<RotationState<S>> rotate_freely(const Vec3<S>& inertia, const RotationState<S>& start,
                                            const std::vector<double>& times,
                                            const dynamics::IntegratorOptions& options = {});

/// The same rotation, to be read at any instant, and with air that brakes it: I ω̇ = … − c I ω, so that the
/// spin of a body with equal moments dies as exp(−c t); c [1/s].
template <class S>
class Rotation {
 public:
  /// From 0 to `last` [s]. Throws as rotate_freely does, and when c is not finite.
  Rotation(const Vec3<S>& inertia, const RotationState<S>& start, const S& damping, double last,
           const dynamics::IntegratorOptions& options = {});
  /// `t` [s] after the start, in [0, last]; derivatives of `t` are carried, at the start too.
  RotationState<S> at(const S& t) const;

 private:
  Quaternion<S> attitude_;
  Vec3<S> omega_;
  Vec3<S> spin_rate_;  ///< ω̇ at the start
  bool closed_form_{};
  dynamics::Trajectory<S, 7> trajectory_;
};

/// Kinetic energy ½ ω·Iω [J if I is in kg m²].
template <class S>
S rotational_energy(const Vec3<S>& inertia, const Vec3<S>& omega) {
  return 0.5 * (inertia[0] * omega[0] * omega[0] + inertia[1] * omega[1] * omega[1] +
                inertia[2] * omega[2] * omega[2]);
}

/// Angular momentum R(q) I ω in the world [kg m²/s].
template <class S>
Vec3<S> angular_momentum(const Vec3<S>& inertia, const RotationState<S>& state) {
  return rotate(state.attitude, Vec3<S>{inertia[0] * state.omega[0], inertia[1] * state.omega[1],
                                        inertia[2] * state.omega[2]});
}

}  // namespace unhand::flight
