// What a throw comes to, and how that changes with the values that its prediction reads.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "experiment/throw_prediction.hpp"

namespace unhand::experiment {

/// Detach time [s], vx, vz [m/s], ω [rad/s]; landing x [m], θ [rad]; flight time [s].
inline constexpr int kOutcomeCount = 7;
inline constexpr int kLandingX = 4, kLandingTheta = 5;  ///< their places

/// The outcomes of a prediction that landed.
template <class S>
std::array<S, kOutcomeCount> outcomes_of(const ThrowPrediction<S>& p) {
  return {p.detach.time,    p.detach.twist.vx,    p.detach.twist.vz,    p.detach.twist.omega,
          p.landing.pose.x, p.landing.pose.theta, p.landing.flight_time};
}

/// ∂(outcome)/∂(value), a row per outcome and a column per value, exact (dual numbers through release, events
/// and flight, dynamics::kDualSize values at a time). Nothing where the throw does not land.
std::optional<Eigen::MatrixXd> outcome_slopes(const PreparedThrow& prepared, const ThrowModel& model,
                                              const std::vector<std::string>& names,
                                              std::span<const double> values);

}  // namespace unhand::experiment
