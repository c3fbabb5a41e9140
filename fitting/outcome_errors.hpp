// How far a fitted model's predictions of the outcome are from what was measured.
#pragma once

#include "fitting/discover.hpp"

namespace unhand::fitting {

/// Of predict_throws (see there): with what is known before the throw. The trajectory is that of the tracked
/// point in flight. Throws that are not predicted to land are left out.
OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads);

}  // namespace unhand::fitting
