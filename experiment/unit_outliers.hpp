// Throws that are in another unit than the rest of their log. Internal to unit_check.
#pragma once

#include <span>
#include <vector>

#include "experiment/unit_check.hpp"
#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {

/// Columns of single throws in another unit, given what compare_sizes says of each throw of the log. A column
/// is told of if its ratio to another channel of the same throw is a unit's (the rule of unit_doubts, for
/// factors above kLeastOutlier) and that far from the log's median; or, of a planar log, if its size is a
/// unit's factor from that of the condition's other throws and outside what they span by kLeastOutlier, and
/// no other channel of the throw confirms it; of the normal force, by 20 from what all throws of the log
/// span.
std::vector<UnitDoubt> outlying_throws(const datasets::ThrowLog& log, std::span<const SizeRatios> throws);

}  // namespace unhand::experiment
