// How sensors and declarations may depart from the truth.
#pragma once

#include "dynamics/effect.hpp"

namespace unhand::experiment {

/// Errors of what is measured or declared, all neutral by default.
template <class S>
struct Sensing {
  S mocap_time_offset{};  ///< mocap stamps minus robot clock [s]
  S ft_time_offset{};     ///< F/T stamps, of wrench and normal force, minus robot clock [s]
  S length_scale{};       ///< reported/true lengths of the tracker − 1 [-]
  S landing_share{};      ///< 1 where the landing was read from the tracker, so that its scale is off too [-]
  S com_offset{};         ///< CoM beyond its declared place, along the object's x [m]
  S inertia{};            ///< true/declared − 1 [-]
  S mass{};               ///< true/declared − 1 [-]; the inertia stays as declared
  S bias_fx{}, bias_fz{};  ///< of the F/T sensor, hand frame [N]
  S bias_tau{};            ///< [N m]
  S normal_force_bias{};   ///< reported − true, of the pad [N]
};

/// sensor.mocap_time_offset, sensor.ft_time_offset, sensor.length_scale, sensor.com_offset, sensor.inertia,
/// sensor.mass, sensor.ft_bias, sensor.normal_force_bias
std::span<const dynamics::EffectOn<Sensing>> sensor_effects();

}  // namespace unhand::experiment
