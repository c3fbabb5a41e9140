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

/// Those, and which frames were elsewhere in one of the columns: a third difference with their neighbours is
/// more than eight of its sigmas; without them, at most five in a row (two at either end), it is noise
/// (five); and they lie, by more than that noise, on neither of the parabolas through the six frames before
/// and after. So an impact is no glitch: each frame about it follows those before or those after. None where
/// they are more than a tenth. `times` [s] increase. O(n).
std::vector<bool> glitches(const std::vector<double>& times, std::span<const std::vector<double>> columns,
                           std::span<const double> sigma);

/// Marks such frames of planar throws from a hand as lost, and returns how many. Where the log declares no σ,
/// that of a throw is its scatter from frame to frame.
std::size_t mark_glitches(datasets::ThrowLog& log);

}  // namespace unhand::experiment
