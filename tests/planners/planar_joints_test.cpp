// Arms that are made planar by holding some of their joints.
#include "planners/tube/planar_joints.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "planners/arm/chain_file.hpp"
#include "planners/arm/kinematics.hpp"
#include "planners/arm/panda.hpp"
#include "planners/tube/robust_throw.hpp"
#include "tests/planners/ur5.hpp"

namespace unhand::planners {
namespace {

using Pose = JointVector<double>;
using testing::HasSubstr;
constexpr double kQuarter = std::numbers::pi / 2;

Chain ur5() { return with_gripper(toml_chain(kUr5, "ur5.toml"), 0.15, 0.9); }
/// Upright, the forearm and the tool level.
Pose ur5_bent() { return Pose{{0, -kQuarter, kQuarter, 0, -kQuarter, 0}}; }

std::vector<int> joints_of(const std::vector<NominalOptions::Fixed>& fixed) {
  std::vector<int> out;
  for (const auto& one : fixed) out.push_back(one.joint);
  return out;
}

/// However the other joints move within their ranges, the tip and its axis are in one vertical plane with the
/// target.
void expect_planar(const Chain& arm, const std::vector<NominalOptions::Fixed>& fixed,
                   const Eigen::Vector3d& target) {
  std::mt19937_64 random(1);
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  for (int k = 0; k < 50; ++k) {
    Pose q(arm.size());
    for (int i = 0; i < arm.size(); ++i)
      q[i] = std::uniform_real_distribution<double>(std::max(-3.0, arm.joints[i].limits.lower),
                                                    std::min(3.0, arm.joints[i].limits.upper))(random);
    for (const auto& [joint, angle] : fixed) {
      q[joint] = angle;
      EXPECT_GE(angle, arm.joints[joint].limits.lower);
      EXPECT_LE(angle, arm.joints[joint].limits.upper);
    }
    const auto tip = forward_kinematics(arm, q);
    const Eigen::Vector2d to = (target - tip.p).head<2>();
    if (k == 0) normal = Eigen::Vector2d(-to.y(), to.x()).normalized();
    EXPECT_NEAR(normal.dot(to), 0, 1e-9);
    EXPECT_NEAR(normal.dot(tip.R.col(2).head<2>()), 0, 1e-9);
  }
}

const Eigen::Vector3d kTargets[]{{1.1, 0, -0.1}, {0.7, 0.8, 0}, {-0.9, 0.1, 0.2}, {-0.2, -1.2, -0.3}};

TEST(PlanarJoints, OfAPandaAreTheSecondTheFourthAndTheSixth) {
  for (const Eigen::Vector3d& target : kTargets) {
    const auto held = planar_joints(panda(), panda_ready(), target);
    ASSERT_TRUE(held);
    EXPECT_EQ(joints_of(*held), (std::vector<int>{0, 2, 4, 6}));
    expect_planar(panda(), *held, target);
    EXPECT_EQ((*held)[1].angle, 0);
    EXPECT_EQ((*held)[2].angle, 0);
    EXPECT_EQ((*held)[3].angle, panda_ready()[6]);
    const double azimuth = std::atan2(target.y(), target.x());
    if (std::abs(azimuth) < panda().joints[0].limits.upper) {
      EXPECT_EQ((*held)[0].angle, azimuth);
    }
  }
}

// From poses in which no joints move in a plane, those are turned that must be.
TEST(PlanarJoints, AreFoundFromAskewPoses) {
  Pose home = panda_ready();
  home[2] = 0.4, home[4] = -0.3;
  const auto held = planar_joints(panda(), home, kTargets[1]);
  ASSERT_TRUE(held);
  EXPECT_EQ(joints_of(*held), (std::vector<int>{0, 2, 4, 6}));
  expect_planar(panda(), *held, kTargets[1]);
}

// The plane of its shoulder, elbow and first wrist joint is beside the axis of its base; stretched out, its
// tool stands across that plane.
TEST(PlanarJoints, OfAUr5AreShoulderElbowAndFirstWrist) {
  for (const Pose& home : {ur5_bent(), Pose(Pose::Zero(6)), Pose{{0.3, -1, 0.5, 0.2, 0.7, 1}}})
    for (const Eigen::Vector3d& target : kTargets) {
      const auto held = planar_joints(ur5(), home, target);
      ASSERT_TRUE(held);
      EXPECT_EQ(joints_of(*held), (std::vector<int>{0, 4, 5}));
      expect_planar(ur5(), *held, target);
      EXPECT_NEAR(std::abs((*held)[1].angle), kQuarter, 1e-9);
      EXPECT_EQ((*held)[2].angle, home[5]) << "it turns the tool about its axis only";
    }
  EXPECT_EQ((*planar_joints(ur5(), ur5_bent(), kTargets[0]))[1].angle, -kQuarter) << "as at rest";
}

TEST(PlanarJoints, SaysWhyThereAreNone) {
  std::string reason;
  const auto none = [&](const Chain& arm, const Pose& home, const Eigen::Vector3d& target) {
    EXPECT_FALSE(planar_joints(arm, home, target, &reason));
    return reason;
  };
  Chain level = toml_chain(kUr5, "ur5.toml");  // all axes upright, as of a SCARA robot
  for (Joint& joint : level.joints) joint.origin.R.setIdentity();
  EXPECT_THAT(none(level, ur5_bent(), kTargets[0]),
              HasSubstr("no two of its joints have level, parallel axes"));
  Chain stiff = toml_chain(kUr5, "ur5.toml");  // its tool cannot come into the plane
  stiff.joints[4].limits.lower = -1, stiff.joints[4].limits.upper = 1;
  EXPECT_THAT(none(stiff, Pose::Zero(6), kTargets[0]), HasSubstr("no two of its joints"));
  EXPECT_THAT(none(ur5(), ur5_bent(), {0.05, 0.02, 1}),
              HasSubstr("nearer to the axis of base than the plane"));
  Chain blocked = toml_chain(kUr5, "ur5.toml");
  blocked.joints[0].limits.lower = -0.1, blocked.joints[0].limits.upper = 0.1;
  EXPECT_THAT(none(blocked, ur5_bent(), {0, 1, 0}), HasSubstr("base cannot turn to the target"));
  Chain standing = toml_chain(kUr5, "ur5.toml");  // from the shoulder on: nothing turns it
  standing.joints.erase(standing.joints.begin());
  standing.joints[0].origin.p = {0, 0, 0.3};
  const Pose home = ur5_bent().tail(5);
  EXPECT_THAT(none(standing, home, {0, 1, 0}), HasSubstr("m beside its plane"));
  const double beside = forward_kinematics(standing, home).p.y();
  EXPECT_TRUE(planar_joints(standing, home, {1, beside, 0}));
  EXPECT_THROW(planar_joints(ur5(), Pose::Zero(7), kTargets[0]), std::invalid_argument);
}

// The whole way: a bar thrown by a UR5 as a card says.
TEST(PlanarJoints, AUr5ThrowsAsACardSays) {
  const Chain arm = ur5();
  const TargetBox box{{0.9, 0.5, -0.2}};
  ReleaseCard card;
  card.grip_force = 150;
  HeldObject bar;
  bar.com_offset = {0.05, 0.004};
  PlanOptions options;
  options.home = ur5_bent();
  options.search.fixed = *planar_joints(arm, options.home, box.middle);
  options.search.samples = 600;
  options.search.window = window_for(card);
  const auto tube =
      plan_throw(with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, bar.com_offset.value}}), box, options);
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p{arm, tube.plan->nominal.state, tube.plan->qdd, box.middle};
  p.hold = options.search.window + 1e-6;
  p.card = card;
  p.object = bar;
  const auto before = draw_landings(p, 100, 1);
  const auto robust = plan_robust_throw(p, options.home);
  ASSERT_TRUE(robust);
  p.start = robust->choice.start;
  p.qdd = robust->choice.qdd;
  EXPECT_LT(draw_landings(p, 100, 1).std, before.std);
  const Eigen::Vector3d across =
      (box.middle - forward_kinematics(arm, p.start.q).p).cross(Eigen::Vector3d::UnitZ()).normalized();
  for (const JointTrajectory* motion : {&tube.plan->motion, &robust->motion})
    for (double t = 0; t <= p.hold; t += 0.01) {
      const auto tip = forward_kinematics(arm, motion->at(t).q);
      EXPECT_NEAR(across.dot(tip.p - box.middle), 0, 1e-6);
      EXPECT_NEAR(across.dot(tip.R.col(2)), 0, 1e-6);
    }
}

// Beside its plane, the axis of its base could help the landing's distance; the throw would leave the plane.
TEST(PlanarJoints, HeldOnesDoNotAccelerate) {
  const Chain arm = ur5();
  const TargetBox box{{0.9, 0.3, 0}};
  NominalOptions search;
  search.samples = 600;
  search.fixed = *planar_joints(arm, ur5_bent(), box.middle);
  double most = 0;
  int solved = 0;
  for (const NominalThrow& one : find_throws(arm, box, search)) {
    TubeProblem problem{arm, one.state, box.middle};
    const auto free = solve_tube(problem);
    problem.held = joints_of(search.fixed);
    const auto tube = solve_tube(problem);
    if (free.outcome != TubeOutcome::solved || tube.outcome != TubeOutcome::solved) continue;
    ++solved;
    const Pose refined = refine_tube(problem, tube.qdd);
    for (const int joint : problem.held) {
      EXPECT_NEAR(tube.qdd[joint], 0, 1e-6);
      EXPECT_NEAR(refined[joint], 0, 1e-6);
      most = std::max(most, std::abs(free.qdd[joint]));
    }
    EXPECT_LE(largest_miss(landings_over_window(problem, refined, 11)),
              largest_miss(landings_over_window(problem, tube.qdd, 11)) + 1e-3);
  }
  EXPECT_GT(solved, 5);
  EXPECT_GT(most, 1e-3) << "if they are asked";
  TubeProblem wrong{arm, {Pose::Zero(6), Pose::Zero(6)}, box.middle};
  wrong.held = {6};
  EXPECT_THROW(solve_tube(wrong), std::invalid_argument);
}

// Stretched out in the middle of its ranges it rests with the tool below its base.
TEST(PlanarJoints, AUr5CannotRestInTheMiddleOfItsRanges) {
  const TargetBox box{{0.9, 0.3, 0}};
  PlanOptions options;
  const auto refused = [&] {
    const auto result = plan_throw(ur5(), box, options);
    EXPECT_EQ(result.outcome, PlanOutcome::no_rest);
    return result.reason;
  };
  const double tip = forward_kinematics(ur5(), Pose(Pose::Zero(6))).p.z();
  ASSERT_LT(tip, 0);
  EXPECT_THAT(refused(), HasSubstr(fmt::format("at rest at (0, 0, 0, 0, 0, 0) deg the arm's lowest joint or "
                                               "what it throws is at {:.3f} m",
                                               tip)));
  options.home = ur5_bent();
  options.home[3] = 7;
  EXPECT_THAT(refused(), HasSubstr("at rest wrist_1 is at 7 rad; accepted: [-6.283, 6.283] rad"));
  Chain arm = ur5();
  arm.home = ur5_bent();
  const auto result = plan_throw(arm, box);
  ASSERT_TRUE(result.plan) << result.reason;
  EXPECT_LT((result.plan->motion.at(result.plan->motion.begin).q - arm.home).norm(), 1e-12);
}

}  // namespace
}  // namespace unhand::planners
