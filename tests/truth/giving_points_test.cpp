// Pads that give at every point: against the closed forms of a disc, the exact disc that they tend to, and
// many bristles of a simulator that shares no equation with them.
#include "contact/giving_points.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "contact/disc_friction.hpp"
#include "contact/registry.hpp"
#include "crosscheck/distributed_patch.hpp"
#include "tests/support/best_difference.hpp"
#include "tests/support/effect_releases.hpp"

namespace unhand {
namespace {

using contact::FrictionVariation;
using contact::GivingPoints;
using dynamics::Twist;

constexpr double kMu = 0.5, kRadius = 0.012, kNormal = 20, kForce = 2 * kMu * kNormal;

contact::FrictionLimits<double> limits(double compliance, double loss_time) {
  FrictionVariation<double> v;
  v.compliance = compliance;
  v.loss_time = loss_time;
  return {{kMu, kRadius}, v};
}

/// The wrench [N, N, N m] of points that are dragged by `slip` for h [s], whatever they say.
contact::Vec3<double> dragged(GivingPoints<double>& points, contact::Stretch<double>& stretch,
                              const contact::Vec3<double>& slip, double h, double force = kForce) {
  constexpr double kHeavy = 1e6;
  contact::Stretch<double> to = stretch;
  contact::Vec3<double> at = slip, wrench;
  const GivingPoints<double>::Step step{
      h, force, 2.0 / 3 * kRadius, {{{kHeavy, 0, 0}, {0, kHeavy, 0}, {0, 0, kHeavy}}}, slip, slip};
  EXPECT_TRUE(points.step(step, stretch, to, at, wrench));
  stretch = to;
  return wrench;
}

TEST(GivingPoints, TheQuadratureKeepsForceTorqueAndStiffness) {
  const auto p = contact::disc_quadrature({3, 5, 7});
  double area = 0, first = 0, second = 0, x = 0, z = 0;
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    const double rho = std::hypot(p.x[i], p.z[i]);
    area += p.area[i], first += p.area[i] * rho, second += p.area[i] * rho * rho;
    x += p.area[i] * p.x[i], z += p.area[i] * p.z[i];
  }
  EXPECT_EQ(p.x.size(), 15u);
  EXPECT_NEAR(area, 1, 1e-14);
  EXPECT_NEAR(first, 2.0 / 3, 1e-14);
  EXPECT_NEAR(second, 0.5, 1e-14);
  EXPECT_NEAR(std::hypot(x, z), 0, 1e-14);
}

TEST(GivingPoints, ADiscTwistedSlipsFromItsRimInwards) {
  // Elastic up to the rim's yield at φ = 1, φ = k a θ/(n μ f_N); beyond it, with ρ = 1/φ the border,
  // τ = τ_max (1 − 1/(4 φ³)).
  constexpr double kCompliance = 2e-5;
  GivingPoints<double> points(limits(kCompliance, 0));
  auto stretch = points.zero();
  const double torque = 2.0 / 3 * kRadius * kForce, unit = kForce * kCompliance / kRadius;  // rad
  for (int k = 1; k <= 40; ++k) {
    const double phi = 0.1 * k;
    const auto wrench = dragged(points, stretch, {0, 0, 0.1 * unit / 1e-3}, 1e-3);
    const double exact = phi <= 1 ? 0.75 * phi : 1 - 0.25 / (phi * phi * phi);
    EXPECT_NEAR(-wrench[2] / torque, exact, phi <= 0.9 ? 1e-3 : 0.02) << phi;  // of four rings
    EXPECT_NEAR(std::hypot(wrench[0], wrench[1]) / kForce, 0, 1e-3);
  }
}

TEST(GivingPoints, TheirSlidingWrenchIsTheDiscs) {
  GivingPoints<double> points(limits(1e-9, 0));
  double worst = 0;
  for (const double epsilon : {0.1, 0.3, 0.5, 0.653, 0.8, 1.0, 1.3, 2.0, 5.0}) {
    auto stretch = points.zero();
    const auto wrench = dragged(points, stretch, {epsilon * kRadius * 3, 0, 3}, 1e-2);
    const auto exact = contact::disc_friction(epsilon);
    const double error = std::max(std::abs(-wrench[0] / kForce - exact.force),
                                  std::abs(-wrench[2] / (kForce * kRadius) - exact.torque));
    worst = std::max(worst, error);
    // where the instantaneous centre lies outside the disc, no point is near it
    if (epsilon > 1.2) {
      EXPECT_LT(error, 1e-4) << epsilon;
    }
  }
  EXPECT_LT(worst, 0.02) << "at the centre's chance distance from one of the points";
}

double distance(const Twist<double>& a, const Twist<double>& b) {
  return std::max(std::hypot(a.vx - b.vx, a.vz - b.vz), 0.1 * std::abs(a.omega - b.omega));  // m/s, at 10 cm
}

TEST(GivingPoints, StiffPadsAreTheExactDisc) {
  std::mt19937_64 random(75);
  double mean = 0;
  constexpr int kThrows = 8;
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, 0);
    FrictionVariation<double> stiff;
    stiff.compliance = 1e-10;  // the least
    const auto points = support::detach("limit_surface_disc", thrown, stiff, 1e-9);
    const auto disc = support::detach("limit_surface_disc", thrown, FrictionVariation<double>{}, 1e-9);
    const double error = distance({points.state[3], points.state[4], points.state[5]},
                                  {disc.state[3], disc.state[4], disc.state[5]});
    mean += error / kThrows;
  }
  EXPECT_LT(mean, 3e-4);  // of some 2 m/s
}

/// A hand that starts at rest without load, launches and brakes while the pads open. No gravity: the bristles
/// of the oracle start unstretched.
struct Launch {
  release::PolynomialHand hand = release::PolynomialHand::segments(
      0, {0, 0, 0}, {1.5, 1.0, 2},
      {{0.03, {0, 0, 0}, {100, 150, -900}}, {0.06, {3, 4.5, -27}}, {0.2, {3, 4.5, -27}, {-300, -500, 3000}}});
  contact::ProfileNormalForce force;
  dynamics::RigidBody<double> body{0.15, 6e-4};
  release::Grasp<double> grasp{0.09, 0.2};

  Launch() : force(profile()) {}
  static contact::OpeningProfile<double> profile() {
    contact::OpeningProfile<double> p;
    p.open_command = 0.04, p.grip_force = kNormal, p.dead_time = 0.008, p.opening_time = 0.05, p.shape = 1.2;
    return p;
  }
  release::ReleaseProblem<double> problem(const contact::ContactModel& model) const {
    return {hand, force, model, body, {0, 0}, grasp, 0.0, {}, 0.0};
  }
};

TEST(GivingPoints, ThrowAsManyBristlesDo) {
  // With losses, as pads have: vibrations that nothing damps, the steps of both would damp.
  const Launch launch;
  for (const double slip : {3e-6, 3e-4, 1e-3})
    for (const double loss : {1e-3, 5e-3}) {
      contact::ContactParameters<double> p;
      p.patch = {kMu, kRadius};
      p.variation.compliance = slip / kForce;
      p.variation.loss_time = loss;
      const auto model = contact::make_contact_model("limit_surface_disc", p);
      const auto problem = launch.problem(*model);
      release::ReleaseOptions usual, fine;
      usual.integrator.tolerances = {1e-5, 1e-8};
      fine.integrator.tolerances = {1e-7, 1e-10};
      const auto ours = simulate_release(problem, usual), finer = simulate_release(problem, fine);
      crosscheck::PatchOptions options;
      options.elastic_slip = slip;
      options.loss_time = loss;
      const auto many =
          simulate_distributed_patch(problem, {kMu, kRadius, crosscheck::disc_points(12)}, options);
      ASSERT_EQ(ours.outcome, release::ReleaseOutcome::detached);
      ASSERT_EQ(many.outcome, release::ReleaseOutcome::detached);
      // 432 bristles are 4e-5 m/s from the disc (distributed_patch_test.cpp)
      EXPECT_LT(distance(finer.detach.twist, many.detach.twist), 5e-5) << slip << ' ' << loss;
      EXPECT_LT(distance(ours.detach.twist, finer.detach.twist), 2e-4) << slip << ' ' << loss;
    }
}

// With and without losses: at the end of an opening the limit pushes springs back that dampers hold.
TEST(GivingPoints, ErrByTheSquareOfTheStep) {
  const Launch launch;
  // a vibration that nothing damps is wrong in its phase
  for (const auto& [loss, most] : {std::pair{0.0, 3e-4}, {3e-3, 3e-5}}) {
    contact::ContactParameters<double> p;
    p.patch = {kMu, kRadius};
    p.variation = limits(1e-3 / kForce, loss).variation();
    const auto model = contact::make_contact_model("limit_surface_disc", p);
    const auto problem = launch.problem(*model);
    const auto detached = [&](double tolerance) {  // the step goes with its root
      const auto result =
          simulate_release(problem, {.integrator = {.tolerances = {tolerance, 1e-3 * tolerance}}});
      EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
      return result.detach.twist;
    };
    const auto exact = detached(1e-9);
    const double coarse = distance(detached(1e-5), exact), fine = distance(detached(1e-7), exact);
    EXPECT_LT(coarse, most) << loss;
    EXPECT_NEAR(std::log10(coarse / fine), 2, 0.4) << loss;
  }
}

// Their friction depends on how fast each of them slips, as in the rigid disc: a spin that viscous pads stop.
// With losses, which let the vibration die in which pads without any would be left (some 0.08 rad/s).
TEST(GivingPoints, StiffPadsSlowASpinAsTheRigidDiscDoes) {
  const auto hand = support::still_hand(0.01);
  const support::ConstantForce force(kNormal);
  const auto spun = [&](double compliance, double viscous) {
    contact::ContactParameters<double> p;
    p.patch = {kMu, kRadius};
    p.variation.compliance = compliance;
    p.variation.loss_time = 1e-4;
    p.variation.viscous = viscous;
    const auto model = contact::make_contact_model("limit_surface_disc", p);
    return simulate_release(
               release::ReleaseProblem<double>{
                   hand, force, *model, {0.15, 5e-5}, {0, 0}, {0, 0}, 0.0, {}, 40.0},
               {.integrator = {.tolerances = {1e-7, 1e-10}}})
        .relative.spin;
  };
  const double rigid = spun(0, 5), coulomb = spun(0, 0);
  EXPECT_GT(coulomb - rigid, 3) << "rad/s that the growth with speed makes";
  EXPECT_NEAR(spun(1e-9, 5), rigid, 0.02);
  EXPECT_NEAR(spun(1e-9, 0), coulomb, 0.02);
}

// By all that the pads are made of, and by when they open: central differences of whole releases.
TEST(GivingPoints, CarryDerivativesOfPadsAndOpening) {
  constexpr int kCount = 7;
  constexpr const char* kNames[kCount] = {"mu",       "radius",       "exponent", "compliance",
                                          "softness", "opening_time", "loss_time"};
  const std::array<double, kCount> at{0.5, kRadius, 0.4, 2e-5, 0.3, 0.05, 3e-3};
  const Launch launch;
  const auto detached = [&]<class S>(const std::array<S, kCount>& x) {
    contact::OpeningProfile<S> opening;
    opening.open_command = 0.04, opening.grip_force = S(kNormal), opening.dead_time = S(0.008);
    opening.opening_time = x[5], opening.shape = S(1.2);
    const contact::ProfileNormalForce force(opening);
    contact::ContactParameters<S> p;
    p.patch = {x[0], x[1], S(2.0 / 3), 2};
    p.variation.reference_force = 15;
    p.variation.pressure_exponent = x[2], p.variation.compliance = x[3], p.variation.softness = x[4];
    p.variation.loss_time = x[6];
    const auto model = contact::make_contact_model("limit_surface_disc", p);
    const auto result = simulate_release(
        release::ReleaseProblem<S>{
            launch.hand, force, *model, {S(0.15), S(6e-4)}, {S(0), S(0)}, {S(0.09), S(0.2)}, 0.0, {}, S(0)},
        {.integrator = {.tolerances = {1e-6, 1e-9}}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
    const auto& twist = result.detach.twist;
    return std::array<S, 3>{twist.vx, twist.vz, twist.omega};
  };
  const auto exact = detached(support::seeded(at));
  for (int k = 0; k < kCount; ++k) {
    std::array<double, 3> best{1e300, 1e300, 1e300};
    for (const double relative : {1e-4, 1e-5, 1e-6}) {
      const double h = relative * at[k];
      auto above = at, below = at;
      above[k] += h, below[k] -= h;
      const auto a = detached(above), b = detached(below);
      for (int j = 0; j < 3; ++j)
        best[j] = std::min(best[j], std::abs((a[j] - b[j]) / (2 * h) - exact[j].v[k]));
    }
    // h² and rounding over h cross near 1e-8 of the slope: both runs take the same steps.
    for (int j = 0; j < 3; ++j)
      EXPECT_LT(best[j], 1e-6 * std::abs(exact[j].v[k])) << kNames[k] << ", state " << j;
  }
}

// Steps may be long where the pads hold the object, but not where it slips, and they must not show in the
// wrench that the sensor would have read.
TEST(GivingPoints, TakeLongStepsWhileTheyHoldAndShortOnesWhileTheySlip) {
  const Launch launch;
  contact::ContactParameters<double> p;
  p.patch = {kMu, kRadius};
  p.variation = limits(1e-7, 3e-3).variation();
  const auto model = contact::make_contact_model("limit_surface_disc", p);
  const auto problem = launch.problem(*model);
  const auto released = [&](double tolerance) {
    return simulate_release(problem,
                            {.integrator = {.tolerances = {tolerance, 1e-3 * tolerance}, .record = true}});
  };
  const auto usual = released(1e-5), fine = released(1e-8);
  ASSERT_EQ(usual.outcome, release::ReleaseOutcome::detached);
  double longest_held = 0, longest_slip = 0;
  for (const auto& piece : usual.trajectory.pieces) {
    const double h = piece.t1 - piece.t0, middle = piece.t0 + 0.5 * h;
    const auto coarse = sample_release(problem, usual, middle), exact = sample_release(problem, fine, middle);
    const double slip = norm(exact.relative.slip);  // creeping pads: micrometres per second
    double& longest = slip < 1e-3 ? longest_held : longest_slip;
    longest = std::max(longest, h);
    EXPECT_LT(norm(coarse.relative.slip - exact.relative.slip), 1e-4 + 1e-3 * slip) << middle;
    EXPECT_LT(norm(coarse.wrench.force() - exact.wrench.force()), 0.02) << middle;  // N, of up to 20
  }
  EXPECT_GT(longest_held, 3e-3);
  EXPECT_LT(longest_slip, 1e-3);
  EXPECT_LT(distance(usual.detach.twist, fine.detach.twist), 1e-4);
}

TEST(GivingPoints, StopAtTheStepBudget) {
  const Launch launch;
  contact::ContactParameters<double> p;
  p.patch = {kMu, kRadius};
  p.variation = limits(1e-5, 3e-3).variation();
  const auto model = contact::make_contact_model("limit_surface_disc", p);
  release::ReleaseOptions options;
  options.integrator.tolerances = {1e-5, 1e-8};
  const auto whole = simulate_release(launch.problem(*model), options);
  ASSERT_EQ(whole.outcome, release::ReleaseOutcome::detached);
  options.integrator.step_budget = whole.statistics.steps;
  const auto just = simulate_release(launch.problem(*model), options);
  EXPECT_EQ(just.outcome, release::ReleaseOutcome::detached);
  EXPECT_EQ(just.detach.twist.omega, whole.detach.twist.omega);
  options.integrator.step_budget = whole.statistics.steps - 1;
  const auto short_of = simulate_release(launch.problem(*model), options);
  EXPECT_EQ(short_of.outcome, release::ReleaseOutcome::not_solved);
  EXPECT_EQ(short_of.integration, dynamics::Outcome::step_budget_spent);
  EXPECT_LT(short_of.statistics.steps, whole.statistics.steps);
  EXPECT_TRUE(std::isfinite(short_of.detach.twist.vx));
}

/// A launch on compliant pads, recorded in steps of 5e-5 s.
struct Recorded {
  Launch launch;
  contact::FrictionLimits<double> pads = limits(3e-4 / kForce, 3e-3);
  std::unique_ptr<contact::ContactModel> model;
  release::ReleaseResult<double> result;

  Recorded() {
    contact::ContactParameters<double> p;
    p.patch = {kMu, kRadius};
    p.variation = pads.variation();
    model = contact::make_contact_model("limit_surface_disc", p);
    result = simulate_release(launch.problem(*model),
                              {.integrator = {.tolerances = {1e-7, 1e-10}}, .ledger = true});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
  }
  release::ReleaseSample<double> at(double t) const {
    return sample_release(launch.problem(*model), result, t);
  }
};

TEST(GivingPoints, TheLedgerClosesAndPadsNeverFeed) {
  const Recorded recorded;
  const auto& l = recorded.result.ledger;
  EXPECT_NEAR(l.residual, 0, 1e-5 * std::abs(l.hand_work)) << l.hand_work;
  const auto start = recorded.at(0);
  const double stored =
      0.5 * recorded.pads.variation().compliance *
      dot(start.wrench.force(), start.wrench.force());  // holds the bar in a hand that turns
  double given = 0;
  for (const auto& piece : recorded.result.trajectory.pieces) {
    const double h = piece.t1 - piece.t0;
    const auto middle = recorded.at(piece.t0 + 0.5 * h), node = recorded.at(piece.t0);
    given +=
        h * (dot(middle.wrench.force(), middle.relative.slip) + middle.wrench.tau * middle.relative.spin);
    ASSERT_LE(given, stored) << piece.t0 << ": no more than the pads had and got";
    // No more than the disc can carry: the force alone is limited exactly, up to what a piece's rate at its
    // begin differs from the step's at its end; force and torque together as well as the quadrature knows the
    // disc.
    const double limit = 2 * kMu * node.normal_force;
    ASSERT_LE(norm(node.wrench.force()), limit * (1 + 1e-6)) << piece.t0;
    ASSERT_LE(contact::UniformDisc{}.gauge(
                  contact::Vec3<double>{node.wrench.fx / limit, node.wrench.fz / limit,
                                        node.wrench.tau / (recorded.pads.length(node.normal_force) * limit)}),
              1 + 1e-4)
        << piece.t0;
  }
  EXPECT_NEAR(given, l.linear_friction + l.torsional_friction, 1e-3 * std::abs(given));  // a midpoint rule
}

// The wrench of a sample is what its motion takes. Points that are dragged along the sampled slip, without
// any body, must come to the same.
TEST(GivingPoints, TheSampledWrenchIsThatOfPointsThatSlipAsSampled) {
  const Recorded recorded;
  constexpr int kSteps = 1000;  // twice as long as the release's
  const double end = recorded.result.detach.time;
  const auto in_hand = [](const release::ReleaseSample<double>& s, dynamics::Vec2<double> v, double about) {
    const auto turned = dynamics::rotate(-s.hand.pose.theta, v);
    return contact::Vec3<double>{turned.x, turned.z, about};
  };
  const auto force_limit = [](const auto& s) { return 2 * kMu * s.normal_force; };
  const auto follow = [&](int steps) {
    GivingPoints<double> points(recorded.pads);
    auto stretch = points.zero();
    const auto start = recorded.at(0);
    EXPECT_TRUE(points.hold(in_hand(start, start.wrench.force(), start.wrench.tau), force_limit(start),
                            recorded.pads.length(start.normal_force), stretch));
    std::vector<contact::Vec3<double>> out;
    for (int k = 1; k < steps; ++k) {
      const auto s = recorded.at(end * k / steps);
      out.push_back(dragged(points, stretch, in_hand(s, s.relative.slip, s.relative.spin), end / steps,
                            force_limit(s)));
    }
    return out;
  };
  const auto coarse = follow(kSteps), fine = follow(2 * kSteps);
  for (int k = 1; k < kSteps; ++k) {
    const auto s = recorded.at(end * k / kSteps);
    const auto sampled = in_hand(s, s.wrench.force(), s.wrench.tau);
    // Both are of second order in steps of 1e-4 s, during which what slips may change; the torque is also
    // that of a heavy object, whose momentum is rounded. Of some 1.5 N and 1.5e-3 N m.
    const double tolerance[] = {3e-4, 3e-4, 5e-6};
    for (std::size_t i = 0; i < 3; ++i) {
      const double dragged_along =
          2 * fine[static_cast<std::size_t>(2 * k - 1)][i] - coarse[static_cast<std::size_t>(k - 1)][i];
      ASSERT_NEAR(sampled[i], dragged_along, tolerance[i]) << i << " at " << end * k / kSteps;
    }
  }
}

}  // namespace
}  // namespace unhand
