// What effects and laws beside a fitted model would do to a throw, column by column. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fitting/discovery/footprints.hpp"

namespace unhand::fitting {

/// Columns of whitened observations, each per unit of its parameter: first the derivatives by the model's
/// unknowns, then those of the candidates, last the residual. Where an effect has no derivative on both sides
/// of neutral, and for a law, the column is a difference of two simulations.
class FootprintColumns {
 public:
  /// Both are kept by the caller as long as this is used.
  FootprintColumns(const CampaignProblem& problem, const FitResult& fit);

  /// From now on samples and throws count for as much as they did in the fit, Huber's loss with this limit
  /// included: what is left of a footprint is then what such a fit would leave of the effect.
  void weigh_as_fitted(double sample_limit) { sample_limit_ = sample_limit; }
  /// What a throw of the fit counts for.
  double weight_of(std::size_t thrown) const { return sample_limit_ ? fit_.throws[thrown].weight : 1; }

  /// One candidate for every effect that the problem does not have: at each value of its shape parameters'
  /// grid, and a one-sided one at three sizes. To be called once.
  void add_effects(const std::vector<std::string>& ids);
  /// One candidate for a law, if it is not the problem's.
  void add_law(const std::string& law);

  const std::vector<Candidate>& candidates() const { return candidates_; }
  /// The number of columns that are the model's own unknowns.
  std::size_t fitted() const { return fitted_; }
  /// Of all columns.
  Eigen::Index width() const { return residual() + 1; }

  /// The columns' inner products over one throw, its own unknowns projected out.
  struct Gram {
    Eigen::MatrixXd products;  ///< zero where it cannot be simulated
    bool solved{};             ///< it can, by the model
    bool complete{};           ///< and by every candidate; those by which it cannot have zero columns
  };
  Gram gram(const CampaignThrow& thrown, const std::vector<double>& own) const;

  /// Combinations of the columns (a column of `coefficients` each) sample by sample, with the throw's own
  /// unknowns projected out; empty where the model cannot simulate it.
  Eigen::MatrixXd combined(const CampaignThrow& thrown, const std::vector<double>& own,
                           const Eigen::MatrixXd& coefficients) const;

 private:
  struct Columns {
    Eigen::MatrixXd all, own;  ///< weighted; zero where a candidate cannot simulate the throw
    Eigen::VectorXd weight;    ///< factor on each row
    bool solved{}, complete{};
  };
  Eigen::VectorXd weights_of(const CampaignThrow& thrown, const Linearisation& l) const;
  Columns columns_of(const CampaignThrow& thrown, const std::vector<double>& own) const;
  using Shape = std::map<std::string, double>;  // parameter → value
  struct Derivatives {
    CampaignProblem problem;
    std::vector<double> at;
    std::vector<std::pair<std::size_t, std::size_t>> columns;  // unknown → column
  };
  struct Difference {
    CampaignProblem problem;
    std::vector<double> at;
    double step;
    std::size_t column;
    /// The throw's own unknowns as this problem names them: laws have others than the gripper's delay.
    std::vector<double> own_of(const CampaignProblem& base, const std::vector<double>& own) const;
  };

  void add_alone(const dynamics::Effect& effect, const Shape& shape, double size);
  void add_together(const std::vector<std::string>& ids);
  std::size_t add_column(Candidate& candidate, const Unknown& unknown);
  Eigen::Index residual() const { return static_cast<Eigen::Index>(width_); }

  const CampaignProblem& problem_;
  const FitResult& fit_;
  std::optional<double> sample_limit_;  ///< none: all samples count the same
  std::size_t fitted_, width_;          // without the residual
  std::vector<Candidate> candidates_;
  std::vector<Derivatives> derivatives_;  // the first: of the model and of all effects without shapes
  std::vector<Difference> differences_;
};

/// Of the candidates that it has, over the throws of the fit.
Footprints footprints(const FootprintColumns& columns, const CampaignProblem& problem, const FitResult& fit,
                      int threads);

}  // namespace unhand::fitting
