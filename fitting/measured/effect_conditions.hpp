// On what else the sizes of an answer hang. Internal to fitting.
#pragma once

#include "fitting/measured/effect_answer.hpp"
#include "fitting/measured/effect_search.hpp"

namespace unhand::fitting {

/// Sizes of the answer's effects as they would be
///  - with another name of one of them in its place, which the log cannot tell from it: what lengths and
///    clocks have in common is the size of a drag's, too;
///  - beside what is evident on the train groups, too, and was not accepted, since held-out groups show too
///    little of it.
/// Only where one differs by more than 2 σ from the answer's, or nothing was accepted. `effects`:
/// described().
std::vector<SizeCondition> conditions_of(const GroupedProblem& problem, const EffectAnswer& answer,
                                         const std::vector<AcceptedEffect>& effects,
                                         const std::vector<dynamics::Effect>& catalogue,
                                         const EffectSearchOptions& options);

}  // namespace unhand::fitting
