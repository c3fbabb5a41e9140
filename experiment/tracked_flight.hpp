// What a tracker reports of a body that flies in space, with effects on the flight and on the tracker.
#pragma once

#include <vector>

#include "dynamics/effect.hpp"
#include "flight/spatial_effects.hpp"

namespace unhand::experiment {

/// Errors of what is tracked or declared, all neutral by default.
template <class S>
struct Tracking {
  S length_scale{0.0};  ///< reported/true lengths − 1 [-]
  S time_scale{0.0};    ///< reported/true time − 1 [-]
  flight::Vec3<S>
      com_offset{};  ///< true − declared CoM, body axes [m]; the tracked point is the declared one
  S inertia_y{0.0}, inertia_z{0.0};  ///< true/declared − 1 of I_y/I_x and I_z/I_x [-]
};

/// sensor.length_scale, sensor.time_scale, sensor.com_offset, sensor.inertia
std::span<const dynamics::EffectOn<Tracking>> tracking_effects();

/// All effects of a flight in space.
std::vector<dynamics::Effect> known_flight_effects();

/// A flight as it is declared.
template <class S>
struct TrackedFlight {
  flight::SpatialStart<S> start;  ///< of the CoM, in true lengths and times
  double gravity{9.81};           ///< [m/s²]
  double drag_k{};                ///< [1/m]
};

/// What a tracker reports of a body in flight, in its own axes and scale.
template <class S>
struct TrackedPose {
  flight::Vec3<S> position{};      ///< as reported [m]
  flight::Quaternion<S> attitude;  ///< body to world, as reported
};

/// The tracked poses at reported `times` [s] from the start, with the effects that `values` names; none if
/// the flight is not solved. Throws as fly_in_space does. Instantiated for double and Dual.
template <class S>
std::vector<TrackedPose<S>> tracked_poses(
    const TrackedFlight<S>& declared, const dynamics::Values<S>& values, const std::vector<double>& times,
    const dynamics::IntegratorOptions& options = dynamics::error_controlled());

}  // namespace unhand::experiment
