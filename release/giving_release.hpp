// The release from pads that give at every point: time steps without events. Internal to release.
#pragma once

#include "contact/giving_points.hpp"
#include "release/simulate_release.hpp"

namespace unhand::release {

/// What a simulation of `simulate_release` starts from, in the order of its own preparations.
template <class S>
struct GivingStart {
  contact::Relative<S> relative;  ///< the object against the hand at the start
  contact::Hold<S> hold;          ///< how it is held there
  std::vector<S> time_events;     ///< [s], increasing: kinks of hand and force, and the separation
  double separation{};            ///< [s]; +infinity for never
  int free_mode{};                ///< the mode in which the object is free
};

/// Steps the points (contact::GivingPoints) with the rigid body by an implicit Runge-Kutta method of two
/// stages, of second order and L-stable, whatever the springs. Each solves for the object's motion against
/// the hand at its end,
///
///   N (q − q₀ − h b)/h = f(q),   q = (v_r, ω_r),   b its rate without friction, N = (G M⁻¹ Gᵀ)⁻¹,
///
/// with q₀ and h of the stage. Steps are as long as the tolerances give to pads that slip, and up to 5 times
/// that where the slip hardly bends. Derivatives are those of the steps that were taken. The recorded
/// trajectory has the rate at the ends of its pieces that the points' wrench there gives.
template <class S>
ReleaseResult<S> simulate_giving_release(const ReleaseProblem<S>& problem, const contact::GivesAtPoints& pads,
                                         const contact::SceneSource& scenes, const GivingStart<S>& start,
                                         const ReleaseOptions& options);

/// The wrench about the patch [N, N, N m] that moves the object as the recorded piece says at `fraction` of
/// it, where the state is y.
template <class S>
dynamics::Wrench<S> wrench_of_motion(const dynamics::TrajectoryPiece<S, 6>& piece, const S& fraction,
                                     const contact::Scene<S>& scene, const contact::Relative<S>& y);

}  // namespace unhand::release
