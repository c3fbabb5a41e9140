// Search for effects over groups: which one leaves such a residual, and do held-out groups agree?
#pragma once

#include "fitting/discovery/ranking.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// When an effect is believed, and how much is tried.
struct EffectSearchOptions {
  GroupedFitOptions fit;           ///< how every fit runs
  double family_wise_level{0.02};  ///< shared among the candidates of a step
  double equivalent{0.98};         ///< footprints that correlate by this much are one answer
  /// An effect matters if, of some channel, it takes away this share of what the held-out χ² per sample
  /// exceeds the noise by.
  double matters{0.1};
  int refits{4};                    ///< candidates fitted in full, in every step
  int most_effects{6};              ///< accepted in all
  std::vector<std::string> forget;  ///< ids that are not tried
};

/// One parameter from one half of the groups against the other, split at the median of a covariate.
struct Stability {
  std::string parameter, covariate;                 ///< which parameter; what the groups were split by
  double split_at{};                                ///< median of the covariate
  double low{}, low_sigma{}, high{}, high_sigma{};  ///< value and 1 σ in the lower and in the upper half
  double degrees_of_freedom{};  ///< of both σ, which come from the scatter between groups
  /// The difference in its own σ.
  double z() const { return (high - low) / std::hypot(low_sigma, high_sigma); }
};

/// A parameter of an answer, and what it would be otherwise.
struct SizeShift {
  std::string effect, parameter, unit;  ///< "flight.quadratic_drag", "k[jar]", "1/m"
  double value{};                       ///< of the answer
  double then{}, then_sigma{};          ///< what it would be, and 1 σ
};
/// Sizes that hang on an effect that the answer does not have.
struct SizeCondition {
  std::string on;  ///< that effect
  std::string
      instead_of;      ///< the accepted one that it is another name of; empty: it stands beside all of them
  double delta_bic{};  ///< of it there; negative: for it
  std::vector<SizeShift> shifts;  ///< with it
};

/// What a search over effects found: the accepted ones, all scores, and the fits before and after.
struct EffectSearch {
  bool solved{};                                  ///< false: the base fit has no answer
  std::string message;                            ///< why not, in words
  std::vector<AcceptedEffect> effects;            ///< in order of acceptance
  std::vector<Ranked> ranking;                    ///< best first
  GroupedFit base, base_test, final, final_test;  ///< train and held-out groups, before and after
  std::vector<Stability> stability;               ///< of the accepted parameters
  std::vector<SizeCondition> conditions;          ///< of their sizes
};

/// Fits the train groups without effects; then, step by step, takes the footprints of all effects of
/// problem.effects() (the groups' own unknowns and what is fitted already projected out), fits the leading
/// ones in full and accepts the best if
///  - Wald's test with the scatter between groups (F distribution) rejects its absence at the rate divided by
///    the number of candidates,
///  - on held-out groups χ² falls, at 5 %, one-sided, by the jackknife over groups of how much they show of
///    the change that is predicted, and
///  - it matters there.
/// Candidates whose footprints are the same are fitted once, under the name that problem.effects() lists
/// first; those that correlate by `equivalent` with what was accepted are listed as its other names. What has
/// become dispensable is taken away. Where a misfit is left, other answers near this one are searched on
/// from, too, and the better one is returned (docs/measured-data.md).
EffectSearch search_effects(const GroupedProblem& problem, const EffectSearchOptions& options);

}  // namespace unhand::fitting
