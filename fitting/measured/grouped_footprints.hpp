// Footprints of effects over groups, and what one linear step along them says. Internal to fitting.
#pragma once

#include "fitting/discovery/footprints.hpp"
#include "fitting/measured/grouped_fit.hpp"
#include "fitting/measured/residual_tests.hpp"

namespace unhand::fitting {

/// Footprints over the train groups, with every group's own part of the Gram matrix.
struct GroupedFootprints {
  Footprints total;
  std::vector<Eigen::MatrixXd> parts;
};

/// At the solution of `fit`: the shared unknowns' columns, those of `effects` at neutral (at each value of a
/// shape parameter's grid), and the residual; the groups' own unknowns are projected out.
GroupedFootprints grouped_footprints(const GroupedProblem& problem, const GroupedFit& fit,
                                     const std::vector<dynamics::Effect>& effects,
                                     const GroupedFitOptions& options);

/// At the solution of `fit`, of those of `effects` that some channel shows: what each does to the rows at the
/// size that takes most off χ² (to first order), where all that is fitted anyway has made up for what it can.
std::vector<FootprintProfile> footprint_profiles(const GroupedProblem& problem, const GroupedFit& fit,
                                                 const std::vector<dynamics::Effect>& effects,
                                                 const GroupedFitOptions& options);

/// One linear step of `columns` over the groups `which`, in units of the scatter between groups.
struct LinearStep {
  Eigen::VectorXd value, sigma, freedom;  ///< change; 1 σ, infinite where no group sees it; its degrees
  Eigen::MatrixXd covariance;
};
LinearStep linear_step(const std::vector<Eigen::MatrixXd>& parts, const std::vector<std::size_t>& which,
                       const std::vector<Eigen::Index>& columns);

}  // namespace unhand::fitting
