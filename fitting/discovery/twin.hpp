// The twin of a campaign: the same throws, simulated with a fitted model, through the same sensors.
#pragma once

#include <cstdint>

#include "fitting/evaluate.hpp"

namespace unhand::fitting {

/// The log that the sensors would have written had its throws obeyed the fitted model. Hand and normal force
/// are as smoothed; the campaign's unknowns as fitted; the throws' own drawn from the fit's spreads. Every
/// sample keeps its time and gets new noise, normal, of its declared σ (of its own scatter if none is
/// declared). Dead channels and lost samples stay so. Throws that the model does not bring to a landing are
/// left out. Synthetic, and says so in its title. Same seed, same log.
datasets::ThrowLog twin_of(const datasets::ThrowLog& log, const CampaignProblem& problem,
                           const FitResult& fit, std::uint64_t seed);

/// What the errors of a model would be if it were true: twins, fitted and predicted as their original was.
/// Differences to the original are the model's own, beyond noise and the throws' scatter.
struct ErrorFloor {
  int twins{};                                      ///< with an answer
  std::vector<experiment::ModelComparison> models;  ///< of each twin

  /// The mean over the twins of each statistic; n of the last one.
  experiment::ErrorStatistics statistics(int quantity, datasets::Split split) const;
};
/// Makes `twins` twins, from seeds derived from `seed`, and fits and predicts each.
ErrorFloor error_floor(const datasets::ThrowLog& log, const std::string& file, const CampaignProblem& problem,
                       const FitResult& fit, const FitOptions& options, int twins, std::uint64_t seed = 1);

}  // namespace unhand::fitting
