// The distributed patch, an oracle that knows neither limit surface nor mode: points tend to the disc, and
// the throws of the exact disc to those of the points.
#include "crosscheck/distributed_patch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "contact/disc_friction.hpp"
#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::crosscheck {
namespace {

using contact::ContactParameters;
using dynamics::Twist;

constexpr double kMu = 0.6, kRadius = 0.02, kNormal = 10;

DistributedPatch patch_of(int rings, double pressure_exponent = 0) {
  return {kMu, kRadius, disc_points(rings, pressure_exponent)};
}

TEST(DistributedPatch, ThePointsShareTheLoad) {
  for (const double s : {0.0, 0.5, 2.0})
    for (const int rings : {1, 2, 5, 20}) {
      const auto points = disc_points(rings, s);
      ASSERT_EQ(points.size(), 3u * rings * rings);
      double load = 0, x = 0, z = 0;
      for (const auto& [p, w] : points) {
        load += w, x += w * p.x, z += w * p.z;
        EXPECT_LT(norm(p), 1.0);
      }
      EXPECT_NEAR(load, 1, 1e-12);  // rounding of a sum
      EXPECT_NEAR(std::hypot(x, z), 0, 1e-12);
    }
  EXPECT_THROW(disc_points(0), std::invalid_argument);
  EXPECT_THROW(disc_points(5, -1), std::invalid_argument);
}

/// Force and torque about the centre [N, N, N m] that slide and spin together at every point, in the limit of
/// stiff bristles: −n μ f_N Σ w_i v_i/|v_i|, v_i = v + ω J a p_i.
dynamics::Wrench<double> sliding_wrench(const DistributedPatch& patch, double normal_force,
                                        const Twist<double>& slip) {
  const double limit = patch.pads * patch.mu * normal_force;
  dynamics::Wrench<double> out{};
  for (const auto& [p, load] : patch.points) {
    const double x = patch.radius * p.x, z = patch.radius * p.z;
    const double vx = slip.vx - slip.omega * z, vz = slip.vz + slip.omega * x, size = std::hypot(vx, vz);
    if (size == 0) continue;
    const double fx = -limit * load * vx / size, fz = -limit * load * vz / size;
    out = {out.fx + fx, out.fz + fz, out.tau + x * fz - z * fx};
  }
  return out;
}

/// Largest error of force and torque, in units of their limits, where the disc slides at εaω and spins at ω.
double wrench_error(int rings, double epsilon) {
  const double full = 2 * kMu * kNormal, omega = 3;
  const auto f = sliding_wrench(patch_of(rings), kNormal, {0, epsilon * kRadius * omega, omega});
  const auto exact = contact::disc_friction(epsilon);
  return std::max(std::abs(-f.fz / full - exact.force), std::abs(-f.tau / (full * kRadius) - exact.torque));
}

TEST(DistributedPatch, ItsWrenchTendsToTheDiscsClosedForm) {
  // A midpoint rule with rings of width a/n. Away from the instantaneous centre it is of second order in 1/n
  // ...
  for (const double epsilon : {2.0, 5.0})
    EXPECT_NEAR(wrench_error(20, epsilon) / wrench_error(40, epsilon), 4, 0.1) << "epsilon " << epsilon;
  // ... and where that lies among the points, so too but for the chance of how near it comes to one: a factor
  // of 256 is expected over sixteen times the rings, a quarter of it is asked for.
  for (const double epsilon : {0.1, 0.3, 0.653, 1.0}) {
    EXPECT_GT(wrench_error(5, epsilon) / wrench_error(80, epsilon), 50) << "epsilon " << epsilon;
    EXPECT_LT(wrench_error(80, epsilon), 4e-5) << "epsilon " << epsilon;
  }
}

TEST(DistributedPatch, ItsTorqueTendsToThatOfThePressure) {
  for (const double s : {0.5, 2.0}) {
    const auto error = [s](int rings) {
      const auto f = sliding_wrench(patch_of(rings, s), kNormal, {0, 0, -1});
      return std::abs(f.tau / (2 * kMu * kNormal * kRadius) - contact::torque_factor(s));
    };
    EXPECT_LT(error(80), 3e-4) << "exponent " << s;
    EXPECT_GT(error(20) / error(80), 5)
        << "exponent " << s;  // not 16: the outermost ring carries too little for its width
  }
}

// Pads without friction let the object go as it began: its centre moves with slip and spin of the pads, and
// falls.
TEST(DistributedPatch, BeginsWithTheSlipAndTheSpinOfTheProblem) {
  const auto hand = support::still_hand(0.05);
  const support::ConstantForce force(1);
  contact::ContactParameters<double> parameters;
  parameters.patch = {kMu, kRadius, 2.0 / 3, 2};
  const auto unused = contact::make_contact_model("limit_surface_disc", parameters);
  const dynamics::Vec2<double> arm{0.1, 0.03}, slip{0.3, -0.2};
  const double spin = 5, angle = 0.4, t = 0.05;
  const release::ReleaseProblem<double> free{
      hand, force, *unused, {0.5, 1e-3}, {0, -9.81}, {arm.x, angle, arm.z}, 0.0, slip, spin};
  const auto end = simulate_distributed_patch(free, {1e-12, kRadius, disc_points(2)}).detach;
  const auto r = dynamics::rotate(angle, arm);
  const double vx = slip.x - spin * r.z, vz = slip.z + spin * r.x;
  EXPECT_NEAR(end.twist.vx, vx, 1e-9);
  EXPECT_NEAR(end.twist.vz, vz - 9.81 * t, 1e-9);
  EXPECT_NEAR(end.twist.omega, spin, 1e-9);
  EXPECT_NEAR(end.pose.x, r.x + vx * t, 1e-9);
  EXPECT_NEAR(end.pose.z, r.z + vz * t - 0.5 * 9.81 * t * t, 1e-6);
  EXPECT_NEAR(end.pose.theta, angle + spin * t, 1e-9);
}

struct Scene {
  support::RandomThrow thrown;
  std::unique_ptr<contact::ContactModel> model;
  explicit Scene(std::mt19937_64& random) : thrown(support::random_throw(random, 0)) {
    model = contact::make_contact_model("limit_surface_disc", support::parameters_of(thrown));
  }
  release::ReleaseProblem<double> problem() const { return support::problem_of(thrown, *model); }
  Twist<double> disc() const {
    const auto result = simulate_release(problem(), {.integrator = {.tolerances = {1e-9, 1e-11}}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
    return result.detach.twist;
  }
  PatchResult points(int rings, const PatchOptions& options = {}) const {
    const auto result = simulate_distributed_patch(
        problem(), {thrown.patch.mu, thrown.patch.radius, disc_points(rings)}, options);
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
    return result;
  }
};

double distance(const Twist<double>& a, const Twist<double>& b) {
  return std::max(std::hypot(a.vx - b.vx, a.vz - b.vz), 0.1 * std::abs(a.omega - b.omega));  // m/s, at 10 cm
}

TEST(DistributedPatch, ThrowsOfTheExactDiscAreTheLimitOfManyPoints) {
  std::mt19937_64 random(75);
  constexpr int kThrows = 8;
  double coarse = 0, medium = 0, fine = 0;
  for (int k = 0; k < kThrows; ++k) {
    const Scene scene(random);
    const auto disc = scene.disc();
    coarse += distance(scene.points(3).detach.twist, disc) / kThrows;
    medium += distance(scene.points(6).detach.twist, disc) / kThrows;
    fine += distance(scene.points(12).detach.twist, disc) / kThrows;
  }
  std::printf("detach speed against the exact disc, mean of %d throws [m/s]: 3 rings %.1e, 6 %.1e, 12 %.1e\n",
              kThrows, coarse, medium, fine);
  // Second order in the rings' width is a factor of four; three, as the instantaneous centre comes near a
  // point by chance.
  EXPECT_GT(coarse / medium, 3);
  EXPECT_GT(medium / fine, 3);
  EXPECT_LT(fine, 6e-5);  // m/s, on throws of some 2 m/s
}

TEST(DistributedPatch, StepsAndBristlesDoNotMatter) {
  std::mt19937_64 random(75);
  for (int k = 0; k < 4; ++k) {
    const Scene scene(random);
    const auto usual = scene.points(5);
    const auto halved = scene.points(5, {0.5 * PatchOptions{}.step});
    EXPECT_NEAR(halved.time_error / usual.time_error, 0.5,
                0.05);  // the implicit Euler method is of first order,
    EXPECT_LT(distance(halved.detach.twist, usual.detach.twist),
              2e-6);  // its extrapolation has 1e-2 of that left
    PatchOptions softer;
    softer.elastic_slip *= 10;  // 0.1 nm
    EXPECT_LT(distance(scene.points(5, softer).detach.twist, usual.detach.twist), 2e-5);
  }
}

/// A grip that closes from nothing to 20 N in 10 ms, and opens again.
class ClosingGrip final : public contact::NormalForce {
 public:
  double at(const contact::Window&, double t) const override {
    return std::clamp(std::min(20 * t / 0.01, 20 * (0.08 - t) / 0.05), 0.0, 20.0);
  }
  dynamics::Dual at(const contact::Window& w, const dynamics::Dual& t) const override {
    return dynamics::Dual(at(w, t.a));
  }
  void kinks(std::vector<double>& out) const override { out.insert(out.end(), {0.01, 0.03, 0.08}); }
  void kinks(std::vector<dynamics::Dual>& out) const override {
    for (const double t : {0.01, 0.03, 0.08}) out.push_back(dynamics::Dual(t));
  }
  double release_time() const override { return 0.08; }
};

TEST(DistributedPatch, AGripThatClosesFirstIsTheDiscs) {
  const auto hand = support::accelerating_hand({3, -4, 30}, 0.2);
  const ClosingGrip force;
  ContactParameters<double> parameters;
  parameters.patch = {kMu, kRadius};
  const auto model = contact::make_contact_model("limit_surface_disc", parameters);
  release::ReleaseProblem<double> problem{hand,        force, *model, {0.4, 1e-3}, {0, -9.81},
                                          {0.05, 0.3}, 0.0,   {},     0.0};
  const auto disc = simulate_release(problem, {.integrator = {.tolerances = {1e-9, 1e-11}}});
  const auto points = simulate_distributed_patch(problem, patch_of(12));
  ASSERT_EQ(points.outcome, release::ReleaseOutcome::detached);
  EXPECT_LT(distance(points.detach.twist, disc.detach.twist),
            2e-4);     // m/s: 12 rings, as above, of a weak grip
  problem.start = -1;  // the hand is not known there
  EXPECT_THROW(simulate_distributed_patch(problem, patch_of(5)), std::invalid_argument);
  problem.start = 0, problem.body.mass = -1;
  EXPECT_THROW(simulate_distributed_patch(problem, patch_of(5)), std::invalid_argument);
}

TEST(DistributedPatch, HoldsWithoutCreep) {
  const auto hand = support::still_hand(1);
  const support::ConstantForce force(kNormal);
  ContactParameters<double> parameters;
  parameters.patch = {kMu, kRadius};
  const auto model = contact::make_contact_model("sliding_pivot", parameters);
  const release::ReleaseProblem<double> problem{hand,       force, *model, {0.5, 2e-3}, {0, -9.81},
                                                {0.005, 0}, 0.0,   {},     0.0};
  PatchOptions options;
  options.step = 1e-3;
  const auto result = simulate_distributed_patch(problem, patch_of(5), options);
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  // within the elastic slip of 1e-11 m: 5 N of 12 N
  EXPECT_NEAR(result.detach.pose.z, 0, 1e-11);
  EXPECT_NEAR(result.detach.twist.vz, 0, 1e-11);
}

TEST(DistributedPatch, AFreeDiscStopsAsFarkasFound) {
  // k = 1/2 on a table: lengths in R = 1 m, speeds in 1e-3 m/s and μ g = 1e-3 m/s², so that the lever that
  // grows between patch and CoM is 1e-3 of R and its effect 1e-6. At 0.8 of the unit of time, 0.034 before
  // the rest, both motions still run; from there the exact disc says how fast.
  constexpr double kUnit = 1e-3;
  const auto hand = support::still_hand(0.8);
  const support::ConstantForce force(kUnit);
  ContactParameters<double> parameters;
  parameters.patch = {1.0, 1.0, 2.0 / 3, 1};
  const auto model = contact::make_contact_model("limit_surface_disc", parameters);
  const release::ReleaseProblem<double> problem{hand,   force, *model,           {1.0, 0.5}, {0, 0},
                                                {0, 0}, 0.0,   {0.3 * kUnit, 0}, kUnit};
  const auto exact = simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-14}}}).relative;
  PatchOptions options;
  options.step = 1e-3;
  const auto points = simulate_distributed_patch(problem, {1.0, 1.0, disc_points(24), 1}, options);
  ASSERT_EQ(points.outcome, release::ReleaseOutcome::never_separated);
  // 1e-4 of the unit: what 1728 points miss (1e-4 of the wrench, see above) over one unit of time
  EXPECT_NEAR(points.detach.twist.vx, exact.slip.x, 1e-4 * kUnit);
  EXPECT_NEAR(points.detach.twist.omega, exact.spin, 1e-4 * kUnit);
}

/// A thin ring: points of equal load at the radius, half a step off the axes.
std::vector<PatchPoint> ring_points(int n) {
  std::vector<PatchPoint> out;
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * M_PI * (i + 0.5) / n;
    out.push_back({{std::cos(angle), std::sin(angle)}, 1.0 / n});
  }
  return out;
}

TEST(DistributedPatch, OfAThinRingResistsSlideAndSpinAlike) {
  // Where it slides at v = ω R, each point's slip halves the angle between those of slide and spin:
  // F = T/R = 2/π of the limit. Half a step beside the point that rests the sum is of second order in 1/n.
  const auto f = sliding_wrench({kMu, kRadius, ring_points(1000)}, kNormal, {3 * kRadius, 0, 3});
  const double full = 2 * kMu * kNormal;
  EXPECT_NEAR(-f.fx / full, 2 / M_PI, 1e-6);
  EXPECT_NEAR(-f.tau / (full * kRadius), 2 / M_PI, 1e-6);
  EXPECT_NEAR(f.fz / full, 0, 1e-12);  // rounding of a sum
}

TEST(DistributedPatch, AFreeRingEndsWithSlideAndSpinAlike) {
  // k = 1: whichever prevails at first is braked more, until v = ω R, and from there on both fall by 2/π of
  // μ g. Units as for the disc above; a tenth of the unit before the rest, and half of that.
  constexpr double kUnit = 1e-3;
  ContactParameters<double> parameters;
  parameters.patch = {1.0, 1.0, 1.0, 1};
  const auto model = contact::make_contact_model("limit_surface", parameters);  // is not looked at
  const support::ConstantForce force(kUnit);
  PatchOptions options;
  options.step = 1e-3;
  for (const auto& [slip, time] : {std::pair{0.5, 1.11}, {2.0, 2.32}}) {
    const auto twist_at = [&, slip = slip](double t) {
      const auto hand = support::still_hand(t);
      const release::ReleaseProblem<double> problem{
          hand, force, *model, {1.0, 1.0}, {0, 0}, {0, 0}, 0.0, {slip * kUnit, 0}, kUnit};
      const auto result = simulate_distributed_patch(problem, {1.0, 1.0, ring_points(200), 1}, options);
      EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
      return result.detach.twist;
    };
    const auto before = twist_at(time), after = twist_at(time + 0.05);
    // The ratio closes in faster than the time left: 2e-3 of the start's 0.5 and 2, then 200 points' 1e-4.
    EXPECT_NEAR(before.vx / before.omega, 1, 4e-3) << slip;
    EXPECT_NEAR(after.vx / after.omega, 1, 4e-4) << slip;
    EXPECT_GT(after.vx, 0.02 * kUnit) << "still on its way";
    for (const double braked : {before.vx - after.vx, before.omega - after.omega})
      EXPECT_NEAR(braked / (0.05 * kUnit), 2 / M_PI, 4e-3) << slip;  // as far as the ratio is 1
  }
}

TEST(DistributedPatch, RefusesWhatIsNoPatch) {
  std::mt19937_64 random(76);
  const Scene scene(random);
  const auto problem = scene.problem();
  const auto refused = [&](const DistributedPatch& patch, const PatchOptions& options = {}) {
    EXPECT_THROW(simulate_distributed_patch(problem, patch, options), std::invalid_argument);
  };
  refused({-1, 0.01, disc_points(2)});
  refused({0.5, 0, disc_points(2)});
  refused({0.5, 0.01, {}});
  refused({0.5, 0.01, disc_points(2), 0});
  refused({0.5, 0.01, disc_points(2)}, {0.1});
  refused({0.5, 0.01, disc_points(2)}, {1e-5, 0});
}

}  // namespace
}  // namespace unhand::crosscheck
