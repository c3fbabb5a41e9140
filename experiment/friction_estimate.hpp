// A first, plain estimate of the friction parameters from a log.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "experiment/model.hpp"

namespace unhand::experiment {

/// A model's parameters as a log's wrenches, or its detach times, first suggest them.
struct FrictionEstimate {
  ModelParameters parameters;  ///< with what was not estimated at its default
  int samples{};               ///< F/T samples used
  double scatter{};  ///< robust 1 σ of gauge − 1 over them [-]: how well they lie on one limit surface
  double mu_sigma{}, length_sigma{};  ///< 1 σ of μ and L from the samples' noise, as shares of them [-]
  std::optional<double> pad_radius;   ///< as the log declares it [m]
  std::string method;                 ///< in words, for reports
};

/// A log does not determine a model's parameters. what() is the model, the reason and the advice.
class Undetermined : public std::invalid_argument {
 public:
  /// With the reason and the advice, neither of which names the model.
  Undetermined(const std::string& model, std::string why, std::string help)
      : std::invalid_argument(model + ": " + why + "; " + help),
        reason(std::move(why)),
        advice(std::move(help)) {}
  std::string reason;  ///< what the log lacks, alike for all models that lack it
  std::string advice;  ///< what helps
};

/// Where a model's parameters start when no card gives them. It uses train throws only.
///
/// Friction: while a pad slips, its wrench lies on the limit surface, gauge(f/(μ f_N), τ/(L μ f_N)) = 1 for
/// the model's own surface; while it sticks, inside. So samples are those of pads that **evidently slip**:
/// the wrench differs from what would hold the object still in the moving hand (M a − m g about the pad, from
/// the smoothed hand and the declared inertia, shared by the pads) by more than 5 σ and more than a fifth of
/// it, continuously from there to the release. Samples within 30 ms after a jump of the hand's acceleration
/// (ObservationOptions::settling: pads that give ring there) and those with a smoothed f_N below 8 σ are left
/// out. μ and L follow by least squares, each gauge weighted with the noise of its wrench (the declared σ,
/// else the series' own scatter, and ObservationOptions::wrench_trust), with a loss that grows linearly. A
/// friction that changes with speed or force gives a mean over the slip. The naive limit surface takes the
/// ellipsoid's values, and so does the sliding pivot, unless the samples lie better on its own surface,
/// max(|f|/(μ f_N), |τ|/(L μ f_N)) = 1: its throws would drive an ellipsoid's μ to infinity. Where the
/// samples do not determine both (objects that only pivot, or only slide, or pads that obey another law), L
/// is that of the declared pad_radius, 2/3 of it, if there is one.
///
/// Delay: mean and scatter over the train throws of (detach − opening command); where no train throw shows a
/// detach (no normal force, no detach_time), of the delay that motion capture shows (seen_delay.hpp).
///
/// Throws Undetermined when the log determines neither: fewer than ten such samples in its train
/// throws (objects that stick to the end, no F/T data), or no detach. Whether what was found is a patch,
/// require_patch says.
FrictionEstimate estimate_friction(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& throws,
                                   const std::string& model);

/// Throws Undetermined where an estimate's friction is not to be relied on: μ outside
/// [0.001, 20] or L outside [1e-5, 0.2] m; either uncertain by more than 15 %; samples that scatter by more
/// than 25 % about the surface; or an L above 1.25 times the declared pad radius, as no pad's torque has a
/// longer arm than its rim and a declared radius may be somewhat wrong.
void require_patch(const FrictionEstimate& estimate, const std::string& model);

}  // namespace unhand::experiment
