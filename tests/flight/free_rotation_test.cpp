// Torque-free rotation against closed forms, and the quaternion's logarithm where it is delicate.
#include "flight/free_rotation.hpp"
#include "tests/support/best_difference.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace unhand::flight {
namespace {

using dynamics::Dual;
using dynamics::independent;
constexpr double kPi = std::numbers::pi;

/// Kinetic energy ½ ω·Iω [J if I is in kg m²].
template <class S>
S rotational_energy(const Vec3<S>& inertia, const Vec3<S>& omega) {
  return 0.5 * (inertia[0] * omega[0] * omega[0] + inertia[1] * omega[1] * omega[1] +
                inertia[2] * omega[2] * omega[2]);
}

/// Angular momentum R(q) I ω in the world [kg m²/s].
template <class S>
Vec3<S> angular_momentum(const Vec3<S>& inertia, const RotationState<S>& state) {
  return rotate(state.attitude, Vec3<S>{inertia[0] * state.omega[0], inertia[1] * state.omega[1],
                                        inertia[2] * state.omega[2]});
}

dynamics::IntegratorOptions sharp() {
  dynamics::IntegratorOptions options;
  options.tolerances = {1e-13, 1e-14};
  return options;
}

double angle_between(const Quaternion<double>& a, const Quaternion<double>& b) {
  return norm(rotation_between(a, b));
}

Vec3<double> random_vector(std::mt19937_64& random, double size) {
  std::normal_distribution<double> normal;
  return {size * normal(random), size * normal(random), size * normal(random)};
}

RotationState<double> after(const Vec3<double>& inertia, const RotationState<double>& start, double t) {
  return rotate_freely(inertia, start, {t}, sharp()).states[0];
}

// ---------------------------------------------------------------- quaternions

TEST(Quaternions, LogarithmUndoesExponential) {
  std::mt19937_64 random(1);
  // Around zero, on both sides of where the series ends (|θ|/2 or |θ| = 1e-2) and up to just below π.
  for (const double size :
       {1e-300, 1e-12, 9.99e-3, 1.001e-2, 1.99e-2, 2.01e-2, 1.0, 3.0, kPi - 1e-6, kPi - 1e-12})
    for (int n = 0; n < 20; ++n) {
      Vec3<double> axis = random_vector(random, 1);
      const Vec3<double> theta = scaled(size / norm(axis), axis), back = log(exp(theta));
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(back[i], theta[i], 4e-15 * std::min(1.0, size) + 1e-15 * size) << size;
    }
}

TEST(Quaternions, TheSameOrientationHasTheSameShortestVector) {
  const Quaternion<double> q = exp(Vec3<double>{0.3, -1.2, 2.0});
  const Vec3<double> a = log(q), b = log(Quaternion<double>{-q.w, -q.x, -q.y, -q.z});
  for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(a[i], b[i]);
  // 1.5 π one way is half a π the other way.
  const Vec3<double> c = log(exp(Vec3<double>{0, 0, 1.5 * kPi}));
  EXPECT_NEAR(c[2], -0.5 * kPi, 1e-15);
  EXPECT_NEAR(norm(log(Quaternion<double>{0, 0, 1, 0})), kPi, 1e-15);
}

TEST(Quaternions, DerivativesAreExactFromZeroToPi) {
  std::mt19937_64 random(2);
  for (const double size : {0.0, 1e-200, 1e-9, 9.9e-3, 1.01e-2, 2.01e-2, 1.0, kPi - 1e-3}) {
    const Vec3<double> axis = random_vector(random, 1);
    Vec3<Dual> theta;
    for (int i = 0; i < 3; ++i) theta[i] = independent(size / norm(axis) * axis[i], i);
    const Vec3<Dual> back = log(exp(theta));  // the identity
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(back[i].v[k], i == k, 1e-12 / (kPi - size)) << size;
    const Quaternion<Dual> q = exp(theta);
    if (size == 0) {
      EXPECT_EQ(q.x.v[0], 0.5);
      EXPECT_EQ(q.w.v[0], 0.0);
    }
  }
}

TEST(Quaternions, RotateLikeRodrigues) {
  std::mt19937_64 random(3);
  for (int n = 0; n < 20; ++n) {
    const Vec3<double> theta = random_vector(random, 1), a = random_vector(random, 1);
    const double angle = norm(theta);
    const Vec3<double> axis = scaled(1 / angle, theta);
    const Vec3<double> expected =
        sum(sum(scaled(std::cos(angle), a), scaled(std::sin(angle), cross(axis, a))),
            scaled(dot(axis, a) * (1 - std::cos(angle)), axis));
    const Vec3<double> turned = rotate(exp(theta), a);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(turned[i], expected[i], 1e-14);
  }
}

// ---------------------------------------------------------------- rotation

TEST(FreeRotation, ASphereTurnsSteadily) {
  const RotationState<double> start{exp(Vec3<double>{0.2, 0.5, -1.0}), {3, -4, 12}};
  const auto states = rotate_freely<double>({2, 2, 2}, start, {1.0, 0.0, 0.25}).states;
  EXPECT_LT(angle_between(states[1].attitude, start.attitude), 1e-15);
  // 13 rad/s about a fixed axis.
  const Quaternion<double> expected = start.attitude * exp(Vec3<double>{3, -4, 12});
  EXPECT_LT(angle_between(states[0].attitude, expected), 1e-14);
  EXPECT_EQ(states[2].omega, start.omega);
  // The integrator agrees on a body that is a sphere but for 1e-13.
  const auto near = after({2, 2, 2 + 2e-13}, start, 1.0);
  EXPECT_LT(angle_between(near.attitude, expected), 1e-11);
}

/// ω₃ is kept and the rest of ω turns about the body's axis at Ω = (I₃ − I)/I ω₃. In the world the axis goes
/// round L at |L|/I: q(t) = exp(L t/I) q₀ exp(−Ω t e₃).
TEST(FreeRotation, ASymmetricTopPrecesses) {
  for (const double I3 : {0.3, 1.9}) {  // a rod and a disc
    const Vec3<double> inertia{1, 1, I3};
    const RotationState<double> start{exp(Vec3<double>{-0.7, 0.1, 0.4}), {1.5, -0.5, 6}};
    const Vec3<double> L = angular_momentum(inertia, start);
    const double rate = (I3 - 1) * start.omega[2];
    const std::vector<double> times{0.01, 0.37, 1.0, 4.0};
    const auto states = rotate_freely(inertia, start, times, sharp()).states;
    for (std::size_t i = 0; i < times.size(); ++i) {
      const double t = times[i], c = std::cos(rate * t), s = std::sin(rate * t);
      EXPECT_NEAR(states[i].omega[0], c * 1.5 + s * 0.5, 1e-10);  // tolerance 1e-13 a step, some 200 steps
      EXPECT_NEAR(states[i].omega[1], s * 1.5 - c * 0.5, 1e-10);
      EXPECT_NEAR(states[i].omega[2], 6, 1e-10);
      const Quaternion<double> expected =
          exp(scaled(t, L)) * start.attitude * exp(Vec3<double>{0, 0, -rate * t});
      EXPECT_LT(angle_between(states[i].attitude, expected), 1e-10) << t;
    }
  }
}

TEST(FreeRotation, EnergyAndAngularMomentumAreKept) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int n = 0; n < 10; ++n) {
    const Vec3<double> a{uniform(random), uniform(random),
                         uniform(random)};  // moments of mass along the axes
    const Vec3<double> inertia{a[1] + a[2], a[2] + a[0], a[0] + a[1]};
    const RotationState<double> start{exp(random_vector(random, 1)), random_vector(random, 8)};
    const Vec3<double> L = angular_momentum(inertia, start);
    const double E = rotational_energy(inertia, start.omega);
    const auto turned = rotate_freely(inertia, start, {0.1, 0.5, 3.0}, sharp());
    for (const auto& state : turned.states) {
      EXPECT_NEAR(rotational_energy(inertia, state.omega) / E, 1, 1e-9) << n;
      EXPECT_LT(norm(difference(angular_momentum(inertia, state), L)) / norm(L), 1e-9) << n;
      const Quaternion<double>& q = state.attitude;
      EXPECT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1, 1e-15);
    }
  }
}

/// About the middle axis a body flips over and over (Dzhanibekov). With I₁ < I₂ < I₃ and |L|² > 2 E I₂,
/// ω = (A cn τ, B sn τ, C dn τ), τ = t √((I₃−I₂)(L²−2EI₁)/(I₁I₂I₃)),
/// k² = (I₂−I₁)(2EI₃−L²)/((I₃−I₂)(L²−2EI₁)), so that half a turn-over takes 2 K(k) in τ.
TEST(FreeRotation, TheMiddleAxisFlipsOnTime) {
  const Vec3<double> I{1, 2, 2.6};
  for (const double nudge : {0.3, 0.1, 0.03}) {  // of the spin, off the middle axis: sn τ = 1 at the start
    const RotationState<double> start{{}, {0, 5, 5 * nudge}};
    const double twice_E = 2 * rotational_energy(I, start.omega);
    const Vec3<double> L = angular_momentum(I, start);
    const double LL = dot(L, L);
    const double rate = std::sqrt((I[2] - I[1]) * (LL - twice_E * I[0]) / (I[0] * I[1] * I[2]));
    const double k =
        std::sqrt((I[1] - I[0]) * (twice_E * I[2] - LL) / ((I[2] - I[1]) * (LL - twice_E * I[0])));
    const double flip = 2 * std::comp_ellint_1(k) / rate;
    const auto half = after(I, start, flip), full = after(I, start, 2 * flip);
    // Errors grow by about 1/nudge² while it passes by the unstable axis twice.
    const double tolerance = 1e-10 / (nudge * nudge);
    EXPECT_NEAR(half.omega[0], 0, tolerance) << nudge;
    EXPECT_NEAR(half.omega[1], -5, tolerance) << nudge;
    EXPECT_NEAR(half.omega[2], 5 * nudge, tolerance) << nudge;
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(full.omega[i], start.omega[i], 2 * tolerance) << nudge;
  }
}

TEST(FreeRotation, OnlyRatiosOfInertiaMatter) {
  const RotationState<double> start{{}, {3, 7, -2}};
  const auto a = after({1, 1.3, 2}, start, 0.8), b = after({1e-4, 1.3e-4, 2e-4}, start, 0.8);
  EXPECT_LT(angle_between(a.attitude, b.attitude), 1e-11);
}

TEST(FreeRotation, TheWorldMayBeTurned) {
  const Quaternion<double> turn = exp(Vec3<double>{0.4, 2.0, -0.3}), q = exp(Vec3<double>{1, 0, 0.5});
  const auto a = after({1, 1.3, 2}, {q, {3, 7, -2}}, 0.8),
             b = after({1, 1.3, 2}, {turn * q, {3, 7, -2}}, 0.8);
  EXPECT_LT(angle_between(turn * a.attitude, b.attitude), 1e-14);
}

TEST(FreeRotation, DerivativesByOmegaAndInertia) {
  // The second body is a sphere, where a difference of zero between moments still has a derivative.
  for (const Vec3<double>& inertia : {Vec3<double>{1, 1.3, 2}, Vec3<double>{1, 1, 1}}) {
    const std::array<double, 6> p{3, 5, -2, inertia[0], inertia[1], inertia[2]};
    const Quaternion<double> q0 = exp(Vec3<double>{0.3, -0.2, 0.9});
    const auto end = [&](const std::array<Dual, 6>& x) {
      const RotationState<Dual> start{{Dual(q0.w), Dual(q0.x), Dual(q0.y), Dual(q0.z)}, {x[0], x[1], x[2]}};
      const auto state = rotate_freely<Dual>({x[3], x[4], x[5]}, start, {0.6}, sharp()).states[0];
      return std::array<Dual, 7>{state.attitude.w, state.attitude.x, state.attitude.y, state.attitude.z,
                                 state.omega[0],   state.omega[1],   state.omega[2]};
    };
    const auto exact = end(support::seeded(p));
    for (std::size_t k = 0; k < 6; ++k) {
      // The bottom of the V: truncation of order 10 step², noise of the steps' choice 1e-12 over the step.
      const auto off = support::best_differences_by(k, end, p, exact);
      for (std::size_t i = 0; i < 7; ++i) EXPECT_LT(off[i], 5e-7) << "parameter " << k << " component " << i;
    }
  }
}

TEST(FreeRotation, TheStartCarriesTheDerivativeByTime) {
  const RotationState<Dual> start{exp(Vec3<Dual>{Dual(0.3), Dual(-0.2), Dual(0.9)}),
                                  {Dual(3), Dual(5), Dual(-2)}};
  const Quaternion<Dual>& q = start.attitude;
  const Quaternion<Dual> rate = q * Quaternion<Dual>{Dual(0), Dual(3), Dual(5), Dual(-2)};
  const double c = 0.4;  // 1/s
  for (const Vec3<double>& I : {Vec3<double>{1, 1.3, 2}, Vec3<double>{1, 1, 1}})
    for (const double last : {0.6, 0.0}) {
      const Rotation<Dual> rotation({Dual(I[0]), Dual(I[1]), Dual(I[2])}, start, Dual(c), last, sharp());
      const auto at = rotation.at(independent(0.0, 0));
      // q' = q (0, omega)/2, and Euler's equations.
      EXPECT_NEAR(at.attitude.w.v[0], 0.5 * rate.w.a, 1e-14) << last;
      EXPECT_NEAR(at.attitude.x.v[0], 0.5 * rate.x.a, 1e-14) << last;
      EXPECT_NEAR(at.attitude.y.v[0], 0.5 * rate.y.a, 1e-14) << last;
      EXPECT_NEAR(at.attitude.z.v[0], 0.5 * rate.z.a, 1e-14) << last;
      EXPECT_NEAR(at.omega[0].v[0], (I[1] - I[2]) / I[0] * 5 * -2 - c * 3, 1e-14) << last;
      EXPECT_NEAR(at.omega[1].v[0], (I[2] - I[0]) / I[1] * -2 * 3 - c * 5, 1e-14) << last;
      EXPECT_NEAR(at.omega[2].v[0], (I[0] - I[1]) / I[2] * 3 * 5 + c * 2, 1e-14) << last;
    }
}

TEST(FreeRotation, RefusesWhatIsNoRotation) {
  const RotationState<double> start{{}, {1, 2, 3}};
  EXPECT_THROW(rotate_freely<double>({1, 0, 1}, start, {1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, NAN, 1}, start, {1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, 1, 2}, start, {-1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, 1, 2}, {{0, 0, 0, 0}, {1, 2, 3}}, {1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, 1, 2}, {{}, {1, INFINITY, 3}}, {1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, 1, 2}, {{}, {1, 1e200, 3}}, {1.0}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1, 1, 1}, start, {1e300}), std::invalid_argument);
  EXPECT_THROW(rotate_freely<double>({1e-300, 1, 1e300}, start, {1.0}), std::invalid_argument);
  EXPECT_TRUE(rotate_freely<double>({1, 1, 2}, start, {}).states.empty());
  // Two steps are too few for a second of it.
  auto few = sharp();
  few.step_budget = 2;
  const auto spent = rotate_freely<double>({1, 2, 3}, start, {1.0}, few);
  EXPECT_EQ(spent.outcome, dynamics::Outcome::step_budget_spent);
  EXPECT_TRUE(spent.states.empty());
}

TEST(FreeRotation, StartsOfAnyLengthAreOrientations) {
  const Vec3<double> omega{0.3, -0.5, 0.2};
  for (const Vec3<double>& I : {Vec3<double>{1, 1, 1}, Vec3<double>{1, 2, 3}})
    for (const double size : {5e-324, 1e-200, 1e-120, 1.0, 1e120, 1e200, 1e308}) {
      const auto one = after(I, {{size, 0, 0, 0}, omega}, 1.0), unit = after(I, {{}, omega}, 1.0);
      const auto& q = one.attitude;
      EXPECT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1, 1e-14) << size;
      EXPECT_LT(angle_between(q, unit.attitude), 1e-14) << size;
    }
}

TEST(FreeRotation, IsReadWithinItsTimesOnly) {
  for (const Vec3<double>& I : {Vec3<double>{1, 1, 1}, Vec3<double>{1, 2, 3}}) {
    const Rotation<double> rotation(I, {{}, {1, 2, 3}}, 0.0, 1.0);
    EXPECT_NO_THROW(rotation.at(0.0));
    EXPECT_NO_THROW(rotation.at(1.0));
    for (const double t : {-3.0, 2.0, static_cast<double>(NAN)})
      EXPECT_THROW(rotation.at(t), std::out_of_range) << t;
  }
}

}  // namespace
}  // namespace unhand::flight
