// Times of a planar throw that cannot be, beside the rest of the throw.
#pragma once

#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/log_note.hpp"

namespace unhand::experiment {

/// Times of a log that lie where nothing of their throw does: an `opening_command_time`, a `detach_time` or
/// `hand_jump_times` outside of the hand's log, a `landing/time` not after the opening, motion capture that
/// has no time in common with the hand. One note for each of them.
std::vector<LogNote> impossible_times(const datasets::ThrowLog& log);

/// Of a landing/time that is not after the opening, or, where that is unknown, after the throw's first
/// sample: "is … s, not after …"; else empty.
std::string landed_before(const datasets::ThrowLog& log, const datasets::Throw& one);

/// Of mocap/time: "runs from … to … s, the robot's clock (hand/time) from … to … s: they do not overlap";
/// empty where they do, where motion capture begins within 1 s after the hand's log (a flight alone was
/// tracked), or where the throw has not both.
std::string clocks_apart(const datasets::ThrowLog& log, const datasets::Throw& one);

}  // namespace unhand::experiment
