// An estimate of what is missing without a form, and whether it would correct predictions. Internal to
// fitting.
#pragma once

#include <optional>

#include "fitting/discovery/missing_estimate.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// What is missing in flight (an acceleration, from the tracked motion) or during the release (a wrench, from
/// the pads' sensors), from the train throws; as a correction of predictions it is tried on the held-out
/// ones. Empty where the sensors for it are missing.
std::optional<MissingEstimate> estimate_missing(const Stage& stage, Phase phase,
                                                const DiscoverOptions& options);

}  // namespace unhand::fitting
