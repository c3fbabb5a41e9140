// What no effect of the catalogue explains. Internal to fitting.
#pragma once

#include <optional>

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// The first phase in which the stage leaves more than noise, and the channel in which most is left; where
/// none does, the outcome whose predictions go with the condition. With the estimate of what is missing
/// there. `so_far` has the answer's errors already.
std::optional<Unexplained> unexplained(const Stage& stage, const Discovery& so_far,
                                       const DiscoverOptions& options);

}  // namespace unhand::fitting
