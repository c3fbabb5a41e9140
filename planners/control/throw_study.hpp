// Throws of unknown objects by a Panda under adaptive and plain computed torque: [DarkoD46] 3.1.2 in
// simulation.
//
// The robot is simulated: rigid links, friction, torque limits, noise of sensors and torques, control at 1
// kHz. The hand holds a body that the controllers do not know; the object leaves at once at the release, with
// the state of its centre of mass.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "planners/control/task_controller.hpp"

namespace unhand::planners::control {

/// What is thrown: mass [kg], and the width of a cube of its volume [m] for its inertia.
struct Payload {
  std::string name;        ///< as in [DarkoD46]
  double mass{}, width{};  ///< kg; m
};
/// The objects of [DarkoD46] Fig. 24: masses as given there, widths chosen.
std::vector<Payload> reported_payloads();

/// A controller, by its gains.
struct ControllerChoice {
  std::string name;     ///< for tables
  double stiffness{};   ///< k_ξ of the position [N/m], > 0
  double rotational{};  ///< of the orientation [N m/rad], > 0
  bool adaptive{};      ///< with Adaptation; else its gains are zero
  bool in_joints{};     ///< Eq. 31 instead of Eq. 35: each joint has the stiffness that it feels of the tip's
                        ///< at the start, J_iᵀ k_ξ J_i, and follows the course by inverse kinematics
};
/// Adaptive low gain (30 N/m), plain low gain (30 N/m), plain high gain (300 N/m).
std::vector<ControllerChoice> reported_controllers();
/// Adaptive low gain (30 N/m) by the law in the joints, which [DarkoD46] gives but does not throw with.
ControllerChoice joint_controller();

/// The motion, the noise and the tolerances of the study.
struct StudyOptions {
  Eigen::Vector3d start{-0.23, -0.63, 0.21};                                  ///< tip at rest [m]
  Eigen::Vector3d release{0, -0.63, 0.30};                                    ///< tip at the release [m]
  Eigen::Vector3d velocity{1.0, 0, 0.38};                                     ///< there [m/s]
  double throw_time{0.5}, brake_time{0.4}, return_time{1.5}, hold_time{0.3};  ///< of a repetition [s]
  int repetitions{4};                            ///< without release, before the throw; >= 0
  double landing_height{-0.3};                   ///< [m]
  Eigen::Vector2d box{0.20, 0.20};               ///< lengths along x and y [m]: chosen
  double angle_noise{2e-5};                      ///< 1 σ [rad]
  double rate_noise{2e-4};                       ///< [rad/s]
  double torque_noise{5e-5};                     ///< share of each joint's limit [-]
  double friction_error{0.1};                    ///< 1 σ of each joint's friction against the model's [-]
  double grasp_offset{0.003};                    ///< 1 σ of the object's centre in the hand, per axis [m]
  double release_jitter{0.002};                  ///< 1 σ [s]
  Adaptation adaptation = default_adaptation();  ///< of the adaptive controller

  /// Gains as docs/adaptive-control.md gives them.
  static Adaptation default_adaptation();
};

/// One instant of a run.
struct TrackingSample {
  double t{};                                 ///< s
  double position_error{}, velocity_error{};  ///< norms [m, m/s]
  double lyapunov{};                          ///< of Lyapunov's function
  double mass_estimate{};                     ///< kg
};

/// Largest shares of the joints' limits: 1 is at a limit.
struct JointUse {
  double position{};      ///< |q − middle| over half the range [-]
  double velocity{};      ///< [-]
  double acceleration{};  ///< of the rate's change over a step of the controller [-]
  double jerk{};          ///< of that change's change [-]
  double torque{};        ///< that was asked for [-]
  /// Of each the larger one.
  void include(const JointUse& other);
};

/// One run: how it landed, and how the controller did.
struct StudyThrow {
  Eigen::Vector2d miss{0, 0};  ///< landing − where the reference would land, along and across [m]
  bool hit{}, lands{};         ///< in the box; comes down to the landing height at all
  double release_position_error{}, release_velocity_error{};  ///< m, m/s
  std::vector<double> rms_error;  ///< of the position per repetition, the throw last [m]
  JointUse use;  ///< of the simulated joints, at every step, from the object's pick-up to the
                 ///< end of the brake
  LinkParameters estimate = LinkParameters::Zero();  ///< π̂ at the release
  std::vector<TrackingSample> history;               ///< every 10 ms, if asked for
};

/// One run: repetitions without release, then the throw. The same seed gives the same robot, object and noise
/// to every controller. Throws std::invalid_argument for options out of range.
StudyThrow run_throw(const ControllerChoice& controller, const Payload& payload, const StudyOptions& options,
                     std::uint64_t seed, bool record = false);

/// Landings of many seeds.
struct Dispersion {
  int throws{}, hits{}, lost{};  ///< runs; landed in the box; never landed
  Eigen::Vector2d mean{0, 0};    ///< of the miss, along and across [m]
  Eigen::Vector2d std{0, 0};     ///< of the miss, of a sample (n - 1) [m]
  double rms{};                  ///< √(mean |miss|²): bias and scatter [m]
  JointUse use;                  ///< the largest of all runs
};
/// Over runs with different seeds.
Dispersion dispersion_of(const std::vector<StudyThrow>& throws);

}  // namespace unhand::planners::control
