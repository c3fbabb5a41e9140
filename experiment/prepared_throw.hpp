// A logged throw made ready for simulation: what went in, and what was measured to come out.
#pragma once

#include <optional>
#include <string>

#include "contact/normal_force.hpp"
#include "datasets/throw_log.hpp"
#include "dynamics/rigid_body.hpp"
#include "flight/fly.hpp"
#include "release/grasp.hpp"
#include "release/hand_motion.hpp"

namespace unhand::experiment {

/// What the log says about the outcome. The twist at detach is that of the flight model fitted to the motion
/// capture after the normal force has fallen below 3 σ (at the release of its smoothed series or later: the
/// first of three samples in a row below) and before flight_end, evaluated at detach.
struct MeasuredOutcome {
  std::optional<double> detach_time;                    ///< [s]
  std::optional<dynamics::Pose<double>> detach_pose;    ///< of the CoM; m, m, rad
  std::optional<dynamics::Twist<double>> detach_twist;  ///< of the CoM; m/s, m/s, rad/s
  std::optional<double> landing_x, landing_theta;       ///< m, rad (unwrapped)
};

/// Above what a clock that counts from 1970 rounds its times to [s]: what is at an event stays on its side.
inline constexpr double kClockRounding = 1e-6;

/// A logged throw, ready to be simulated.
struct PreparedThrow {
  std::string id, object, condition;  ///< as in the log
  /// What throws share that repeat one experiment: objects may use the same names of conditions.
  std::string experiment() const { return object + ", condition " + condition; }
  datasets::Split split{};                                  ///< whether it may be fitted to
  release::PolynomialHand hand;                             ///< smoothed
  release::HandFitSummary hand_fit;                         ///< how well it explains the logged hand
  std::optional<contact::SampledNormalForce> normal_force;  ///< of one pad; absent if it was not measured,
                                                            ///< or is dead
  contact::NormalForceSummary
      force_fit;                     ///< how well it explains the logged force; without a force, its defaults
  dynamics::RigidBody<double> body;  ///< declared; kg, kg m²
  dynamics::Vec2<double> gravity;    ///< declared [m/s²]
  double drag_k{};                   ///< declared [1/m]
  double landing_height{};           ///< [m]
  release::Grasp<double> grasp;      ///< CoM and angle against the hand
  double start{};                    ///< [s]
  double open_command{};             ///< when the gripper is told to open [s]
  MeasuredOutcome measured;          ///< what the model is to predict
  /// Of one pad, where it was not measured and somebody told how the gripper opens; prepare() leaves it
  /// empty.
  std::optional<contact::ProfileNormalForce> told_force{};
};

/// Smooths the hand and the normal force, finds the grasp and the measured outcome.
///
/// The hand's motion is the spline of release::fit_hand_motion (pose, twist and acceleration, each weighted
/// by its declared σ). The grasp angle is the mean of θ_O − θ_H over the motion capture before the gripper is
/// told to open; the log's `grasp_angle` is used where there is none. The CoM lies at the declared
/// `com_offset` on the object's x axis; if it is not declared, where motion capture saw it.
///
/// Where the log shows that the pads let go, a normal force may end at up to half its grip (an untared
/// sensor); else a level above NormalForceOptions::max_tail_bias means that they still press.
///
/// Throws datasets::LogError, naming the path inside `file`, when the throw lacks what a release needs: the
/// hand, the planar inertia, a grasp, an opening time.
PreparedThrow prepare(const datasets::ThrowLog& log, const datasets::Throw& logged, const std::string& file);

/// Whether a throw from a hand shows how the object is held: by motion capture before the gripper opens, or
/// declared (`grasp_angle` and the object's `com_offset`). Both are optional in a log, and a throw without
/// either cannot be prepared. True of throws without a hand.
bool shows_grasp(const datasets::ThrowLog& log, const datasets::Throw& logged);

/// Up to when a planar throw flies [s, motion capture's clock]: samples from there on may have touched
/// something. The earliest of
/// - the logged landing: where motion capture goes on after it, 3 σ of its time before it, else itself;
/// - the first sample at or below the landing height once the object has been above it by a centimetre since
///   `since` [s], its release or, where that is not known, the opening: it may land above the hand;
/// - the end of a declared `free_flight`.
/// Infinite where none of them is known.
double flight_end(const datasets::ThrowLog& log, const datasets::Throw& logged, double since);

}  // namespace unhand::experiment
