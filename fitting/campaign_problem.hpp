// A campaign of throws as a least-squares problem: which numbers are unknown, and what each throw says of
// them.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/model.hpp"
#include "experiment/throw_prediction.hpp"

namespace unhand::fitting {

/// An unknown: of the campaign, or of every throw.
struct Unknown {
  std::string name, unit;
  double start{}, low{}, high{};
  double scale{};  ///< a change of it that matters
  /// 1 σ of what is known of it without this log, about `start`.
  std::optional<double> prior_sigma{};
};

struct CampaignOptions {
  std::string model{"limit_surface_disc"};
  std::vector<std::string> effects;  ///< ids whose parameters are unknowns, too
  experiment::ObservationOptions observations;
  dynamics::IntegratorOptions integrator{.tolerances = {1e-6, 1e-9}};
  int threads{0};
  /// For predictions with parameters from elsewhere: the log need hold no observations, starts are not looked
  /// for, and the campaign's own numbers (ThrowModel) are these if given.
  bool predict_only{false};
  std::optional<int> pads{};
  std::optional<double> reference_force{};  ///< [N]
};

/// One throw: its observations, and how its parameters are named and found among the unknowns.
struct CampaignThrow {
  experiment::PreparedThrow prepared;
  experiment::Observations observed;
  std::vector<std::string> names;  ///< of the values that it reads
  std::vector<int> columns;        ///< where they are: campaign unknowns first, then the throw's own
  /// By observation: the phase's boundaries as the log has them [s], for choosing samples.
  double opening{}, release{};
  /// The measured release, or a predicted one where there is none.
  double release_or(double predicted) const { return release == release ? release : predicted; }
};

/// r = (predicted − observed)/σ, and its derivatives with respect to the campaign's unknowns and the throw's
/// own.
struct Linearisation {
  bool solved{};
  Eigen::VectorXd residual;
  Eigen::MatrixXd campaign, own;
  std::vector<int> modes;
  double detach{};  ///< [s]
};

class CampaignProblem {
 public:
  /// Prepares every throw, on several threads. Throws datasets::LogError for throws that lack what a release
  /// needs, std::invalid_argument for an unknown model or effect, or a log without any observation.
  CampaignProblem(const datasets::ThrowLog& log, const std::string& file, const CampaignOptions& options);

  const std::vector<CampaignThrow>& throws() const { return throws_; }
  const std::vector<Unknown>& campaign() const { return campaign_; }
  const std::vector<Unknown>& own() const { return own_; }
  const experiment::ThrowModel& model() const { return model_; }
  const CampaignOptions& options() const { return options_; }
  const std::vector<std::string>& notes() const { return notes_; }

  /// The same throws with other effects, or another contact model.
  CampaignProblem with(const std::string& model, const std::vector<std::string>& effects) const;

  /// Where a fit starts: the campaign's unknowns, in their order.
  std::vector<double> start() const;

  /// The residual of one throw; with `derivatives`, through dual numbers, kDualSize unknowns at a time.
  Linearisation linearise(const CampaignThrow& thrown, std::span<const double> campaign,
                          std::span<const double> own, bool derivatives) const;

  /// The prediction itself.
  experiment::ThrowPrediction<double> predict(const CampaignThrow& thrown, std::span<const double> campaign,
                                              std::span<const double> own) const;

 private:
  CampaignProblem() = default;
  void name_unknowns(const std::vector<dynamics::Effect>& effects);
  std::vector<double> values_of(const CampaignThrow&, std::span<const double> campaign,
                                std::span<const double> own) const;

  datasets::ThrowLog header_;  // objects and gripper, without its throws
  CampaignOptions options_;
  experiment::ThrowModel model_;
  std::vector<Unknown> campaign_, own_;
  std::vector<CampaignThrow> throws_;
  std::vector<std::string> notes_;
  experiment::ModelParameters first_guess_;
};

/// The effect of that id. Throws std::invalid_argument, listing the ids, if there is none.
dynamics::Effect find_effect(const std::string& id);

}  // namespace unhand::fitting
