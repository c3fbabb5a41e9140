// How far a fitted model's predictions of the outcome are from what was measured.
#pragma once

#include "fitting/discover.hpp"

namespace unhand::fitting {

/// Predicted with what is known before the throw: the campaign's unknowns, and the throw's own from its
/// samples before the gripper opens. The errors of the twist at detach are the slopes over time of (predicted
/// − observed) in flight, which is the twist of the flight model fitted to motion capture, whatever that
/// flight model is. Throws that are not predicted to land are left out.
OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads);

}  // namespace unhand::fitting
