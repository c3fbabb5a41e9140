// What no effect of the catalogue explains: where it is, and an estimate of it that assumes no form. Internal
// to fitting.
#pragma once

#include <optional>

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// The channels and phases, in their order, in which a stage leaves more than noise in both halves of the
/// throws; of what an effect on the pads has taken away of the base's misfit, a hundredth may stay.
std::vector<ChannelMisfit> left_by_answer(const Stage& stage, const Discovery& so_far,
                                          const DiscoverOptions& options);

/// The first phase in which the stage leaves more than noise, and the channel in which most is left; where
/// none does, the outcome whose predictions go with the condition. With the estimate of what is missing
/// there. `so_far` has the answer's errors already.
std::optional<Unexplained> unexplained(const Stage& stage, const Discovery& so_far,
                                       const DiscoverOptions& options);

/// What is missing in flight (an acceleration, from the tracked motion) or during the release (a wrench, from
/// the pads' sensors), from the train throws; as a correction of predictions it is tried on the held-out
/// ones. Empty where the sensors for it are missing.
std::optional<MissingEstimate> estimate_missing(const Stage& stage, Phase phase,
                                                const DiscoverOptions& options);

}  // namespace unhand::fitting
