// A planar arm with three revolute joints that carries the hand: the hand motion of the synthetic campaigns.
#pragma once

#include <array>
#include <vector>

#include "dynamics/piecewise_polynomial.hpp"
#include "release/hand_motion.hpp"

namespace unhand::experiment {

using dynamics::Window;

/// Three links in the x-z plane. The joint angles q_i [rad] are relative, so link i points along
/// φ_i = q_1 + … + q_i against +x, and the hand frame (midway between the pads) sits at the tip of the last
/// link, turned with it: p_WH = base + Σ l_i e_x(φ_i), θ_H = φ_3.
struct PlanarArm {
  dynamics::Vec2<double> base{0.0, 0.333};             ///< shoulder, in the world [m]
  std::array<double, 3> lengths{0.316, 0.384, 0.250};  ///< l_i > 0 [m]
};

/// Joint angles, velocities and accelerations of the arm [rad, rad/s, rad/s²].
template <class S>
using JointState = dynamics::Jet2<S, 3>;

/// The hand's state from the joints', with e = e_x(φ_i), n = e_z(φ_i):
///   p' = Σ l_i φ_i' n,   p'' = Σ l_i (φ_i'' n − φ_i'² e).
template <class S>
release::HandState<S> forward_kinematics(const PlanarArm& arm, const JointState<S>& joints) {
  using std::cos, std::sin;
  release::HandState<S> hand;
  hand.pose.x = S(arm.base.x);
  hand.pose.z = S(arm.base.z);
  S angle(0.0), rate(0.0), acceleration(0.0);
  for (int i = 0; i < 3; ++i) {
    const double l = arm.lengths[i];
    angle += joints.value[i];
    rate += joints.first[i];
    acceleration += joints.second[i];
    const S ex = l * cos(angle), ez = l * sin(angle);
    hand.pose.x += ex;
    hand.pose.z += ez;
    hand.twist.vx -= rate * ez;
    hand.twist.vz += rate * ex;
    hand.acceleration.ax -= acceleration * ez + rate * rate * ex;
    hand.acceleration.az += acceleration * ex - rate * rate * ez;
  }
  hand.pose.theta = angle;
  hand.twist.omega = rate;
  hand.acceleration.alpha = acceleration;
  return hand;
}

/// A hand at the tip of a planar arm whose joints follow piecewise polynomials. Pose, twist and acceleration
/// are exact derivatives of each other; the acceleration jumps at `jumps()` only.
class PlanarArmHand final : public release::HandMotion {
 public:
  using JointPath = dynamics::PiecewisePolynomial<3, 5>;  ///< rad, s

  /// Every inner break of `joints` counts as a jump. Throws std::invalid_argument unless the links are longer
  /// than 0.
  PlanarArmHand(const PlanarArm& arm, JointPath joints);

  release::HandState<double> at(const Window& window, double t) const override { return at_(window, t); }
  release::HandState<release::Dual> at(const Window& window, const release::Dual& t) const override {
    return at_(window, t);
  }
  std::vector<double> jumps() const override { return jumps_; }
  double begin() const override { return joints_.begin(); }
  double end() const override { return joints_.end(); }
  /// The arm's links and shoulder.
  const PlanarArm& arm() const { return arm_; }
  /// The joints over time [rad].
  const JointPath& joints() const { return joints_; }

 private:
  template <class S>
  release::HandState<S> at_(const Window& window, const S& t) const {
    return forward_kinematics(arm_, joints_.at(window, t));
  }

  PlanarArm arm_;
  JointPath joints_;
  std::vector<double> jumps_;
};

/// A throw, told by what the hand does where its acceleration switches.
///
/// The joints stay on a straight line in joint space, q(t) = q_s + q_s' s(t), so the hand's path does not
/// depend on how it speeds up or brakes along it. At the switch s' = 1, and s'' = a/|v| is constant before
/// and after: a is then the acceleration of the hand along its path, at the switch. From `follow_through` on
/// the arm brakes at a constant s'' and comes to rest at `end`. So the acceleration jumps twice: at
/// `switch_time` and at `follow_through`.
struct ThrowMotion {
  double begin{-0.05}, switch_time{0.020}, follow_through{0.16}, end{0.30};  ///< [s], increasing
  dynamics::Pose<double> pose;    ///< of the hand at the switch; m, m, rad
  dynamics::Twist<double> twist;  ///< the same, v ≠ 0; m/s, m/s, rad/s
  double before{}, after{};       ///< a up to the switch and from it on [m/s²]
};

/// The arm's motion for a throw, elbow up. Throws std::invalid_argument if the times do not increase, the
/// hand stands still, or the arm cannot take the pose (out of reach, or stretched or folded, where the joint
/// velocities are not determined).
PlanarArmHand throw_motion(const PlanarArm& arm, const ThrowMotion& motion);

/// A hand as polynomials in time: quintics of at most `longest` [s] that meet pose, twist and acceleration at
/// their ends, with the same jumps.
release::PolynomialHand polynomial_hand(const release::HandMotion& hand, double longest = 5e-3);

}  // namespace unhand::experiment
