// How far a fitted number may be off because the model is not quite right, beside the noise.
#pragma once

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// Gives `fit` intervals that count the model's misfit. Of every unknown
///
///   σ² = H⁻¹ + (C − 1)/C t² (Σ_c δ_c² − Σ_c V_c)₊ + max_b (δ_b² − V_b)₊
///
/// the scatter's σ² if that is more. δ_c is the Gauss-Newton step that the fit would take without condition
/// c, V_c = H₋c⁻¹ − H⁻¹ what noise alone would make of it (a jackknife): repetitions share what the law gets
/// wrong about their condition, so they are one witness. C is the number of conditions that speak of the
/// unknown, (Σ h)²/Σ h² by their shares h = 1 − H⁻¹/H₋c⁻¹ of it, and t = t₀.₉₇₅(C − 1)/1.96 makes ±1.96 σ a
/// 95 % interval of few. Fewer than 2.5 cannot disagree: the size of such an object is as much less sure than
/// noise says as those of other objects are. δ_b is the step without a block of channels (pads' wrenches;
/// motion in the hand; flight; landing) and V_b what noise alone would make of it (H₋b⁻¹ − H⁻¹, scaled as the
/// first two terms are to H⁻¹), which counts beyond 1.5 σ, about the largest of four by chance: where one
/// kind of sensor says something else than the rest, the law is wrong in one of the two, and nobody knows in
/// which [Hausman1978]. A block without which the unknown is no longer determined has no say. Correlations
/// stay as they are. What is widened so needs no Student's t any more (allows_for_few), unless the last term
/// is the larger part: two sensors know little of how much they differ.
void count_discrepancy(const CampaignProblem& problem, FitResult& fit, int threads);

}  // namespace unhand::fitting
