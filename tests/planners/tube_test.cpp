// Tube acceleration: the printed problem, its solution against IPOPT and the nonlinear problem, infeasible
// answers.
#include "planners/tube/tube_cvx.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>
#include <tuple>

#include "planners/arm/panda.hpp"
#include "planners/tube/plan_throw.hpp"
#include "planners/tube/planar_joints.hpp"
#include "tests/planners/ipopt_qp.hpp"

namespace unhand::planners {
namespace {

using Joints = JointVector<double>;

/// The Panda with a gripper of 0.15 m on its flange.
Chain thrower() { return with_tool(panda(), {Eigen::Matrix3d::Identity(), {0, 0, 0.15}}); }
TargetBox box_at(double x, double y, double z) { return {{x, y, z}, 0.15, 0.15}; }
/// The boxes of [DarkoD46] Table 6.
std::vector<TargetBox> boxes() {
  return {box_at(1.3, 0, -0.2), box_at(1.1, 0, 0), box_at(1.3, 0, -0.3), box_at(0, -0.7, 0.7)};
}
NominalOptions planar(const TargetBox& box) {
  NominalOptions out;
  out.fixed = *planar_joints(thrower(), panda_ready(), box.middle);
  return out;
}
NominalOptions few() {
  NominalOptions out;
  out.samples = 600;
  return out;
}

TEST(NominalThrow, LandsInTheMiddleWithinTheLimits) {
  const Chain arm = thrower();
  for (const TargetBox& box : boxes())
    for (const double drag : {0.0, 0.1}) {
      NominalOptions options = few();
      options.samples = drag > 0 ? 60 : 600;
      options.refined = drag > 0 ? 1 : 10;
      options.medium.drag_k = drag;
      const auto found = find_throws(arm, box, options);
      ASSERT_FALSE(found.empty());
      for (std::size_t i = 0; i < found.size(); ++i) {
        const NominalThrow& one = found[i];
        if (i > 0) {
          EXPECT_LE(one.margin, found[i - 1].margin);
        }
        EXPECT_GT(one.margin, 0);
        for (int k = 0; k < 7; ++k) {
          EXPECT_LT(std::abs(one.state.qd[k]), arm.joints[k].limits.velocity);
          EXPECT_GT(one.state.q[k], arm.joints[k].limits.lower);
          EXPECT_LT(one.state.q[k], arm.joints[k].limits.upper);
        }
        const TubeProblem problem{arm, one.state, box.middle, 0.1, options.medium};
        const auto at = landings_over_window(problem, Joints::Zero(7), 1).front();
        ASSERT_TRUE(at.lands);
        // The speed is solved to 1e-10 with drag; the plane regularised by 1e-9.
        EXPECT_LT(std::hypot(at.forward, at.across), drag > 0 ? 1e-5 : 1e-6);
      }
    }
}

TEST(NominalThrow, FliesClearOfTheArmsColumn) {
  const Chain arm = thrower();
  const auto through = [&](const NominalThrow& one, const TargetBox& box) {
    const auto frames = frames_of(arm, one.state.q);
    const Eigen::Vector3d p = frames.tip.p, v = jacobian(arm, one.state.q).topRows<3>() * one.state.qd;
    double top = 0;
    for (int i = 0; i < arm.size(); ++i)
      if (frames.links[i].p.head<2>().norm() < 0.25) top = std::max(top, frames.links[i].p.z());
    for (double t = 0;; t += 1e-3) {
      const Eigen::Vector3d at = p + t * v - Eigen::Vector3d{0, 0, 0.5 * 9.81 * t * t};
      if (v.z() < 9.81 * t && at.z() < box.middle.z()) return false;
      // 1 cm: the search looks at sixty points of the path only.
      if (at.head<2>().norm() < 0.24 && at.z() < top) return true;
    }
  };
  for (const TargetBox& box : {box_at(-0.5, 0, 0), box_at(0.4, 0.2, -0.2), box_at(0, -0.3, 0.3)}) {
    NominalOptions options = few();
    const auto clear = find_throws(arm, box, options);
    options.clear_column = false;
    const auto any = find_throws(arm, box, options);
    EXPECT_FALSE(clear.empty());
    for (const auto& one : clear) EXPECT_FALSE(through(one, box)) << box.middle.transpose();
    EXPECT_TRUE(std::any_of(any.begin(), any.end(), [&](const auto& one) { return through(one, box); }));
  }
}

TEST(NominalThrow, IsTheSameEveryTime) {
  NominalOptions threaded = few();
  threaded.threads = 3;
  const auto a = find_throws(thrower(), boxes()[0], few()), b = find_throws(thrower(), boxes()[0], threaded);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].state.q, b[i].state.q);
}

/// Throws of all kinds, with the box each is for.
std::vector<std::pair<NominalThrow, TargetBox>> throws() {
  std::vector<std::pair<NominalThrow, TargetBox>> out;
  for (const TargetBox& box : boxes())
    for (const auto& one : find_throws(thrower(), box, few())) out.emplace_back(one, box);
  return out;
}

/// [DarkoD46] Eq. 2b to 2l spelt out with nothing but kinematics and the parabola, and the smallest
/// acceleration against its limits.
QuadraticProgram printed_program(const Chain& arm, const ThrowState& at, const TargetBox& box, double T) {
  QuadraticProgram out{QpMatrix::Zero(7, 7), QpVector::Zero(7), {}};
  const Joints q_T = at.q + T * at.qd;
  const auto tip = forward_kinematics(arm, q_T);
  const Eigen::Matrix<double, 3, 7> J = jacobian(arm, q_T).topRows<3>();
  const Eigen::Vector3d e = box.middle - tip.p, still = J * at.qd;
  const Eigen::Vector2d along = e.head<2>().normalized();
  const double g = 9.81, speed = still.head<2>().norm(), z = tip.p.z() - box.middle.z(),
               root = std::sqrt(still.z() * still.z() + 2 * g * z), flight = (still.z() + root) / g,
               phi = -e.head<2>().norm() + speed * flight;
  const QpVector across = J.transpose() * Eigen::Vector3d(-along.y(), along.x(), 0),
                 ahead = J.transpose() * Eigen::Vector3d(along.x(), along.y(), 0), up = J.row(2).transpose();
  out.constraints = {
      {T * across, -across.dot(at.qd), true},
      {flight * T * (ahead + speed / root * up),
       -phi - flight * (ahead.dot(at.qd) - speed + speed / root * (up.dot(at.qd) - still.z())), true}};
  for (int i = 0; i < 7; ++i) {
    const JointLimits& l = arm.joints[i].limits;
    out.H(i, i) = 1 / (l.acceleration * l.acceleration);
    for (const double side : {1.0, -1.0}) {
      const QpVector unit = side * QpVector::Unit(7, i);
      out.constraints.push_back({T * unit, -l.velocity - side * at.qd[i], false});
      out.constraints.push_back({unit, -l.acceleration, false});
    }
  }
  return out;
}

TEST(TubeCvx, SolvesThePrintedProblem) {
  const Chain arm = thrower();
  int solved = 0;
  for (const auto& [one, box] : throws()) {
    const QpSolution printed = solve(printed_program(arm, one.state, box, 0.1));
    const TubeSolution s = solve_tube({arm, one.state, box.middle, 0.1});
    EXPECT_EQ(s.outcome == TubeOutcome::solved, printed.outcome == QpOutcome::solved) << s.reason;
    if (s.outcome != TubeOutcome::solved) continue;
    ++solved;
    EXPECT_LT((s.qdd - printed.x).norm(), 1e-9 * (1 + s.qdd.norm()));
    const Joints q_T = one.state.q + 0.1 * one.state.qd, qd_T = one.state.qd + 0.1 * s.qdd;
    const Eigen::Vector3d e = box.middle - forward_kinematics(arm, q_T).p,
                          v = jacobian(arm, q_T).topRows<3>() * qd_T;
    EXPECT_GT(v.head<2>().dot(e.head<2>()), 0);
  }
  EXPECT_GT(solved, 40);
}

TEST(TubeCvx, AgreesWithIpopt) {
  const auto all = throws();
  int compared = 0;
  for (std::size_t i = 0; i < all.size() && compared < 12; i += 5) {
    const Chain arm = thrower();
    const TubeProblem problem{arm, all[i].first.state, all[i].second.middle, 0.1};
    const TubeSolution own = solve_tube(problem);
    const auto other = solve_by_ipopt(printed_program(arm, all[i].first.state, all[i].second, 0.1));
    EXPECT_EQ(own.outcome == TubeOutcome::solved, other.status <= Ipopt::Solved_To_Acceptable_Level)
        << own.reason;
    if (own.outcome != TubeOutcome::solved) continue;
    ++compared;
    EXPECT_LT((own.qdd - other.x).norm(),
              1e-3 * (1 + own.qdd.norm()));  // an interior point stops short of the bounds
  }
  EXPECT_GT(compared, 3);
}

TEST(TubeCvx, ErrorOfTheConvexProblemIsOfSecondOrder) {
  // What Tube-CVX leaves out, q̈ T²/2 in q_T and the flow map's curvature, is of second order in T, while the
  // landing of an unaccelerated throw moves with the first.
  const Chain arm = thrower();
  int checked = 0;
  for (const auto& one : find_throws(arm, boxes()[3], few())) {
    double miss[3], still[3];
    bool all = true;
    for (int k = 0; k < 3; ++k) {
      const TubeProblem problem{arm, one.state, boxes()[3].middle, 0.004 / (1 << k)};
      const TubeSolution s = solve_tube(problem);
      all = all && s.outcome == TubeOutcome::solved;
      miss[k] = largest_miss(landings_over_window(problem, s.qdd, 2));
      still[k] = largest_miss(landings_over_window(problem, Joints::Zero(7), 2));
    }
    if (!all) continue;
    ++checked;
    for (int k = 0; k < 2;
         ++k) {  // the next order is some per cent of T = 4 ms, and more where the first is small
      EXPECT_NEAR(miss[k] / miss[k + 1], 4, 0.5);
      EXPECT_NEAR(still[k] / still[k + 1], 2, 0.3);
    }
  }
  EXPECT_GT(checked, 5);
}

TEST(TubeCvx, RefinementNeverMissesMore) {
  const Chain arm = thrower();
  double before = 0, after = 0;
  for (const auto& [one, box] : throws()) {
    const TubeProblem problem{arm, one.state, box.middle, 0.1};
    const TubeSolution s = solve_tube(problem);
    if (s.outcome != TubeOutcome::solved) continue;
    const Joints refined = refine_tube(problem, s.qdd);
    const auto squares = [&](const Joints& qdd) {  // at the instants that refinement looks at, with its ease
      double sum = 0;
      for (const auto& at : landings_over_window(problem, qdd, 5)) sum += at.x * at.x + at.y * at.y;
      for (int i = 0; i < 7; ++i) sum += 1e-6 * std::pow(qdd[i] / arm.joints[i].limits.acceleration, 2);
      return sum;
    };
    EXPECT_LE(squares(refined), squares(s.qdd) * (1 + 1e-12));
    for (int i = 0; i < 7; ++i) {
      EXPECT_LE(std::abs(refined[i]), arm.joints[i].limits.acceleration * (1 + 1e-9));
      EXPECT_LE(std::abs(one.state.qd[i] + 0.1 * refined[i]), arm.joints[i].limits.velocity * (1 + 1e-9));
    }
    before += largest_miss(landings_over_window(problem, s.qdd, 11));
    after += largest_miss(landings_over_window(problem, refined, 11));
  }
  EXPECT_LT(after, 0.5 * before);
}

TEST(TubeCvx, SaysWhyThereIsNone) {
  Chain arm = thrower();
  const auto one = find_throws(arm, boxes()[0], planar(boxes()[0])).front();
  const auto answer = [&](const Chain& chain, const ThrowState& state, const Eigen::Vector3d& target) {
    return solve_tube({chain, state, target, 0.1});
  };
  for (Joint& joint : arm.joints) joint.limits.acceleration = 1e-3;
  const auto weak = answer(arm, one.state, boxes()[0].middle);
  EXPECT_EQ(weak.outcome, TubeOutcome::infeasible);
  EXPECT_THAT(weak.reason, testing::StartsWith("cannot hold together: the "));
  EXPECT_THAT(weak.reason, testing::HasSubstr("the acceleration limit of panda_joint"));
  EXPECT_THAT(weak.reason, testing::HasSubstr("the landing"));
  arm = thrower();
  JointLimits& second = arm.joints[1].limits;
  ASSERT_GT(std::abs(one.state.qd[1]), 0.2);
  (one.state.qd[1] > 0 ? second.upper : second.lower) =
      one.state.q[1] + 0.01 * (one.state.qd[1] > 0 ? 1 : -1);
  EXPECT_THAT(answer(arm, one.state, boxes()[0].middle).reason, testing::HasSubstr("panda_joint2 is at"));
  arm = thrower();
  const auto high = answer(arm, one.state, {1.3, 0, 2});
  EXPECT_EQ(high.outcome, TubeOutcome::never_reaches);
  EXPECT_THROW(solve_tube({arm, one.state, {1, 0, 0}, 0}), std::invalid_argument);
  EXPECT_THROW(solve_tube({arm, {Joints::Zero(3), Joints::Zero(7)}, {1, 0, 0}}), std::invalid_argument);
}

TEST(PlanThrow, ReachesTheBoxesWithinTheLimits) {
  const Chain arm = thrower();
  PlanOptions options;
  options.home = Joints{{0, -0.785, 0, -2.356, 0, 1.571, 0.785}};
  for (const TargetBox& box : boxes())
    for (const bool plane : {true, false}) {
      options.search = plane ? planar(box) : NominalOptions{};
      const auto result = plan_throw(arm, box, options);
      ASSERT_EQ(result.outcome, PlanOutcome::planned) << result.reason;
      const ThrowPlan& plan = *result.plan;
      EXPECT_TRUE(check_limits(arm, plan.motion, 1e-4).within()) << plan.limits.worst(arm);
      const auto open = plan.motion.at(0), last = plan.motion.at(0.1),
                 home = plan.motion.at(plan.motion.begin), rest = plan.motion.at(plan.motion.end());
      EXPECT_LT((open.q - plan.nominal.state.q).norm() + (open.qd - plan.nominal.state.qd).norm(), 1e-10);
      EXPECT_LT((open.qdd - plan.qdd).norm(), 1e-6);
      EXPECT_LT((last.qd - plan.nominal.state.qd - 0.1 * plan.qdd).norm(), 1e-10);
      EXPECT_LT((home.q - options.home).norm() + home.qd.norm(), 1e-12);
      EXPECT_LT(rest.qd.norm(), 1e-9);
      EXPECT_LE(largest_miss(plan.landings), 0.075 * std::numbers::sqrt2);
    }
}

TEST(PlanThrow, SaysWhyThereIsNone) {
  PlanOptions options;
  options.search = few();
  EXPECT_EQ(plan_throw(thrower(), box_at(6, 0, 0), options).outcome, PlanOutcome::no_throw);
  for (const TargetBox& inside : {box_at(0, 0, -0.2), box_at(0.1, 0, 0.1)}) {
    const auto own = plan_throw(thrower(), inside, options);
    EXPECT_EQ(own.outcome, PlanOutcome::no_throw);
    EXPECT_THAT(own.reason, testing::HasSubstr("flies through the arm's own column"));
  }
  options.search = planar(boxes()[0]);
  Chain arm = thrower();
  for (Joint& joint : arm.joints) joint.limits.torque = 1;  // it cannot even hold itself
  const auto weak = plan_throw(arm, boxes()[0], options);
  EXPECT_EQ(weak.outcome, PlanOutcome::no_motion);
  EXPECT_THAT(weak.reason, testing::HasSubstr("torque of panda_joint"));
  arm = thrower();
  arm.joints[0].limits.jerk = JointLimits::kNone;
  EXPECT_THROW(plan_throw(arm, boxes()[0]), std::invalid_argument);
}

// The parabola of what leaves at t, from nothing but the tip's place and velocity there.
TEST(TubeCvx, LandingsOverTheWindowAreParabolas) {
  const Chain arm = thrower();
  const TargetBox box = box_at(0.9, -0.5, 0.1);
  const auto one = find_throws(arm, box, few()).front();
  Joints qdd(7);
  qdd << 1, -2, 1.5, -1, 2, 0.5, -3;
  const TubeProblem problem{arm, one.state, box.middle, 0.12};
  constexpr int kSamples = 5;
  const auto landings = landings_over_window(problem, qdd, kSamples);
  ASSERT_EQ(landings.size(), static_cast<std::size_t>(kSamples));
  const Eigen::Vector2d along = (box.middle - forward_kinematics(arm, one.state.q).p).head<2>().normalized();
  for (int k = 0; k < kSamples; ++k) {
    const LandingAt& at = landings[static_cast<std::size_t>(k)];
    const double t = 0.12 * k / (kSamples - 1);
    EXPECT_NEAR(at.time, t, 1e-15);
    const Joints q = one.state.q + t * one.state.qd + 0.5 * t * t * qdd, qd = one.state.qd + t * qdd;
    const Eigen::Vector3d p = forward_kinematics(arm, q).p, v = jacobian(arm, q).topRows<3>() * qd;
    const double flight = (v.z() + std::sqrt(v.z() * v.z() + 2 * 9.81 * (p.z() - box.middle.z()))) / 9.81;
    const Eigen::Vector2d off = (p + flight * v - box.middle).head<2>();
    ASSERT_TRUE(at.lands);
    EXPECT_NEAR(at.x, off.x(), 1e-12);
    EXPECT_NEAR(at.y, off.y(), 1e-12);
    EXPECT_NEAR(at.forward, along.dot(off), 1e-12);
    EXPECT_NEAR(at.across, along.x() * off.y() - along.y() * off.x(), 1e-12);
  }
}

TEST(TubeCvx, TheLargestMissIsADistance) {
  std::vector<LandingAt> landings(3);
  for (LandingAt& one : landings) one.lands = true;
  landings[1].x = -0.03, landings[1].y = 0.04;
  landings[2].x = 0.045;
  EXPECT_DOUBLE_EQ(largest_miss(landings), 0.05);
  landings[1].lands = false;
  EXPECT_EQ(largest_miss(landings), JointLimits::kNone);
}

// The convex problem knows the air: over a short window what it leaves out is small against what moves.
TEST(TubeCvx, ReckonsWithTheDragOfTheFlight) {
  const Chain arm = thrower();
  NominalOptions options = few();
  options.samples = 60;
  options.refined = 0;
  options.medium.drag_k = 0.1;
  int checked = 0;
  for (const auto& one : find_throws(arm, boxes()[3], options)) {
    const TubeProblem problem{arm, one.state, boxes()[3].middle, 0.002, options.medium};
    const TubeSolution s = solve_tube(problem);
    if (s.outcome != TubeOutcome::solved) continue;
    ++checked;
    EXPECT_LT(largest_miss(landings_over_window(problem, s.qdd, 2)),
              0.2 * largest_miss(landings_over_window(problem, Joints::Zero(7), 2)));
  }
  EXPECT_GT(checked, 2);
}

// Whichever way a joint moves, the window ends before it is at its stop.
TEST(TubeCvx, KeepsBothPositionLimitsAtTheWindowsEnd) {
  const auto one = find_throws(thrower(), boxes()[0], planar(boxes()[0])).front();
  int up = 0, down = 0;
  for (int i = 0; i < 7; ++i) {
    const double rate = one.state.qd[i];
    if (std::abs(rate) < 0.2) continue;
    (rate > 0 ? up : down) += 1;
    Chain arm = thrower();
    JointLimits& l = arm.joints[i].limits;
    (rate > 0 ? l.upper : l.lower) = one.state.q[i] + 0.09 * rate;
    EXPECT_THAT(solve_tube({arm, one.state, boxes()[0].middle, 0.1}).reason,
                testing::HasSubstr(fmt::format("panda_joint{} is at", i + 1)));
    EXPECT_THAT(solve_tube({arm, one.state, boxes()[0].middle, 0.08}).reason,
                testing::Not(testing::HasSubstr("is at")));
  }
  EXPECT_GT(up, 0);
  EXPECT_GT(down, 0);
}

TEST(NominalThrow, LeavesRoomForItsWindow) {
  const Chain arm = thrower();
  for (const double window : {0.1, 0.4}) {
    NominalOptions options = few();
    options.window = window;
    const auto found = find_throws(arm, boxes()[0], options);
    ASSERT_FALSE(found.empty());
    for (const auto& one : found)
      for (int i = 0; i < 7; ++i) {
        const JointLimits& l = arm.joints[i].limits;
        const double end = one.state.q[i] + window * one.state.qd[i];
        EXPECT_TRUE(end > l.lower && end < l.upper) << window << ' ' << i;
      }
  }
}

// Planar throws stay in the plane of their target, also where the first joint cannot turn all the way to it.
TEST(NominalThrow, IsInThePlaneOfItsTarget) {
  const Chain arm = thrower();
  for (const TargetBox& box : {box_at(0.6, 1.1, -0.2), box_at(-1.3, 0.1, -0.2), box_at(-1.3, -0.5, -0.2)}) {
    NominalOptions options = planar(box);
    options.samples = 600;
    for (const auto& one : find_throws(arm, box, options)) {
      const auto tip = tip_motion<double>(arm, one.state.q, one.state.qd, Joints::Zero(7));
      const Eigen::Vector3d across = (box.middle - tip.frame.p).cross(Eigen::Vector3d::UnitZ()).normalized();
      EXPECT_NEAR(tip.velocity.dot(across), 0, 1e-6);
      EXPECT_NEAR(tip.frame.R.col(2).dot(across), 0, 1e-6) << "the hand's axis";
      EXPECT_NEAR(one.state.qd[0], 0, 1e-9);
    }
  }
}

// A box that the tube's landings leave is no box that is thrown into.
TEST(PlanThrow, LandsInsideItsBoxFromTheWholeWindow) {
  PlanOptions options;
  options.search = few();
  options.refine = false;
  const TargetBox box{{1.1, 0, 0}, 4e-3, 4e-3};
  const auto result = plan_throw(thrower(), box, options);
  if (result.plan) {
    for (const LandingAt& at : result.plan->landings) EXPECT_TRUE(box.holds(at.x, at.y)) << at.time;
  } else {
    EXPECT_EQ(result.outcome, PlanOutcome::no_tube);
  }
}

TEST(PlanThrow, StaysAboveItsBase) {
  PlanOptions options;
  options.search = few();
  options.home = Joints{{0, 1.5, 0, -1.0, 0, 2.6, 0.785}};
  const Chain arm = thrower();
  ASSERT_LT(forward_kinematics(arm, options.home).p.z(), -0.02);
  EXPECT_EQ(plan_throw(arm, boxes()[0], options).outcome, PlanOutcome::no_rest);
  // Two links that rest level behind their shoulder swing through below it to throw forward.
  Joint shoulder{"shoulder", modified_dh(0, std::numbers::pi / 2, 0), {}, {-3, 3, 4, 40, 5000}};
  shoulder.origin.p.z() = 0.3;
  const Chain links{"links",
                    {shoulder, {"elbow", modified_dh(0.5, 0, 0), {}, {-2.5, 2.5, 6, 60, 5000}}},
                    modified_dh(0.4, 0, 0)};
  options.home = Joints{{-2.95, 0.0}};
  ASSERT_GT(forward_kinematics(links, options.home).p.z(), 0.05);
  const auto below = plan_throw(links, {{1.3, 0, -0.2}}, options);
  EXPECT_EQ(below.outcome, PlanOutcome::no_motion);
  EXPECT_THAT(below.reason, testing::HasSubstr("the arm would come down to -0."));
  options.home = Joints{{2.5, 0.0}};
  EXPECT_EQ(plan_throw(links, {{1.3, 0, -0.2}}, options).outcome, PlanOutcome::planned);
}

// Braking begins with the acceleration of the window: what that adds to a velocity at its limit is left room
// for, where the throw has it.
TEST(PlanThrow, LeavesRoomForItsBrake) {
  const Chain arm = thrower();
  for (const auto& [window, drag, box] : {std::tuple{0.13, 0.2, box_at(1.1, 0, 0)},
                                          {0.2, 0.0, box_at(1.3, 0, -0.2)},
                                          {0.2, 0.0, box_at(1.2, 0, 0)}}) {
    PlanOptions options;
    options.home = panda_ready();
    options.search = planar(box);
    options.search.samples = 100;
    options.search.window = window;
    options.search.medium.drag_k = drag;
    const auto result = plan_throw(arm, box, options);
    ASSERT_TRUE(result.plan) << result.reason;
    EXPECT_TRUE(check_limits(arm, result.plan->motion, 1e-4).within()) << result.plan->limits.worst(arm);
    EXPECT_LE(largest_miss(result.plan->landings), 0.075 * std::numbers::sqrt2);
  }
}

// What a plan says of its limits is what a look as dense finds, not what the first, coarse one did.
TEST(PlanThrow, TellsTheLimitsThatItsMotionUses) {
  const Chain arm = thrower();
  PlanOptions options;
  options.search = planar(boxes()[1]);
  const auto result = plan_throw(arm, boxes()[1], options);
  ASSERT_TRUE(result.plan) << result.reason;
  const LimitCheck dense = check_limits(arm, result.plan->motion);
  const LimitCheck& told = result.plan->limits;
  EXPECT_EQ(told.torque.fraction, dense.torque.fraction);
  EXPECT_EQ(told.position.fraction, dense.position.fraction);
  EXPECT_EQ(told.lowest, dense.lowest);
  EXPECT_EQ(told.torque_rate.value, dense.torque_rate.value);
}

// From any pose to a throw: the way there, the swing and the brake take no more than their share.
TEST(ThrowMotion, KeepsItsShareOfTheLimits) {
  const Chain arm = thrower();
  const auto one = find_throws(arm, boxes()[0], planar(boxes()[0])).front();
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> part(0.2, 0.8);
  for (int k = 0; k < 20; ++k) {
    Joints home(7);
    for (int i = 0; i < 7; ++i)
      home[i] = std::lerp(arm.joints[i].limits.lower, arm.joints[i].limits.upper, part(random));
    for (const double share : {0.9, 0.3}) {
      const auto motion = throw_motion(arm, home, one.state, Joints::Zero(7), 0.1, share);
      ASSERT_TRUE(motion);
      const LimitCheck use = check_limits(arm, *motion, 0.01);
      EXPECT_LE(use.acceleration.fraction, share * (1 + 1e-9)) << k;
      EXPECT_LE(use.jerk.fraction, share * (1 + 1e-9)) << k;
      EXPECT_LE(use.velocity.fraction, 1) << k;
    }
  }
}

}  // namespace
}  // namespace unhand::planners
