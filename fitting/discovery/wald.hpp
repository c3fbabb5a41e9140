// Whether the sizes of an effect are told from none. Internal to fitting.
#pragma once

#include "dynamics/effect.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// Wald's test of an effect's size parameters against neutral, with the fit's covariance, which is known to
/// its degrees of freedom only: each size by Student's t of its own, and several together by Hotelling's T²
/// of the fewest; the smaller p of the two ways, times two, since few throws know a covariance of several
/// sizes (forces of three components, drags of two objects) less than the variance of each. Sizes that are
/// neutral at an end of their range count as hotelling_bar_tail has it. Where an effect is absent its shape
/// (a loss time, a Stribeck speed) is nothing that data could tell: sizes are tested with the shape as it was
/// fitted, and p counts for every shape of its grid (Bonferroni's bound on the search).
double wald_p_value(const FitResult& fit, const dynamics::Effect& effect);
/// Whether the two-sided confidence region of the sizes, of a level, leaves neutral out: with the shape as it
/// was fitted, by those degrees of freedom, or whatever the shape is, by the sizes' own intervals
/// (FittedUnknown::interval_freedom).
bool is_told_from_none(const FitResult& fit, const dynamics::Effect& effect, double level);

}  // namespace unhand::fitting
