// One step of a search for effects: what could be added to an answer. Internal to fitting.
#pragma once

#include "fitting/measured/effect_answer.hpp"
#include "fitting/measured/effect_search.hpp"

namespace unhand::fitting {

/// What is evident on train groups beside an answer.
struct EvidentEffects {
  std::vector<EffectTrial> trials;       ///< fitted in full, the most evident first
  std::vector<dynamics::Effect> silent;  ///< what no channel shows yet
  double level{};                        ///< at which a trial is evident
};

/// Of `effects`: their footprints beside the answer are scored to first order, and the leading ones, at most
/// `options.refits`, fitted in full. One of two with the same footprint is fitted, that which `effects` lists
/// first. A trial is evident if Wald's test rejects its absence at the family-wise level over the number of
/// candidates, no parameter ends where it could not be, and its own shape is told. Takes all scores into the
/// answer's ranking.
EvidentEffects evident_effects(const GroupedProblem& problem, const std::vector<dynamics::Effect>& effects,
                               const EffectSearchOptions& options, EffectAnswer& answer);

/// The ids of those of `silent` that a channel shows once the trial's effect is there.
std::vector<std::string> shown_beside(const GroupedProblem& problem, const EffectTrial& trial,
                                      const std::vector<dynamics::Effect>& silent,
                                      const EffectSearchOptions& options);

}  // namespace unhand::fitting
