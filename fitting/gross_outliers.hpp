// Groups of samples that err as no other does: a track that jumps, a throw that was touched, a phone that hit
// something.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

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
  /// How far it is off.
  std::string in_words() const;
};

/// Whether a group is one of them.
bool is_among(const std::vector<WildGroup>& wild, std::size_t group);

/// Inner products of what effects do to a group's whitened samples and of its residual (last), the group's
/// own unknowns projected out of all.
struct GroupFooting {
  std::size_t group{};   ///< its place among the problem's
  bool train{};          ///< else it is held out
  double n{};            ///< samples
  Eigen::MatrixXd gram;  ///< symmetric; a row for each effect's parameter, the last for the residual
  /// χ² per sample that is left where the effects have these sizes.
  double misfit(const Eigen::VectorXd& sizes) const;
  /// The same where they have none.
  double misfit() const;
};

/// Groups that err grossly where all effects together explain what the groups have in common, to first order.
/// What the effects add up to is fitted to the train groups, none of which counts for more than `limit`
/// medians, and again without those that stand out until the same ones do.
///
/// Gross: the logarithm of the misfit lies above the median by more than six times what it scatters upwards
/// (its 84th percentile minus the median), and the misfit is over ten medians. Upwards, since what is not
/// listed makes some groups err more than others, by degrees; a wild group is apart from all of them. More
/// than an eighth of the groups are no strays: then, and of fewer than six groups, none is.
std::vector<WildGroup> gross_outliers(const std::vector<GroupFooting>& groups, double limit);

/// Of `wild`, those whose misfit exceeds `limit` times that of every group that is not among them. One
/// without a footing could not be fitted, and is not explained.
std::vector<WildGroup> still_gross(const std::vector<WildGroup>& wild,
                                   const std::vector<GroupFooting>& groups, double limit);

}  // namespace unhand::fitting
