// Frames in which a tracker was elsewhere for once, or held the pose before.
#pragma once

#include <span>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// Which frames repeat the one before in every column, to the bit, while some column moves to that one and to
/// the next different one by more than four sigmas and three steps of its grid: a tracker that had lost the
/// object. At either end, one or two that show one of both motions. `columns`: tracked coordinates by frame,
/// `sigma`: 1 σ of a column.
std::vector<bool> held_frames(std::span<const std::vector<double>> columns, std::span<const double> sigma);

/// Those, and which frames lie, in one of the columns, so far off the parabolas through their neighbours that
/// a third difference is more than eight of its sigmas, and leave a smooth motion (five) behind when they are
/// taken out, worst first, at most a tenth: what a force that sets in or an impact does is smooth without no
/// frame. `times` [s] increase.
std::vector<bool> glitches(const std::vector<double>& times, std::span<const std::vector<double>> columns,
                           std::span<const double> sigma);

/// Marks such frames of planar throws from a hand as lost, and returns how many. Where the log declares no σ,
/// that of a throw is its scatter from frame to frame.
std::size_t mark_glitches(datasets::ThrowLog& log);

}  // namespace unhand::experiment
