// Where and how fast the arm should be when the gripper opens.
#pragma once

#include <vector>

#include "flight/flow_map.hpp"
#include "planners/tube/tube_cvx.hpp"

namespace unhand::planners {

/// A box to hit: its middle B in the base's frame [m], and its opening along the base's x and y [m].
struct TargetBox {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< m, in the base's frame
  double length_x{0.15}, length_y{0.15};             ///< m, > 0

  /// Half of what the box allows along a level direction through its middle [m].
  double half_length(const Eigen::Vector2d& direction) const;
  /// Whether a landing that is off by so much [m] is in the box.
  bool holds(double off_x, double off_y) const {
    return std::abs(off_x) <= length_x / 2 && std::abs(off_y) <= length_y / 2;
  }
};

/// Radius of the arm's column about the base's z axis [m]: no tip is nearer when the gripper opens.
inline constexpr double kColumn = 0.25;

/// What throws are looked for, and how long.
struct NominalOptions {
  double window{0.1};                            ///< the arm must be able to go on for so long [s]
  flight::Medium medium{};                       ///< of the flight
  flight::LandingSet landing{.half_length = 1};  ///< velocities at the landing; its length is the box's
  int samples{3000};                             ///< configurations looked at, >= 1
  int refined{10};                               ///< best ones improved by small steps, >= 0
  int candidates{40};                            ///< most that come back, >= 1
  /// No flight through the arm's column: within kColumn of the base's z axis, and lower than the highest
  /// joint that is as near.
  bool clear_column{true};
  /// A joint that stays at an angle.
  struct Fixed {
    int joint;     ///< index
    double angle;  ///< rad
  };
  std::vector<Fixed> fixed;  ///< the other joints move; planar_joints: in the vertical plane of the target
  int threads{0};            ///< 0: one per core; the answer does not depend on it
};

/// Throws std::invalid_argument, naming value and accepted range: numbers finite and in range, joints of the
/// chain, each fixed once.
void validate(const NominalOptions& options, const Chain& chain);

/// A throw, and what it leaves free: 1 − the largest use of a joint's velocity; the room that the joints have
/// before and after for speeding up and braking, over half their range; and −f of the tube. The margin is the
/// smallest of them.
struct NominalThrow {
  ThrowState state;                                                   ///< when the gripper is told to open
  double margin{}, speed_margin{}, position_margin{}, tube_margin{};  ///< [-]; the first is the least
};

/// Configurations from a low-discrepancy sequence, with the tip at least 0.15 m high and 0.3 m from the
/// target; at each, elevations whose parabola (with drag: whose
/// flight) ends in the box's middle, and of all joint velocities with that tip velocity the one that is
/// smallest against the limits, q̇ = W Jᵀ (J W Jᵀ)⁻¹ v with W = diag(q̇_max²), of which 2 % are kept free.
/// Sorted, best first; only margins > 0. The same options give the same throws. Throws std::invalid_argument
/// for a box without area, a chain that is none or lacks limits, and as validate() does.
std::vector<NominalThrow> find_throws(const Chain& chain, const TargetBox& box,
                                      const NominalOptions& options = {});

}  // namespace unhand::planners
