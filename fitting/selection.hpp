// Which effects a model lacks: forward steps, a backward check, and other names of what was accepted.
// Internal to fitting.
#pragma once

#include <optional>

#include "fitting/stage.hpp"

namespace unhand::fitting {

/// One step forward: the candidate that explains most, if it convinces. Writes its scores into `out.ranking`
/// and what it accepted into `out.effects`. Empty if none convinces.
std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Effects that a later one has made superfluous are taken back.
void backward(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Values, significance and other names of what was accepted.
void describe(const Stage& stage, const DiscoverOptions& options, Discovery& out);

}  // namespace unhand::fitting
