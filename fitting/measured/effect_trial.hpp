// One effect refitted over groups, and whether the held-out groups agree. Internal to fitting.
#pragma once

#include "fitting/discovery/footprints.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// A fall of the held-out χ², over groups.
struct HeldOutFall {
  double was{}, is{};  ///< χ² per sample
  double p{1};         ///< of a fall by chance: one-sided, jackknife over groups
  double share{};      ///< the largest share of a channel's misfit beyond the noise that goes
  double fall() const { return was - is; }
};

/// A fit with one effect more, on the train groups and, its shared parameters held, on the test groups.
struct EffectTrial {
  std::string id;
  GroupedFit fit, test;
  double p{1}, delta_bic{};
  HeldOutFall held;
};
/// The fit of the train groups without one of its effects, the others fitted again.
GroupedFit fit_without(const GroupedProblem& problem, const GroupedFit& fit, const std::string& id,
                       const GroupedFitOptions& options);
/// On the held-out groups, by the shared parameters of two fits of the train groups: `before` and `after`.
HeldOutFall held_out_fall(const GroupedProblem& problem, const GroupedFit& before,
                          const GroupedFit& before_test, const GroupedFit& after,
                          const GroupedFit& after_test);
/// Starts at `step` from neutral, the shape parameters at the candidate's.
EffectTrial try_effect(const GroupedProblem& problem, const GroupedFit& fit, const GroupedFit& test,
                       const Candidate& candidate, const Eigen::VectorXd& step,
                       const dynamics::Effect& effect, const GroupedFitOptions& options);

/// (θ − neutral)ᵀ V⁻¹ (θ − neutral) of an effect's size parameters, and Bayes' criterion by it.
struct Wald {
  double statistic{};
  Eigen::Index parameters{};
  int bounded{};   ///< of the parameters: neutral at an end of their range
  double each{1};  ///< p-value of the parameter that is told best from neutral, alone
  /// Bayes' criterion with the effect less that without: parameters log(groups) less the statistic.
  double delta_bic(const GroupedFit& fit) const;
  /// Against Hotelling's T² over the groups used, half of it where a parameter may only go one way
  /// (hotelling_bar_tail); or of the surest alone, by its own degrees of freedom and shared by the
  /// parameters: few groups cannot say how all of them scatter together, and still that one of them is there.
  /// The smaller one, twice.
  double p_value(const GroupedFit& fit) const;
};
Wald wald_of(const GroupedFit& fit, const std::string& id);
/// Of parameters that are `away` from neutral, their variances of so many degrees of freedom; `sides` as
/// Candidate has them.
Wald wald_of(const Eigen::VectorXd& away, const Eigen::MatrixXd& covariance, const Eigen::VectorXd& freedom,
             const std::vector<int>& sides);

}  // namespace unhand::fitting
