// Frames in which a tracker was elsewhere for once.
#pragma once

#include <span>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// Which frames lie, in one of the `columns` (tracked coordinates by frame), so far off the parabolas through
/// their neighbours that a third difference is more than eight of its sigmas, and leave a smooth motion
/// (five) behind when they are taken out, worst first, at most a tenth: what a force that sets in or an
/// impact does is smooth without no frame. `times` [s] increase; `sigma`: 1 σ of a column.
std::vector<bool> glitches(const std::vector<double>& times, std::span<const std::vector<double>> columns,
                           std::span<const double> sigma);

/// Marks such frames of planar throws from a hand as lost, and returns how many. Where the log declares no σ,
/// that of a throw is its scatter from frame to frame.
std::size_t mark_glitches(datasets::ThrowLog& log);

}  // namespace unhand::experiment
