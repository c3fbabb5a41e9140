// What the derivatives of a fit cost, beside plain predictions and beside finite differences.
#pragma once

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// CPU time of one thread, of every throw used once, at the solution [s].
struct GradientCost {
  int unknowns{};    ///< of a throw: the campaign's and its own
  double plain{};    ///< the residuals alone
  double exact{};    ///< with their derivatives, in dual numbers
  double central{};  ///< the same by central differences: two predictions an unknown
  /// Largest deviation of a central difference from the exact derivative, over the largest derivative of that
  /// unknown in that throw; the median over throws and unknowns.
  double deviation{};
};
/// Central differences with a step of 1e-3 of an unknown's scale.
GradientCost gradient_cost(const CampaignProblem& problem, const FitResult& fit);

}  // namespace unhand::fitting
