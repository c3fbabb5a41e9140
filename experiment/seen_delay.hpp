// When an object was let go, from motion capture alone. Internal to friction_estimate.
#pragma once

#include <optional>

#include "datasets/throw_log.hpp"
#include "experiment/prepared_throw.hpp"

namespace unhand::experiment {

/// The time after the opening command [s] until which an object has to be carried in order to fly on as
/// motion capture sees it: least squares of the path's x and z from the command to the landing, over delays
/// from 0 to the hand's last sample. It is the delay of contact::GripperDelay, not the instant at which the
/// pads part: an object that turns or slips in them before has another one. Nothing where motion capture
/// shows fewer than eight samples, or where the best delay is the longest.
std::optional<double> seen_delay(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                 const PreparedThrow& prepared);

}  // namespace unhand::experiment
