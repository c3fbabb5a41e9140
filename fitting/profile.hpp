// Intervals of unknowns whose cost is no parabola. Internal to fitting.
#pragma once

#include "fitting/fit_rounds.hpp"

namespace unhand::fitting {

/// Fills FittedUnknown::profile of the unknowns that the fit knows little of: whose interval is wider than a
/// fifth of their value, whom the prior holds more than the log, or that are at a bound. What the log alone
/// does not know to within its accepted range has no bounds.
void profile(FitRounds& rounds, FitResult& fit);

}  // namespace unhand::fitting
