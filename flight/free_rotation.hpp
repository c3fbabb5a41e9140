// Rotation of a rigid body that nothing turns.
#pragma once

#include <vector>

#include "dynamics/smooth_flow.hpp"
#include "flight/quaternion.hpp"

namespace unhand::flight {

/// Orientation (body to world) and angular velocity in body axes [rad/s].
template <class S>
struct RotationState {
  Quaternion<S> attitude;  ///< body to world
  Vec3<S> omega{};         ///< body axes [rad/s]
};

/// A rotation at some instants, or why there is none.
template <class S>
struct FreeRotation {
  dynamics::Outcome outcome{dynamics::Outcome::horizon};  ///< only `horizon` has states
  std::vector<RotationState<S>> states;                   ///< in the order of the times asked for
};

/// Torque-free rotation in the principal axes of the body,
///
///   I₁ ω̇₁ = (I₂ − I₃) ω₂ ω₃ and so on in turn,   q̇ = ½ q ⊗ (0, ω),
///
/// with inertia I = (I₁, I₂, I₃) about the CoM; only ratios of I matter, so any unit will do. With I₁ = I₂ =
/// I₃ the closed form q(t) = q₀ exp(ω t) answers, otherwise the integrator; the quaternion returned has unit
/// length.
///
/// `times` [s] count from `start` and are >= 0 (in any order). The start's attitude may have any length but
/// zero. Throws std::invalid_argument when an input is not finite, a time is negative, the attitude is zero,
/// a moment of inertia is not > 0 or 1e15 times another, or the body turns by more than 1e15 rad, which no
/// double resolves: |ω| and |ω t| of each axis are accepted up to that. Instantiated for double and Dual.
template <class S>
FreeRotation<S> rotate_freely(const Vec3<S>& inertia, const RotationState<S>& start,
                              const std::vector<double>& times,
                              const dynamics::IntegratorOptions& options = dynamics::error_controlled());

/// The same rotation, to be read at any instant, and with air that brakes it: I ω̇ = … − c I ω, so that the
/// spin of a body with equal moments dies as exp(−c t); c [1/s].
template <class S>
class Rotation {
 public:
  /// From 0 to `last` [s]. Throws as rotate_freely does, and when c is not finite.
  Rotation(const Vec3<S>& inertia, const RotationState<S>& start, const S& damping, double last,
           const dynamics::IntegratorOptions& options = dynamics::error_controlled());
  /// `horizon`, or why there is nothing to read.
  dynamics::Outcome outcome() const { return flow_.outcome; }
  /// `t` [s] after the start, in [0, last], of a rotation that was solved; derivatives of `t` are carried, at
  /// the start too. Throws std::out_of_range for another.
  RotationState<S> at(const S& t) const;

 private:
  Quaternion<S> attitude_;
  Vec3<S> omega_;
  Vec3<S> spin_rate_;  ///< ω̇ at the start
  bool closed_form_{};
  double last_{};  ///< s
  dynamics::Flow<S, 7> flow_{dynamics::Outcome::horizon, {}};
};

}  // namespace unhand::flight
