// A disc that slides and spins to rest on its own: [Farkas2003]. Both motions stop at one instant, at a slip ratio that
// the inertia alone decides.
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

/// The table disc carries its pressure along; a patch at the pads does not, and the lever that grows between them changes
/// the motion by (sliding distance/R)². So the friction is strong: the distance is of order (ω R)²/(μ g) = 1e-6 R, its
/// effect 1e-12. Lengths in R = 1, times in R ω/(μ g).
constexpr double kGrip = 1e6;  // μ g [m/s²]

struct Rest {
  double time;     ///< until both stop, times μ g [m/s]
  double epsilon;  ///< slip ratio at the last recorded piece before the stop
  double force;    ///< F/(μN) there
  std::size_t events;
};

template <class Shape>
Rest stop(double k, double slip, double spin, double direction = 0) {
  const double end = 20 / kGrip;
  const auto hand = support::still_hand(end);
  const support::ConstantForce force(kGrip);  // N, on a mass of 1 kg
  const LimitSurface<Shape> model("limit surface", Patch<double>{1.0, 1.0, 2.0 / 3, 1});
  const ReleaseProblem<double> problem{
      hand, force, model, {1.0, k}, {0, 0}, {0, 0}, 0.0, {slip * std::cos(direction), slip * std::sin(direction)}, spin};
  release::ReleaseOptions options;
  options.integrator = support::tight(1e-11, 1e-13);
  options.integrator.record = true;
  options.integrator.longest_step = 1e-2 / kGrip;
  const auto result = simulate_release(problem, options);
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  EXPECT_TRUE(result.slips_at_start);
  EXPECT_EQ(result.relative.slip.x, 0.0);  // at rest, exactly
  EXPECT_EQ(result.relative.spin, 0.0);
  Rest rest{std::nan(""), std::nan(""), std::nan(""), 0};
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) {
      ++rest.events;
      rest.time = event.t * kGrip;
    }
  // The last piece in slip that is not the straight line to zero.
  for (const auto& piece : result.trajectory.pieces) {
    if (piece.phase.mode == 0) break;
    const auto y = Relative<double>::from(piece.nodes[0]);
    if (norm(y.slip) == 0 && y.spin == 0) break;
    rest.epsilon = norm(y.slip) / std::abs(y.spin);
    const auto sample = sample_release(problem, result, piece.t0);
    rest.force = norm(sample.wrench.force()) / kGrip;
  }
  return rest;
}

TEST(FreeDisc, BothMotionsStopTogetherAtTheUniversalRatio) {
  for (const auto& [slip, spin] : {std::pair{0.3, 1.0}, {2.0, 1.0}, {1.0, -0.5}, {0.7, -1.3}}) {
    const Rest rest = stop<UniformDisc>(0.5, slip, spin);
    EXPECT_EQ(rest.events, 1u) << "one event ends slide and spin";
    EXPECT_NEAR(rest.epsilon, 0.6530017892, 1e-6) << "from v " << slip << " omega " << spin;
    EXPECT_NEAR(rest.force, 0.6160334132, 1e-6);
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
  EXPECT_NEAR(stop<UniformDisc>(0.4, 0.8, 1).epsilon, 0.853513, 2e-6);
  EXPECT_NEAR(stop<UniformDisc>(0.6, 0.4, 1).epsilon, 0.404383, 2e-6);
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

TEST(FreeDisc, LargeInertiaEndsInSpinAndSmallInSlide) {
  EXPECT_LT(stop<UniformDisc>(0.8, 0.5, 1).epsilon, 0.1);
  EXPECT_LT(stop<UniformDisc>(1.0, 3, 1).epsilon, 0.01);
  EXPECT_GT(stop<UniformDisc>(0.2, 0.5, 1).epsilon, 10);
  EXPECT_GT(stop<UniformDisc>(0.15, 0.5, 1).epsilon, 100);
}

TEST(FreeDisc, TheEllipsoidGivesAnotherEnd) {
  // Here v̇/v = −μg/|u| and ω̇/ω = −(4/(9k)) μg/|u|, so ε grows or falls as |ω|^(9k/4 − 1) and no ratio attracts.
  const double first = stop<Ellipsoid>(0.5, 0.3, 1).epsilon, second = stop<Ellipsoid>(0.5, 2, 1).epsilon;
  EXPECT_LT(first, 0.3);
  EXPECT_GT(std::abs(first - 0.6530017892), 0.1);
  EXPECT_NEAR(second / first, 2 / 0.3, 0.4 * 2 / 0.3);  // keeps the memory of its start but for the depth of the last piece
  EXPECT_LT(stop<Ellipsoid>(0.48, 0.3, 1).epsilon, 0.3);
  EXPECT_GT(stop<Ellipsoid>(0.40, 0.3, 1).epsilon, 0.3);
  // the threshold k = 4/9 keeps every ratio
  for (const double slip : {0.1, 0.653, 3.0})
    EXPECT_NEAR(stop<Ellipsoid>(4.0 / 9, slip, 1).epsilon, slip, 1e-6 * slip) << slip;
}

TEST(FreeDisc, TheEllipsoidFollowsItsPowerLaw) {
  const double k = 0.5;
  const auto hand = support::still_hand(20 / kGrip);
  const support::ConstantForce force(kGrip);
  const LimitSurface<Ellipsoid> model("limit surface", Patch<double>{1.0, 1.0, 2.0 / 3, 1});
  const ReleaseProblem<double> problem{hand, force, model, {1.0, k}, {0, 0}, {0, 0}, 0.0, {0.3, 0}, 1.0};
  release::ReleaseOptions options;
  options.integrator = support::tight(1e-11, 1e-13);
  options.integrator.record = true;
  const auto result = simulate_release(problem, options);
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
  release::ReleaseOptions options;
  options.integrator = support::tight(1e-10, 1e-12);
  const auto result = simulate_release(problem, options);
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) return event.t;
  return std::nan("");
}

TEST(PureStops, SpinAndSlideOfEveryLaw) {
  // f_max = 4 N, R = 0.3 m, τ_max = 2/3 R f_max = 0.8 N m. Uniform deceleration: 1e-10 is the integrator's tolerance.
  const Patch<double> patch{0.5, 0.3, 2.0 / 3, 2};
  const LimitSurface<Ellipsoid> ellipsoid("limit_surface", patch);
  const LimitSurface<UniformDisc> disc("limit_surface_disc", patch);
  const LimitSurface<ConvexQuartic> quartic("limit_surface_quartic", patch, ConvexQuartic::closest_to_disc());
  const SlidingPivot pivot(patch);
  const auto check = [](const auto& model) {
    const double k = 0.5, inertia = k * 0.09, mu_g = 4.0;
    EXPECT_NEAR(time_to_rest(model, inertia, {0.6, 0.8}, 0.0), 1.0 / mu_g, 1e-10) << model.name();
    EXPECT_NEAR(time_to_rest(model, inertia, {0, 0}, 2.0), 3 * 0.3 * 2.0 / (4 * mu_g), 1e-10) << model.name();
    EXPECT_NEAR(time_to_rest(model, inertia, {0, 0}, -2.0), 3 * 0.3 * 2.0 / (4 * mu_g), 1e-10) << model.name();
  };
  check(ellipsoid);
  check(disc);
  check(quartic);
  check(pivot);
}

}  // namespace
}  // namespace unhand::contact
