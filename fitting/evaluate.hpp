// What a fit says of throws, how sure it is, and how far off it was.
#pragma once

#include <optional>
#include <vector>

#include "experiment/compare.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// 1 σ of a prediction, SI units.
struct OutcomeSigma {
  double detach_time{}, detach_vx{}, detach_vz{}, detach_omega{};  ///< s, m/s, m/s, rad/s
  double landing_x{}, landing_theta{}, flight_time{};              ///< m, rad, s
};

/// A throw predicted by a fit, with its uncertainty.
struct PredictedThrow {
  experiment::ThrowComparison comparison;  ///< the prediction, and its errors where something was measured
  std::optional<OutcomeSigma> sigma;       ///< absent where the throw does not land
  std::vector<double> own;                 ///< the throw's own unknowns, as known before its release
  double seconds{};                        ///< of one simulation of release and flight
};

/// Whether uncertainty is wanted, and threads.
struct EvaluateOptions {
  bool uncertainty{true};  ///< else sigma is absent
  int threads{0};          ///< 0: one per core; the answer does not depend on it
};

/// Predicts throws of `problem` with a fit of the same unknowns; all, or those listed. Throws
/// std::invalid_argument as require_fit_of does, and for a place that is none in problem.throws().
///
/// The throw's own unknowns o are what its samples before the opening and the learned spread say,
/// for train throws, too: a prediction does not know the outcome.
///
/// σ by exact derivatives, y(c, o(c)) with c the campaign's unknowns: T Σ_c Tᵀ + (∂y/∂o) H⁻¹ (∂y/∂o)ᵀ,
/// T = ∂y/∂c − (∂y/∂o) H⁻¹ JᵒᵀJᶜ, H = JᵒᵀJᵒ + Λ of the samples before the opening. Noise of the measured
/// normal force is in it (force_deviation); that of the logged hand and of the sensors that measure the
/// outcome is not.
///
/// Errors are predicted minus measured. Of the landing: the channels as the tracker would report them. Of
/// vx and ω at detach: minus the slope over time of (observed − predicted) mocap x and θ in flight, from the
/// later of the measured and the predicted detach on. For the base model that is the twist of
/// experiment::PreparedThrow::measured subtracted, to first order; with effects on the flight or the tracker
/// (wind, lift, clock, scale) it judges the twist with the flight that the model believes in. With fewer than
/// four samples there, the measured twist is used as experiment::compare does.
std::vector<PredictedThrow> predict_throws(const CampaignProblem& problem, const FitResult& fit,
                                           const EvaluateOptions& options = {});
/// The same for the throws at these places only.
std::vector<PredictedThrow> predict_some(const CampaignProblem& problem, const FitResult& fit,
                                         const std::vector<std::size_t>& which,
                                         const EvaluateOptions& options = {});

/// The same as experiment::compare gives for a model, for its tables; `fit` names the parameters.
experiment::ModelComparison comparison_of(const CampaignProblem& problem, const FitResult& fit,
                                          const std::vector<PredictedThrow>& throws);

/// Predictions by fits that have not seen their conditions.
struct CrossValidation {
  int folds{};                         ///< made
  std::vector<PredictedThrow> throws;  ///< each predicted by a fit that has not seen its condition
  std::vector<std::string> failed;     ///< folds without an answer, and why
  /// Over all throws predicted; `quantity` is a place in experiment::kQuantities.
  experiment::ErrorStatistics statistics(int quantity) const;
};

/// Grouped by condition: all repetitions of a condition are left out together, the conditions dealt to the
/// folds in order of appearance. Train throws only. Every fold prepares its own problem from a log without
/// the others, so that not even a starting value knows them. Throws std::invalid_argument unless there are
/// two conditions among the train throws and folds >= 2; more folds than conditions become as many.
CrossValidation cross_validate(const datasets::ThrowLog& log, const std::string& file,
                               const CampaignOptions& campaign, const FitOptions& options, int folds);

}  // namespace unhand::fitting
