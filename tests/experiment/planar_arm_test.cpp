// The arm that throws: pose, twist and acceleration are derivatives of each other, and the motion is as told.
#include "experiment/planar_arm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

namespace {

using namespace unhand;
using namespace unhand::experiment;
using dynamics::Dual;
using dynamics::independent;

std::array<double, 9> flat(const release::HandState<double>& h) {
  return {h.pose.x,      h.pose.z,          h.pose.theta,      h.twist.vx,          h.twist.vz,
          h.twist.omega, h.acceleration.ax, h.acceleration.az, h.acceleration.alpha};
}

ThrowMotion a_throw(double after) {
  ThrowMotion motion;
  motion.pose = {0.50, 0.55, -0.4};
  motion.twist = {1.8, 1.5, 4.0};
  motion.before = 3;
  motion.after = after;
  return motion;
}

/// Joints that follow quintics with random coefficients: nothing is zero.
PlanarArmHand random_hand(std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<PlanarArmHand::JointPath::Coefficients> pieces(2);
  for (auto& piece : pieces)
    for (auto& power : piece)
      for (double& c : power) c = 3 * uniform(random);
  return {PlanarArm{}, PlanarArmHand::JointPath({0.0, 0.5, 1.0}, pieces)};
}

// One joint turning at a steady rate moves the hand on a circle: v = ω r, a = ω² r towards the centre.
TEST(PlanarArm, OneJointIsACircle) {
  const PlanarArm arm{{0.1, 0.2}, {0.3, 0.4, 0.5}};
  PlanarArmHand::JointPath::Coefficients turning{};
  turning[1][0] = 2.0;  // the arm is stretched along +x at t = 0
  const PlanarArmHand hand(arm, PlanarArmHand::JointPath({0.0, 1.0}, {turning}));
  const double t = 0.7, angle = 2.0 * t, radius = 1.2, c = std::cos(angle), s = std::sin(angle);
  const std::array<double, 9> expected{0.1 + radius * c, 0.2 + radius * s, angle,
                                       -2 * radius * s,  2 * radius * c,   2.0,
                                       -4 * radius * c,  -4 * radius * s,  0.0};
  const auto seen = flat(hand.at({0, 1}, t));
  for (int i = 0; i < 9; ++i)
    EXPECT_NEAR(seen[i], expected[i], 1e-14) << i;  // rounding of a dozen operations
}

// The derivative that a Dual time carries through the pose is the twist, and through the twist the
// acceleration.
TEST(PlanarArm, TwistAndAccelerationAreDerivatives) {
  std::mt19937_64 random(20);
  for (int trial = 0; trial < 20; ++trial) {
    const PlanarArmHand hand = random_hand(random);
    for (const Window window : {Window{0, 0.5}, Window{0.5, 1}})
      for (const double t : {window.begin, window.begin + 0.1, window.begin + 0.37, window.end}) {
        const auto dual = hand.at(window, independent(t, 3));
        const auto plain = flat(hand.at(window, t));
        const std::array<Dual, 9> d{dual.pose.x,          dual.pose.z,          dual.pose.theta,
                                    dual.twist.vx,        dual.twist.vz,        dual.twist.omega,
                                    dual.acceleration.ax, dual.acceleration.az, dual.acceleration.alpha};
        for (int i = 0; i < 9; ++i) EXPECT_EQ(d[i].a, plain[i]) << "trial " << trial << " t " << t;
        for (int i = 0; i < 6; ++i)
          // both sides are sums of products up to a few hundred
          EXPECT_NEAR(d[i].v[3], plain[i + 3], 1e-12 * (1 + std::abs(plain[i + 3])) * 100)
              << "trial " << trial << " t " << t << " column " << i;
      }
  }
}

// And a difference quotient, which knows nothing of Duals, finds the jerk that the Dual of the acceleration
// has.
TEST(PlanarArm, DualOfTheAccelerationIsItsDifferenceQuotient) {
  std::mt19937_64 random(21);
  const PlanarArmHand hand = random_hand(random);
  const Window window{0, 0.5};
  const double t = 0.21;
  const auto dual = hand.at(window, independent(t, 0)).acceleration;
  double best = 1e300;
  for (double h = 1e-2; h > 1e-8; h /= 10) {
    const auto up = hand.at(window, t + h).acceleration, down = hand.at(window, t - h).acceleration;
    const double error = std::abs((up.ax - down.ax) / (2 * h) - dual.ax.v[0]) +
                         std::abs((up.az - down.az) / (2 * h) - dual.az.v[0]) +
                         std::abs((up.alpha - down.alpha) / (2 * h) - dual.alpha.v[0]);
    best = std::min(best, error);
  }
  EXPECT_LT(best, 1e-5);  // of some hundred m/s³: the plateau between truncation (h²) and rounding (1/h)
}

TEST(ThrowMotion, IsAsTold) {
  for (const double after : {8.0, 0.0, -19.0}) {
    const ThrowMotion motion = a_throw(after);
    const PlanarArmHand hand = throw_motion(PlanarArm{}, motion);
    EXPECT_EQ(hand.begin(), motion.begin);
    EXPECT_EQ(hand.end(), motion.end);
    EXPECT_EQ(hand.jumps(), (std::vector<double>{motion.switch_time, motion.follow_through}));

    const Window left{motion.begin, motion.switch_time}, right{motion.switch_time, motion.follow_through};
    const auto l = hand.at(left, motion.switch_time), r = hand.at(right, motion.switch_time);
    const auto told = flat({motion.pose, motion.twist, {}});
    // the left limit is extrapolated over 70 ms, the right one is a coefficient of the path
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(flat(r)[i], told[i], 1e-13) << i;
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(flat(l)[i], told[i], 1e-12) << i;

    // Both sides follow the same path, so the jump of the acceleration is along the velocity, by after −
    // before.
    const double speed = norm(motion.twist.linear()), jump = (motion.after - motion.before) / speed;
    EXPECT_NEAR(r.acceleration.ax - l.acceleration.ax, jump * motion.twist.vx, 1e-11);
    EXPECT_NEAR(r.acceleration.az - l.acceleration.az, jump * motion.twist.vz, 1e-11);
    EXPECT_NEAR(r.acceleration.alpha - l.acceleration.alpha, jump * motion.twist.omega, 1e-11);

    const Window last{motion.follow_through, motion.end};
    const auto stopped = flat(hand.at(last, motion.end));
    for (int i = 3; i < 6; ++i) EXPECT_NEAR(stopped[i], 0.0, 1e-13) << i;
    const auto before = flat(hand.at(right, motion.follow_through)),
               behind = flat(hand.at(last, motion.follow_through));
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(before[i], behind[i], 1e-12) << i;
  }
}

// How the hand brakes does not change where it goes: equal path parameters s give equal poses.
TEST(ThrowMotion, PathDoesNotDependOnTheAcceleration) {
  const ThrowMotion fast = a_throw(6), slow = a_throw(-12);
  const PlanarArmHand one = throw_motion(PlanarArm{}, fast), other = throw_motion(PlanarArm{}, slow);
  const double speed = norm(fast.twist.linear()), t = 0.05;  // after the switch
  const double s = t + 0.5 * (slow.after / speed) * t * t;
  const double a = fast.after / speed, same = (std::sqrt(1 + 2 * a * s) - 1) / a;  // s(same) = s
  const Window window{fast.switch_time, fast.follow_through};
  const auto p = one.at(window, fast.switch_time + same).pose,
             q = other.at(window, fast.switch_time + t).pose;
  EXPECT_NEAR(p.x, q.x, 1e-13);
  EXPECT_NEAR(p.z, q.z, 1e-13);
  EXPECT_NEAR(p.theta, q.theta, 1e-13);
}

TEST(ThrowMotion, RefusesWhatTheArmCannotDo) {
  ThrowMotion far = a_throw(0);
  far.pose.x = 1.5;
  EXPECT_THROW(throw_motion(PlanarArm{}, far), std::invalid_argument);
  ThrowMotion disordered = a_throw(0);
  disordered.follow_through = disordered.switch_time;
  EXPECT_THROW(throw_motion(PlanarArm{}, disordered), std::invalid_argument);
  ThrowMotion still = a_throw(0);
  still.twist = {0, 0, 1};
  EXPECT_THROW(throw_motion(PlanarArm{}, still), std::invalid_argument);
  EXPECT_THROW(throw_motion(PlanarArm{{0, 0}, {0.3, 0.3, 0}}, a_throw(0)), std::invalid_argument);
  ThrowMotion unknown = a_throw(0);
  unknown.pose.x = std::nan("");
  EXPECT_THROW(throw_motion(PlanarArm{}, unknown), std::invalid_argument);
}

}  // namespace
