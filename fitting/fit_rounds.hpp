// The rounds of a fit: least squares, then what the solution teaches of weights and spreads. Internal.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/simulated_throws.hpp"

namespace unhand::fitting {

/// The state of a fit between its rounds. Unknowns are in units of their scales here.
class FitRounds {
 public:
  /// Takes the throws of the options' share that can be simulated at `start`; where they fit badly from the
  /// beginning, channels are weighed accordingly.
  FitRounds(const CampaignProblem& problem, const FitOptions& options, const std::vector<double>& start);

  FitRounds(const FitRounds&) = delete;  // parts of it refer to each other
  FitRounds& operator=(const FitRounds&) = delete;

  const std::vector<std::size_t>& used() const { return used_; }
  /// A throw that must take part and cannot be simulated at the start: then none is used.
  const std::optional<std::size_t>& refused() const { return refused_; }
  /// By throw of the log: why it could not be simulated at the start, in words; empty where it could, or was
  /// not asked to.
  const std::vector<std::string>& why_not() const { return why_not_; }
  bool is_fixed(const Unknown& unknown) const;

  /// Least squares with the weights and spreads as they are, and the normal equations at its solution; false
  /// where Ceres gives up.
  bool solve(bool last);
  /// The weights of channels, and (empirical Bayes) the spread of the throws' own unknowns.
  void learn();
  /// Values of all unknowns, in units of their scales.
  struct Point {
    std::vector<double> campaign, own;
  };
  /// Where the last round ended.
  Point solution_point() const { return {x_, own_}; }
  /// The least cost with unknown k held at `value`, weights and spreads as the last round left them; infinite
  /// where there is none. Starts from `from`, which becomes the place of the least; the state stays as it is.
  double cost_with(std::size_t k, double value, Point& from);

  std::vector<double> campaign() const { return shared_.unscaled(x_.data()); }
  std::vector<double> own(std::size_t i) const { return shared_.own_unscaled(own_at(i)); }
  const Shared& shared() const { return shared_; }
  const NormalEquations& equations() const { return equations_; }
  /// What the log says of the campaign's unknowns, those that are fixed taking part in nothing: rows and
  /// columns of them are those of an unknown apart, known to its scale.
  Eigen::MatrixXd information() const;

  /// How the last round ended.
  struct Solution {
    bool usable{}, converged{};
    double cost{};  ///< ½ Σ ρ(r²), priors included
    int iterations{};
    std::string message;
  };
  const Solution& solution() const { return solution_; }
  int iterations() const { return iterations_; }
  /// Throws whose sequence of modes changed in the last round, between its start and its end.
  int mode_changes() const { return mode_changes_; }

 private:
  const double* own_at(std::size_t i) const { return own_.data() + i * shared_.own_scale.size(); }
  double* own_at(std::size_t i) { return own_.data() + i * shared_.own_scale.size(); }
  /// A likelier variance of own unknown k than it was solved with: a step of Fisher's scoring of the
  /// likelihood of the variance [Longford1987], not far from the fixed-point iteration of [MacKay1992], which
  /// has the same solutions; a step of expectation-maximisation, too short where the variance is small but
  /// always likelier, where the throws say little of it. About zero or the mean of their condition, as
  /// Unknown::Kind says, the latter if there are repetitions enough.
  double variance_of(std::size_t k) const;
  void choose_throws(const std::vector<double>& start);
  /// Moves x_ and own_ to the least; `held` keeps its value, too.
  Solution minimise(double tolerance, std::optional<std::size_t> held);

  const CampaignProblem& problem_;
  const FitOptions& options_;
  Shared shared_;
  std::vector<std::size_t> used_;
  std::optional<std::size_t> refused_;
  std::vector<std::string> why_not_;
  SimulatedThrows simulated_{shared_, used_};
  std::vector<double> x_;
  // One array: Ceres orders blocks by their addresses, which must be the throws' order in every run.
  std::vector<double> own_;
  std::vector<double> chi2_;
  std::vector<std::vector<int>> modes_;  // where the last round ended, or the first one starts
  NormalEquations equations_;
  Solution solution_;
  int iterations_{}, mode_changes_{}, learned_{};
};

}  // namespace unhand::fitting
