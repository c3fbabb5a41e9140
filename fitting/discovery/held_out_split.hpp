// Which throws of a log without a split are held out.
#pragma once

#include "datasets/throw_log.hpp"

namespace unhand::fitting {

/// Whether the log itself says what is held out.
bool has_both_splits(const datasets::ThrowLog& log);

/// The log as it is if it has throws of both splits. Else half of the conditions of each object are held out,
/// one less if they are odd: such that train and held-out throws are distributed most alike in the grip's
/// force and in what the hand does when the gripper opens (velocity, spin, attitude, accelerations), each by
/// itself, so that no grip, posture or speed is on one side alone while another choice has it on both. Of an
/// object with a single condition every other repetition is held out, if another object has more. Names play
/// no part but by their order, and chance none. If nothing can be held out, all throws are train.
datasets::ThrowLog with_held_out(datasets::ThrowLog log);

}  // namespace unhand::fitting
