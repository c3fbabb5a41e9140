// The rounds of a fit: least squares, then what the solution teaches of weights and spreads. Internal.
#pragma once

#include <string>
#include <vector>

#include "fitting/throw_cost.hpp"

namespace unhand::fitting {

/// The state of a fit between its rounds. Unknowns are in units of their scales here.
class FitRounds {
 public:
  /// Takes the throws of the options' share that can be simulated at `start`; where they fit badly from the
  /// beginning, channels are weighed accordingly.
  FitRounds(const CampaignProblem& problem, const FitOptions& options, const std::vector<double>& start);

  const std::vector<std::size_t>& used() const { return used_; }
  bool is_fixed(const Unknown& unknown) const;

  /// Least squares with the weights and spreads as they are, and the normal equations at its solution; false
  /// where Ceres gives up.
  bool solve(bool last);
  /// The weights of channels, and (empirical Bayes) the spread of the throws' own unknowns: what they show
  /// plus what each is uncertain by.
  void learn();

  std::vector<double> campaign() const { return shared_.unscaled(x_.data()); }
  std::vector<double> own(std::size_t i) const { return shared_.own_unscaled(own_at(i)); }
  const Shared& shared() const { return shared_; }
  const NormalEquations& equations() const { return equations_; }
  const ceres::Solver::Summary& summary() const { return summary_; }
  int iterations() const { return iterations_; }
  /// Throws whose sequence of modes changed in the last round.
  int mode_changes() const { return mode_changes_; }

 private:
  const double* own_at(std::size_t i) const { return own_.data() + i * shared_.own_scale.size(); }
  double* own_at(std::size_t i) { return own_.data() + i * shared_.own_scale.size(); }
  void choose_throws(const std::vector<double>& start);
  void add_throws(ceres::Problem& problem, const AllThrows& all, ceres::ParameterBlockOrdering& ordering);
  void add_campaign(ceres::Problem& problem);

  const CampaignProblem& problem_;
  const FitOptions& options_;
  Shared shared_;
  std::vector<std::size_t> used_;
  std::vector<double> x_;
  // One array: Ceres orders blocks by their addresses, which must be the throws' order in every run.
  std::vector<double> own_;
  std::vector<double> chi2_;
  std::vector<std::vector<int>> modes_;
  NormalEquations equations_;
  ceres::Solver::Summary summary_;
  int iterations_{}, mode_changes_{};
};

}  // namespace unhand::fitting
