// A whole throw: from rest to the nominal state, along the tube while the gripper opens, and to rest again.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "planners/arm/jerk_profile.hpp"
#include "planners/tube/nominal_throw.hpp"

namespace unhand::planners {

/// How the arm moves before and after the window.
struct MotionOptions {
  double window{0.1};              ///< T >= 0 [s], from the instant at which the gripper is told to open
  double velocity_share{0.95};     ///< of the joints' limits that speeding up and braking use, in (0, 1]
  double acceleration_share{0.9};  ///< the same of acceleration and jerk; a torque limit may ask for less
};

/// The arm's motion, t = 0 where the gripper is told to open: from rest at `home` along a straight line in
/// joint space to where the swing begins; from rest to (q₀, q̇₀, q̈), all joints at once; q̈ held for the
/// window; to rest, all joints at once. Acceleration is continuous. Empty where |q̈| exceeds a limit. Throws
/// std::invalid_argument unless there is one finite number per joint, and the options are in their ranges.
std::optional<JointTrajectory> throw_motion(const Chain& chain, const JointVector<double>& home,
                                            const ThrowState& state, const JointVector<double>& qdd,
                                            const MotionOptions& options = {});

struct ThrowPlan;

/// What a whole throw may be.
struct PlanOptions {
  NominalOptions search;     ///< window and medium are those of all parts
  MotionOptions motion;      ///< its window is the search's
  JointVector<double> home;  ///< where the arm rests before; empty: middle_of
  bool tube{true};           ///< false: no acceleration in the window, for comparison
  bool refine{true};         ///< go on from Tube-CVX to refine_tube
  int landing_samples{21};   ///< instants of the window at which landings are reported, >= 2
  double check_step{1e-3};   ///< of the dense check of limits, in [kLeastCheckStep, inf) [s]
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
};
/// The outcome's name, as it is written above.
const char* to_string(PlanOutcome);

/// A whole throw, and how it lands.
struct ThrowPlan {
  NominalThrow nominal;                           ///< the state that it was planned for
  TubeSolution tube;                              ///< of Tube-CVX
  JointVector<double> qdd;                        ///< what the motion holds: q̈_tube, refined, or none
  JointTrajectory motion;                         ///< from rest to rest
  LimitCheck limits;                              ///< of the motion, looked at densely
  std::vector<LandingAt> landings;                ///< over the window, with qdd
  std::vector<LandingAt> tube_landings, at_rest;  ///< the same with q̈_tube, and with none
  double acceleration_share{};  ///< share of the limits that speeding up and braking used [-]
};

/// The middle of all joints' ranges; 0 where there is none.
JointVector<double> middle_of(const Chain& chain);

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

/// Tries the throws of find_throws in order of their margin. The same options give the same plan.
/// Throws std::invalid_argument as find_throws does, and for options out of range.
PlanResult plan_throw(const Chain& chain, const TargetBox& box, const PlanOptions& options = {});

}  // namespace unhand::planners
