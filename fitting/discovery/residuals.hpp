// The residuals of a campaign's throws, beside the state in which each was seen.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/discovery/missing_force.hpp"
#include "fitting/discovery/residual_structure.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// The whitened residual of a channel over time, of many throws together.
struct ResidualBin {
  experiment::Channel channel{};  ///< of which sensor
  double time{};                  ///< from the release [s], middle of the bin
  int n{};                        ///< samples
  double mean{}, rms{};           ///< in σ
};

/// What a channel leaves in a phase: is it noise, and if not, what does it go with?
struct ChannelStructure {
  experiment::Channel channel{};  ///< of which sensor
  Phase phase{};                  ///< of the throw
  ResidualStructure structure;    ///< noise, and what it goes with
};

/// Predicted minus observed over σ, one vector per throw; empty for throws that `fit` did not use.
std::vector<Eigen::VectorXd> residuals_of(const CampaignProblem& problem, const FitResult& fit, int threads);

/// Bins of 5 ms from the log's begin to 50 ms after the release (measured, or `fit`'s where it was not), then
/// of 20 ms.
std::vector<ResidualBin> residual_over_time(const CampaignProblem& problem, const FitResult& fit,
                                            const std::vector<Eigen::VectorXd>& residuals);

/// Whose motion.
enum class MotionOf {
  model,  ///< as predicted
  /// The model's less its residual, smoothed over eleven frames: what depends on the motion, and is missing
  /// in the model, would be too small by the model's.
  measurement,
};

/// The motion of the tracked frame where motion capture saw it, by differences of its samples, and the normal
/// force. Empty without motion capture.
struct StateSeries {
  std::vector<double> time;                 ///< as in the log [s]
  std::vector<ResidualTrace::State> state;  ///< one per time
  std::vector<std::array<double, 3>> pose;  ///< m, m, rad
  /// By linear interpolation, level beyond the ends; the normal force at that time.
  ResidualTrace::State at(const CampaignThrow& thrown, double time) const;
};
/// The states of one throw; `residual` is its own, of residuals_of.
StateSeries states_of(const CampaignThrow& thrown, const Eigen::VectorXd& residual, MotionOf motion);

/// By channel and phase, against condition, time from the release, and state (speed, spin, and until the
/// release the normal force). In the order of the phases.
std::vector<ChannelStructure> structures(const CampaignProblem& problem, const FitResult& fit,
                                         const std::vector<Eigen::VectorXd>& residuals);

}  // namespace unhand::fitting
