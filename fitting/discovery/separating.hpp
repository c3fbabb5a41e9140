// The experiment that would tell two explanations apart. Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/accepted_effect.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// Experiments that could be added to the log, with what the correlation between the footprint of the
/// accepted effect and that of `other` would then be; the most telling first. Each is simulated: ten more
/// throws of a condition with its motion slower or faster, or with another object of the log; and each sensor
/// that the log lacks, on all of its throws. Throws that cannot be simulated are left out.
std::vector<SeparatingExperiment> separating_experiments(const Stage& stage, const AcceptedEffect& accepted,
                                                         const std::string& other,
                                                         const DiscoverOptions& options);

}  // namespace unhand::fitting
