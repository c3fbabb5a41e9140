// What would determine what a log leaves open.
#pragma once

#include <string>
#include <vector>

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// In words: the measurement or the throws that would fix an open direction of a fit.
std::string remedy(const CampaignProblem& problem, const OpenDirection& open);

struct Correlation {
  std::string first, second;
  double value{};
};
/// Pairs of campaign unknowns with |correlation| > limit, the strongest first.
std::vector<Correlation> strong_correlations(const FitResult& fit, double limit = 0.9);

/// Half the width of a 95 % interval in units of a fitted unknown's sigma: Student's t for as many degrees of
/// freedom as throws were used beyond the unknowns, since that sigma comes from the scatter between throws.
double interval_factor(const FitResult& fit);

}  // namespace unhand::fitting
