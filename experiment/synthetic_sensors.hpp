// The sensors of a synthetic campaign: one throw's record from its simulation.
#pragma once

#include <cstdint>

#include "experiment/planar_arm.hpp"
#include "experiment/random_stream.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "experiment/throw_setup.hpp"

namespace unhand::experiment {

/// One simulated throw as its sensors meet it. The references must outlive it.
struct SensedThrow {
  const PlanarArmHand& commanded;            ///< the hand as its controller logs it
  const contact::NormalForce& normal_force;  ///< of one pad, before any lateness
  const ThrowReader<double>& reader;         ///< what the sensors would see without noise
  double start{};                            ///< [s]
  double landing_time{};                     ///< of the tracked frame [s]
  dynamics::Pose<double> landing_pose;       ///< of the tracked frame; m, m, rad
  double normal_force_bias{};                ///< [N]
  double mocap_time_offset{};                ///< [s]
  double ft_time_offset{};                   ///< [s]
};

/// Writes the groups that the suite has into `record`. Each sensor draws from its own stream of (seed,
/// index).
void record_sensors(const SensedThrow& sensed, const SensorSuite& sensors, std::uint64_t seed,
                    std::uint64_t index, datasets::Throw& record);

}  // namespace unhand::experiment
