// Effects on a flight in space: what a projectile that turns freely leaves out.
#pragma once

#include "dynamics/effect.hpp"
#include "flight/spatial_flight.hpp"

namespace unhand::flight {

/// flight.quadratic_drag, flight.linear_drag, flight.magnus_lift, flight.wind, flight.gravity_tilt,
/// flight.gravity, flight.drag_by_axis, flight.cubic_drag, flight.spin_damping. They enter an air whose
/// gravity is (0, 0, −g); drag adds to the declared one.
std::span<const dynamics::EffectOn<SpatialAir>> spatial_effects();

}  // namespace unhand::flight
