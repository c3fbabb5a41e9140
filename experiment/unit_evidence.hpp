// What the channels of a throw say of each other's size. Internal to unit_check.
#pragma once

#include <map>
#include <optional>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// A column whose size another source tells, too.
enum class SizedColumn {
  hand_clock,     ///< against the sums of twist and acceleration over it
  ft_clock,       ///< against the hand's, by what they span
  mocap_clock,    ///< the same
  landing_clock,  ///< against a free fall from the opening
  hand_shift,     ///< pose against the sum of the twist
  hand_turn,      ///< the same of the angle
  hand_speed,     ///< twist against the sum of the acceleration
  hand_spin,      ///< the same of the rate
  fall,           ///< the height of a free flight against gravity
  held_shift,     ///< the object's position against the hand's while it is held
  held_turn,      ///< the same of the angle
  lever,          ///< declared com_offset against the distance at which motion capture sees the object
  force,          ///< against Newton's law of the held body
  torque,         ///< against Euler's
  landing_x,      ///< against a free flight from the opening
  landing_turn,   ///< against the angle that motion capture saw last
  slip_force,     ///< tangential over normal force where the pads slip: a friction coefficient
};

/// Size over what the other source tells, where the throw has a say.
using SizeRatios = std::map<SizedColumn, double>;

/// What a throw shows: from a hand if the log is planar, and the height of a free flight in either.
SizeRatios compare_sizes(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// Where a throw lands by its landing/time.
struct TimedLanding {
  double height;     ///< of a free flight of the pads' centre at that time [m]
  double tolerance;  ///< the object's size, and the air for half of the fall [m]
};
/// Nothing if the throw does not tell.
std::optional<TimedLanding> timed_landing(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// From the declared com_offset to where motion capture sees the CoM from the pads' centre while the object
/// is held, in the object's frame [rad]; nothing if the throw does not tell, or tells of another distance (by
/// a factor of two).
std::optional<double> lever_angle(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// The highest point that a throw is seen at or could reach from the hand's state [m].
std::optional<double> highest_point(const datasets::ThrowLog& log, const datasets::Throw& logged);

}  // namespace unhand::experiment
