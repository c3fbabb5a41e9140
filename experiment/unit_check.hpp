// Is a channel in the unit that its file says? Channels of one throw measure each other.
#pragma once

#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// A column that is as many times too large as another unit would make it, or whole turns off, or a declared
/// number that physics or motion capture contradicts.
struct UnitDoubt {
  std::string path;    ///< in the log: "/throws/*/mocap/pose", or of one throw: "/throws/017/mocap/pose"
  std::string column;  ///< "theta"
  double ratio{};      ///< its size over what the other channels say, median over throws; of the normal
                       ///< force: the friction that the wrenches take of it; of grasp_angle: itself; of
                       ///< angles that are whole turns off: 1
  int throws{};        ///< that show it, or that are in the median; 0: it is impossible by itself
  std::string reason;  ///< in words, with the unit that would explain it
};

/// Least friction coefficient that pads may have [-]: below PTFE's 0.04, the least of any dry pair in the
/// tables.
inline constexpr double kLeastFriction = 0.01;
/// Most friction coefficient that pads may have [-]: above rubber's 2, the most of any.
inline constexpr double kMostFriction = 3;

/// Factor by which a single throw's column must differ from what the others say to be told of [-]: sensors
/// and repetitions differ by less than 2, units by 10 and more (pound-force, 4.4, is told only of a whole
/// log).
inline constexpr double kLeastOutlier = 5;

/// The columns of a log whose size contradicts other channels by about the factor of a
/// unit in use (mm, cm, inch; degrees; kgf, lbf, mN, kN; N mm, N cm, kgf cm; ms; g). Compared are
///
/// - a column of the tracked pose that never changes with the hand's, which moves;
/// - the hand's pose with the sum of its twist, the twist with the sum of the acceleration;
/// - the object's motion with the hand's while it is held, and then its distance with its com_offset;
/// - the wrench of all pads with what the held body's mass, inertia and lever need (Newton and Euler);
/// - the landing with the hand's state at the opening (as a free flight from there: to a factor of three)
///   and with the attitude that motion capture saw last;
/// - the clocks of the groups with each other, where one has another pace than 10 Hz to 50 kHz; a declared
///   grasp_angle with a whole turn;
/// - the wrench with the normal force while that falls through its last fifth and the pads slip: no
///   channel knows the unit of the normal force, of which only the product with friction is determined, but
///   in another one friction lies outside [kLeastFriction, kMostFriction], by the same factor (1.5) in the
///   upper and the lower half of that fifth;
/// - a declared inertia with what a body of that mass and size can have, and a declared pad_radius with the
///   objects (declared_check.hpp);
/// - each axis by itself (axis_check.hpp), the signs of the wrench and of the normal force
///   (wrench_check.hpp);
/// - the direction of com_offset with where motion capture sees the CoM while the object is held;
/// - the landing height with the height at which motion capture sees the flights end (to 0.1 m), with where
///   free flights are at landing/time, and with the highest point of all throws (to a metre);
/// - the angles of hand and object with themselves, from sample to sample, and those of the landing with
///   what motion capture leads to: logs hold them unwrapped, without jumps of whole turns;
/// - the height of a free flight of a log without a hand with what gravity makes of it, and which axis it
///   falls along, in either dimension;
/// - what an accelerometer reads at rest before a fall, and in it, with gravity.
///
/// A throw has a say where the two are proportional (cosine of at least 0.9 over its samples) and what is
/// expected is large enough to show. The median over throws must lie within a factor of 1.5 (clocks and
/// landing_x: 3 to 4) of a unit's factor, the smallest of which is 4.4: no scale or bias that a sensor may
/// have comes near. Where no median does, single throws are looked at the same way, and by the size of their
/// columns in the other throws of their condition: those are told by their own path
/// ("/throws/017/mocap/pose") with what is accepted. Glitches of a tracker (glitches.hpp) have no say.
std::vector<UnitDoubt> unit_doubts(const datasets::ThrowLog& logged);

/// Throws datasets::LogError, naming the columns, if unit_doubts has any.
void require_units(const datasets::ThrowLog& log, const std::string& file);

}  // namespace unhand::experiment
