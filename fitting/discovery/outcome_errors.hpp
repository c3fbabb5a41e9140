// How far a fitted model's predictions of the outcome are from what was measured.
#pragma once

#include "fitting/discovery/discover.hpp"

namespace unhand::fitting {

/// Of predict_throws (see there): with what is known before the throw. The trajectory is that of the tracked
/// point in flight. Of throws that are not predicted to land only the errors at the detach count, where they
/// were measured.
OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads);

/// What one model's predictions of the same throws are better by than another's: rms of the tracked position
/// in flight, of landing x where nothing is tracked [m]; zeros where nothing can be compared.
struct PredictionGain {
  double before{};  ///< rms of the first model [m]
  double after{};   ///< rms of the other [m]
};
/// Of the throws of `share`, each predicted before it is made; both problems hold the same throws in the same
/// order.
PredictionGain prediction_gain(const CampaignProblem& problem, const FitResult& fit,
                               const CampaignProblem& other, const FitResult& other_fit, Share share,
                               int threads);

}  // namespace unhand::fitting
