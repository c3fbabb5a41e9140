// Groups that err as no other does: a track that jumps, a throw that was touched, a phone that hit something.
#pragma once

#include <vector>

#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// The share of groups that are exceptions at most; more than that are no strays.
inline constexpr double kMostWild = 0.125;

/// A group whose misfit is a gross outlier.
struct WildGroup {
  std::size_t group{};  ///< its place among the problem's
  double times{};       ///< its misfit, in medians of all groups'
  double sigmas{};      ///< the logarithm of that, in robust sigmas
  double apart{};       ///< its misfit, in those of the worst group that is not gross
  bool operator==(const WildGroup&) const = default;
};

/// Groups that err grossly where all `effects` together explain what the groups have in common, to first
/// order beside the base model. What the effects add up to is fitted to the train groups, none of which
/// counts for more than options.group_limit medians, and again without those that stand out until the same
/// ones do. Misfit: χ² per sample with each group's own unknowns projected out, stray samples counting
/// linearly.
///
/// Gross: the logarithm of the misfit lies above the median by more than six times what it scatters upwards
/// (its 84th percentile minus the median), and the misfit is over ten medians. Upwards, since what is not
/// listed makes some groups err more than others, by degrees; a wild group is apart from all of them. More
/// than an eighth of the groups are no strays: then, and of fewer than six groups, none is.
std::vector<WildGroup> wild_groups(const GroupedProblem& problem,
                                   const std::vector<dynamics::Effect>& effects,
                                   const GroupedFitOptions& options);

/// Of `groups`, those whose misfit beside `answer` exceeds options.group_limit times that of every other
/// group.
std::vector<WildGroup> still_wild(const GroupedProblem& problem, const std::vector<WildGroup>& groups,
                                  const GroupedFit& answer, const GroupedFitOptions& options);

}  // namespace unhand::fitting
