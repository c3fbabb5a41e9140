// How far a fitted model's predictions of the outcome are from what was measured.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "experiment/compare.hpp"
#include "fitting/discovery/lack_of_fit.hpp"
#include "fitting/discovery/residuals.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// What predictions are judged by, throw by throw.
enum class Outcome {
  position,       ///< of the tracked frame, mean over the flight
  orientation,    ///< the same of its angle
  landing_x,      ///< of the landing
  landing_theta,  ///< of the landing
};
/// The outcome's name in words.
const char* to_string(Outcome);
/// "m" or "rad".
const char* unit_of(Outcome);

/// Outcomes are few: numbered from 0.
inline constexpr int kOutcomes = 4;

/// Whether an outcome's errors go with the condition.
struct OutcomeLack {
  Outcome outcome{};    ///< whose errors these are
  LackOfFit fit;        ///< mean squares in m² or rad²
  double resolution{};  ///< 1 σ of one reading of the outcome's sensor [m or rad]; of a position, both axes'
};

/// Errors of the outcome, predicted before the throw (own unknowns from the grasp alone) minus measured; none
/// of what was not measured, or not predicted.
struct OutcomeErrors {
  int n{};                                  ///< throws
  std::optional<double> landing_x_mae;      ///< [m]
  std::optional<double> landing_theta_mae;  ///< [deg]
  std::optional<double> detach_vx_mae;      ///< [m/s]
  std::optional<double> detach_omega_mae;   ///< [deg/s]
  std::optional<double> trajectory_rms;     ///< of the position in flight [m]
  std::optional<double>
      chi2_per_dof;  ///< with the throws' own unknowns fitted, where observations outnumber them
  std::vector<OutcomeLack> lacks;  ///< of every outcome that was measured
};

/// An error of the same predictions, rms, by two models; zeros where nothing can be compared.
struct RmsOfBoth {
  double before{};  ///< by the first
  double after{};   ///< by the other
  /// Whether it falls by a factor.
  bool falls_by(double factor) const { return before > factor * after; }
  /// Whether it rises by one.
  bool rises_by(double factor) const { return after > factor * before; }
};

/// What one model's predictions are better by than another's: rms errors of the pose tracked in flight, of
/// the landing where nothing is tracked.
struct PredictionGain {
  RmsOfBoth position;  ///< of x and z together, or landing x [m]
  RmsOfBoth angle;     ///< of theta [rad]
  /// Whether either falls by a factor, and the other does not rise by it.
  bool is_better_by(double factor) const {
    return (position.falls_by(factor) && !angle.rises_by(factor)) ||
           (angle.falls_by(factor) && !position.rises_by(factor));
  }
  /// "1.21 to 1.19 mm, 1.14 to 0.69 deg rms"
  std::string in_words() const;
};

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
