// A disc that slides and spins to rest on its own: [Farkas2003]. Both motions stop at one instant, at a slip
// ratio that the inertia alone decides.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact/disc_friction.hpp"
#include "contact/limit_surface.hpp"
#include "contact/sliding_pivot.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

using release::ReleaseProblem;

/// Lengths in R = 1 m, speeds in 1e-6 m/s, times in 1 s (μ g = 1e-6 m/s²). A disc on a table carries its
/// pressure along, a patch at the pads does not: the lever that grows between them changes the motion by its
/// square, here (1e-6)². And the straight line by which a stop is finished, 1e-8 s, is 1e-8 of the unit.
constexpr double kSpeed = 1e-6, kGrip = 1e-6;

struct Rest {
  double time{std::nan("")};        ///< until both stop, in units
  double epsilon[3]{}, force[3]{};  ///< slip ratio and F/(μN) at 1e-5, 1e-6, 1e-7 of a unit before
  std::size_t events{};

  /// What x tends to if it does so as a power of the time left (Aitken).
  static double limit(const double (&x)[3]) {
    return x[2] - (x[2] - x[1]) * (x[2] - x[1]) / (x[2] - 2 * x[1] + x[0]);
  }
  /// d ln ε / d ln (time left)
  double exponent() const { return std::log(epsilon[2] / epsilon[1]) / std::log(0.1); }
};

template <class Shape>
Rest stop(double k, double slip, double spin, double direction = 0) {
  const auto hand = support::still_hand(20 * kSpeed / kGrip);
  const support::ConstantForce force(kGrip);  // N, on a mass of 1 kg
  const LimitSurface<Shape> model("limit surface", Patch<double>{1.0, 1.0, 2.0 / 3, 1});
  const ReleaseProblem<double> problem{
      hand,         force,  model, {1.0, k},
      {0, 0},       {0, 0}, 0.0,   {kSpeed * slip * std::cos(direction), kSpeed * slip * std::sin(direction)},
      kSpeed * spin};
  const auto result =
      simulate_release(problem, {.integrator = {.tolerances = {1e-11, 1e-14}, .record = true}});
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  EXPECT_TRUE(result.slips_at_start);
  EXPECT_EQ(result.relative.slip.x, 0.0);  // at rest, exactly
  EXPECT_EQ(result.relative.spin, 0.0);
  Rest rest;
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) {
      ++rest.events;
      rest.time = event.t * kGrip / kSpeed;
    }
  if (rest.events == 0) return rest;
  for (int i = 0; i < 3; ++i) {
    const double t = (rest.time - std::pow(10, -5 - i)) * kSpeed / kGrip;
    const auto sample = sample_release(problem, result, t);
    rest.epsilon[i] = norm(sample.relative.slip) / std::abs(sample.relative.spin);
    rest.force[i] = norm(sample.wrench.force()) / kGrip;
  }
  return rest;
}

TEST(FreeDisc, BothMotionsStopTogetherAtTheUniversalRatio) {
  for (const auto& [slip, spin] : {std::pair{0.3, 1.0}, {2.0, 1.0}, {1.0, -0.5}, {0.7, -1.3}}) {
    const Rest rest = stop<UniformDisc>(0.5, slip, spin);
    EXPECT_EQ(rest.events, 1u) << "one event ends slide and spin";
    // The ratio closes in as (time left)^0.62: 1e-3 are left at 1e-7 and 1e-6 after the extrapolation, which
    // is of second order in that.
    EXPECT_NEAR(rest.epsilon[2], 0.6530017892, 1e-3) << "from v " << slip << " omega " << spin;
    EXPECT_NEAR(Rest::limit(rest.epsilon), 0.6530017892, 1e-6) << "from v " << slip << " omega " << spin;
    EXPECT_NEAR(Rest::limit(rest.force), 0.6160334132, 1e-6) << "from v " << slip << " omega " << spin;
  }
}

TEST(FreeDisc, TheTimeToRest) {
  // 1e-8: all digits known; the integrator's relative tolerance is 1e-11
  EXPECT_NEAR(stop<UniformDisc>(0.5, 0.3, 1).time, 0.83398447, 1e-8);
  EXPECT_NEAR(stop<UniformDisc>(0.5, 2, 1).time, 2.24337057, 1e-8);
}

TEST(FreeDisc, DoesNotDependOnTheDirection) {
  const Rest reference = stop<UniformDisc>(0.5, 0.3, 1);
  std::mt19937_64 random(3);
  for (int k = 0; k < 5; ++k) {
    const double direction = std::uniform_real_distribution<double>(-M_PI, M_PI)(random);
    EXPECT_NEAR(stop<UniformDisc>(0.5, 0.3, 1, direction).time, reference.time, 1e-9) << direction;
    EXPECT_NEAR(stop<UniformDisc>(0.5, 0.3, -1, direction).time, reference.time, 1e-9) << direction;
  }
}

TEST(FreeDisc, OtherInertias) {
  // six digits are known
  EXPECT_NEAR(Rest::limit(stop<UniformDisc>(0.4, 0.8, 1).epsilon), 0.853513, 2e-6);
  EXPECT_NEAR(Rest::limit(stop<UniformDisc>(0.6, 0.4, 1).epsilon), 0.404383, 2e-6);
}

TEST(FreeDisc, TheRatioBalancesTheTwoDecelerations) {
  // ε stays constant where v̇/v = ω̇/ω: F/ε = T/k
  for (const double epsilon : {0.6530017892, 0.853513, 0.404383}) {
    const DiscFriction f = disc_friction(epsilon);
    const double k = f.torque * epsilon / f.force;
    EXPECT_NEAR(k, epsilon > 0.8 ? 0.4 : epsilon > 0.6 ? 0.5 : 0.6, 1e-6);
  }
  // and that has a solution for 1/4 < k < 2/3 only: T ε/F falls from 2/3 to 1/4
  double before = 2.0 / 3;
  for (double epsilon = 1e-3; epsilon < 1e3; epsilon *= 1.1) {
    const DiscFriction f = disc_friction(epsilon);
    const double k = f.torque * epsilon / f.force;
    EXPECT_LT(k, before);
    EXPECT_GT(k, 0.25);
    before = k;
  }
}

TEST(FreeDisc, LargeInertiaEndsInSpin) {
  // Where spin prevails, F = ε and T = 2/3: v̇/v = (3k/2) ω̇/ω, so ε falls as |ω|^(3k/2 − 1). 1 %: the next
  // order in ε².
  for (const double k : {0.8, 0.9, 1.0}) {
    const Rest rest = stop<UniformDisc>(k, 0.5, 1);
    EXPECT_EQ(rest.events, 1u);
    EXPECT_NEAR(rest.exponent(), 1.5 * k - 1, 0.01 * (1.5 * k - 1)) << "k " << k;
    EXPECT_LT(rest.epsilon[2], 0.1) << "k " << k;
  }
}

TEST(FreeDisc, SmallInertiaEndsInSlide) {
  // Where slide prevails, F = 1 and T = 1/(4ε): ω̇/ω = v̇/(4k v), so ε grows as v^(1 − 1/(4k)).
  for (const double k : {0.1, 0.15, 0.2}) {
    const Rest rest = stop<UniformDisc>(k, 0.5, 1);
    EXPECT_EQ(rest.events, 1u);
    EXPECT_NEAR(rest.exponent(), 1 - 0.25 / k, 0.01 * (0.25 / k - 1)) << "k " << k;
    EXPECT_GT(rest.epsilon[2], 10) << "k " << k;
  }
}

TEST(FreeDisc, TheEllipsoidGivesAnotherEnd) {
  // Here v̇/v = −μg/|u| and ω̇/ω = −(4/(9k)) μg/|u|: ε = ε₀ (ω/ω₀)^(9k/4 − 1). No finite ratio attracts: above
  // the threshold k = 4/9 the end is spin, below it slide, and at it every ratio stays what it was.
  for (const double slip : {0.1, 0.6530017892, 3.0})
    for (const double epsilon : stop<Ellipsoid>(4.0 / 9, slip, 1).epsilon)
      EXPECT_NEAR(epsilon, slip, 2e-7 * slip);  // the record between steps is a quartic
  const Rest spin = stop<Ellipsoid>(0.5, 0.6530017892, 1), slide = stop<Ellipsoid>(0.4, 0.6530017892, 1);
  EXPECT_NEAR(spin.exponent(), 2.25 * 0.5 - 1, 1e-3);  // 1e-3: ε² is not zero yet
  EXPECT_LT(spin.epsilon[2], 0.2);                     // from the disc's own ratio far away from it
  EXPECT_LT(slide.exponent(), -0.05);
  EXPECT_GT(slide.epsilon[2], 1.5);
}

TEST(FreeDisc, TheEllipsoidFollowsItsPowerLaw) {
  const double k = 0.5;
  constexpr double kStrong = 1e6;
  const auto hand = support::still_hand(20 / kStrong);
  const support::ConstantForce force(kStrong);
  const LimitSurface<Ellipsoid> model("limit surface", Patch<double>{1.0, 1.0, 2.0 / 3, 1});
  const ReleaseProblem<double> problem{hand, force, model, {1.0, k}, {0, 0}, {0, 0}, 0.0, {0.3, 0}, 1.0};
  const auto result =
      simulate_release(problem, {.integrator = {.tolerances = {1e-11, 1e-13}, .record = true}});
  int seen = 0;
  for (const auto& piece : result.trajectory.pieces) {
    const auto y = Relative<double>::from(piece.nodes[0]);
    if (piece.phase.mode == 0 || std::abs(y.spin) < 1e-6) break;
    const double epsilon = norm(y.slip) / y.spin;
    EXPECT_NEAR(epsilon, 0.3 * std::pow(y.spin, 2.25 * k - 1), 1e-8) << "omega " << y.spin;
    ++seen;
  }
  EXPECT_GT(seen, 10);
}

// ---------------------------------------------------------------- pure motions, every law

template <class Model>
double time_to_rest(const Model& model, double inertia, dynamics::Vec2<double> slip, double spin) {
  const auto hand = support::still_hand(10);
  const support::ConstantForce force(4.0);  // N; two pads of 0.5: 4 N on 1 kg
  const ReleaseProblem<double> problem{hand, force, model, {1.0, inertia}, {0, 0}, {0, 0}, 0.0, slip, spin};
  const auto result = simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}}});
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) return event.t;
  return std::nan("");
}

TEST(PureStops, SpinAndSlideOfEveryLaw) {
  // f_max = 4 N, R = 0.3 m, τ_max = 2/3 R f_max = 0.8 N m. Uniform deceleration: 1e-10 is the integrator's
  // tolerance.
  const Patch<double> patch{0.5, 0.3, 2.0 / 3, 2};
  const LimitSurface<Ellipsoid> ellipsoid("limit_surface", patch);
  const LimitSurface<UniformDisc> disc("limit_surface_disc", patch);
  const LimitSurface<ConvexQuartic> quartic("limit_surface_quartic", patch, ConvexQuartic::closest_to_disc());
  const SlidingPivot pivot(patch);
  const auto check = [](const auto& model) {
    const double k = 0.5, inertia = k * 0.09, mu_g = 4.0;
    EXPECT_NEAR(time_to_rest(model, inertia, {0.6, 0.8}, 0.0), 1.0 / mu_g, 1e-10) << model.name();
    EXPECT_NEAR(time_to_rest(model, inertia, {0, 0}, 2.0), 3 * 0.3 * 2.0 / (4 * mu_g), 1e-10) << model.name();
    EXPECT_NEAR(time_to_rest(model, inertia, {0, 0}, -2.0), 3 * 0.3 * 2.0 / (4 * mu_g), 1e-10)
        << model.name();
  };
  check(ellipsoid);
  check(disc);
  check(quartic);
  check(pivot);
}

}  // namespace
}  // namespace unhand::contact
