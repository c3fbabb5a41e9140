// An answer on the way of a search: effects accepted one after another. Internal to fitting.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fitting/discovery/ranking.hpp"
#include "fitting/measured/effect_trial.hpp"

namespace unhand::fitting {

/// Accepted effects with the fits that have them, and what was seen on the way to them.
struct EffectAnswer {
  std::vector<AcceptedEffect> effects;  ///< in order of acceptance
  GroupedFit train, test;       ///< of the train groups, and of the held-out ones by the same parameters
  std::vector<Ranked> ranking;  ///< in no order
  std::map<std::string, std::size_t> shown_from;  ///< after how many effects one first had a footprint
  std::vector<std::string> barred;                ///< ids that may not be accepted (again)

  /// The accepted ids, in their order, but for this one.
  std::vector<std::string> ids_without(const std::string& id) const;
  /// Whether another accepted effect is nothing without this one: a wind without its drag.
  bool needs(const GroupedProblem& problem, const std::string& id) const;
  /// Of the catalogue, what can be asked for beside the accepted effects.
  std::vector<dynamics::Effect> candidates(const GroupedProblem& problem,
                                           const std::vector<dynamics::Effect>& catalogue) const;
  /// The entry of the ranking, made where there is none: its gain is then negative.
  Ranked& ranked(const std::string& id);
  /// The effect of a trial from this answer becomes the last one.
  void accept(const EffectTrial& trial);
  /// Of a step from this answer, counted from 1: beside the base model.
  int step() const { return 1 + static_cast<int>(effects.size()); }
};

/// The answer without one of its effects, the others fitted again; nothing where that has no fit.
std::optional<EffectAnswer> without(const GroupedProblem& problem, const EffectAnswer& answer,
                                    const std::string& id, const GroupedFitOptions& options);
/// χ² per sample; 0 of none.
double left(const GroupedFit& fit);

/// A shape parameter that ends at the border of its range: it would like to be another effect, as a decay
/// without end is a constant.
bool shape_is_open(const GroupedFit& fit, const std::string& id);

/// Places in a matrix.
std::vector<Eigen::Index> indices(const std::vector<std::size_t>& from);

}  // namespace unhand::fitting
