// What is told of an answer's effects: values, other names, how they hold up. Internal to fitting.
#pragma once

#include "fitting/measured/effect_answer.hpp"
#include "fitting/measured/effect_search.hpp"

namespace unhand::fitting {

/// The answer's effects with their values at its fit, the evidence there, and as other names those of the
/// catalogue's effects whose footprints correlate with theirs by `equivalent`.
std::vector<AcceptedEffect> described(const GroupedProblem& problem, const EffectAnswer& answer,
                                      const std::vector<dynamics::Effect>& catalogue,
                                      const EffectSearchOptions& options);

/// The answer's parameters from one half of the train groups against the other, by every covariate whose
/// halves have groups enough.
std::vector<Stability> stability_of(const GroupedProblem& problem, const EffectAnswer& answer,
                                    const EffectSearchOptions& options);

}  // namespace unhand::fitting
