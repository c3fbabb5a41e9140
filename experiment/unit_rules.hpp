// Which columns of a throw tell each other's size, and the units that they may be in by mistake. Internal to
// unit_check.
#pragma once

#include <map>
#include <span>
#include <string>

#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {

// Sizes that show: far above any sensor's noise.
inline constexpr double kShowsShift = 0.02;  ///< of a position [m]
inline constexpr double kShowsTurn = 0.02;   ///< of an angle [rad]
inline constexpr double kShowsSpeed = 0.1;   ///< of a velocity [m/s]; of an acceleration [m/s²]
inline constexpr double kShowsSpin = 0.1;    ///< of a rate [rad/s]; of an angular acceleration [rad/s²]
inline constexpr double kShowsNewton = 0.1;  ///< of a force [N]
inline constexpr double kShowsNewtonMetre = 2e-3;  ///< of a torque [N m]
inline constexpr double kShowsLever = 5e-3;        ///< of a lever [m]
inline constexpr double kShowsBend = 1e-3;         ///< of a flight's path from a straight line, rms [m]

/// A unit that is not SI.
struct OtherUnit {
  double factor;      ///< numbers in it are so many times those in SI units [-]
  const char* words;  ///< "mm for m"
};
/// One side of a comparison.
struct ColumnSide {
  const char *path, *column;         ///< the path inside a throw, or from the root
  std::span<const OtherUnit> units;  ///< that it may be in; none: not in question
};
/// Two columns that say the same of a throw.
struct UnitRule {
  ColumnSide seen;      ///< its size over that of `expected` is the ratio
  ColumnSide expected;  ///< what it is compared with
  const char* where;    ///< they are compared
  double within = 1.5;  ///< a factor of a unit's, to be taken for it

  /// What one of the sides says of the other, in words: "position of hand/pose says while the object is
  /// held".
  std::string said_by(const ColumnSide& side) const;
};

/// Every comparison that knows units; slip_force, a friction coefficient, knows none.
const std::map<SizedColumn, UnitRule>& unit_rules();

/// A column by itself: repetitions of a condition share its size.
struct PlainColumn {
  ColumnSide side;                                            ///< where it is, and its units
  const datasets::Series* (*series)(const datasets::Throw&);  ///< null where the throw has none
  std::size_t first, last;                                    ///< its columns, first to last - 1
  double shows;                                               ///< a size that shows, SI
  bool grip = false;  ///< alike in all conditions of a log, and no other channel tells it
};
/// All of a planar throw.
std::span<const PlainColumn> plain_columns();

/// The unit whose factor lies nearest to `ratio` [-] and within a factor of `within` of it; null if none.
const OtherUnit* explaining_unit(std::span<const OtherUnit> units, double ratio, double within);

}  // namespace unhand::experiment
