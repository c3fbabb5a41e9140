// What an accelerometer reads of a body that falls, with effects on the fall and on the sensor.
#pragma once

#include <vector>

#include "dynamics/effect.hpp"
#include "flight/spatial_effects.hpp"

namespace unhand::experiment {

/// Errors of an accelerometer, all neutral by default; body axes.
template <class S>
struct Accelerometer {
  flight::Vec3<S> bias{};       ///< b [m/s²]
  flight::Vec3<S> drift{};      ///< d [m/s³]
  flight::Vec3<S> settling{};   ///< s, as the fall begins [m/s²]
  S settling_time{0.05};        ///< τ [s]
  flight::Vec3<S> lever_arm{};  ///< r, from the CoM to the sensor [m]
};

/// sensor.accelerometer_bias, sensor.accelerometer_drift, sensor.settling, sensor.lever_arm
std::span<const dynamics::EffectOn<Accelerometer>> accelerometer_effects();

/// All effects of an accelerometer in free fall.
std::vector<dynamics::Effect> known_fall_effects();

/// A body that falls along the vertical, at one instant.
template <class S>
struct FallingBody {
  double time{};                      ///< t, since the fall began [s]
  S velocity{};                       ///< v, up [m/s]
  flight::Vec3<S> up{};               ///< u, the unit vertical, body axes
  flight::Vec3<double> omega{};       ///< ω, body axes [rad/s]
  flight::Vec3<double> omega_rate{};  ///< ω̇ [rad/s²]
};

/// What the sensor reads [m/s²], body axes: with a(v u) the drag of the air (flight::body_drag),
///
///   f = a(v u) + b + d t + s exp(−t/τ) + ω × (ω × r) + ω̇ × r.
///
/// In free fall a perfect one at the CoM reads zero. Instantiated for double and Dual.
template <class S>
flight::Vec3<S> specific_force(const Accelerometer<S>& sensor, const flight::SpatialAir<S>& air,
                               const FallingBody<S>& body);

/// When a falling sensor was read, and what a gyroscope beside it said.
struct FallSamples {
  std::vector<double> time;                 ///< from the first sample [s]
  std::vector<flight::Vec3<double>> omega;  ///< ω, body axes [rad/s]; empty: no gyroscope, taken as zero
  std::vector<flight::Vec3<double>> omega_rate;  ///< ω̇ [rad/s²]; empty likewise
  std::vector<flight::Vec3<double>> turned;      ///< ∫ ω dt as a rotation vector [rad]; empty likewise
};

/// A fall as it begins.
template <class S>
struct FallStart {
  S velocity{};            ///< v, up [m/s]
  flight::Vec3<S> up{};    ///< u, body axes
  flight::Vec3<S> spin{};  ///< turning rate beyond what the gyroscope said, body axes [rad/s]
};

/// The body at the samples, with the effects that `values` names: the vertical turns against the body, and
/// v̇ = −g + a(v u)·u by Heun's method from sample to sample. `gravity` g [m/s²]. Instantiated for double and
/// Dual. Throws std::invalid_argument where `omega`, `omega_rate` or `turned` is of another size than `time`,
/// and not empty.
template <class S>
std::vector<FallingBody<S>> falling_bodies(const FallStart<S>& start, const FallSamples& samples,
                                           double gravity, const dynamics::Values<S>& values);

/// What the sensor reads there [m/s²], body axes. Instantiated, and throws, as above.
template <class S>
std::vector<flight::Vec3<S>> falling_readings(const FallStart<S>& start, const FallSamples& samples,
                                              double gravity, const dynamics::Values<S>& values);

}  // namespace unhand::experiment
