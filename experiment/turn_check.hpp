// Angles that are whole turns off: logs hold them unwrapped. Which turns are real is the log's to say, so
// that none is repaired. Internal to unit_check.
#pragma once

#include <vector>

#include "experiment/unit_check.hpp"

namespace unhand::experiment {

/// Whole turns that a planar series leaves out: θ between two samples, beyond what its rate before makes of
/// the time between, changes by one or more (to 1 rad). One doubt each for hand/pose and mocap/pose, with the
/// first throw that shows it; `throws` counts all.
std::vector<UnitDoubt> jumping_angles(const datasets::ThrowLog& log);

/// Landings whose θ differs by more than half a turn from where motion capture leads: its last tenth of a
/// second before, carried on at its spin for at most 0.3 s. At most one doubt, with the first such throw.
std::vector<UnitDoubt> landings_turns_off(const datasets::ThrowLog& log);

}  // namespace unhand::experiment
