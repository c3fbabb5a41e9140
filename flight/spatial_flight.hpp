// Flight of a rigid body in space, with whatever the air may do to it.
#pragma once

#include <vector>

#include "flight/free_rotation.hpp"

namespace unhand::flight {

/// What acts on a body in flight. With u the velocity against the air, u_b = Rᵀ u in body axes, n = u_b/|u|
/// and ω in the world,
///
///   a = g − k |u| u − c u + k_m ω × u − |u| R A Rᵀ u − κ (Σ n_i⁴ − 3/5) |u| u,   A = diag(a_x, a_y, −a_x −
///   a_y).
///
/// A is drag by axis (its mean is in k). κ is what is left for a cube, whose A is zero: the lowest harmonic
/// of its symmetry, 1 along a face's normal and 1/3 along a diagonal, with mean 3/5 over all directions.
template <class S>
struct SpatialAir {
  Vec3<S> gravity{};                     ///< g [m/s²]
  S drag_k{0.0};                         ///< k [1/m], >= 0
  S linear_drag{0.0};                    ///< c [1/s]
  S lift{0.0};                           ///< k_m [-]: Magnus
  S axis_drag_x{0.0}, axis_drag_y{0.0};  ///< a_x, a_y [1/m]
  S cubic_drag{0.0};                     ///< κ [1/m]
  S spin_damping{0.0};                   ///< the spin dies as exp(−c_ω t) [1/s]
  Vec3<S> wind{};                        ///< velocity of the air [m/s]
};

/// What the air does to a body by where it comes from [m/s²], u [m/s] its velocity against the air, both in
/// body axes: −k |u| u − c u − |u| A u − κ (Σ n_i⁴ − 3/5) |u| u. Instantiated for double and Dual.
template <class S>
Vec3<S> body_drag(const SpatialAir<S>& air, const Vec3<S>& u);

/// A rigid body as it is let go, in space.
template <class S>
struct SpatialStart {
  Vec3<S> position{}, velocity{};     ///< of the CoM [m, m/s]
  RotationState<S> rotation{};        ///< at the start
  Vec3<S> inertia{S(1), S(1), S(1)};  ///< about the principal axes, which are the body's; any unit
};

/// A rigid body on its flight.
template <class S>
struct SpatialState {
  Vec3<S> position{};         ///< of the CoM [m]
  RotationState<S> rotation;  ///< orientation and spin
};

/// A flight at some instants, or why there is none.
template <class S>
struct SpatialFlight {
  dynamics::Outcome outcome{dynamics::Outcome::horizon};  ///< only `horizon` has states
  std::vector<SpatialState<S>> states;                    ///< in the order of the times asked for
};

/// States at `times` [s] after the start, each >= 0 (in any order; they may carry derivatives). Without air:
/// closed form for the CoM and Rotation; otherwise by the integrator. Throws std::invalid_argument when an
/// input is not finite, a time or drag_k is negative, or the rotation is none that Rotation takes.
/// Instantiated for double and Dual.
template <class S>
SpatialFlight<S> fly_in_space(const SpatialStart<S>& start, const SpatialAir<S>& air,
                              const std::vector<S>& times,
                              const dynamics::IntegratorOptions& options = dynamics::error_controlled());

}  // namespace unhand::flight
