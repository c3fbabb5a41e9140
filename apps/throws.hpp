// Logs of throws as the subcommands want them: read, not empty, in the units that they declare.
#pragma once

#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::apps {

/// Throws datasets::LogError where the file is no throw log or a column is in another unit
/// (experiment::require_units), Unanswered where it holds no throws.
datasets::ThrowLog read_throws(const std::string& file);

}  // namespace unhand::apps
