// What the channels of a throw say of each other's size. Internal to unit_check.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/column_pair.hpp"

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
  rest,           ///< what an accelerometer reads before a fall against gravity
  held_shift,     ///< the object's position against the hand's while it is held
  held_turn,      ///< the same of the angle
  lever,          ///< declared com_offset against the distance at which motion capture sees the object
  force,          ///< against Newton's law of the held body
  torque,         ///< against Euler's
  landing_x,      ///< against a free flight from the opening
  landing_turn,   ///< against the angle that motion capture saw last
  slip_force,     ///< tangential over normal force where the pads slip: a friction coefficient
  slip_growth,    ///< that of the upper half of these normal forces over that of the lower half
};

/// Size over what the other source tells, where the throw has a say.
using SizeRatios = std::map<SizedColumn, double>;

/// What a throw shows: from a hand if the log is planar, and the height of a free flight in either.
SizeRatios compare_sizes(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// Of a throw without a hand, by position axis (x, z; or x, y, z): what is not straight of it over time,
/// beside that of a fall by gravity. Nothing if it was held, or has fewer than eight samples.
std::vector<ColumnPair> flight_bends(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// What an accelerometer reads before a fall, in the quietest fifth of a second of the last three seconds,
/// and in the fall.
struct ForceLevels {
  double before{};   ///< size of the mean reading [m/s²]
  double scatter{};  ///< of the readings about it [m/s²]
  double fall{};     ///< median size of a reading in the fall [m/s²]
  /// Whether the sensor was at rest, in any unit.
  bool at_rest() const { return scatter < 0.06 * before; }
};
/// Of a throw with `imu` and `free_flight`; nothing where the recording has too little of either.
std::optional<ForceLevels> force_levels(const datasets::Throw& logged);

/// The hand's columns at a time within its own, by straight lines.
std::array<double, 3> hand_at(const datasets::Series& time, const datasets::Series& values, double t);

/// When the gripper opens: the command, else where the normal force has fallen to half [s].
std::optional<double> opening_of(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// One F/T sample of a held object.
struct HeldWrench {
  std::array<double, 3> seen;    ///< of all pads, (fx, fz, tau) [N, N, N m]
  std::array<double, 3> needed;  ///< M a − m g about the pads' centre, in the hand frame; tau NaN: not known
};
/// Newton and Euler for the held body from `begin` to `end` [s]; the throw has a hand and F/T samples.
std::vector<HeldWrench> held_wrenches(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                      double begin, double end, std::optional<double> grasp_angle);

/// Where a throw lands by its landing/time.
struct TimedLanding {
  double height;     ///< of a free flight of the pads' centre at that time [m]
  double tolerance;  ///< the object's size, and the air for half of the fall [m]
};
/// Nothing if the throw does not tell.
std::optional<TimedLanding> timed_landing(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// The last tenth of a second that motion capture shows before a landing, latest first.
struct LastTrack {
  std::vector<double> time, x, theta;  ///< [s], [m], [rad]
};
/// Of a planar throw with motion capture and a timed landing; nothing where fewer than four samples show it,
/// or none within `gap` [s] before the landing.
std::optional<LastTrack> track_before_landing(const datasets::Throw& logged, double gap);

/// From the declared com_offset to where motion capture sees the CoM from the pads' centre while the object
/// is held, in the object's frame [rad]; nothing if the throw does not tell, or tells of another distance (by
/// a factor of two).
std::optional<double> lever_angle(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// The highest point that a throw is seen at or could reach from the hand's state [m].
std::optional<double> highest_point(const datasets::ThrowLog& log, const datasets::Throw& logged);

}  // namespace unhand::experiment
