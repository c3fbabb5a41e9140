// The limit surface of a small, strong patch tends to the pivot of the decoupled model: with τ_max held and
// ρ = |f|/f_max → 0 the contact point is carried and the torque is τ_max √(1 − ρ²).
#include <gtest/gtest.h>

#include <cmath>

#include "contact/limit_surface.hpp"
#include "contact/sliding_pivot.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

constexpr double kNormal = 20;         // N, one pad
constexpr double kTorqueLimit = 0.05;  // N m, held throughout
constexpr double kEnd = 0.08;          // s
constexpr double kLever = 0.12;        // m
const dynamics::RigidBody<double> kBar{0.2, 1.2e-3};

/// Two pads of friction mu whose radius makes the torque limit 0.05 N m.
Patch<double> patch_of(double mu) { return {mu, kTorqueLimit / (2 * mu * kNormal) * 1.5, 2.0 / 3, 2}; }

/// A bar held off its CoM in a hand that moves up; gravity's torque exceeds the limit.
struct Pivoting {
  support::SwayingHand hand{{{{0, 0.4, 3, 0, 1, 0}, {0, 0.5, 6, 0, 1, 0}, {0, 1, -20, 0, 1, 0}}}, kEnd};
  support::ConstantForce force{kNormal};
  release::ReleaseProblem<double> problem(const ContactModel& model) const {
    return {hand, force, model, kBar, {0, -9.81}, {kLever, 0.1}, 0.0, {}, 0.0};
  }
};

release::ReleaseOptions options() { return {.integrator = {.tolerances = {1e-9, 1e-11}, .record = true}}; }

/// The pivot equation with the torque `tau`: the force that carries the contact point, with r the lever in
/// the world.
dynamics::Vec2<double> carrying_force(const release::ReleaseSample<double>& s, double tau) {
  const auto& [m, I] = kBar;
  const dynamics::Vec2<double> r{s.pose.x - s.hand.pose.x, s.pose.z - s.hand.pose.z};
  const auto& a = s.hand.acceleration;
  const double alpha = (m * (r.z * a.ax - r.x * (a.az + 9.81)) + tau) / (I + m * (r.x * r.x + r.z * r.z));
  const double omega = s.twist.omega;
  return {m * (a.ax - alpha * r.z - omega * omega * r.x),
          m * (a.az + 9.81 + alpha * r.x - omega * omega * r.z)};
}

TEST(PivotLimit, TheTorqueRatioOfTheEllipsoid) {
  const Pivoting scene;
  double worst_before = 1;
  for (const double mu : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    const LimitSurface<Ellipsoid> model("limit_surface", patch_of(mu));
    const auto problem = scene.problem(model);
    const auto result = simulate_release(problem, options());
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
    EXPECT_TRUE(result.slips_at_start);
    const double f_max = 2 * mu * kNormal;
    double worst = 0;
    for (double t = 0.01; t < kEnd; t += 0.0037) {
      const auto s = sample_release(problem, result, t);
      ASSERT_EQ(s.mode, "slip");
      // the force that carries the contact point under the torque in force; ρ follows from it, not from the
      // law
      const auto f = carrying_force(s, s.wrench.tau);
      const double rho = norm(f) / f_max;
      const double ratio = -s.wrench.tau * (s.relative.spin > 0 ? 1 : -1) / kTorqueLimit;
      worst = std::max(worst, std::abs(ratio - std::sqrt(1 - rho * rho)));
    }
    // The slip that is left is of the order of L ω ρ, so its own acceleration is a share of order L/l of the
    // force, and enters the ratio as ρ² L/l: a factor of eight for each doubling of f_max; four is asked for.
    EXPECT_LT(worst, 0.25 * worst_before) << "mu " << mu;
    worst_before = worst;
  }
  EXPECT_LT(worst_before, 1e-5);
}

TEST(PivotLimit, TheMotionTendsToTheDecoupledPivot) {
  const Pivoting scene;
  double error_before = 0;
  for (const double mu : {1.0, 2.0, 4.0, 8.0}) {
    const LimitSurface<Ellipsoid> surface("limit_surface", patch_of(mu));
    const SlidingPivot pivot(patch_of(mu));
    const auto a = simulate_release(scene.problem(surface), options());
    const auto b = simulate_release(scene.problem(pivot), options());
    const auto words = mode_events(scene.problem(pivot), b);
    ASSERT_EQ(words.size(), 1u);  // starts pivoting and goes on
    ASSERT_EQ(words[0].mode, "pivot-");
    EXPECT_EQ(norm(b.relative.slip), 0.0);  // carried exactly
    const double error = std::abs(a.detach.twist.omega - b.detach.twist.omega);
    // second order in ρ: the torque is short by 1 − √(1 − ρ²)
    if (error_before > 0) {
      EXPECT_NEAR(error_before / error, 4, 0.8) << "mu " << mu;
    }
    error_before = error;
  }
  EXPECT_LT(error_before, 1e-3);  // rad/s
}

// A radius of zero is refused (tests/contract/outcomes_test.cpp); what patches shrink to is a point contact:
// its torque goes to zero with the radius, and the throw to that of a point, from a micrometre down to a
// nanometre.
TEST(PivotLimit, AShrinkingPatchTendsToAPointContact) {
  for (const char* name : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    for (int seed = 80; seed < 83; ++seed) {
      std::mt19937_64 random(seed);
      const auto thrown = support::random_throw(random, 0.5 * (seed - 80));
      const auto spin = [&](double radius) {
        auto p = support::parameters_of(thrown);
        p.patch.radius = radius;
        const auto model = make_contact_model(name, p);
        const auto result = simulate_release(support::problem_of(thrown, *model), options());
        EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << name << ' ' << seed << ' ' << radius;
        return result.detach.twist.omega;
      };
      const double point = spin(1e-9), near = spin(1e-6) - point, far = spin(1e-5) - point;
      // Linear in the radius, 0.1 to 0.2 rad/s a millimetre; a limit surface slips with ρ too, which bends
      // it.
      EXPECT_NEAR(far / near, 10, 1) << name << ' ' << seed;
      EXPECT_LT(std::abs(near), 1e-3) << name << ' ' << seed;
    }
}

// A gram on a lever of 30 cm under a hand that spins: 81 turns of the relative spin in ten seconds of
// opening, at each of which the patch's slip comes to rest and sets out anew with some 1e-13 m/s. A torque of
// 1e-8 N m and less is nothing beside gravity's of 3e-3 N m, so the surface's shape has no say, and an error
// of the slip's direction must not look like a stop: the event budget would be spent.
TEST(PivotLimit, EveryShapeOfANanometreSwingsAlike) {
  const double opening = 10;  // s
  std::array<support::SwayingHand::Coordinate, 3> c{};
  c[2].v = 50;  // rad/s
  const support::SwayingHand hand(c, opening + 0.02);
  const ProfileNormalForce force({0.001, 30, 0, opening, 1});
  for (const double radius : {1e-9, 1e-8}) {
    std::vector<release::ReleaseResult<double>> results;
    for (const char* name : {"limit_surface", "limit_surface_disc", "limit_surface_quartic"}) {
      ContactParameters<double> p;
      p.patch = {5.0, radius};
      const auto model = make_contact_model(name, p);
      results.push_back(simulate_release(release::ReleaseProblem<double>{
          hand, force, *model, {1e-3, 2.5e-6}, {0, -9.81}, {0.3, 0.3}, 0.0, {}, 0.0}));
      const auto &got = results.back().detach, &first = results.front().detach;
      ASSERT_EQ(results.back().outcome, release::ReleaseOutcome::detached) << name << ' ' << radius;
      EXPECT_EQ(results.back().events.size(), results.front().events.size()) << name << ' ' << radius;
      // errors of 1e-8 each time, over 81 turns
      EXPECT_NEAR(got.twist.omega, first.twist.omega, 5e-6) << name << ' ' << radius;
      EXPECT_NEAR(got.twist.vx, first.twist.vx, 1e-5) << name << ' ' << radius;
    }
  }
}

// Where even the slip of a spinning patch is beyond double's resolution the answer is typed and finite.
TEST(PivotLimit, APatchOfAnAtomsSizeEndsTyped) {
  for (const char* name : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    for (int seed = 80; seed < 83; ++seed) {
      std::mt19937_64 random(seed);
      const auto thrown = support::random_throw(random, 0.5 * (seed - 80));
      auto p = support::parameters_of(thrown);
      p.patch.radius = 1e-12;
      const auto model = make_contact_model(name, p);
      const auto result = simulate_release(support::problem_of(thrown, *model));
      EXPECT_TRUE(std::isfinite(result.detach.twist.omega)) << name << ' ' << seed;
      EXPECT_LE(result.statistics.steps, dynamics::IntegratorOptions{}.step_budget);
      EXPECT_LE(result.events.size(), static_cast<std::size_t>(dynamics::IntegratorOptions{}.event_budget));
    }
}

// What hardly rubs swings as a pendulum about the pads. From rest at `swing` off its lowest point it is there
// after a quarter of the period, K(sin(swing/2)) √((I + m l²)/(m g l)), and at rest again after each half.
TEST(PivotLimit, WithoutTorqueABarIsAPendulum) {
  const double swing = 2.5;  // rad, far from small
  const double pull = kBar.mass * 9.81 * kLever, inertia = kBar.inertia + kBar.mass * kLever * kLever;
  const double quarter = std::comp_ellint_1(std::sin(swing / 2)) * std::sqrt(inertia / pull);
  const double fastest = std::sqrt(2 * pull * (1 - std::cos(swing)) / inertia);
  for (const char* name : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"}) {
    ContactParameters<double> p;
    p.patch = {0.5, 1e-9};
    const double rubs = p.patch.tau_max(kNormal);  // 1.3e-8 N m, beside gravity's 0.24 N m
    const auto model = make_contact_model(name, p);
    const support::SwayingHand hand = support::still_hand(4.5 * quarter);
    const support::ConstantForce force(kNormal);
    const release::ReleaseProblem<double> problem{
        hand, force, *model, kBar, {0, -9.81}, {kLever, swing - M_PI / 2}, 0.0, {}, 0.0};
    auto o = options();
    o.ledger = true;
    const auto result = simulate_release(problem, o);
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::never_separated) << name;
    ASSERT_EQ(result.events.size(), 3u) << name << ": the start and two rests";
    // That little takes 5e-7 rad off each swing, which shortens it by 3e-7 of itself.
    for (int half = 1; half <= 2; ++half) {
      EXPECT_NEAR(result.events[static_cast<std::size_t>(half)].t / quarter, 2 * half, 1e-6 * half) << name;
      const auto low = sample_release(problem, result, (2 * half - 1) * quarter);
      EXPECT_NEAR(low.pose.theta, -M_PI / 2, 2e-6 * half) << name;
      EXPECT_NEAR(low.twist.omega, half == 1 ? -fastest : fastest, 1e-6 * fastest) << name;
    }
    // All that is lost is what it rubs over 4.5 quarters, and a limit surface's slip under the weight a
    // little.
    EXPECT_EQ(result.ledger.hand_work, 0) << name;
    EXPECT_LT(result.ledger.mechanical_change, 0) << name;
    EXPECT_GT(result.ledger.mechanical_change, -1.1 * rubs * 4.5 * swing) << name;
    EXPECT_NEAR(result.ledger.residual, 0, 1e-8 * pull) << name;  // ten times the tolerance
  }
}

}  // namespace
}  // namespace unhand::contact
