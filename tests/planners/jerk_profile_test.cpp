// Jerk-limited motions: ends, limits, and the shortest times in closed form.
#include "planners/arm/jerk_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "planners/arm/dynamics.hpp"
#include "planners/arm/panda.hpp"

namespace unhand::planners {
namespace {

JointLimits limits(double a, double j) {
  JointLimits out;
  out.acceleration = a;
  out.jerk = j;
  return out;
}

TEST(VelocityRamp, EndsWhereItShouldWithinTheLimits) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> v(-2.5, 2.5), a(-15, 15), longer(1, 3);
  for (int n = 0; n < 500; ++n) {
    const JointLimits l = limits(15, 5000);
    const double v1 = v(random), a1 = a(random), shortest = shortest_ramp(v1, a1, l);
    for (const double duration : {shortest, shortest * longer(random)}) {
      const auto ramp = velocity_ramp(v1, a1, duration, l);
      ASSERT_TRUE(ramp) << v1 << ' ' << a1 << ' ' << duration;
      JerkProfile profile({0.3, 0, 0, 0});
      profile.append(*ramp);
      EXPECT_NEAR(profile.duration(), duration, 1e-12);
      EXPECT_NEAR(profile.end().qd, v1, 1e-8);
      EXPECT_NEAR(profile.end().qdd, a1, 1e-8);
      for (double t = 0; t < duration; t += duration / 37) {
        EXPECT_LE(std::abs(profile.at(t).qdd), 15 * (1 + 1e-12));
        EXPECT_LE(std::abs(profile.at(t).jerk), 5000 * (1 + 1e-12));
      }
    }
    EXPECT_FALSE(velocity_ramp(v1, a1, 0.999 * shortest - 1e-6, l)) << v1 << ' ' << a1;
  }
}

TEST(VelocityRamp, ShortestTimesFromRest) {
  // To v without acceleration: v/a + a/j if the limit of acceleration is reached, else 2 √(v/j).
  EXPECT_NEAR(shortest_ramp(2, 0, limits(10, 1000)), 2 / 10. + 10 / 1000., 1e-12);
  EXPECT_NEAR(shortest_ramp(0.04, 0, limits(10, 1000)), 2 * std::sqrt(0.04 / 1000), 1e-12);
  EXPECT_NEAR(shortest_ramp(-2, 0, limits(10, 1000)), 0.21, 1e-12);
  // To v with the full acceleration: the first jerk and the rest of v.
  EXPECT_NEAR(shortest_ramp(2, 10, limits(10, 1000)), 0.01 + (2 - 0.05) / 10, 1e-12);
  EXPECT_EQ(shortest_ramp(0, 0, limits(10, 1000)), 0);
  EXPECT_TRUE(std::isinf(shortest_ramp(1, 11, limits(10, 1000))));
}

TEST(RestToRest, CoversTheDistanceInTheShortestTime) {
  // Seven, five, six and four pieces: duration in closed form.
  const struct {
    double v, a, j, duration;
  } cases[]{{0.5, 2, 20, 1 / 0.5 + 0.5 / 2 + 2 / 20.},        // cruises, with full acceleration
            {0.1, 2, 20, 1 / 0.1 + 2 * std::sqrt(0.1 / 20)},  // cruises, never reaches it
            {50, 2, 20, 0.1 + std::sqrt(0.01 + 4 / 2.)},      // full acceleration, no cruise
            {50, 200, 20, 4 * std::cbrt(1 / (2 * 20.))}};     // jerk alone
  for (const auto& [v, a, j, duration] : cases) {
    JerkProfile profile({0, 0, 0, 0});
    profile.append(rest_to_rest(v, a, j));
    EXPECT_NEAR(profile.duration(), duration, 1e-12);
    EXPECT_NEAR(profile.end().q, 1, 1e-12);
    EXPECT_NEAR(profile.end().qd, 0, 1e-12);
    EXPECT_NEAR(profile.end().qdd, 0, 1e-12);
    for (double t = 0; t <= duration; t += duration / 101) {
      EXPECT_LE(std::abs(profile.at(t).qd), v * (1 + 1e-12));
      EXPECT_LE(std::abs(profile.at(t).qdd), a * (1 + 1e-12));
    }
  }
}

TEST(JerkProfile, IsItsOwnDerivative) {
  JerkProfile profile({1, 0.5, -2, 0});
  profile.append({{0.1, 30}, {0.2, 0}, {0.05, -100}});
  for (double t = 0.01; t < 0.35; t += 0.0237) {
    const double h = 1e-5;
    const auto at = profile.at(t), up = profile.at(t + h), down = profile.at(t - h);
    EXPECT_NEAR((up.q - down.q) / (2 * h), at.qd, 1e-7);
    EXPECT_NEAR((up.qd - down.qd) / (2 * h), at.qdd, 3e-3);  // a jump of the jerk within h
  }
  EXPECT_EQ(profile.at(-1).qd, 0.5);
  EXPECT_EQ(profile.at(9).qd, profile.end().qd);
}

TEST(LimitCheck, FindsWhatIsExceeded) {
  const Chain arm = panda();
  JointTrajectory still;
  for (int i = 0; i < 7; ++i) {
    JerkProfile profile({0.5 * (arm.joints[i].limits.lower + arm.joints[i].limits.upper), 0, 0, 0});
    profile.append({{0.01, 0}});
    still.joints.push_back(profile);
  }
  const LimitCheck held = check_limits(arm, still);
  EXPECT_TRUE(held.within());
  EXPECT_LT(held.position.fraction, 1e-12);
  EXPECT_GT(held.torque.fraction, 0.01);  // its own weight
  JointTrajectory fast = still;
  fast.joints[3] = JerkProfile({-1, 3, 0, 0});
  fast.joints[3].append({{0.01, 0}});
  const LimitCheck found = check_limits(arm, fast);
  EXPECT_FALSE(found.within());
  EXPECT_EQ(found.velocity.joint, 3);
  EXPECT_NEAR(found.velocity.fraction, 3 / 2.175, 1e-12);
  EXPECT_EQ(found.worst(arm).substr(0, 24), "velocity of panda_joint4");
}

// From rest under a constant jerk, the torque grows by the inertia times the jerk, once friction is left out.
TEST(LimitCheck, TellsHowFastTorquesChange) {
  Chain arm = panda();
  for (Joint& joint : arm.joints) joint.friction = {};
  constexpr double kJerk = 1000, kDuration = 4e-3;
  JointTrajectory motion;
  JointVector<double> q(7);
  for (int i = 0; i < 7; ++i) {
    q[i] = 0.5 * (arm.joints[i].limits.lower + arm.joints[i].limits.upper);
    JerkProfile profile({q[i], 0, 0, 0});
    profile.append({{kDuration, i == 1 ? kJerk : 0}});
    motion.joints.push_back(profile);
  }
  const JointVector<double> none = JointVector<double>::Zero(7), one = JointVector<double>::Unit(7, 1);
  const JointVector<double> inertia =
      inverse_dynamics(arm, q, none, one) - inverse_dynamics(arm, q, none, none);
  Eigen::Index joint = 0;
  const double most = inertia.cwiseAbs().maxCoeff(&joint);
  for (const double step : {1e-3, 2.5e-4}) {
    const LimitCheck found = check_limits(arm, motion, step);
    EXPECT_EQ(found.torque_rate.joint, joint);
    // Gravity and speed hardly change.
    EXPECT_NEAR(found.torque_rate.value, most * kJerk, 0.01 * most * kJerk) << step;
  }
}

TEST(JerkProfile, GoesOnUniformlyBeyondItsEnds) {
  JerkProfile profile({0, 1, 0, 0});
  profile.append({{1, 0}});
  for (const double t : {-2.0, 0.5, 3.0}) EXPECT_EQ(profile.at(t).q, t);
}

TEST(JerkProfile, RefusesWhatIsNoMotion) {
  JerkProfile profile({0, 1, 0, 0});
  for (const double h : {-1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)})
    EXPECT_THROW(profile.append({{h, 0}}), std::invalid_argument) << h;
  EXPECT_THROW(profile.append({{1, NAN}}), std::invalid_argument);
  EXPECT_EQ(profile.duration(), 0);
  EXPECT_THROW(profile.at(NAN), std::invalid_argument);
  EXPECT_THROW(velocity_ramp(NAN, 0, 1, limits(10, 1000)), std::invalid_argument);
  EXPECT_THROW(velocity_ramp(1, 0, NAN, limits(10, 1000)), std::invalid_argument);
  EXPECT_THROW(shortest_ramp(1, NAN, limits(10, 1000)), std::invalid_argument);
  EXPECT_THROW(shortest_ramp(1, 0, limits(10, 0)), std::invalid_argument);
  EXPECT_THROW(rest_to_rest(1, 1, NAN), std::invalid_argument);
}

TEST(LimitCheck, RefusesOtherArmsAndStepsWithoutEnd) {
  const Chain arm = panda();
  JointTrajectory motion;
  for (int i = 0; i < 7; ++i) motion.joints.emplace_back(JointSample{});
  for (const double step : {0.0, -1e-3, 1e-9, static_cast<double>(NAN)})
    EXPECT_THROW(check_limits(arm, motion, step), std::invalid_argument) << step;
  motion.joints.pop_back();
  EXPECT_THROW(check_limits(arm, motion), std::invalid_argument);
  LimitCheck elsewhere;
  elsewhere.torque = {2.0, 9, 0.0};
  EXPECT_THROW(static_cast<void>(elsewhere.worst(arm)), std::invalid_argument);
}

/// All joints of the Panda in the middle of their ranges, but for one that moves otherwise from `begin` on.
JointTrajectory one_moves(const Chain& arm, int joint, const JointSample& start,
                          const std::vector<JerkPiece>& pieces, double begin = 0) {
  JointTrajectory out;
  out.begin = begin;
  double duration = 0;
  for (const JerkPiece& piece : pieces) duration += piece.duration;
  for (int i = 0; i < arm.size(); ++i) {
    const JointLimits& l = arm.joints[i].limits;
    JerkProfile profile(i == joint ? start : JointSample{0.5 * (l.lower + l.upper), 0, 0, 0});
    profile.append(i == joint ? pieces : std::vector<JerkPiece>{{duration, 0}});
    out.joints.push_back(profile);
  }
  return out;
}

// Between two looks and two pieces: q̇ = a t − ½ j t² is largest at t = a/j, with a²/(2 j).
TEST(LimitCheck, FindsTheLargestVelocityBetweenItsLooks) {
  const Chain arm = panda();
  const double a = 2, j = 1000;
  const LimitCheck found = check_limits(arm, one_moves(arm, 5, {1, 0, a, 0}, {{3 * a / j, -j}}, -5), 1);
  // At the end q̇ is 3 a²/j − 4.5 a²/j = −1.5 a²/j, three times as large; the other sign has the same peak.
  EXPECT_NEAR(found.velocity.fraction, 1.5 * a * a / j / arm.joints[5].limits.velocity, 1e-12);
  const LimitCheck peak = check_limits(arm, one_moves(arm, 5, {1, 0, a, 0}, {{2 * a / j, -j}}, -5), 1);
  EXPECT_NEAR(peak.velocity.fraction, 0.5 * a * a / j / arm.joints[5].limits.velocity, 1e-12);
  EXPECT_EQ(peak.velocity.joint, 5);
  EXPECT_NEAR(peak.velocity.time, -5 + a / j, 1e-12);
}

// The first joint stands upright: where it turns evenly and alone, nothing but friction asks for its torque.
TEST(LimitCheck, FrictionAsksForTorque) {
  Chain arm = panda();
  for (int i = 1; i < 7; ++i) arm.joints[i].limits.torque = JointLimits::kNone;
  const double rate = 1.3;
  const JointFriction& f = arm.joints[0].friction;
  const auto sigmoid = [&](double qd) { return f.phi1 / (1 + std::exp(-f.phi2 * (qd + f.phi3))); };
  const LimitCheck found = check_limits(arm, one_moves(arm, 0, {-0.1, rate, 0, 0}, {{0.1, 0}}));
  EXPECT_NEAR(found.torque.fraction, (sigmoid(rate) - sigmoid(0)) / arm.joints[0].limits.torque, 1e-9);
  EXPECT_GT(found.torque.fraction, 1e-3);
}

TEST(LimitCheck, AJerkAloneMayBeTooMuch) {
  const Chain arm = panda();
  const double most = arm.joints[2].limits.jerk, h = 1e-3;
  const auto with = [&](double jerk) {
    return check_limits(arm, one_moves(arm, 2, {0, 0, 0, 0}, {{h, jerk}, {h, -jerk}}));
  };
  EXPECT_TRUE(with(0.99 * most).within());
  const LimitCheck broken = with(-1.01 * most);
  EXPECT_FALSE(broken.within());
  EXPECT_NEAR(broken.jerk.fraction, 1.01, 1e-12);
  EXPECT_EQ(broken.worst(arm).substr(0, 20), "jerk of panda_joint3");
}

// Bent over, with the hand turned up again: the wrist is lower than the hand.
TEST(LimitCheck, TheWristMayBeTheLowest) {
  const Chain arm = panda();
  JointTrajectory bent;
  const double q[]{0, 1.7, 0, -3.0, 0, 1.5, 0};
  JointVector<double> at(7);
  for (int i = 0; i < 7; ++i) {
    at[i] = q[i];
    bent.joints.push_back(JerkProfile({q[i], 0, 0, 0}));
    bent.joints.back().append({{0.01, 0}});
  }
  // The shoulder 0.333 m up, 0.316 m along the upper arm and 0.0825 m across it; 0.384 m along the forearm,
  // and back across it.
  const double wrist =
      0.333 + 0.316 * std::cos(1.7) - 0.0825 * std::sin(1.7) + 0.384 * std::cos(4.7) + 0.0825 * std::sin(4.7);
  ASSERT_GT(forward_kinematics(arm, at).p.z(), wrist + 0.05);
  EXPECT_NEAR(check_limits(arm, bent).lowest, wrist, 1e-12);
}

}  // namespace
}  // namespace unhand::planners
