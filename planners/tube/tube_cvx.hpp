// Tube acceleration: one joint acceleration with which a throw lands in the same place whenever, within a
// window, the object leaves the hand.
#pragma once

#include <string>
#include <vector>

#include "flight/flow_map.hpp"
#include "planners/arm/chain.hpp"
#include "planners/tube/small_qp.hpp"

namespace unhand::planners {

/// Where the arm is when the gripper is told to open: q₀ [rad], q̇₀ [rad/s].
struct ThrowState {
  JointVector<double> q, qd;  ///< rad; rad/s
};

/// What the tube acceleration is asked for.
struct TubeProblem {
  const Chain& chain;       ///< its tip carries the object's centre of mass; kept by reference
  ThrowState start;         ///< when the gripper is told to open
  Eigen::Vector3d target;   ///< B, in the base [m]
  double window{0.1};       ///< T [s]
  flight::Medium medium{};  ///< of the flight
  /// Joints that are not asked for the landing's distance: they accelerate only if the throw's direction
  /// needs them to, which planar throws do not.
  std::vector<int> held{};
};

/// How the problem ended.
enum class TubeOutcome {
  solved,         ///< `qdd` is the answer
  infeasible,     ///< `reason` names the constraints that cannot hold together
  never_reaches,  ///< with the velocity q̇₀ held, the flight does not come down to the target's height
};

/// The tube acceleration, or why there is none.
struct TubeSolution {
  TubeOutcome outcome{};    ///< only `solved` has a q̈
  JointVector<double> qdd;  ///< q̈_tube [rad/s²]
  std::string reason;       ///< in words
};

/// Problem Tube-CVX, [DarkoD46] Eq. 2: with q_T = q₀ + T q̇₀ a parameter and q̇_T = q̇₀ + T q̈, find q̈ with
///
///   v_T = J(q_T) q̇_T along E → B,   −Φ(0) = ∂Φ/∂ṙ (ṙ_T(q̈) − ṙ_T(0)) + ∂Φ/∂ż (ż_T(q̈) − ż_T(0)),
///   q̇_min <= q̇_T <= q̇_max,   q̈_min <= q̈ <= q̈_max.
///
/// The problem only asks for a q̈; of all, the smallest ½ Σ (q̈_i/q̈_max,i)² is taken, which is a quadratic
/// program with one solution. Beyond the printed constraints, q_T must obey the position limits, or the
/// answer is infeasible. Throws std::invalid_argument for sizes that differ, a window outside (0, 1] s, or
/// held joints that the chain does not have, or twice.
TubeSolution solve_tube(const TubeProblem& problem);

/// Where the object really lands when it leaves at t under a constant q̈ (problem RTV, [DarkoD46] Eq. 1: q(t)
/// is integrated, kinematics and flight are not linearised).
struct LandingAt {
  double time{};               ///< of the release, from the gripper's command [s]
  double forward{}, across{};  ///< of the target, in the vertical plane from q₀'s tip to it [m]
  double x{}, y{};             ///< of the target, in the base's axes [m]
  bool lands{};                ///< the flight comes down to the target's height
};
/// At `samples` >= 1 instants from 0 to T. Throws std::invalid_argument for sizes and ranges, as solve_tube
/// does.
std::vector<LandingAt> landings_over_window(const TubeProblem& problem, const JointVector<double>& qdd,
                                            int samples);

/// Beyond problem Tube-CVX: the acceleration whose real landings, as landings_over_window finds them, miss
/// least over the window,
///
///   min Σ_k |landing(t_k; q̈) − B|² + (1 mm)² Σ (q̈_i/q̈_max,i)²   with the same limits,
///
/// by at most six steps of Gauss-Newton from `start`, each a quadratic program; t_k = k T/4, k = 1 … 4.
/// Derivatives are exact. Returns `start` where no step helps. Throws as landings_over_window does.
JointVector<double> refine_tube(const TubeProblem& problem, const JointVector<double>& start);

}  // namespace unhand::planners
