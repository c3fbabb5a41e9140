// What would determine what a log leaves open.
#pragma once

#include <string>
#include <vector>

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// In words: the measurement or the throws that would fix an open direction of a fit.
std::string remedy(const CampaignProblem& problem, const OpenDirection& open);

/// Two unknowns that a log hardly tells apart.
struct Correlation {
  std::string first, second;  ///< of the unknowns
  double value{};             ///< of their estimates, −1 … 1
};
/// Pairs of campaign unknowns with |correlation| > limit, the strongest first.
std::vector<Correlation> strong_correlations(const FitResult& fit, double limit = 0.9);

}  // namespace unhand::fitting
