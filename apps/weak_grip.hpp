// Grips that cannot hold the object even before they open.
#pragma once

#include "experiment/compare.hpp"

namespace unhand::apps {

/// Throws of the model in which the object slips from the start.
int slips_at_start(const experiment::ModelComparison& model);

/// Says on stderr, in one line, in how many throws and under which conditions the model's grip cannot hold
/// the object; nothing where it holds.
void tell_weak_grip(const experiment::ModelComparison& model);

}  // namespace unhand::apps
