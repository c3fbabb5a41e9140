// Limit surfaces identified from measured slips: which surface has its normal along the measured twists?
#pragma once

#include <array>
#include <string>
#include <vector>

#include "fitting/slips/slip_samples.hpp"

namespace unhand::fitting {

/// H(w) = 1 is the limit surface, w = (f_x, f_y, τ/L) [N] the wrench that the object applies to the surface;
/// sliding goes along +∇H(w) in (v_x, v_y, L ω). [GoyalRuinaPapadopoulos1991]
enum class SurfaceModel {
  ellipsoid,       ///< wᵀ A w, A diagonal: 3 coefficients
  ellipsoid_full,  ///< wᵀ A w, A positive definite: 6
  convex_quartic   ///< homogeneous of degree four and convex: 15 [Zhou2016]
};
/// All of them, those with the fewest coefficients first.
inline constexpr SurfaceModel surface_models[] = {SurfaceModel::ellipsoid, SurfaceModel::ellipsoid_full,
                                                  SurfaceModel::convex_quartic};
/// The model's name, as it is written above.
std::string to_string(SurfaceModel model);
/// Throws std::invalid_argument, listing the names.
SurfaceModel surface_model(const std::string& name);

/// A limit surface identified from slips.
struct SlipSurface {
  SurfaceModel model{};            ///< which family
  double characteristic_length{};  ///< L [m]
  /// Ellipsoids: A_xx, A_xy, A_xτ, A_yy, A_yτ, A_ττ [1/N²]. Quartic: the 15 coefficients [1/N⁴] in the order
  /// of contact::ConvexQuartic.
  std::vector<double> coefficients;

  /// H^(1/degree): 1 on the surface, below 1 inside.
  double gauge(const std::array<double, 3>& w) const;
  /// ∇H/|∇H|: where the object slides under w ≠ 0.
  std::array<double, 3> normal(const std::array<double, 3>& w) const;
  /// The least and the largest force on the surface with τ = 0, and the torque [N m] with f = 0.
  struct Extremes {
    double least_force{}, largest_force{}, torque{};  ///< N, N, N m
  };
  /// From a search over directions.
  Extremes extremes() const;
};

/// How a fit of a limit surface ended.
enum class SurfaceOutcome {
  fitted,                  ///< an answer: converged, or the best that the budget allowed
  too_few_slips,           ///< fewer than the model has coefficients, or than 5
  directions_do_not_span,  ///< all twists in one direction, or all in a plane
  not_converged            ///< the solver failed
};
/// The outcome's name, as it is written above.
std::string to_string(SurfaceOutcome outcome);

/// A fitted surface and how its fit ended.
struct SurfaceFit {
  SurfaceOutcome outcome{SurfaceOutcome::not_converged};  ///< only `fitted` has a surface
  std::string reason;                                     ///< names the surface; empty if fitted
  SlipSurface surface;                                    ///< the answer
  double sigma_direction{};                               ///< noise of a direction, per component [rad]
  double sigma_level{};                                   ///< noise of the gauge [-]
  int iterations{};                                       ///< of the solver, over all rounds
  /// Whether there is a surface.
  bool fitted() const { return outcome == SurfaceOutcome::fitted; }
};

/// Least Σ ρ(|n(w) − u|²/σ_d²) + ρ((gauge(w) − 1)²/σ_g²) over the samples: normality and level set, after
/// [Zhou2016] but with residuals that have units of angle and of relative force, so that noise can whiten
/// them. ρ(s) = 2(√(1 + s) − 1) grows linearly: near a support foot directions may be far off. σ_d and σ_g
/// are the medians of the residuals at the last solution (for Gauss noise, standard deviations), fit and
/// estimate in turn. Ceres' Levenberg-Marquardt with automatic derivatives.
///
/// The quartic starts at the full ellipsoid and is a sum of squares H = Σ_k (wᵀ A_k w)², k = 1 … 6. Its
/// second derivative is 4 Σ_k [2 (xᵀA_k y)² + (xᵀA_k x)(yᵀA_k y)] at x along y, and (xᵀAx)(yᵀAy) = (xᵀAy)² +
/// (x × y)ᵀ adj(A) (x × y): it is a sum of squares, hence H convex, if Σ_k adj(A_k) is positive semidefinite;
/// and every convex quartic of three variables is of this form, since for these convexity is sum-of-squares
/// convexity [AhmadiParrilo2013]. The condition is kept by an augmented Lagrangian and then exactly: the
/// result is mixed with the least share of the squared ellipsoid that meets it, and contact::ConvexQuartic
/// accepts it.
///
/// Deterministic. Throws std::invalid_argument for a characteristic length that is not positive.
SurfaceFit fit_surface(const SlipSamples& slips, SurfaceModel model);

/// How many slips with a sample a model asks for.
int least_slips(SurfaceModel model);

/// The angle [rad] between predicted and measured direction of a sample.
double direction_error(const SlipSurface& surface, const SlipSample& sample);

}  // namespace unhand::fitting
