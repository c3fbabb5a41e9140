// A whole throw: from rest to the nominal state, along the tube while the gripper opens, and to rest again.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "planners/arm/jerk_profile.hpp"
#include "planners/tube/nominal_throw.hpp"

namespace unhand::planners {

/// The arm's motion, t = 0 where the gripper is told to open: from rest at `home` along a straight line in
/// joint space to where the swing begins; from rest to (q₀, q̇₀, q̈), all joints at once; q̈ held for the
/// window T >= 0 [s]; to rest, all joints at once. Acceleration is continuous. Speeding up and braking use
/// 95 % of the joints' limits of velocity and `acceleration_share`, in (0, 1], of those of acceleration and
/// jerk (a torque limit may ask for less). Empty where |q̈| exceeds a limit. Throws std::invalid_argument
/// unless there is one finite number per joint, for another window and for another share.
std::optional<JointTrajectory> throw_motion(const Chain& chain, const JointVector<double>& home,
                                            const ThrowState& state, const JointVector<double>& qdd,
                                            double window, double acceleration_share);

struct ThrowPlan;

/// Instants of the window at which the landings of a plan are reported.
inline constexpr int kLandingSamples = 21;

/// What a whole throw may be.
struct PlanOptions {
  NominalOptions search;     ///< window and medium are those of all parts
  JointVector<double> home;  ///< where the arm rests before [rad]; empty: rest_pose
  bool refine{true};         ///< go on from Tube-CVX to refine_tube
  /// Why a plan within the limits is not taken, as that the grip does not hold its object (why_not_held);
  /// empty: it is taken. Without one all are.
  std::function<std::string(const ThrowPlan&)> refuse{};
};

/// How planning ended.
enum class PlanOutcome {
  planned,    ///< a plan was found
  no_throw,   ///< no configuration reaches the box within the limits
  no_tube,    ///< none of the throws has a tube acceleration that lands in the box from the whole window
  no_motion,  ///< no motion to any of them stays within the limits, or they are refused
  no_rest,    ///< the arm cannot rest where it is to begin
};
/// The outcome's name, as it is written above.
const char* to_string(PlanOutcome);

/// A whole throw, and how it lands.
struct ThrowPlan {
  NominalThrow nominal;                           ///< the state that it was planned for
  TubeSolution tube;                              ///< of Tube-CVX
  JointVector<double> qdd;                        ///< what the motion holds: q̈_tube, or refined
  JointTrajectory motion;                         ///< from rest to rest
  LimitCheck limits;                              ///< of the motion, looked at densely
  std::vector<LandingAt> landings;                ///< over the window, with qdd
  std::vector<LandingAt> tube_landings, at_rest;  ///< the same with q̈_tube, and with none
};

/// The middle of all joints' ranges; 0 where there is none.
JointVector<double> middle_of(const Chain& chain);

/// The chain's own home; where it tells none, middle_of [rad].
JointVector<double> rest_pose(const Chain& chain);

/// Largest distance of a landing from the middle [m]; infinite if one does not land.
double largest_miss(const std::vector<LandingAt>& landings);

/// A plan, or why there is none.
struct PlanResult {
  PlanOutcome outcome{};          ///< only `planned` has a plan
  std::string reason;             ///< of the best throw that failed, where nothing was planned
  std::optional<ThrowPlan> plan;  ///< the answer
  int throws{};                   ///< found by the search
  int tried{};                    ///< of them, until one went all the way
};

/// Tries the throws of find_throws in order of their margin; if none goes all the way, those again whose
/// brake goes beyond a velocity limit by up to 5 %, with as much less of it at the window's end. The same
/// options give the same plan. Throws std::invalid_argument as find_throws does, and for a home of another
/// number of joints.
PlanResult plan_throw(const Chain& chain, const TargetBox& box, const PlanOptions& options = {});

}  // namespace unhand::planners
