// Single axes of a planar throw in another unit, or with the other sign, and a vertical that another axis
// has. Internal to unit_check.
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

}  // namespace unhand::experiment
