// Joint motions with piecewise constant jerk.
#pragma once

#include <optional>
#include <vector>

#include "planners/arm/chain.hpp"

namespace unhand::planners {

/// One joint at an instant [rad, rad/s, rad/s²] and the jerk from there on [rad/s³].
struct JointSample {
  double q{}, qd{}, qdd{}, jerk{};  ///< rad, rad/s, rad/s², rad/s³
};

/// A stretch of constant jerk [s, rad/s³].
struct JerkPiece {
  double duration{}, jerk{};  ///< s; rad/s³
};

/// Position, velocity and acceleration of one joint, cubic in pieces.
class JerkProfile {
 public:
  /// From (q, q̇, q̈) at t = 0.
  explicit JerkProfile(const JointSample& start) : knots_{start}, times_{0.0} {}
  /// Adds stretches after the last one. Throws std::invalid_argument unless durations are >= 0 [s] and all is
  /// finite.
  void append(const std::vector<JerkPiece>& pieces);
  /// Beyond its ends the motion goes on uniformly, with the end's velocity; no `t` [s], no sample: NaN throws
  /// std::invalid_argument.
  JointSample at(double t) const;
  /// Appends the instants at which acceleration or velocity may be largest: the pieces' ends, and where the
  /// acceleration passes through zero.
  void extremes(std::vector<double>& out) const;
  /// The state at the end of the last stretch.
  const JointSample& end() const { return knots_.back(); }
  /// From the start to the end of the last stretch [s].
  double duration() const { return times_.back(); }

 private:
  std::vector<JointSample> knots_;
  std::vector<double> times_;
};

/// From rest to velocity `v` with acceleration `a` at the end, in three pieces (jerk, none, jerk): the peak
/// acceleration follows from the duration. Empty where `duration` is too short for the limits. Throws
/// std::invalid_argument for a number that is not finite, and for limits that are not > 0.
std::optional<std::vector<JerkPiece>> velocity_ramp(double v, double a, double duration,
                                                    const JointLimits& limits);
/// The shortest duration for which there is one. Infinite if |a| exceeds the limit. Throws as velocity_ramp.
double shortest_ramp(double v, double a, const JointLimits& limits);

/// From rest to rest over the distance 1 with limits of velocity, acceleration and jerk [1/s, 1/s², 1/s³]:
/// the time-optimal seven pieces. Throws std::invalid_argument unless each is > 0 and finite.
std::vector<JerkPiece> rest_to_rest(double velocity, double acceleration, double jerk);

/// All joints of a chain together, from `begin` [s] on.
struct JointTrajectory {
  double begin{};                   ///< s
  std::vector<JerkProfile> joints;  ///< all of the same duration

  /// s
  double end() const { return begin + (joints.empty() ? 0.0 : joints.front().duration()); }
  /// All joints at an instant.
  struct State {
    JointVector<double> q, qd, qdd, jerk;  ///< rad, rad/s, rad/s², rad/s³
  };
  /// At t [s].
  State at(double t) const;
};

/// The largest use of each limit over a trajectory, as a fraction of the limit (1: just reached); of the
/// position, |q − middle| over half the range. Infinite limits are not used.
struct LimitUse {
  double fraction{};  ///< of the limit; above 1 it is broken
  int joint{};        ///< index
  double time{};      ///< s
};
/// The largest change of a joint's torque from look to look, over the time between them.
struct TorqueRate {
  double value{};  ///< N m/s
  int joint{};     ///< index
  double time{};   ///< of the later look [s]
};
/// The use of all limits over a trajectory.
struct LimitCheck {
  LimitUse position, velocity, acceleration, jerk, torque;  ///< the largest of each
  TorqueRate torque_rate;  ///< for information: motions are not limited by it
  double lowest{};         ///< as lowest_height [m]
  /// Whether every fraction is at most 1 + tolerance.
  bool within(double tolerance = 1e-9) const;
  /// The limit that is used most, in words. Throws std::invalid_argument for a joint that the chain does not
  /// have.
  std::string worst(const Chain& chain) const;
};
inline constexpr double kCheckStep = 1e-3;  ///< of check_limits, where nobody asks for another [s]
/// The least, by which a long look stays one of seconds [s].
inline constexpr double kLeastCheckStep = 1e-5;
/// Looks every `step` [s], at the end, and where a velocity or an acceleration is largest. Torques are those
/// of inverse dynamics, with friction. Throws std::invalid_argument for a step out of [kLeastCheckStep, inf)
/// and a trajectory of another number of joints than the chain's.
LimitCheck check_limits(const Chain& chain, const JointTrajectory& trajectory, double step = kCheckStep);

}  // namespace unhand::planners
