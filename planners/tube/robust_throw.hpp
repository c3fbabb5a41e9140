// A throw whose landing depends least on what is not known of its release, and the motion to it.
#pragma once

#include <optional>
#include <string>

#include "planners/tube/held_motion.hpp"
#include "planners/tube/insensitive_throw.hpp"
#include "planners/tube/plan_throw.hpp"

namespace unhand::planners {

/// How long q̈ must be held for the object to be free [s]: dead time and opening time of the card, and 4 σ of
/// their sum.
double window_for(const ReleaseCard& card);

/// What make_insensitive chose, and a motion to it.
struct RobustThrow {
  InsensitiveResult choice;  ///< q̇₀ and q̈, for the q₀ that was given
  JointTrajectory motion;    ///< from rest to rest; its window is the throw's `hold`
  LimitCheck limits;         ///< of the motion, looked at densely; its lowest counts the object's centre
  int dropped{};             ///< of kDraws draws, those that slip in the hand before the gripper opens
  static constexpr int kDraws = 200;  ///< that every motion is tried with
};

/// The throw made insensitive by the joints that move in it, and of a few motions to it from `home`, within
/// the limits, above the base, and over which the nominal grip holds the object, the one that drops the
/// fewest draws (of these the fastest); nothing where none does, and `reason`, where given, says why. The way
/// to a throw to begin with: plan_throw with a chain up to the object's centre of mass, in the vertical plane
/// of the target (planar_joints). Throws std::invalid_argument as make_insensitive and throw_motion do.
std::optional<RobustThrow> plan_robust_throw(const ReleaseThrow& problem, const JointVector<double>& home,
                                             std::string* reason = nullptr);

}  // namespace unhand::planners
