// How well identified limit surfaces predict directions of sliding that they have not seen.
#pragma once

#include <cstdint>
#include <functional>
#include <numbers>
#include <vector>

#include "fitting/slips/slip_surface.hpp"

namespace unhand::fitting {

/// For angles that are reported [°/rad].
inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

/// How identified surfaces are cross-validated.
struct SurfaceComparisonOptions {
  int folds = 5;               ///< >= 2; slip number n is left out in fold n % folds
  int null_draws = 4;          ///< simulated data sets of the null control; 0: none
  std::uint64_t seed = 1;      ///< of the null control
  int threads = 0;             ///< 0: one per core; the outcome does not depend on it
  std::function<void()> step;  ///< called after each of surface_comparison_steps, from any thread
};

/// Errors of one model on one surface.
struct SurfaceScore {
  SurfaceModel model{};  ///< which family
  SurfaceFit fit;        ///< to all slips
  /// Of the cross-validation, the null control included: the first fit that failed, or fitted.
  SurfaceOutcome outcome{SurfaceOutcome::not_converged};
  std::string reason;               ///< why the outcome is none, in words
  std::vector<double> errors_deg;   ///< per sample, predicted by the fold that left its slip out
  double mean_deg{}, median_deg{};  ///< of the errors
  /// The same mean on data simulated from the surface's fitted axis-aligned ellipsoid, a member of every
  /// family: what a model loses to noise alone. Mean over the draws.
  double null_control_deg{};
  /// Whether there are errors to speak of.
  bool scored() const { return outcome == SurfaceOutcome::fitted; }
  /// Takes the errors, with their mean and median.
  void set_errors(std::vector<double> deg);
};

/// Every model on every surface, in that order. An error is the angle [deg] between predicted and measured
/// direction in the metric (v_x, v_y, L ω). Samples of a slip are left out together.
///
/// Null control: the measured wrenches, taken to the fitted ellipsoid along their rays, its normals there,
/// and noise drawn (with replacement, and each on its own) from the ellipsoid's residuals: the angle, turned
/// about the normal at random, and the gauge.
///
/// Throws std::invalid_argument for options out of range.
std::vector<std::vector<SurfaceScore>> compare_surfaces(const std::vector<SlipSamples>& surfaces,
                                                        const std::vector<SurfaceModel>& models,
                                                        const SurfaceComparisonOptions& options = {});
/// How many calls of `step` a comparison makes.
std::size_t surface_comparison_steps(std::size_t surfaces, std::size_t models,
                                     const SurfaceComparisonOptions& options);

/// One data set of the null control. `fit` is a fitted ellipsoid of these slips.
SlipSamples simulate_slips(const SlipSamples& slips, const SurfaceFit& fit, std::uint64_t seed);

}  // namespace unhand::fitting
