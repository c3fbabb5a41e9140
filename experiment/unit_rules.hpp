// Which columns of a throw tell each other's size, and the units that they may be in by mistake. Internal to
// unit_check.
#pragma once

#include <map>
#include <span>
#include <string>

#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {

// What shows: far above any sensor's noise.
inline constexpr double kShowsShift = 0.02, kShowsTurn = 0.02, kShowsSpeed = 0.1, kShowsSpin = 0.1,
                        kShowsNewton = 0.1, kShowsNewtonMetre = 2e-3, kShowsLever = 5e-3, kShowsBend = 1e-3;

/// A quantity in this unit has `factor` times the number that it has in SI units.
struct OtherUnit {
  double factor;
  const char* words;
};
/// One side of a comparison.
struct ColumnSide {
  const char *path, *column;  ///< the path inside a throw, or from the root
  std::span<const OtherUnit> units;
};
/// Two columns that say the same of a throw.
struct UnitRule {
  ColumnSide seen, expected;
  const char* where;    ///< they are compared
  double within = 1.5;  ///< a factor of a unit's, to be taken for it
};

/// Every comparison that knows units; slip_force, a friction coefficient, knows none.
const std::map<SizedColumn, UnitRule>& unit_rules();

/// A column by itself: repetitions of a condition share its size.
struct PlainColumn {
  ColumnSide side;
  const datasets::Series* (*series)(const datasets::Throw&);  ///< null where the throw has none
  std::size_t first, last;                                    ///< its columns, first to last − 1
  double shows;                                               ///< a size far above any sensor's noise, SI
  bool grip = false;  ///< alike in all conditions of a log, and no other channel tells it
};
/// All of a planar throw.
std::span<const PlainColumn> plain_columns();

/// The unit whose factor lies nearest to `ratio` [-] and within a factor of `within` of it; null if none.
const OtherUnit* explaining_unit(std::span<const OtherUnit> units, double ratio, double within);

}  // namespace unhand::experiment
