// Times of a planar throw that cannot be, beside the rest of the throw.
#pragma once

#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// Something that a log says and that cannot be so, though it can be read.
struct TimeNote {
  std::string path;  ///< of the first throw that shows it, or of the log's one value
  std::string said;  ///< what is there, and what the throw's other clocks say [s of the file]
  int throws{};      ///< that show it
  /// "/throws/003@detach_time: ...; so in 12 of 24 throws".
  std::string in_words(std::size_t of) const;
};

/// Times of a log that lie where nothing of their throw does: an `opening_command_time`, a `detach_time` or
/// `hand_jump_times` outside of the hand's log, a `landing/time` not after the opening, motion capture that
/// has no time in common with the hand. One note for each of them.
std::vector<TimeNote> impossible_times(const datasets::ThrowLog& log);

/// Of a landing/time that is not after the opening, or, where that is unknown, after the throw's first
/// sample: "is … s, not after …"; else empty.
std::string landed_before(const datasets::ThrowLog& log, const datasets::Throw& one);

/// Of mocap/time: "runs from … to … s, the robot's clock (hand/time) from … to … s: they do not overlap";
/// empty where they do, where motion capture begins within 1 s after the hand's log (a flight alone was
/// tracked), or where the throw has not both.
std::string clocks_apart(const datasets::ThrowLog& log, const datasets::Throw& one);

}  // namespace unhand::experiment
