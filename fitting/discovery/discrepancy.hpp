// How far a fitted number may be off because the model is not quite right, beside the noise.
#pragma once

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// Gives `fit` intervals that count the model's misfit. Of every unknown
///
///   σ² = max(H⁻¹, V t²) + max_b (δ_b² − V_b)₊
///
/// V is the jackknife over conditions, (C − 1)/C Σ_c δ_c δ_cᵀ with δ_c the Gauss-Newton step that the fit
/// would take without condition c: repetitions share what the law gets wrong about their condition, so they
/// are one witness; t = t₀.₉₇₅(C − 1)/1.96 makes ±1.96 σ a 95 % interval of few conditions. δ_b is the step
/// without a block of channels (pads' wrenches; motion in the hand; flight; landing) and V_b what noise alone
/// would make of it (H₋b⁻¹ − H⁻¹, scaled as V is to H⁻¹): where one kind of sensor says something else than
/// the rest, the law is wrong in one of the two, and nobody knows in which [Hausman1978]. A block without
/// which the unknown is no longer determined has no say. Correlations stay as they are, and so do the degrees
/// of freedom: Wald's test of a σ that t has widened (allows_for_few) asks for somewhat more than its level.
void count_discrepancy(const CampaignProblem& problem, FitResult& fit, int threads);

}  // namespace unhand::fitting
