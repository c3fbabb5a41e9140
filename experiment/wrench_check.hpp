// Columns of the wrench, and a normal force, with the other sign, and a wrench whose axes are swapped.
// Internal to unit_check.
#pragma once

#include <vector>

#include "experiment/unit_check.hpp"

namespace unhand::experiment {

/// Columns of the wrench with the other sign. While the object is held the pads' wrench is M a − m g. A
/// column is told if it goes against that: in the median over throws a correlation below −0.9 about the means
/// (a bias of the sensor does not count), a cosine below −0.5, and a size within a factor of five. The torque
/// has a say where motion capture confirms the lever.
///
/// Axes are told as swapped instead if fx and fz fit each other's need over all samples of all throws: the
/// rms of the difference below 0.6 of the need and half of that as they stand or reversed, about the means
/// (which a bias leaves alone) below 0.8 of it. That sees what noise hides within a throw, by what objects
/// and conditions differ. Or, where no sign is told, if each follows the other's need in the median over
/// throws (correlations beyond ±0.95, and within ±0.9 with their own).
std::vector<UnitDoubt> reversed_wrenches(const datasets::ThrowLog& log);

/// A normal force that is below zero in 95 % of the samples before the gripper opens, while the pads hold the
/// object: of all throws, or of those that show it where most do not.
std::vector<UnitDoubt> reversed_forces(const datasets::ThrowLog& log);

}  // namespace unhand::experiment
