// A first, plain estimate of the friction parameters from a log.
#pragma once

#include <string>
#include <vector>

#include "experiment/model.hpp"

namespace unhand::experiment {

/// A model's parameters as a log's wrenches, or its detach times, first suggest them.
struct FrictionEstimate {
  ModelParameters parameters;  ///< with what was not estimated at its default
  int samples{};               ///< F/T samples used
  double scatter{};    ///< robust 1 σ of gauge − 1 over them [-]: how well they lie on one limit surface
  std::string method;  ///< in words, for reports
};

/// Where a model's parameters start when no card gives them. It uses train throws only.
///
/// Friction: near the end of the opening the demand exceeds what the vanishing normal force allows, so the
/// pad slips and its wrench lies on the limit surface: gauge(f/(μ f_N), τ/(L μ f_N)) = 1 for the model's own
/// surface, solved for μ and L by least squares with a loss that grows linearly (samples that still stick lie
/// inside). Samples: smoothed f_N between 8 σ and 20 % of the grip force, on the falling ramp. The naive
/// limit surface takes the ellipsoid's values, and so does the sliding pivot, unless the samples lie better
/// on its own surface, max(|f|/(μ f_N), |τ|/(L μ f_N)) = 1: its throws would drive an ellipsoid's μ to
/// infinity.
///
/// Delay: mean and scatter over the train throws of (detach − opening command).
///
/// Throws std::invalid_argument when the log determines neither (no F/T data in any train throw, or no
/// detach).
FrictionEstimate estimate_friction(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& throws,
                                   const std::string& model);

/// Throws std::invalid_argument, in words, where an estimate's friction is that of no pad: μ outside [0.001,
/// 20] or a length outside [1e-5, 0.2] m. A few throws whose wrenches point one way determine one of the two.
void require_patch(const FrictionEstimate& estimate, const std::string& model);

}  // namespace unhand::experiment
