// How far a fitted model's predictions of the outcome are from what was measured.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "experiment/compare.hpp"
#include "fitting/discovery/discover.hpp"

namespace unhand::fitting {

/// One throw, predicted with what is known before it is made (predict_throws): predicted minus measured.
struct PredictedOutcome {
  int condition{};  ///< throws that repeat one experiment share it
  std::array<std::optional<double>, experiment::kQuantityCount> error;  ///< as experiment::kQuantities
  double samples{};                                                     ///< of the tracked position in flight
  double squares{};        ///< Σ (Δx² + Δz²) over them [m²]
  double angles{};         ///< of the tracked angle in flight
  double angle_squares{};  ///< Σ Δθ² over them [rad²]
  /// Mean error of the tracked pose in flight [m, m, rad]; none where it was not tracked.
  std::optional<std::array<double, 3>> flight;
  /// Variance of one reading of each outcome's sensor [m² or rad²]; of a position, both axes' together.
  std::array<double, kOutcomes> variance{};
};

/// Of the throws of `share`, in the order of the log.
std::vector<PredictedOutcome> predicted_outcomes(const CampaignProblem& problem, const FitResult& fit,
                                                 Share share, int threads);

/// Means over throws, and whether the errors go with the condition. The trajectory is that of the tracked
/// point in flight. Of throws that are not predicted to land only the errors at the detach count, where they
/// were measured.
OutcomeErrors outcome_errors(const std::vector<PredictedOutcome>& throws);

/// Of two models' predictions of the same throws, in the same order.
PredictionGain prediction_gain(const std::vector<PredictedOutcome>& before,
                               const std::vector<PredictedOutcome>& after);

}  // namespace unhand::fitting
