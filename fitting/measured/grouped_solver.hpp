// Gauss-Newton over groups, every group's own unknowns eliminated. Internal to fitting.
#pragma once

#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// From the fit's values and own unknowns to a minimum of Σ weight·cost over its used groups: with every row
/// and group counting alike where the fit has no weights yet, then, where options.robust, by weights learned
/// from that; then residuals, χ² and the shared parameters' covariance. A group that cannot be solved drops
/// out; fit.solved is false where none is left or the covariance is not finite.
void solve_groups(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options);

}  // namespace unhand::fitting
