// Throws whose object leaves as a contact model says: the hand, limits in closed form, derivatives, spread.
#include "planners/tube/insensitive_throw.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "planners/arm/panda.hpp"
#include "planners/tube/held_motion.hpp"
#include "planners/tube/plan_throw.hpp"
#include "planners/tube/planar_hand.hpp"
#include "planners/tube/planar_joints.hpp"
#include "planners/tube/robust_throw.hpp"

namespace unhand::planners {
namespace {

using Joints = JointVector<double>;

Chain pads() { return with_tool(panda(), {Eigen::Matrix3d::Identity(), {0, 0, 0.15}}); }

/// A planar swing of joints 2, 4 and 6 towards a box 1.3 m ahead.
ReleaseThrow swing(const Chain& arm) {
  ReleaseThrow out{arm,
                   {Joints{{0, -0.98, 0, -0.68, 0, 2.25, 0.785}}, Joints{{0, 1.5, 0, -1.5, 0, -1.6, 0}}},
                   Joints{{0, 0.5, 0, -0.8, 0, -0.4, 0}},
                   {1.3, 0, -0.2}};
  out.hold = 0.14;
  return out;
}

TEST(PlanarHand, IsTheTipOfTheArm) {
  const Chain arm = pads();
  const ReleaseThrow p = swing(arm);
  const ThrowPlane plane(forward_kinematics(arm, p.start.q).p, p.target);
  const PlanarHand hand(arm, plane, p.start.q, p.start.qd.cast<Dual>(), p.qdd.cast<Dual>(), p.hold);
  for (double t = 0; t <= p.hold; t += p.hold / 23) {
    const Joints q = p.start.q + t * p.start.qd + 0.5 * t * t * p.qdd, qd = p.start.qd + t * p.qdd;
    const auto tip = tip_motion(arm, q, qd, p.qdd);
    const auto at = hand.at({0, p.hold}, t);
    // The remainder of a polynomial of degree 8 over 0.14 s.
    EXPECT_NEAR(at.pose.x, tip.frame.p.x() - 1.3, 1e-9);
    EXPECT_NEAR(at.pose.z, tip.frame.p.z(), 1e-9);
    EXPECT_NEAR(std::cos(at.pose.theta), tip.frame.R(0, 2), 1e-9);
    EXPECT_NEAR(at.twist.vx, tip.velocity.x(), 1e-7);
    EXPECT_NEAR(at.twist.vz, tip.velocity.z(), 1e-7);
    EXPECT_NEAR(at.twist.omega, -tip.omega.y(), 1e-7);  // x to z turns about −y
    EXPECT_NEAR(at.acceleration.ax, tip.acceleration.x(), 1e-5);
    EXPECT_NEAR(at.acceleration.az, tip.acceleration.z(), 1e-5);
    EXPECT_NEAR(at.acceleration.alpha, -tip.alpha.y(), 1e-5);
  }
}

TEST(PlanarHand, RefusesAThrowOutOfThePlane) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.start.qd[0] = 0.5;
  EXPECT_THROW(release_landing(p, nominal_draw(p)), std::invalid_argument);
}

TEST(ReleaseThrow, OfAGripperThatOpensAtOnceIsTheRigidOne) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  for (const char* model : {"sliding_pivot", "limit_surface"}) {
    p.card.model = model;
    double last = 0;
    for (const double opening : {4e-3, 1e-3, 2.5e-4}) {
      p.card.opening_time = {opening, 0};
      p.card.grip_force = 400;  // so that it does not slip before
      const auto real = release_landing(p, nominal_draw(p));
      const auto rigid = rigid_landing(p, 0.14, 0.020 + opening);
      ASSERT_TRUE(real && rigid);
      const double apart = std::abs(real->miss - rigid->miss);
      if (last > 0) {
        EXPECT_LT(apart, 0.6 * last) << model;
      }
      last = apart;
    }
    EXPECT_LT(last, 2e-3) << model;
  }
}

TEST(ReleaseThrow, DerivativesAreCentralDifferences) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  for (const char* model : {"sliding_pivot", "limit_surface"}) {
    p.card.model = model;
    const auto spread = release_spread(p);
    ASSERT_TRUE(spread);
    for (int k = 0; k < kUnknowns; ++k) {
      const double size = k == kGraspAngle ? 1 : nominal_draw(p)[k];  // rad; its own value is 0
      double best = INFINITY;
      for (double step = 1e-1; step > 1e-6; step *= 0.1) {
        Draw up = nominal_draw(p), down = up;
        up[k] += step * size, down[k] -= step * size;
        const auto a = release_landing(p, up), b = release_landing(p, down);
        if (!a || !b) continue;
        best = std::min(best, std::abs((a->miss - b->miss) / (2 * step) - spread->gradient[k] * size));
      }
      // Landings in m per 100 % of the unknown; the integrator's 1e-8 over the best step.
      EXPECT_LT(best, 1e-4) << model << ' ' << name_of(static_cast<Unknown>(k));
    }
  }
}

TEST(ReleaseThrow, LinearSpreadIsThatOfDraws) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.mu.sigma *= 0.2, p.card.dead_time.sigma *= 0.2, p.card.opening_time.sigma *= 0.2;
  p.object.com_offset.sigma *= 0.2;
  const auto spread = release_spread(p);
  const auto drawn = draw_landings(p, 400, 1);
  ASSERT_TRUE(spread);
  EXPECT_EQ(drawn.lost, 0);
  // The standard deviation of 400 draws scatters by 1/√800 = 3.5 %; four of those and a little curvature.
  EXPECT_NEAR(drawn.std, spread->spread, 0.18 * spread->spread);
  EXPECT_NEAR(drawn.mean, spread->miss, 0.25 * spread->spread);
}

/// A grip that slides and turns for long, so that pads and object matter.
ReleaseThrow weak_swing(const Chain& arm) {
  ReleaseThrow out = swing(arm);
  out.qdd *= 4;
  out.card.mu.sigma = out.card.dead_time.sigma = out.card.opening_time.sigma = 0;
  out.card.grip_force = 30;
  out.object.com_offset.sigma = 0;
  return out;
}

// What is not known of the pads and of the object widens the landings by what a finite difference says.
TEST(ReleaseThrow, SigmasOfPadsAndObjectCount) {
  const Chain arm = pads();
  for (const Unknown k : {kLength, kShape, kMass, kInertia}) {
    ReleaseThrow p = weak_swing(arm);
    const double value = nominal_draw(p)[k], sigma = 0.05 * value;
    EXPECT_EQ(release_spread(p)->spread, 0);
    (k == kLength  ? p.card.length_sigma
     : k == kShape ? p.card.shape_sigma
     : k == kMass  ? p.object.mass_sigma
                   : p.object.inertia_sigma) = sigma;
    Draw up = nominal_draw(p), down = up;
    up[k] += 0.2 * sigma, down[k] -= 0.2 * sigma;
    const auto a = release_landing(p, up), b = release_landing(p, down);
    ASSERT_TRUE(a && b) << name_of(k);
    const double expected = std::abs(a->miss - b->miss) / 0.4;
    EXPECT_GT(expected, k == kInertia ? 1e-6 : 2e-5) << name_of(k) << ": it matters to the landing";
    EXPECT_NEAR(release_spread(p)->spread, expected, 0.02 * expected) << name_of(k);
    // The standard deviation of 200 draws scatters by 5 %: four of those, and some curvature.
    const Landings drawn = draw_landings(p, 200, 1);
    EXPECT_EQ(drawn.lost, 0) << name_of(k);
    EXPECT_NEAR(drawn.std, expected, 0.3 * expected) << name_of(k);
  }
}

TEST(ReleaseThrow, InsensitiveMotionsMissLess) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.model = "sliding_pivot";
  const auto result = make_insensitive(p, {1, 3, 5});
  EXPECT_LT(result.after, 0.5 * result.before);
  const auto before = draw_landings(p, 300, 1);
  for (const int j : {1, 3, 5}) {
    const JointLimits& l = arm.joints[j].limits;
    EXPECT_LE(std::abs(result.start.qd[j]), l.velocity);
    EXPECT_LE(std::abs(result.start.qd[j] + p.hold * result.qdd[j]), l.velocity);
    EXPECT_LE(std::abs(result.qdd[j]), l.acceleration);
  }
  p.start = result.start;
  p.qdd = result.qdd;
  const auto after = draw_landings(p, 300, 1);
  const auto rms = [](const Landings& l) { return std::hypot(l.mean, l.std); };
  EXPECT_LT(rms(after), 0.6 * rms(before));
  EXPECT_NEAR(rms(after), result.after, 0.3 * result.after);
  EXPECT_THROW(make_insensitive(p, {}), std::invalid_argument);
}

// With a gripper, from ready pose to rest; the spread of its landing against the tube's.
TEST(RobustThrow, IsPlannedForAPandaWithAGripper) {
  const Chain arm = with_gripper(panda(), 0.15, 0.9);
  const TargetBox box{{1.3, 0, -0.2}};
  ReleaseCard card;
  EXPECT_NEAR(window_for(card), 0.080 + 4 * std::hypot(0.005, 0.006), 1e-12);
  ReleaseCard sticky = card;  // pads that stick let go when that has died
  sticky.friction.adhesion = 1, sticky.friction.parting_time = 0.03;
  EXPECT_NEAR(window_for(sticky), window_for(card) + 0.03, 1e-12);
  PlanOptions options;
  options.home = panda_ready();
  options.search.fixed = *planar_joints(arm, options.home, box.middle);
  options.search.window = window_for(card);
  const HeldObject object;
  const auto tube = plan_throw(with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, object.com_offset.value}}),
                               box, options);
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p{arm, tube.plan->nominal.state, tube.plan->qdd, box.middle};
  p.hold = options.search.window + 1e-6;
  p.card = card;
  const auto before = draw_landings(p, 100, 1);
  const auto robust = plan_robust_throw(p, options.home);
  ASSERT_TRUE(robust);
  p.start = robust->choice.start;
  p.qdd = robust->choice.qdd;
  const auto after = draw_landings(p, 100, 1);
  EXPECT_LT(after.std, before.std);
  EXPECT_LT(std::abs(after.mean), box.length_x / 2);
  EXPECT_TRUE(check_limits(arm, robust->motion, 5e-4).within());
  const auto at = robust->motion.at(0), end = robust->motion.at(robust->motion.end());
  EXPECT_LT((at.q - p.start.q).norm() + (at.qd - p.start.qd).norm(), 1e-9);
  EXPECT_LT(end.qd.norm(), 1e-9);
  EXPECT_LT((robust->motion.at(robust->motion.begin).q - panda_ready()).norm(), 1e-9);
}

/// A tube throw of a bar held 0.14 m beside its centre of mass.
struct BarThrow {
  Chain arm = with_gripper(panda(), 0.15, 0.9);
  TargetBox box{{1.3, 0, -0.2}};
  ReleaseCard card;
  HeldObject object;
  PlanOptions options;

  BarThrow() {
    options.home = panda_ready();
    options.search.fixed = *planar_joints(arm, options.home, box.middle);
    options.search.window = window_for(card);
  }
  ReleaseThrow release(const ThrowPlan& plan) const {
    ReleaseThrow p{arm, plan.nominal.state, plan.qdd, box.middle};
    p.hold = options.search.window + 1e-6;
    p.card = card;
    p.object = object;
    return p;
  }
  PlanResult plan() const {
    return plan_throw(with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, object.com_offset.value}}), box,
                      options);
  }
};

// At its needed force the torque of the pads' ellipsoid is used up where the load is largest: the wrench from
// the arm's own kinematics.
TEST(HeldMotion, NeedsTheForceThatTheLargestLoadTakes) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  for (const double angle : {0.0, 0.3}) {  // of the bar against the hand, counter-clockwise from x to z
    ReleaseThrow p = bar.release(*tube.plan);
    p.object.angle = angle;
    const Eigen::AngleAxisd turn(angle, Eigen::Vector3d(0, -1, 0));
    const auto needed = HeldMotion(p, tube.plan->motion, 1e-3).needed_force();
    ASSERT_TRUE(needed);
    double most = 0;
    for (double t = tube.plan->motion.begin; t <= 0; t += 1e-3) {
      const auto s = tube.plan->motion.at(t);
      const auto tip = tip_motion<double>(bar.arm, s.q, s.qd, s.qdd);
      const Eigen::Vector3d r = 0.14 * (turn * tip.frame.R.col(2)),
                            a = tip.acceleration + tip.alpha.cross(r) + tip.omega.cross(tip.omega.cross(r)),
                            f = p.object.mass * (a + Eigen::Vector3d(0, 0, p.medium.gravity)),
                            torque = p.object.inertia * tip.alpha + r.cross(f);
      // f² + (τ/L)² = (n μ N)²
      most = std::max(most, std::hypot(f.norm(), torque.y() / p.card.length));
    }
    EXPECT_NEAR(*needed, most / (p.card.pads * p.card.mu.value), 5e-3 * *needed) << angle;
    ReleaseThrow weaker = p;
    weaker.card.grip_force = 0.99 * *needed;
    EXPECT_FALSE(HeldMotion(weaker, tube.plan->motion).holds(nominal_draw(p)));
    EXPECT_THAT(why_not_held(weaker, tube.plan->motion), testing::HasSubstr("needs at least"));
    weaker.card.grip_force = 1.01 * *needed;
    EXPECT_TRUE(HeldMotion(weaker, tube.plan->motion).holds(nominal_draw(p)));
  }
}

TEST(HeldMotion, PadsThatGiveHoldWhatRigidOnesDo) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  const auto rigid = HeldMotion(p, tube.plan->motion).needed_force();
  p.card.friction.compliance = 1e-7;  // m/N
  p.card.friction.loss_time = 0.005;
  EXPECT_EQ(HeldMotion(p, tube.plan->motion).needed_force(), rigid);
}

// A draw that slips while the arm swings has no landing, wherever a release from rest in the hand would go.
TEST(HeldMotion, DrawsThatSlipBeforeTheGripperOpensAreLost) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.card.grip_force = *HeldMotion(p, tube.plan->motion).needed_force();
  const HeldMotion before(p, tube.plan->motion);
  const Landings drawn = draw_landings(p, 200, 1, &before);
  EXPECT_GT(drawn.lost, 60);  // half of the draws have less friction, or a longer lever
  EXPECT_LT(drawn.lost, 140);
  p.card.grip_force = 1;
  EXPECT_EQ(draw_landings(p, 50, 1).lost, 50) << "slips at t = 0";
}

// A heavier draw may slip out of a grip that holds the nominal object.
TEST(HeldMotion, DrawsTheObjectsMass) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.card.grip_force = 1.02 * *HeldMotion(p, tube.plan->motion).needed_force();
  const HeldMotion held(p, tube.plan->motion);
  Draw draw = nominal_draw(p);
  EXPECT_TRUE(held.holds(draw));
  draw[kMass] *= 1.2;
  EXPECT_FALSE(held.holds(draw));
  draw = nominal_draw(p);
  draw[kLength] *= 0.8;
  EXPECT_FALSE(held.holds(draw));
}

TEST(RobustThrow, IsNotPlannedWhereTheGripDoesNotHold) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.card.grip_force = 1;
  std::string reason;
  EXPECT_FALSE(plan_robust_throw(p, bar.options.home, &reason));
  EXPECT_THAT(reason, testing::HasSubstr("a grip of 1 N per pad lets the object slip before"));
}

// A grip that hardly holds its object over the fastest swing drops fewer draws over a slower one.
TEST(RobustThrow, TakesTheSwingInWhichTheFewestDrawsSlip) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.card.mu.sigma = 0.1 * p.card.mu.value;
  ASSERT_TRUE(plan_robust_throw(p, bar.options.home));
  // The grip that the fastest swing needs with the nominal draw: half of the draws have less friction.
  const auto choice = make_insensitive(p, {1, 3, 5});
  ReleaseThrow chosen = p;
  chosen.start = choice.start, chosen.qdd = choice.qdd;
  const auto fastest = throw_motion(bar.arm, bar.options.home, choice.start, choice.qdd, p.hold, 0.9);
  ASSERT_TRUE(fastest);
  const auto needed = HeldMotion(chosen, *fastest).needed_force();
  ASSERT_TRUE(needed);
  p.card.grip_force = 1.03 * *needed;
  const auto robust = plan_robust_throw(p, bar.options.home);
  ASSERT_TRUE(robust);
  ReleaseThrow taken = p;
  taken.start = robust->choice.start, taken.qdd = robust->choice.qdd;
  int least = RobustThrow::kDraws, most = 0;
  for (const double share : {0.9, 0.65, 0.45, 0.3}) {
    const auto motion = throw_motion(bar.arm, bar.options.home, taken.start, taken.qdd, p.hold, share);
    if (!motion || !check_limits(bar.arm, *motion).within() || !why_not_held(taken, *motion).empty())
      continue;
    const int dropped = HeldMotion(taken, *motion).drops(RobustThrow::kDraws, 1);
    least = std::min(least, dropped), most = std::max(most, dropped);
  }
  EXPECT_LT(least, most);  // there is a choice
  EXPECT_EQ(robust->dropped, least);
  // What slips in the hand is lost.
  EXPECT_LE(robust->dropped, [&] {
    const HeldMotion before(taken, robust->motion);
    return draw_landings(taken, RobustThrow::kDraws, 1, &before).lost;
  }());
}

// A bar whose centre of mass is behind the pads: the tube's motion stays above the base, the fastest one to
// the insensitive throw would dip the pads below it.
TEST(RobustThrow, StaysAboveItsBase) {
  BarThrow bar;
  bar.box = {{1.0, 0, -0.1}};
  bar.card = {"limit_surface_disc", {0.5004, 0.022},  0.007066, 2, 59.81,
              {0.01002, 0.0015},    {0.0704, 0.0014}, 2.0};
  bar.card.grasp_angle = 8.6e-4;
  bar.object = {0.246, 1.21e-3, {-0.1, 0.002}};
  bar.options.search.window = 0.1;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  // The motion to what would be least sensitive swings the pads below the base.
  std::string reason;
  EXPECT_FALSE(plan_robust_throw(bar.release(*tube.plan), bar.options.home, &reason));
  EXPECT_THAT(reason, testing::HasSubstr("it would come down to -0.0"));
}

TEST(RobustThrow, SaysWhyThereIsNothingToMinimise) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.card.dead_time.sigma = 0.2;  // longer than the motion goes on
  std::string reason;
  EXPECT_FALSE(plan_robust_throw(p, bar.options.home, &reason));
  EXPECT_THAT(reason, testing::HasSubstr("a draw of dead_time within its spread does not land"));
}

// Friction known to no better than its own size and more: draws stay within what pads may have.
TEST(ReleaseThrow, DrawsFrictionThatPadsMayHave) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.mu.sigma = 20;
  EXPECT_NO_THROW(draw_landings(p, 50, 1));
  EXPECT_NO_THROW(make_insensitive(p, {1, 3, 5}));
}

TEST(ReleaseCard, NamesTheSigmasThatItPassesOver) {
  datasets::ModelCard card;
  card.model = "limit_surface_quartic";
  card.parameters = {{"mu", {0.6, 0.03, "-"}},
                     {"length", {0.008, 1e-3, "m"}},
                     {"shape", {2, 0.1, "-"}},
                     {"kappa", {1.5, 0.2, "-"}}};
  const ReleaseCard taken = release_card(card, "card.json");
  EXPECT_THAT(taken.passed_over, testing::ElementsAre("kappa"));
  EXPECT_EQ(taken.length_sigma, 1e-3);
  EXPECT_EQ(taken.shape_sigma, 0.1);
}

// What the search offers first strains the grip; a plan over which it holds comes after, or none does.
TEST(PlanThrow, PassesOverMotionsThatAreRefused) {
  BarThrow bar;
  int refused = 0;
  bar.options.refuse = [&](const ThrowPlan&) { return refused++ < 5 ? "not this one" : ""; };
  const auto plan = bar.plan();
  ASSERT_TRUE(plan.plan);
  EXPECT_GT(plan.tried, 1);
  bar.options.refuse = [](const ThrowPlan&) { return "none"; };
  const auto none = bar.plan();
  EXPECT_EQ(none.outcome, PlanOutcome::no_motion);
  EXPECT_EQ(none.reason, "none");
}

TEST(ReleaseThrow, TakesModelCards) {
  datasets::ModelCard card;
  card.model = "sliding_pivot";
  card.parameters = {
      {"mu", {0.6, 0.03, "-"}}, {"length", {0.008, {}, "m"}}, {"opening_time", {0.05, 0.002, "s"}}};
  card.own_spreads["mu_deviation"] = {0.1, "-"};
  const ReleaseCard taken = release_card(card, "card.json");
  EXPECT_EQ(taken.model, "sliding_pivot");
  EXPECT_NEAR(taken.mu.sigma, std::hypot(0.03, 0.06), 1e-15);
  EXPECT_EQ(taken.opening_time.sigma, 0.002);
  EXPECT_EQ(taken.dead_time.value, ReleaseCard{}.dead_time.value);
  card.parameters["mu"].unit = "N";
  EXPECT_THROW(release_card(card, "card.json"), datasets::CardError);
  card.parameters["mu"].unit = "-";
  card.effects = {"release.hand_tracking_lag"};
  EXPECT_THROW(release_card(card, "card.json"), datasets::CardError);
  card.effects.clear();
  for (const char* model : {"gripper_delay", "limit_surface_naive", "projectile", "convex_quartic"}) {
    card.model = model;
    EXPECT_THAT(
        [&] { release_card(card, "card.json"); },
        testing::ThrowsMessage<datasets::CardError>(testing::HasSubstr(fmt::format(
            "card.json: /model: '{}' does not say how the pads let go (there are: sliding_pivot, ", model))));
  }
}

datasets::ModelCard quartic(double kappa) {
  datasets::ModelCard card;
  card.model = "limit_surface_quartic";
  card.parameters = {{"mu", {0.4, 0.01, "-"}}, {"length", {0.01, {}, "m"}}, {"kappa", {kappa, {}, "-"}}};
  return card;
}

// Where force and torque act together, κ is how much of both there is: a grip that slides and turns for long.
TEST(ReleaseThrow, FollowsTheShapeOfItsCard) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.qdd *= 4;  // the swing itself is close to free fall, which asks nothing of the pads
  const auto lands = [&](double kappa) {
    p.card = release_card(quartic(kappa), "card.json");
    p.card.grip_force = 4;
    const auto at = release_landing(p, nominal_draw(p));
    EXPECT_TRUE(at) << kappa;
    return at ? at->miss : NAN;
  };
  const double lean = lands(0.3), full = lands(2.7), ellipsoid = lands(1);
  EXPECT_GT(std::abs(lean - full), 1e-3);
  p.card.model = "limit_surface";
  p.card.law_values.clear();
  const auto exact = release_landing(p, nominal_draw(p));
  ASSERT_TRUE(exact);
  EXPECT_NEAR(ellipsoid, exact->miss, 1e-6);  // the quartic of κ = 1 is the ellipsoid; the integrator's 1e-8
}

TEST(ReleaseCard, RefusesWhatItDoesNotTake) {
  const auto expect_refused = [](const datasets::ModelCard& card, const char* why) {
    EXPECT_THAT([&] { release_card(card, "card.json"); },
                testing::ThrowsMessage<datasets::CardError>(testing::HasSubstr(why)));
  };
  EXPECT_NO_THROW(release_card(quartic(2.7), "card.json"));
  expect_refused(quartic(3.1), "/parameters/kappa/value");
  datasets::ModelCard card = quartic(1);
  card.parameters["mu"].value = 11;  // contact::Patch takes no more than contact::kMostMu
  expect_refused(card, "card.json");
  expect_refused(card, "/parameters/mu/value");
  expect_refused(card, "is 11; accepted: (0, 10]");
  card.parameters["mu"].value = 10;
  EXPECT_NO_THROW(release_card(card, "card.json"));
  card.parameters["length"].value = 0.7;
  expect_refused(card, "/parameters/length/value");
  card = quartic(1);
  card.model = "sliding_pivot";
  expect_refused(card, "/parameters/kappa");
  card = quartic(1);
  card.parameters["stiffness"] = {1, {}, "N/m"};
  expect_refused(card, "/parameters/stiffness");
  card = quartic(1);
  card.own_spreads["tilt"] = {0.1, "rad"};
  expect_refused(card, "/own_spreads/tilt");
  card = quartic(1);
  card.own_spreads["dead_time_deviation"] = {0.1, "ms"};
  expect_refused(card, "/own_spreads/dead_time_deviation/unit");
  card = quartic(1);
  card.effects = {"flight.quadratic_drag"};
  expect_refused(card, "flight.quadratic_drag");
  card = quartic(1);
  card.effects = {"contact.viscous"};
  card.parameters["contact.viscous.1/v_0"] = {1, {}, "1/s"};
  expect_refused(card, "/parameters/contact.viscous.1/v_0/unit");
  card.parameters["contact.viscous.1/v_0"] = {500, {}, "s/m"};
  expect_refused(card, "/parameters/contact.viscous.1/v_0/value");
  card = quartic(1);
  card.effects = {"contact.soft_patch_radius"};
  card.parameters["contact.soft_patch_radius.gamma"] = {0.3, {}, "-"};
  expect_refused(card, "f_0 = 0");
  card = quartic(1);
  card.parameters["reference_force"] = {20, {}, "N"};  // every fit's card has it
  card.own_spreads["force_deviation"] = {1, "-"};
  card.own_spreads["grasp_across"] = {2e-4, "m"};
  EXPECT_NO_THROW(release_card(card, "card.json"));
}

/// A card of the disc with some effects.
datasets::ModelCard disc_with(const std::vector<std::string>& effects,
                              const std::map<std::string, datasets::CardParameter>& parameters) {
  datasets::ModelCard card;
  card.model = "limit_surface_disc";
  card.parameters = parameters;
  card.parameters["mu"] = {0.5, 0.01, "-"};
  card.parameters["reference_force"] = {40, {}, "N"};
  card.parameters["grip_force"] = {6, {}, "N"};
  card.parameters["opening_time"] = {0.11, {}, "s"};
  card.effects = effects;
  return card;
}

TEST(ReleaseCard, EffectsOnFrictionActInTheRelease) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  const auto landing_of = [&](const std::vector<std::string>& effects,
                              const std::map<std::string, datasets::CardParameter>& parameters) {
    p.card = release_card(disc_with(effects, parameters), "card.json");
    return release_landing(p, nominal_draw(p)).value();
  };
  const ReleaseLanding rigid = landing_of({}, {});
  const auto with_give = [&](double compliance) {
    return landing_of({"contact.pad_compliance"},
                      {{"contact.pad_compliance.compliance", {compliance, {}, "m/N"}},
                       {"contact.pad_compliance.loss_time", {0.005, {}, "s"}}});
  };
  EXPECT_EQ(with_give(0).miss, rigid.miss);  // fitted along, and nothing there
  EXPECT_NEAR(with_give(1e-8).miss, rigid.miss, 1e-3);
  EXPECT_GT(std::abs(with_give(3e-5).miss - rigid.miss), 1e-3);
  // Adhesion holds on for the parting time.
  const ReleaseLanding stuck = landing_of(
      {"contact.adhesion"},
      {{"contact.adhesion.f_adh", {1, 0.1, "N"}}, {"contact.adhesion.parting_time", {0.004, {}, "s"}}});
  EXPECT_NEAR(stuck.detach_time, rigid.detach_time + 0.004, 1e-9);
  EXPECT_THAT(p.card.passed_over, testing::ElementsAre("contact.adhesion.f_adh"));
  // Friction that grows with speed is a friction that is larger by what the pads slip at, below 1 m/s.
  constexpr double kViscous = 0.5;  // s/m
  const ReleaseLanding viscous =
      landing_of({"contact.viscous"}, {{"contact.viscous.1/v_0", {kViscous, {}, "s/m"}}});
  const double speed =
      (viscous.miss - rigid.miss) / (release_spread(p).value().gradient[kMu] * p.card.mu.value * kViscous);
  EXPECT_GT(speed, 0.01);
  EXPECT_LT(speed, 1);
  // A sensor's error is no part of a throw.
  EXPECT_EQ(landing_of({"sensor.length_scale"}, {{"sensor.length_scale.scale", {1.01, 0.001, "-"}}}).miss,
            rigid.miss);

  with_give(1e-5);  // and derivatives go with it
  const auto spread = release_spread(p).value();
  Draw up = nominal_draw(p), down = up;
  up[kMu] += 1e-4, down[kMu] -= 1e-4;
  EXPECT_NEAR((release_landing(p, up)->miss - release_landing(p, down)->miss) / 2e-4, spread.gradient[kMu],
              1e-3 * std::abs(spread.gradient[kMu]) + 1e-4);
}

TEST(ReleaseCard, CountsWhatScattersFromThrowToThrow) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  datasets::ModelCard card = quartic(1.6);
  card.parameters["dead_time"] = {0.02, 0.003, "s"};
  const ReleaseCard still = release_card(card, "card.json");
  EXPECT_EQ(still.dead_time.sigma, 0.003);
  p.card = still;
  const auto before = release_spread(p);
  card.own_spreads = {
      {"dead_time_deviation", {0.004, "s"}}, {"grasp_offset", {0.003, "m"}}, {"grasp_angle", {0.02, "rad"}}};
  p.card = release_card(card, "card.json");
  EXPECT_DOUBLE_EQ(p.card.dead_time.sigma, 0.005);  // 3, 4, 5
  EXPECT_EQ(p.card.origins.at("dead_time").sigma, NumberSource::parameter);
  EXPECT_THAT(p.card.origins.at("dead_time").with, testing::ElementsAre("dead_time_deviation"));
  EXPECT_THAT(p.card.origins.at("mu").with, testing::IsEmpty());
  EXPECT_THAT(p.card.origins.at("mu").counted_in, testing::IsEmpty());
  const auto after = release_spread(p);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(after->miss, before->miss);
  const auto& g = after->gradient;
  const double added = std::pow(g[kDeadTime] * 0.004, 2) + std::pow(g[kComOffset] * 0.003, 2) +
                       std::pow(g[kGraspAngle] * 0.02, 2);
  for (const Unknown k : {kDeadTime, kComOffset, kGraspAngle}) EXPECT_NE(g[k], 0) << name_of(k);
  EXPECT_NEAR(after->spread * after->spread, before->spread * before->spread + added, 1e-12);
  card.parameters.erase("dead_time");
  EXPECT_EQ(release_card(card, "card.json").origins.at("dead_time").sigma, NumberSource::widened);
}

TEST(ReleaseCard, TakesTheGripperThatItsThrowsHad) {
  datasets::ModelCard card = quartic(1.6);
  card.valid_range = {{"grip_force", {48, 52, "N"}}, {"opening_time", {0.03, 0.036, "s"}}};
  const ReleaseCard seen = release_card(card, "card.json");
  EXPECT_DOUBLE_EQ(seen.grip_force, 50);
  EXPECT_DOUBLE_EQ(seen.opening_time.value, 0.033);
  EXPECT_DOUBLE_EQ(seen.opening_time.sigma, 0.006 / std::sqrt(12.0));
  // Friction holds mu grip_force: 4 N of an even spread are less than the 3 % that are taken at least.
  EXPECT_DOUBLE_EQ(seen.mu.sigma, std::hypot(0.01, 0.4 * 0.03));
  EXPECT_EQ(seen.origins.at("grip_force").value, NumberSource::range);
  EXPECT_EQ(seen.origins.at("mu").value, NumberSource::parameter);
  EXPECT_FALSE(seen.origins.contains("dead_time"));  // nothing tells it
  EXPECT_THAT(seen.origins.at("mu").with, testing::ElementsAre("grip_force"));
  EXPECT_EQ(seen.origins.at("grip_force").counted_in, "mu");
  card.valid_range["dead_time"] = {0.006, 0.008, "s"};
  card.valid_range["shape"] = {1.9, 2.1, "-"};
  const ReleaseCard whole = release_card(card, "card.json");
  EXPECT_DOUBLE_EQ(whole.dead_time.value, 0.007);
  EXPECT_DOUBLE_EQ(whole.dead_time.sigma, kLeastOpeningSigma) << "an even spread of 2 ms is less";
  EXPECT_DOUBLE_EQ(whole.shape, 2);
  EXPECT_EQ(whole.origins.at("dead_time").value, NumberSource::range);

  // Fitted numbers go before the range; of mu and the force a fit knows the product better than either.
  card.parameters["grip_force"] = {30, 6, "N"};
  card.parameters["mu"] = {0.4, 0.08, "-"};
  card.covariance = {{"mu", "grip_force"}, {0.08 * 0.08, -0.99 * 0.08 * 6, -0.99 * 0.08 * 6, 36}};
  const ReleaseCard fitted = release_card(card, "card.json");
  EXPECT_EQ(fitted.grip_force, 30);
  EXPECT_EQ(fitted.origins.at("grip_force").value, NumberSource::parameter);
  EXPECT_NEAR(fitted.mu.sigma, 0.08 * std::sqrt(2 - 2 * 0.99), 1e-15);  // both are known to 20 %

  card.valid_range["opening_time"].unit = "ms";
  EXPECT_THROW(release_card(card, "card.json"), datasets::CardError);
}

TEST(ReleaseCard, RefusesNumbersThatNoGripperHas) {
  const auto read_with = [](const std::string& name, const std::string& unit, double value) {
    datasets::ModelCard card;
    card.model = "limit_surface";
    card.parameters[name] = {value, {}, unit};
    release_card(card, "card.json");
  };
  const auto expect_refused = [&](const std::string& name, const std::string& unit, double value) {
    EXPECT_THAT([&] { read_with(name, unit, value); },
                testing::ThrowsMessage<datasets::CardError>(
                    testing::HasSubstr("card.json: /parameters/" + name + "/value")));
  };
  expect_refused("mu", "-", 0);
  expect_refused("mu", "-", std::nan(""));
  expect_refused("length", "m", -1e-3);
  expect_refused("opening_time", "s", 0);
  expect_refused("dead_time", "s", -1e-3);
  expect_refused("shape", "-", 0);
  for (const double pads : {0.0, 0.5, 2.5, 1e300}) expect_refused("pads", "-", pads);
  EXPECT_NO_THROW(read_with("dead_time", "s", 0));  // of a gripper that opens at once
  EXPECT_NO_THROW(read_with("pads", "-", 1));
}

TEST(ReleaseThrow, OfAGripperWithoutDeadTimeIsDrawn) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.dead_time = {0, 0};
  p.card.mu.sigma = p.card.opening_time.sigma = p.object.com_offset.sigma = 0;
  const Landings same = draw_landings(p, 3, 1);
  const auto nominal = release_landing(p, nominal_draw(p));
  ASSERT_TRUE(nominal);
  ASSERT_EQ(same.miss.size(), 3u);
  for (const double miss : same.miss) EXPECT_EQ(miss, nominal->miss);
  p.card.dead_time.sigma = 0.005;  // half of the normal distribution has no meaning
  EXPECT_EQ(draw_landings(p, 20, 1).miss.size(), 20u);
}

/// The message of the std::invalid_argument that `action` throws.
template <class Action>
std::string refusal(Action&& action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ReleaseThrow, RefusesWhatIsNoThrow) {
  using testing::HasSubstr;
  const Chain arm = pads();
  const auto expect_refused = [&](const char* what, auto&& change) {
    ReleaseThrow p = swing(arm);
    const Draw draw = nominal_draw(p);
    change(p);
    EXPECT_THAT(refusal([&] { release_landing(p, draw); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { nominal_draw(p); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { rigid_landing(p, 0.14, 0.05); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { release_spread(p); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { draw_landings(p, 1, 1); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { make_insensitive(p, {1, 3, 5}); }), HasSubstr(what));
  };
  expect_refused("q has 3 values for 7 joints", [](auto& p) { p.start.q = p.start.q.head(3).eval(); });
  expect_refused("qd has 3 values for 7 joints", [](auto& p) { p.start.qd = p.start.qd.head(3).eval(); });
  expect_refused("qdd has 3 values for 7 joints", [](auto& p) { p.qdd = p.qdd.head(3).eval(); });
  expect_refused("qdd = nan", [](auto& p) { p.qdd[4] = NAN; });
  expect_refused("target = inf", [](auto& p) { p.target.z() = INFINITY; });
  for (const double hold : {static_cast<double>(NAN), -1.0, 0.0, HUGE_VAL})
    expect_refused("hold = ", [=](auto& p) { p.hold = hold; });
  expect_refused("sigma of mu = nan is not in [0, inf)", [](auto& p) { p.card.mu.sigma = NAN; });
  expect_refused("sigma of dead_time = -0.1", [](auto& p) { p.card.dead_time.sigma = -0.1; });
  expect_refused("sigma of com_offset = -1", [](auto& p) { p.object.com_offset.sigma = -1; });
  expect_refused("sigma of length = -1", [](auto& p) { p.card.length_sigma = -1; });
  expect_refused("sigma of mass = nan", [](auto& p) { p.object.mass_sigma = NAN; });
  expect_refused("mu = 10.5 is not in [0, 10]", [](auto& p) { p.card.mu.value = 10.5; });
  expect_refused("grasp_angle = inf", [](auto& p) { p.card.grasp_angle = INFINITY; });
  expect_refused("grip_force = nan", [](auto& p) { p.card.grip_force = NAN; });
  expect_refused("pads = 0", [](auto& p) { p.card.pads = 0; });
  expect_refused("mass = -1 is not in (0, inf) kg", [](auto& p) { p.object.mass = -1; });
  for (const double gravity : {0.0, -9.81, static_cast<double>(NAN)})
    expect_refused("gravity = ", [=](auto& p) { p.medium.gravity = gravity; });
  const ReleaseThrow p = swing(arm);
  EXPECT_THAT(refusal([&] { draw_landings(p, -5, 1); }), HasSubstr("count = -5"));
  const auto insensitive = [&](const std::vector<int>& joints) {
    return refusal([&] { make_insensitive(p, joints); });
  };
  EXPECT_THAT(insensitive({1, 1}), HasSubstr("joint 1 is named twice"));
  EXPECT_THAT(insensitive({1, 7}), HasSubstr("joint 7 is not in [0, 6]"));
  EXPECT_THAT(insensitive({0, 1, 2, 3, 4}), HasSubstr("accepted: 1 to 4"));
}

TEST(ReleaseThrow, IsNotOfALawWithoutPads) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.model = "gripper_delay";
  EXPECT_THAT(refusal([&] { release_landing(p, nominal_draw(p)); }),
              testing::HasSubstr("gripper_delay does not follow the pads"));
}

TEST(NominalThrow, RefusesASearchWithoutSense) {
  using testing::HasSubstr;
  const Chain arm = pads();
  const auto expect_refused = [&](const char* what, auto&& change) {
    PlanOptions o;
    change(o.search);
    const TargetBox box{{1.3, 0, -0.2}};
    EXPECT_THAT(refusal([&] { find_throws(arm, box, o.search); }), HasSubstr(what));
    EXPECT_THAT(refusal([&] { plan_throw(arm, box, o); }), HasSubstr(what));
  };
  expect_refused("samples = 0 is not in [1, inf)", [](auto& o) { o.samples = 0; });
  expect_refused("samples = -1 is not in [1, inf)", [](auto& o) { o.samples = -1; });
  expect_refused("candidates = 0 is not in [1, inf)", [](auto& o) { o.candidates = 0; });
  expect_refused("refined = -1", [](auto& o) { o.refined = -1; });
  for (const double gravity : {0.0, -9.0, static_cast<double>(NAN)})
    expect_refused("gravity = ", [=](auto& o) { o.medium.gravity = gravity; });
  expect_refused("drag_k = -1", [](auto& o) { o.medium.drag_k = -1; });
  expect_refused("window = 0 is not in (0, 1] s", [](auto& o) { o.window = 0; });
  expect_refused("joint 99 is not in [0, 6]", [](auto& o) { o.fixed = {{99, 0}}; });
  expect_refused("joint 2 is named twice", [](auto& o) { o.fixed = {{2, 0}, {2, 0.1}}; });
}

TEST(ThrowMotion, RefusesAnotherNumberOfJoints) {
  using testing::HasSubstr;
  const Chain arm = pads();
  const ReleaseThrow p = swing(arm);
  const Joints three = p.qdd.head(3).eval();
  const auto moved = [&](const Joints& home, const Joints& qdd, double window, double share) {
    return refusal([&] { throw_motion(arm, home, p.start, qdd, window, share); });
  };
  EXPECT_THAT(moved(three, p.qdd, 0.1, 0.9), HasSubstr("home has 3 values"));
  EXPECT_THAT(moved(middle_of(arm), three, 0.1, 0.9), HasSubstr("qdd has 3"));
  EXPECT_THAT(moved(middle_of(arm), p.qdd, -0.1, 0.9), HasSubstr("window = -0.1"));
  EXPECT_THAT(moved(middle_of(arm), p.qdd, 0.1, 0), HasSubstr("acceleration_share = 0"));
  const TubeProblem tube{arm, p.start, p.target};
  EXPECT_THAT(refusal([&] { landings_over_window(tube, three, 5); }), HasSubstr("qdd has 3"));
  EXPECT_THAT(refusal([&] { landings_over_window(tube, p.qdd, 0); }), HasSubstr("samples = 0"));
  EXPECT_THAT(refusal([&] { refine_tube(tube, three); }), HasSubstr("qdd has 3"));
}

TEST(PlanarHand, TurnsOnWhereItsAnglesWouldJump) {
  // The hand's axis turned so that it points straight back from the target halfway: θ passes π there.
  const Chain bare = pads();
  const ReleaseThrow unturned = swing(bare);
  const auto tip_at = [&](double t) {
    return forward_kinematics(bare,
                              Joints(unturned.start.q + t * unturned.start.qd + 0.5 * t * t * unturned.qdd));
  };
  const Transform<double> middle = tip_at(0.5 * unturned.hold);
  const Eigen::Vector3d back = middle.R.transpose() * Eigen::Vector3d(-1, 0, 0);
  const Eigen::Matrix3d turn =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), back).toRotationMatrix();
  const Chain arm = with_tool(bare, {turn, Eigen::Vector3d::Zero()});
  const ReleaseThrow p = swing(arm);
  const ThrowPlane plane(forward_kinematics(arm, p.start.q).p, p.target);
  const PlanarHand hand(arm, plane, p.start.q, p.start.qd.cast<Dual>(), p.qdd.cast<Dual>(), p.hold);
  for (double t = 0; t <= p.hold; t += p.hold / 23) {
    const auto tip = tip_motion(arm, Joints(p.start.q + t * p.start.qd + 0.5 * t * t * p.qdd),
                                Joints(p.start.qd + t * p.qdd), p.qdd);
    const auto at = hand.at({0, p.hold}, t);
    EXPECT_NEAR(std::cos(at.pose.theta), tip.frame.R(0, 2), 1e-9);
    EXPECT_NEAR(std::sin(at.pose.theta), tip.frame.R(2, 2), 1e-9);
    EXPECT_NEAR(at.twist.omega, -tip.omega.y(), 1e-7);
  }
}

TEST(PlanarHand, RefusesAnAxisThatLeansOutAndAMotionThatTurnsTooFar) {
  const Chain leaning =
      with_tool(pads(), {Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()).toRotationMatrix(), {0, 0, 0}});
  ReleaseThrow p = swing(leaning);
  EXPECT_THROW(release_landing(p, nominal_draw(p)), std::invalid_argument);
  const Chain arm = pads();
  ReleaseThrow far = swing(arm);
  far.hold = 2;
  EXPECT_THAT([&] { release_landing(far, nominal_draw(far)); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("turns too far")));
}

// Carried rigidly until it is free, the object's centre is the tip of a longer arm, bent where the object
// hangs askew; it lands where the tube says that that tip throws to, in air too.
TEST(ReleaseThrow, ARigidlyCarriedObjectIsTheTipOfALongerArm) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.qdd *= 2;
  for (const double angle : {0.0, 0.4})
    for (const double drag : {0.0, 0.2}) {
      p.object.angle = angle;
      p.medium.drag_k = drag;
      // From x to z turns about −y of the base; of this arm, whose hand points along its z axis, it is the
      // tool's axis that turns so.
      const Transform<double> tip = forward_kinematics(arm, p.start.q);
      const Eigen::Vector3d axis = tip.R.transpose() * Eigen::Vector3d(0, -1, 0);
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
      const Chain longer = with_tool(arm, {turn, turn * Eigen::Vector3d(0, 0, 0.14)});
      const TubeProblem tube{longer, p.start, p.target, 0.1, p.medium};
      for (const LandingAt& at : landings_over_window(tube, p.qdd, 4)) {
        const auto rigid = rigid_landing(p, 0.14, at.time);
        ASSERT_TRUE(rigid && at.lands);
        EXPECT_NEAR(rigid->miss, at.forward, 1e-7) << angle << ' ' << drag;  // the hand's polynomial
        EXPECT_EQ(rigid->detach_time, at.time);
        const auto there =
            tip_motion(longer, Joints(p.start.q + at.time * p.start.qd + 0.5 * at.time * at.time * p.qdd),
                       Joints(p.start.qd + at.time * p.qdd), p.qdd);
        EXPECT_NEAR(rigid->speed, there.velocity.norm(), 1e-7);
      }
    }
}

// The same of a gripper that opens at once, whatever the air and the angle in the hand.
TEST(ReleaseThrow, OfAGripperThatOpensAtOnceFliesThroughTheSameAir) {
  const Chain arm = pads();
  ReleaseThrow p = swing(arm);
  p.card.dead_time = {0.1, 0};  // when it rises
  p.card.opening_time = {2.5e-4, 0};
  p.card.grip_force = 400;
  p.object.angle = 0.3;
  p.medium.drag_k = 0.2;
  const auto real = release_landing(p, nominal_draw(p));
  const auto rigid = rigid_landing(p, 0.14, 0.1 + 2.5e-4);
  ASSERT_TRUE(real && rigid);
  EXPECT_NEAR(real->miss, rigid->miss, 2e-3);  // it turns a little while the pads open
  EXPECT_NEAR(real->speed, rigid->speed, 5e-3);
  EXPECT_NEAR(real->angle, 0, 1e-3) << "it did not turn in the hand";
  p.medium.drag_k = 0;
  EXPECT_GT(release_landing(p, nominal_draw(p))->miss, real->miss + 0.05);
}

TEST(ReleaseThrow, SummaryIsOfASample) {
  Landings out;
  out.miss = {0.01, 0.03, 0.02};
  summarise(out);
  EXPECT_DOUBLE_EQ(out.mean, 0.02);
  EXPECT_NEAR(out.std, 0.01, 1e-15);  // n − 1
  out.miss = {0.5};
  summarise(out);
  EXPECT_EQ(out.mean, 0.5);
  EXPECT_TRUE(std::isnan(out.std)) << "one has no spread";
  out.miss.clear();
  summarise(out);
  EXPECT_TRUE(std::isnan(out.mean) && std::isnan(out.std));
}

// Rubber: friction of more than one scatters as any other.
TEST(ReleaseThrow, DrawsFrictionOfMoreThanOne) {
  const Chain arm = pads();
  ReleaseThrow p = weak_swing(arm);
  p.card.mu = {1.5, 0.05};
  p.card.grip_force = 10;
  const Landings drawn = draw_landings(p, 200, 1);
  const double spread = release_spread(p)->spread;
  EXPECT_GT(spread, 1e-5);
  EXPECT_NEAR(drawn.std, spread, 0.3 * spread);  // as above
}

// Pads that stick press on with what they stick by.
TEST(HeldMotion, AdhesionSparesGripForce) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  const double dry = *HeldMotion(p, tube.plan->motion).needed_force(), stick = 0.2 * dry;
  p.card.friction.adhesion = stick;
  p.card.friction.parting_time = 0.01;
  EXPECT_NEAR(*HeldMotion(p, tube.plan->motion).needed_force(), dry - stick, 3e-3 * dry);
  p.card.grip_force = 1.01 * dry - stick;
  EXPECT_TRUE(HeldMotion(p, tube.plan->motion).holds(nominal_draw(p)));
  p.card.grip_force = 0.99 * dry - stick;
  EXPECT_FALSE(HeldMotion(p, tube.plan->motion).holds(nominal_draw(p)));
}

// A wrist that turns evenly about a level axis pulls its load inward, m ω² r, against its weight.
TEST(HeldMotion, AnEvenTurnPullsInward) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  p.object.com_offset.value = 0.3;
  constexpr double kRate = 8, kDuration = 0.05;  // rad/s, s
  JointTrajectory turning;
  turning.begin = -kDuration;
  for (int i = 0; i < 7; ++i) {
    turning.joints.push_back(JerkProfile({p.start.q[i], i == 5 ? kRate : 0, 0, 0}));
    turning.joints.back().append({{kDuration, 0}});
  }
  const auto needed = HeldMotion(p, turning, 1e-3).needed_force();
  ASSERT_TRUE(needed);
  double most = 0;
  for (double t = -kDuration; t <= 0; t += 1e-3) {
    const auto s = turning.at(t);
    const auto wrist = frames_of(bar.arm, s.q);
    const Eigen::Vector3d axis = wrist.links[5].p, r = 0.3 * wrist.tip.R.col(2);
    // All of it goes round the wrist's axis.
    Eigen::Vector3d out = wrist.tip.p + r - axis;
    out.y() = 0;
    const Eigen::Vector3d f = p.object.mass * (Eigen::Vector3d(0, 0, p.medium.gravity) - kRate * kRate * out);
    most = std::max(most, std::hypot(f.norm(), r.cross(f).y() / p.card.length));
  }
  EXPECT_NEAR(*needed, most / (p.card.pads * p.card.mu.value), 5e-3 * *needed);
}

// Of two bodies of one mass the one that is harder to turn needs the better grip.
TEST(HeldMotion, DrawsTheObjectsInertia) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  ReleaseThrow p = bar.release(*tube.plan);
  const auto needed = [&](double inertia) {
    ReleaseThrow q = p;
    q.object.inertia = inertia;
    return *HeldMotion(q, tube.plan->motion).needed_force();
  };
  const double slim = needed(0.5e-3), wide = needed(1e-2);
  ASSERT_GT(std::abs(wide / slim - 1), 0.02);
  p.object.inertia = slim < wide ? 0.5e-3 : 1e-2;
  p.card.grip_force = 0.5 * (slim + wide);
  const HeldMotion held(p, tube.plan->motion);
  Draw draw = nominal_draw(p);
  EXPECT_TRUE(held.holds(draw));
  draw[kInertia] = slim < wide ? 1e-2 : 0.5e-3;
  EXPECT_FALSE(held.holds(draw));
}

// An arm that is weaker than the fastest motion asks for takes a slower one, or none.
TEST(RobustThrow, KeepsTheTorqueOfItsArm) {
  BarThrow bar;
  const auto tube = bar.plan();
  ASSERT_TRUE(tube.plan) << tube.reason;
  const auto strong = plan_robust_throw(bar.release(*tube.plan), bar.options.home);
  ASSERT_TRUE(strong);
  const LimitUse& most = strong->limits.torque;
  bar.arm.joints[most.joint].limits.torque *= 0.9 * most.fraction;
  std::string reason;
  const auto weak = plan_robust_throw(bar.release(*tube.plan), bar.options.home, &reason);
  if (weak) {
    EXPECT_TRUE(check_limits(bar.arm, weak->motion, 5e-4).within());
  } else {
    EXPECT_THAT(reason, testing::HasSubstr("torque of " + bar.arm.joints[most.joint].name));
  }
  // Its height counts what hangs from the pads.
  const Chain to_object = with_tool(bar.arm, {Eigen::Matrix3d::Identity(), {0, 0, 0.14}});
  EXPECT_EQ(strong->limits.lowest, std::min(check_limits(bar.arm, strong->motion).lowest,
                                            check_limits(to_object, strong->motion).lowest));
}

}  // namespace
}  // namespace unhand::planners
