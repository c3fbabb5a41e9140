// Runs of elastic arms as CSV: what a robot would have to do, and what its spring does.
#pragma once

#include <string>

#include "planners/elastic/replay.hpp"

namespace unhand::apps {

/// The header, with the column `of` first, which tells the runs of one file apart.
std::string trajectory_header(const std::string& of);

/// The rows of a run: samples 1 ms apart or a bit more, with both ends, and both sides of a clutch that
/// switches at one instant.
std::string trajectory_rows(const std::string& name, const planners::elastic::ClutchedArm& arm,
                            const planners::elastic::Replay& run);

}  // namespace unhand::apps
