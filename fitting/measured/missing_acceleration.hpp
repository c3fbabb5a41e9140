// The acceleration that a model of measured flights or falls lacks, as a function without a form.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// A component of it: piecewise linear between its knots, level beyond them.
struct MissingComponent {
  std::string along;                     ///< which way it points where it is positive: "the velocity"
  std::string object;                    ///< whose; none: of all, where they do not differ
  std::vector<double> at, value, sigma;  ///< knots, in the argument's unit; [m/s²] there; 1 σ
  std::string name() const;              ///< "the velocity", "the velocity of ball"
};

/// What is estimated to be missing, and whether it is worth anything.
struct MissingAcceleration {
  std::string of;                            ///< "along the velocity": what its components are
  std::string against;                       ///< "speed [m/s]": what it is a function of
  std::vector<MissingComponent> components;  ///< that the rows say something of
  double test_before{}, test_after{};        ///< χ² per sample on held-out groups, as they count in fits
  /// It lowers the misfit of held-out groups by more than two standard errors, from the scatter of what it
  /// leaves there: else it must not be used as a correction.
  bool helps{};
};

/// Least squares over the train groups in what their residual leaves, to first order, beside the own unknowns
/// of the groups and what the shared ones of `fit` can do: their part is theirs. Tried along the velocity,
/// along ω × v, along the axes of the world and of the body, as functions of time or of speed, for all
/// objects or for each; taken is the one that predicts train groups best that it was not estimated from (five
/// folds). Nothing where a problem has no such motion (GroupedProblem::motion), fewer than ten train groups,
/// or no held-out one. `held_out`: own unknowns of the held-out groups at the values of `fit`.
std::optional<MissingAcceleration> missing_acceleration(const GroupedProblem& problem, const GroupedFit& fit,
                                                        const GroupedFit& held_out,
                                                        const GroupedFitOptions& options);

}  // namespace unhand::fitting
