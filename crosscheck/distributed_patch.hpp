// A patch of many points with elasto-plastic bristles: what limit surface and sliding pivot are reductions
// of.
#pragma once

#include <vector>

#include "contact/patch.hpp"
#include "release/simulate_release.hpp"

namespace unhand::crosscheck {

/// A point of the patch: where it is, in radii, in the hand's frame; and its share of the normal force.
struct PatchPoint {
  dynamics::Vec2<double> position;  ///< radii of the patch [-]
  double load{};                    ///< w_i [-]; Σ w_i = 1
};

/// 3 n² points of equal load on the unit disc, on n rings of 3, 9, 15, ... points (1 <= rings <= 1000).
///
/// Pressure p(ρ) ∝ (1 − ρ²)^s, s > −1: 0 uniform, 1/2 Hertz. A ring sits at the median of its share of the
/// load, ρ = sqrt(1 − (1 − u)^(1/(s+1))), u the load inside it. As n grows, the sums over the points tend to
/// the integrals over the disc. Throws std::invalid_argument, naming parameter, value and range.
std::vector<PatchPoint> disc_points(int rings, double pressure_exponent = 0);

/// Coulomb friction at every point i, |f_i| <= n μ f_N w_i [N], through a bristle of the stiffness K w_i:
///
///   ṡ_i = v_i while |K w_i s_i| is below the limit, otherwise the bristle slides at the limit;  f_i = −K w_i
///   (s_i + T v_i), cut at the limit
///
/// with v_i [m/s] the slip of the object against the pads at the point. Stick is elastic, never a mode;
/// nothing is assumed of how force and torque are coupled.
struct DistributedPatch {
  double mu{};                     ///< friction coefficient, [0, 10]
  double radius{};                 ///< a [m], (0, 1]
  std::vector<PatchPoint> points;  ///< as disc_points makes them
  int pads{2};                     ///< n >= 1
  double softness{0};         ///< γ: the radius is a (f_N/f₀)^γ, the patch shrinks as it is let go [-]
  double reference_force{1};  ///< f₀ > 0 [N]
};

/// How finely the patch is integrated.
struct PatchOptions {
  double step{4e-5};  ///< h of the coarser of two runs [s], (0, 1e-3]
  /// n μ f₀/K, by how much a bristle stretches before it slides [m]; f₀ the largest normal force. Its
  /// own vibration is shorter than the step and damped by it.
  double elastic_slip{1e-11};
  double loss_time{0};  ///< T, of the bristles [s]
};

/// How a release from the patch ended.
struct PatchResult {
  release::ReleaseOutcome outcome{};    ///< not_solved: a step's iteration spent its budget
  release::DetachState<double> detach;  ///< at the end of the hand's motion, if the pads never part
  double time_error{};  ///< largest difference between the finer run and the extrapolated twist [m/s, rad/s]
};

/// Integrates pose and twist of the CoM in the world by the implicit Euler method with steps h and h/2 that
/// end at every kink of hand and force, and extrapolates (Richardson): second order in h.
///
/// A step is a convex problem in the new twist V, 0 = M (V − V₀)/h − m g − Σ G_iᵀ f_i(V), with the return
/// mapping of every bristle in f_i; Newton with a line search on its potential solves it. Shares no equation
/// with contact/: of `problem` only hand, normal force, body, gravity, grasp and start are used, the contact
/// model is not. Throws std::invalid_argument, naming parameter, value and range.
PatchResult simulate_distributed_patch(const release::ReleaseProblem<double>& problem,
                                       const DistributedPatch& patch, const PatchOptions& options = {});

}  // namespace unhand::crosscheck
