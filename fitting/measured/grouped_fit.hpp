// Least squares over groups, with each group's own unknowns eliminated.
#pragma once

#include <functional>

#include "fitting/measured/grouped_problem.hpp"

namespace unhand::fitting {

/// Budget and robustness of a fit.
struct GroupedFitOptions {
  int iterations{20};  ///< of the solver
  /// Samples beyond this many times the scatter of their channel count linearly; groups whose χ² per sample
  /// exceeds `group_limit` medians count as if it did not.
  double sample_limit{6}, group_limit{3};  ///< in scatters; in medians
  bool robust{true};                       ///< else all samples count alike
  int threads{0};                          ///< 0: one per core; the answer does not depend on it
};

/// What a row and a group count for; learned from a fit.
struct GroupedWeights {
  std::vector<double> channel_scale;  ///< robust scatter by channel, at least 1 [σ]
  std::vector<double> group;          ///< factor on every group's part
  /// Factor on the rows of what is known beforehand: samples that err by more than their noise, alike their
  /// neighbours, are worth fewer than they are, and must not outvote it by their number.
  double prior{1};
};

/// One group at the solution: its own unknowns and its whitened residual.
struct GroupFit {
  bool used{}, solved{};          ///< took part; has equations at the answer
  Eigen::VectorXd own, residual;  ///< own unknowns; (predicted − measured)/σ by row
  double chi2{};                  ///< of the measurements, not robust
  int n{};                        ///< measurements
};

/// The shared parameters with their covariance, and every group's fit. Not converging is an outcome.
struct GroupedFit {
  bool solved{};                        ///< false: `message` says why
  std::string message;                  ///< in words
  std::vector<SharedParameter> shared;  ///< the parameters
  Eigen::VectorXd values;               ///< theirs, in their order
  /// By the scatter of the groups' gradients (borrowing_scatter): it holds when the noise within a group is
  /// correlated and when the model is not quite right. Not below that of white noise; what no group sees is
  /// as uncertain as its range is wide.
  Eigen::MatrixXd covariance;
  Eigen::VectorXd freedom;               ///< degrees of freedom of every parameter's variance
  std::vector<GroupFit> groups;          ///< one per group of the problem
  GroupedWeights weights;                ///< as at the answer
  double chi2{};                         ///< of the groups used, not robust
  long samples{}, degrees_of_freedom{};  ///< measurements; those minus unknowns
  int used{}, iterations{};              ///< groups; of the solver
  /// Of the shared parameters.
  std::vector<std::string> names() const;
  /// The places of the groups that took part and are solved.
  std::vector<std::size_t> solved_groups() const;
  /// 1 σ of shared parameter k; from the covariance.
  double sigma(std::size_t k) const {
    return std::sqrt(covariance(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)));
  }
  /// 1 where the model explains everything to its noise.
  double chi2_per_dof() const {
    return degrees_of_freedom > 0 ? chi2 / static_cast<double>(degrees_of_freedom) : 0;
  }
};

/// Fits `shared` (from `values`) and the own unknowns of all groups of the split. Those begin as they are in
/// `near`, where it is given: a fit of the same groups that differs little is found in fewer steps.
GroupedFit fit_groups(const GroupedProblem& problem, datasets::Split split,
                      const std::vector<SharedParameter>& shared, const Eigen::VectorXd& values,
                      const GroupedFitOptions& options = {}, const GroupedFit* near = nullptr);

/// The own unknowns alone, the shared ones as in `fit`; of the groups of another split, or the same.
/// They begin as above.
GroupedFit fit_own(const GroupedProblem& problem, datasets::Split split, const GroupedFit& fit,
                   const GroupedFitOptions& options = {}, const GroupedFit* near = nullptr);

/// The own unknowns of one group fitted to the rows for which `use(row)`: for predicting the others. What is
/// known beforehand counts as it does in `fit`.
GroupFit fit_own_part(const GroupedProblem& problem, std::size_t group, const GroupedFit& fit,
                      const std::function<bool(const GroupRow&)>& use);

/// Weighted equations with the own unknowns projected out of every column: F̃ = F − O (OᵀO)⁺ Oᵀ F.
struct ProjectedEquations {
  bool solved{};              ///< false: the equations are not finite
  Eigen::MatrixXd columns;    ///< shared, then the residual last
  Eigen::MatrixXd own_basis;  ///< orthonormal, of what the own unknowns can do
};
/// The projected equations of one group at these values.
ProjectedEquations projected(const GroupedProblem& problem, std::size_t group,
                             std::span<const std::string> names, std::span<const double> values,
                             const Eigen::VectorXd& own, const GroupedWeights& weights, double sample_limit);
/// The same of equations that are there, and solved.
ProjectedEquations projected(GroupEquations equations, const Group& group, const GroupedWeights& weights,
                             double sample_limit);

/// χ² per sample of a channel over the groups used.
struct GroupedMisfit {
  std::string channel;  ///< which
  int n{};              ///< measurements
  double chi2{};        ///< not robust
  double weight{};      ///< what its groups count for together: n where all count alike
  /// 1 where the model explains the channel to its noise.
  double chi2_per_sample() const { return weight > 0 ? chi2 / weight : 0; }
};
/// By channel. With weights, every group counts as it does in them.
std::vector<GroupedMisfit> misfit(const GroupedProblem& problem, const GroupedFit& fit,
                                  const GroupedWeights* weights = nullptr);

}  // namespace unhand::fitting
