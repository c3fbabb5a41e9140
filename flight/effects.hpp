// What the air may do to an object, beyond what its declaration says.
#pragma once

#include "dynamics/effect.hpp"
#include "dynamics/frames.hpp"

namespace unhand::flight {

/// Air: a = −k |v_a| v_a + k_m ω J v_a with v_a = v − w, the velocity against the air, and k the declared
/// drag plus `extra_drag`. J turns a vector by +90° (counter-clockwise).
template <class S>
struct Air {
  S extra_drag{};            ///< k beyond the declared one [1/m]
  S lift{};                  ///< k_m [-]: Magnus
  dynamics::Vec2<S> wind{};  ///< w [m/s]
};

/// flight.quadratic_drag, flight.magnus_lift, flight.wind
std::span<const dynamics::EffectOn<Air>> air_effects();

}  // namespace unhand::flight
