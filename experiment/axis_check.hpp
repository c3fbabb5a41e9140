// Single axes of a planar throw in another unit, or with the other sign, a normal force with it, and a
// vertical that another axis has. Internal to unit_check.
#pragma once

#include <vector>

#include "experiment/unit_check.hpp"

namespace unhand::experiment {

/// Single axes (x, z or θ of pose, twist, acceleration, motion capture, landing) that contradict the channels
/// which tell the same: the hand's pose and the sum of its twist, the twist and the sum of the acceleration,
/// motion capture and the hand with its lever while the object is held, the height of the flight and gravity,
/// the landing and where motion capture leads or a free flight from the opening.
///
/// Two channels disagree where they are proportional (|cosine| of at least 0.95 over the samples), the larger
/// is of a size that shows, and the ratio lies near a unit's factor, or its inverse (a file that declares mm
/// and holds m), or is about −1 (an axis that points the other way). The column told is that with the most
/// disagreements beyond its agreements. An axis that hardly moves has no say. Of the median over throws
/// first; where that agrees, of single throws, by factors alone.
std::vector<UnitDoubt> contradicted_axes(const datasets::ThrowLog& log);

/// A vertical that is not z, or points down: free flights without a hand, of either dimension, that fall by
/// gravity (within a factor of 1.5, in the median over the throws) along another axis than −z, and not along
/// that.
std::vector<UnitDoubt> turned_vertical(const datasets::ThrowLog& log);

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
