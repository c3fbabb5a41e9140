// Flights or falls that err as no other does.
#pragma once

#include <vector>

#include "fitting/gross_outliers.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// The gross outliers among the groups, of both splits, where all `effects` stand beside the base model.
/// Misfit: with stray samples counting linearly.
std::vector<WildGroup> wild_groups(const GroupedProblem& problem,
                                   const std::vector<dynamics::Effect>& effects,
                                   const GroupedFitOptions& options);

/// Of `groups`, those whose misfit beside `answer` exceeds options.group_limit times that of every other
/// group.
std::vector<WildGroup> still_wild(const GroupedProblem& problem, const std::vector<WildGroup>& groups,
                                  const GroupedFit& answer, const GroupedFitOptions& options);

}  // namespace unhand::fitting
