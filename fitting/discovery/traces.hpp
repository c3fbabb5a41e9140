// The residuals of a phase as recordings of something missing: what missing_force.hpp looks into. Internal to
// fitting.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "fitting/discovery/missing_force.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// Time as the estimates know it: since the detach [s], or the share of the opening that has passed.
struct PhaseClock {
  double origin{}, scale{1};  ///< s: its zero and its unit
};
/// The clock of one throw, whose object was free from `release` on [s], in the flight or the release.
PhaseClock phase_clock(const CampaignThrow& thrown, double release, Phase phase);

/// The residuals of a campaign in one phase.
struct PhaseTraces {
  std::vector<ResidualTrace> all;      ///< of the throws in which enough was seen; grouped by object
  std::map<std::string, int> objects;  ///< group of each object of the campaign
  MissingOptions how;                  ///< how the channels respond
  /// The object of each group.
  std::map<int, std::string> names() const;
};

/// In flight the tracked positions (m, m, rad; they respond twice integrated), during the release the wrench
/// (N, N, N m), of the throws that `fit` used.
PhaseTraces traces_of(const CampaignProblem& problem, const FitResult& fit, Phase phase, int threads);

}  // namespace unhand::fitting
