// A robot that throw-flips a bar: what is published or declared of it, and how much robots and throws differ.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "contact/law_parameter.hpp"
#include "planners/arm/chain.hpp"

namespace unhand::planners::flip {

/// One number per joint, in the chain's order.
using Joints = JointVector<double>;

/// u = (γ, s, D) [LiuDaCostaBillard2025]: pitch [rad], speed [-], damping of the brake [N m s/rad].
struct FlipCommand {
  double pitch{}, speed{}, damping{};  ///< rad; -; N m s/rad
  /// (pitch, speed, damping)
  std::array<double, 3> array() const { return {pitch, speed, damping}; }
  bool operator==(const FlipCommand&) const = default;
};

/// The commands that may be given, ends included.
struct CommandRange {
  FlipCommand low, high;  ///< low <= high in each
  /// Whether a command is in the range.
  bool holds(const FlipCommand& u) const;
  /// The nearest command of the range.
  FlipCommand clamp(const FlipCommand& u) const;
  /// The command at fractions of the range, each from 0 to 1, and back.
  FlipCommand at(double pitch, double speed, double damping) const;
  /// Where in the range a command is, 0 to 1 in each.
  std::array<double, 3> fractions(const FlipCommand& u) const;
};

/// The object: a bar whose centre of mass lies `com_offset` [m] beyond the pads.
struct Bar {
  double mass{};        ///< [kg]
  double inertia{};     ///< about the centre of mass, out of the plane [kg m²]
  double com_offset{};  ///< [m]
  bool operator==(const Bar&) const = default;
};

/// The motion family: accelerate to (q_d, s q̇_s), q_d = q_s + γ/N over the N joints that throw, then brake.
struct FlipMotion {
  Joints pose, rate;   ///< q_s [rad], q̇_s [rad/s]; the joints that throw are those with q̇_s ≠ 0
  double duration{};   ///< of the acceleration [s]
  double window{};     ///< from the brake's start; the bar must be free before [s]
  CommandRange range;  ///< that may be given
};

/// Joint impedance control, τ = K (q_r − q) + D (q̇_r − q̇) + what the model says of gravity and Coriolis.
struct FlipControl {
  Joints stiffness, damping;          ///< while accelerating [N m/rad, N m s/rad]
  Joints brake_stiffness;             ///< while braking [N m/rad]
  Joints brake_damping, brake_share;  ///< D_i = damping_i + share_i D while braking [N m s/rad, -]
  double torque_rate{};               ///< of each joint's command, at most [N m/s]
};

/// How the gripper opens.
struct Gripper {
  double grip_force{};    ///< of one pad [N]
  double dead_time{};     ///< from the command to the first change of the force [s]
  double opening_time{};  ///< from there until the pads part [s]
  double shape{};         ///< p of contact::OpeningProfile [-]
};

/// What holds the bar.
struct Pads {
  std::string law;                          ///< a contact model's name
  double mu{};                              ///< [-]
  double length{};                          ///< L = τ_max/f_max [m]
  int count{2};                             ///< n >= 1
  contact::LawValues<double> law_values{};  ///< of the law's own parameters
};

/// 1 σ of what differs from robot to robot and stays as it is for one. Shares are of the declared value.
struct RobotSpread {
  double link_mass{}, friction{}, torque_gain{};  ///< of each link and joint, shares
  double mu{}, length{}, grip_force{}, shape{};   ///< shares
  double dead_time{}, opening_time{};             ///< [s]
  double com_offset{};                            ///< of the bar's, against the declared one [m]
};

/// 1 σ of what differs from throw to throw.
struct ThrowSpread {
  double mu{}, grip_force{};           ///< shares
  double dead_time{}, opening_time{};  ///< [s]
  double grasp_offset{};               ///< of the held point along the bar [m]
  double grasp_angle{};                ///< of the bar against the hand [rad]
  double torque_noise{};               ///< share of each joint's limit, white at 1 kHz
};

/// 1 σ of what is measured.
struct FlipSensors {
  double angle{}, rate{};                       ///< of the joints, as the controller gets them [rad, rad/s]
  double position{}, turn{}, speed{}, omega{};  ///< of the bar and the hand at detach [m, rad, m/s, rad/s]
  double landing{}, landing_turn{};             ///< [m, rad]
};

/// All that is declared of a robot and of how robots differ.
struct FlipRobot {
  std::string name;     ///< for reports
  Chain chain;          ///< with the hand, up to the middle of the pads, without a bar
  FlipMotion motion;    ///< how it throws
  FlipControl control;  ///< how its joints are driven
  Gripper gripper;      ///< how it opens
  Pads pads;            ///< what holds
  Bar bar;              ///< what it throws
  RobotSpread robots;   ///< between robots
  ThrowSpread throws;   ///< between throws
  FlipSensors sensors;  ///< of what is measured
};

/// The text of planners/flip/robot.toml, which comes with the library as "panda-flip" and says what each key
/// means.
std::string_view built_in_robot();

/// Which of a bar's numbers no robot here could throw, and what is accepted; empty: all may be thrown.
std::string complaint_of(const Bar& bar);

/// "panda-flip", or a TOML file with the same keys; all but `source`, `notes` and what the pads' law takes of
/// its own are required. `arm` is as for read_chain, a file's name relative to the TOML file. Throws
/// datasets::TomlError, also where the reference of a command would leave the joints' limits or the vertical
/// plane of x and z.
FlipRobot read_flip_robot(const std::string& name_or_file);

/// The chain with the bar held rigidly along the tip's z axis: a thin rod's inertia across it.
Chain carrying(const Chain& chain, const Bar& bar);

}  // namespace unhand::planners::flip
