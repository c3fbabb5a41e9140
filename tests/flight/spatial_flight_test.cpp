// Flights in space against closed forms, the planar flight, and what turning or moving the whole scene must
// leave alone.
#include "flight/spatial_flight.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "flight/fly.hpp"
#include "flight/spatial_effects.hpp"
#include "tests/flight/tight.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::flight {
namespace {

using OpenAir = SpatialAir<double>;
using LetGo = SpatialStart<double>;
using Flown = SpatialState<double>;

constexpr double kSame = 1e-11;  // [m], [m/s], [rad]: both are integrated to 1e-12

Flown at(const LetGo& start, const OpenAir& air, double t) {
  return fly_in_space<double>(start, air, {t}, kTight).states[0];
}

void expect_near(const Vec3<double>& a, const Vec3<double>& b, double tolerance, const std::string& what) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << what << ", component " << i;
}
void expect_near(const Flown& a, const Flown& b, const std::string& what) {
  expect_near(a.position, b.position, kSame, what + ": position");
  expect_near(rotation_between(a.rotation.attitude, b.rotation.attitude), {0, 0, 0}, kSame,
              what + ": attitude");
  expect_near(a.rotation.omega, b.rotation.omega, kSame, what + ": spin");
}

/// Every term of the air at once, on a body whose moments differ.
const OpenAir kAllOfIt{{0.3, -0.2, -9.7}, 0.05, 0.11, 0.02, 0.07, -0.03, 0.15, 0.4, {1.1, -0.6, 0.3}};
const LetGo kStart{{0.2, -0.1, 1.3},
                   {2.4, 0.7, 1.6},
                   {normalised(Quaternion<double>{0.8, 0.3, -0.4, 0.2}), {3.0, -5.0, 2.0}},
                   {1.0, 1.7, 2.2}};

TEST(SpatialFlight, WithoutAirIsTheParabola) {
  const Vec3<double> g{0.1, 0.2, -9.8};
  const double t = 0.7;
  const auto flown = at(kStart, OpenAir{g}, t);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(flown.position[i], kStart.position[i] + kStart.velocity[i] * t + 0.5 * g[i] * t * t, 1e-14);
}

TEST(SpatialFlight, InItsPlaneIsThePlanarFlight) {
  // θ turns x towards z, which is about −y.
  const double spin = 4, t = 0.6;
  FlightProblem<double> planar{{0.1, 1.2, 0}, {2.5, 1.7, spin}, {0.4, -9.81}};
  planar.drag_k = 0.08;
  planar.lift_km = 0.03;
  planar.wind = {1.3, -0.4};
  const auto expected = fly_through(planar, {t}, kTight)[0];
  OpenAir air{{0.4, 0, -9.81}};
  air.drag_k = planar.drag_k;
  air.lift = planar.lift_km;
  air.wind = {1.3, 0, -0.4};
  const auto flown = at({{0.1, 0, 1.2}, {2.5, 0, 1.7}, {{}, {0, -spin, 0}}}, air, t);
  expect_near(flown.position, {expected.x, 0, expected.z}, kSame, "position");
  expect_near(rotation_between({}, flown.rotation.attitude), {0, -expected.theta, 0}, kSame, "attitude");
}

TEST(SpatialFlight, LinearDragEndsAtTheWindAndTheTerminalVelocity) {
  // v' = g − c (v − w): v = w + g/c + (v₀ − w − g/c) exp(−c t)
  const double c = 0.9, t = 1.4, decay = std::exp(-c * t);
  OpenAir air{{0.1, 0.2, -9.8}};
  air.linear_drag = c;
  air.wind = {2, -1, 0.5};
  const auto flown = at(kStart, air, t);
  for (std::size_t i = 0; i < 3; ++i) {
    const double end = air.wind[i] + air.gravity[i] / c;
    EXPECT_NEAR(flown.position[i],
                kStart.position[i] + end * t + (kStart.velocity[i] - end) * (1 - decay) / c, kSame);
  }
}

/// The path of a body that does not turn and is thrown at 3 m/s along `axis` of its own, without gravity:
/// with a = −k |v| v it is ln(1 + k v t)/k of a straight line. Returns k.
double drag_along(const Vec3<double>& axis, const OpenAir& air) {
  const double speed = 3, t = 0.8;
  LetGo start = kStart;
  start.rotation.omega = {0, 0, 0};
  const Vec3<double> way = rotate(start.rotation.attitude, scaled(1 / norm(axis), axis));
  start.velocity = scaled(speed, way);
  const auto path = difference(at(start, air, t).position, start.position);
  const double length = dot(path, way);
  EXPECT_NEAR(norm(difference(path, scaled(length, way))), 0, kSame) << "the path is straight";
  double k = 2 * (1 - length / (speed * t)) / (speed * t);
  for (int i = 0; i < 50; ++i) {  // Newton's method on ln(1 + k v t) = k length
    const double f = std::log1p(k * speed * t) - k * length;
    k -= f / (speed * t / (1 + k * speed * t) - length);
  }
  return k;
}

TEST(SpatialFlight, DragByAxisIsThatOfTheAxisThatTheAirComesAlong) {
  OpenAir air;
  air.drag_k = 0.2;
  air.axis_drag_x = 0.07;
  air.axis_drag_y = -0.03;
  EXPECT_NEAR(drag_along({1, 0, 0}, air), 0.27, 1e-9);
  EXPECT_NEAR(drag_along({0, 1, 0}, air), 0.17, 1e-9);
  EXPECT_NEAR(drag_along({0, 0, 1}, air), 0.16, 1e-9) << "A has no trace: its mean is in k";
}

TEST(SpatialFlight, ACubesDragHasTheMeanOfASpheres) {
  OpenAir air;
  air.drag_k = 0.2;
  air.cubic_drag = 0.15;
  // Σ n⁴ is 1 along a face's normal, 1/2 across an edge, 1/3 along a diagonal.
  const double face = drag_along({0, -1, 0}, air), edge = drag_along({1, 0, 1}, air),
               corner = drag_along({1, -1, 1}, air);
  EXPECT_NEAR(face, 0.2 + 0.15 * (1 - 0.6), 1e-9);
  EXPECT_NEAR(edge, 0.2 + 0.15 * (0.5 - 0.6), 1e-9);
  EXPECT_NEAR(corner, 0.2 + 0.15 * (1.0 / 3 - 0.6), 1e-9);
  // Lebedev's rule of 6, 12 and 8 points, exact to degree seven: the mean over all directions.
  EXPECT_NEAR(6 * face / 21 + 12 * edge * 4 / 105 + 8 * corner * 9 / 280, 0.2, 1e-9);
}

TEST(SpatialFlight, ItsAirMayMove) {
  const Vec3<double> boost{-0.8, 1.9, 0.4};
  const double t = 0.9;
  LetGo start = kStart;
  start.velocity = sum(start.velocity, boost);
  OpenAir air = kAllOfIt;
  air.wind = sum(air.wind, boost);
  Flown moved = at(start, air, t);
  moved.position = difference(moved.position, scaled(t, boost));
  expect_near(moved, at(kStart, kAllOfIt, t), "boosted");
}

TEST(SpatialFlight, TheWorldMayBeTurned) {
  const auto turn = normalised(Quaternion<double>{0.5, -0.6, 0.3, 0.7});
  const double t = 0.9;
  LetGo start = kStart;
  start.position = rotate(turn, start.position);
  start.velocity = rotate(turn, start.velocity);
  start.rotation.attitude = turn * start.rotation.attitude;
  OpenAir air = kAllOfIt;
  air.gravity = rotate(turn, air.gravity);
  air.wind = rotate(turn, air.wind);
  Flown expected = at(kStart, kAllOfIt, t);
  expected.position = rotate(turn, expected.position);
  expected.rotation.attitude = turn * expected.rotation.attitude;
  expect_near(at(start, air, t), expected, "turned");
}

TEST(SpatialFlight, ADyingSpinIsAFreeOneOnASlowerClock) {
  // Euler's equations are quadratic in ω: with ω' = … − c ω, ω(t) = exp(−c t) ω_free(τ), τ = (1 − exp(−c
  // t))/c.
  const double c = 1.6, t = 0.9, tau = (1 - std::exp(-c * t)) / c;
  OpenAir air;
  air.spin_damping = c;
  const auto damped = at(kStart, air, t).rotation, free = at(kStart, OpenAir{}, tau).rotation;
  expect_near(rotation_between(damped.attitude, free.attitude), {0, 0, 0}, kSame, "attitude");
  expect_near(damped.omega, scaled(std::exp(-c * t), free.omega), kSame, "spin");
}

TEST(SpatialFlight, ASpheresDyingSpinKeepsItsAxis) {
  // ω' = −c ω: it has turned by |ω₀| (1 − exp(−c t))/c about ω₀, also where all moments of inertia are alike.
  const double c = 1.6, t = 0.9;
  LetGo ball = kStart;
  ball.inertia = {2e-3, 2e-3, 2e-3};
  OpenAir air;
  air.spin_damping = c;
  const auto damped = at(ball, air, t).rotation;
  const auto& from = kStart.rotation;
  const auto turned = from.attitude * exp(scaled((1 - std::exp(-c * t)) / c, from.omega));
  expect_near(rotation_between(damped.attitude, turned), {0, 0, 0}, kSame, "attitude");
  expect_near(damped.omega, scaled(std::exp(-c * t), from.omega), kSame, "spin");
}

TEST(SpatialFlight, DerivativesAreCentralDifferences) {
  constexpr int kInputs = 8;
  const double t = 0.8;
  const auto answer = [&]<class S>(const std::array<S, kInputs>& p) {
    SpatialStart<S> start;
    for (std::size_t i = 0; i < 3; ++i) {
      start.position[i] = S(kStart.position[i]);
      start.velocity[i] = S(kStart.velocity[i]);
      start.rotation.omega[i] = S(kStart.rotation.omega[i]);
      start.inertia[i] = S(kStart.inertia[i]);
    }
    const auto& q = kStart.rotation.attitude;
    start.rotation.attitude = {S(q.w), S(q.x), S(q.y), S(q.z)};
    SpatialAir<S> air;
    air.gravity = {S(0.3), S(-0.2), p[7]};
    air.drag_k = p[0], air.linear_drag = p[1], air.lift = p[2], air.axis_drag_x = p[3];
    air.axis_drag_y = S(-0.03), air.cubic_drag = p[4], air.spin_damping = p[5];
    air.wind = {p[6], S(-0.6), S(0.3)};
    return fly_in_space<S>(start, air, {S(t)}, kTight).states[0].position;
  };
  const std::array<double, kInputs> p{0.05, 0.11, 0.02, 0.07, 0.15, 0.4, 1.1, -9.7};
  const auto exact = answer(support::seeded(p));
  for (std::size_t k = 0; k < kInputs; ++k) {
    const auto off = support::best_differences_by(k, answer, p, exact, 1e-3);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(off[i], 1e-7) << "input " << k << ", component " << i;
  }
}

TEST(SpatialEffects, TiltsTurnGravityAndKeepItsSize) {
  const double g = 9.8, x = 0.2, y = -0.3;
  const auto gravity = [&](std::vector<std::string> names, std::vector<double> values) {
    OpenAir air{{0, 0, -g}};
    dynamics::apply_effects(spatial_effects(), dynamics::Values<double>(names, values), air);
    return air.gravity;
  };
  const auto both = gravity({"flight.gravity_tilt.toward_x", "flight.gravity_tilt.toward_y"}, {x, y});
  EXPECT_NEAR(norm(both), g, 1e-14);
  EXPECT_NEAR(std::asin(both[1] / g), y, 1e-14) << "towards +y";
  EXPECT_NEAR(std::atan2(both[0], -both[2]), x, 1e-14) << "towards +x";
  expect_near(gravity({"flight.gravity.ratio", "flight.gravity_tilt.toward_x"}, {1.02, x}),
              {1.02 * g * std::sin(x), 0, -1.02 * g * std::cos(x)}, 1e-14, "both effects");
}

TEST(SpatialEffects, EachIsTheAirsTermAndDragAddsToTheDeclaredOne) {
  const std::vector<std::string> names{"flight.quadratic_drag.k", "flight.linear_drag.c",
                                       "flight.magnus_lift.k_m",  "flight.wind.w_y",
                                       "flight.drag_by_axis.a_x", "flight.drag_by_axis.a_y",
                                       "flight.cubic_drag.kappa", "flight.spin_damping.c"};
  const std::vector<double> values{0.03, 0.11, 0.02, -0.6, 0.07, -0.03, 0.15, 0.4};
  OpenAir air{{0, 0, -9.8}, 0.02};
  dynamics::apply_effects(spatial_effects(), dynamics::Values<double>(names, values), air);
  EXPECT_DOUBLE_EQ(air.drag_k, 0.05);
  OpenAir expected{{0, 0, -9.8}, 0.05, 0.11, 0.02, 0.07, -0.03, 0.15, 0.4, {0, -0.6, 0}};
  expect_near(at(kStart, air, 0.8), at(kStart, expected, 0.8), "effects");
}

TEST(SpatialFlight, RefusesADragThatDrives) {
  for (const double k : {-1.0, static_cast<double>(NAN)}) {
    OpenAir air{{0, 0, -9.8}, k};
    EXPECT_THROW(fly_in_space<double>(kStart, air, {0.5}), std::invalid_argument) << k;
    air.drag_k = 0, air.linear_drag = k;
    EXPECT_THROW(fly_in_space<double>(kStart, air, {0.5}), std::invalid_argument) << k;
  }
}

}  // namespace
}  // namespace unhand::flight
