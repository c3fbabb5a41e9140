// What is withdrawn of the effects that a search over groups has accepted. Internal to fitting.
#pragma once

#include "fitting/measured/measured_discovery.hpp"

namespace unhand::fitting {

/// Writes a search's effects, parameters and misfit into the answer.
void take_fits(const GroupedProblem& problem, const EffectSearch& search, MeasuredDiscovery& out);

/// Names that explain no channel to within a tenth of its misfit, or not the one they act in, or less than
/// they leave, are taken back; all of them, as each was found beside the others.
void withdraw_imitations(const GroupedProblem& problem, const EffectSearchOptions& options,
                         EffectSearch& search, MeasuredDiscovery& out);

}  // namespace unhand::fitting
