// Is the wrench that was measured of slips off by a constant? Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/slips/compare_surfaces.hpp"

namespace unhand::fitting {

/// Limit surfaces H(w − b) = 1 of wrenches that one sensor reads with a constant b too much, in the frame of
/// the object. Any patch of Coulomb friction slides one way as it slides the other: H is even [Zhou2016], and
/// a constant is what no even H can be.
struct WrenchBias {
  bool solved{};                                         ///< all surfaces were fitted, and b came to rest
  Eigen::Vector3d value = Eigen::Vector3d::Zero();       ///< b: (f_x, f_y, τ) [N, N, N m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< by the scatter between slips
  std::vector<SurfaceFit> fits;                          ///< of the surfaces to the wrenches without b
  /// P of as much, or more, where there is none: Hotelling's, with as many degrees of freedom as slips.
  double p_value = 1;
};

/// The samples with wrenches that are less by `bias` (f_x, f_y, τ) [N, N, N m].
SlipSamples without_bias(SlipSamples slips, const Eigen::Vector3d& bias);
/// The same of each surface.
std::vector<SlipSamples> without_bias(std::vector<SlipSamples> surfaces, const Eigen::Vector3d& bias);

/// Bias and surfaces together: steps of Newton for the one, the others eliminated, and fits of the
/// others (fit_surface, whose weights the steps have, too) in turn, from `start` (as `value`) on. A step that
/// goes back is cut to where the line through it and the one before is zero, and none is longer than a third
/// of the mean force.
WrenchBias fit_wrench_bias(const std::vector<SlipSamples>& surfaces, SurfaceModel model,
                           const Eigen::Vector3d& start = Eigen::Vector3d::Zero());

/// As compare_surfaces scores `model`, by the same folds, with the bias that the slips of all surfaces but of
/// the left-out fold show: errors, and fits to all slips without the bias `whole`. No null control. Empty
/// where a fold has no answer.
std::vector<SurfaceScore> score_with_bias(const std::vector<SlipSamples>& surfaces, SurfaceModel model,
                                          const WrenchBias& whole, const SurfaceComparisonOptions& options);

}  // namespace unhand::fitting
