// Is what a fit leaves noise? Tests over groups, each group's own unknowns allowed for.
#pragma once

#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// Correlation of neighbouring residuals of a channel, minus what the groups' own unknowns cause by
/// themselves (a fit to white noise leaves neighbours slightly against each other).
struct Autocorrelation {
  std::string channel;  ///< which
  double lag1{};        ///< [-]
  double z{};           ///< in standard deviations of white noise
};
/// By channel, over the groups that `fit` used.
std::vector<Autocorrelation> autocorrelation(const GroupedProblem& problem, const GroupedFit& fit);

/// The residual of a channel over the share of the group's duration that has passed.
struct ResidualProfile {
  std::string channel;   ///< which
  double share{};        ///< 0 … 1, middle of the bin
  int n{};               ///< measurements in the bin
  double mean{}, rms{};  ///< in σ
  double z{};            ///< of the mean, from the scatter between groups
};
/// By channel and bin, over the groups that `fit` used.
std::vector<ResidualProfile> residual_profile(const GroupedProblem& problem, const GroupedFit& fit,
                                              int bins = 20);

/// The same of what an effect would do to the samples.
struct FootprintProfile {
  std::string id;                        ///< of the effect
  std::vector<ResidualProfile> profile;  ///< as residual_profile has it
};

/// The shortest time from the start of the groups over which the model is told from one that is right: own
/// unknowns are fitted to the samples up to there, and χ² per degree of freedom of some channel exceeds
/// `limit` and one by three standard errors (from the scatter between groups).
struct LeavesNoise {
  bool any{};             ///< false: it stays in the noise
  double time{};          ///< [s]
  std::string channel;    ///< which channel does
  double chi2_per_dof{};  ///< there; NaN of slips
  bool at_once{};         ///< in the shortest time that is looked at: earlier cannot be told
};
/// See LeavesNoise.
LeavesNoise leaves_noise(const GroupedProblem& problem, const GroupedFit& fit, double limit, int threads);

}  // namespace unhand::fitting
