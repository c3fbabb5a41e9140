// Flights to their landing: closed forms, the event's direction, drag.
#include "flight/fly.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "flight/spatial_flight.hpp"
#include "tests/flight/tight.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::flight {
namespace {

using dynamics::Dual;
using dynamics::independent;
using dynamics::Vec2;
constexpr double g = 9.81;

using Problem = FlightProblem<double>;

Problem thrown(double z, double vz) {
  Problem p;
  p.pose = {0.2, z, 0.4};
  p.twist = {1.5, vz, -7.0};
  p.gravity = {0, -g};
  return p;
}

/// So little drag that it moves nothing by more than 1e-12, but the integrator flies.
Problem by_integrator(Problem p) {
  p.drag_k = 1e-14;
  return p;
}

void expect_near(const Landing<double>& a, const Landing<double>& b, double tolerance) {
  EXPECT_NEAR(a.flight_time, b.flight_time, tolerance);
  EXPECT_NEAR(a.pose.x, b.pose.x, tolerance);
  EXPECT_NEAR(a.pose.z, b.pose.z, tolerance);
  EXPECT_NEAR(a.pose.theta, b.pose.theta, 10 * tolerance);  // 7 rad/s
  EXPECT_NEAR(a.twist.vx, b.twist.vx, tolerance);
  EXPECT_NEAR(a.twist.vz, b.twist.vz, 10 * tolerance);
  EXPECT_NEAR(a.twist.omega, b.twist.omega, tolerance);
}

TEST(Projectile, LandsWhereTheFormulaSays) {
  const auto result = fly(thrown(1.2, 3.0));
  ASSERT_EQ(result.outcome, FlightOutcome::landed);
  const double t = (3 + std::sqrt(9 + 2 * g * 1.2)) / g;
  EXPECT_NEAR(result.landing.flight_time, t, 1e-15);
  EXPECT_NEAR(result.landing.pose.x, 0.2 + 1.5 * t, 1e-15);
  EXPECT_NEAR(result.landing.pose.z, 0, 1e-15);
  EXPECT_NEAR(result.landing.pose.theta, 0.4 - 7 * t, 1e-15);
  EXPECT_NEAR(result.landing.twist.vz, 3 - g * t, 1e-14);
}

TEST(Projectile, TheLandingAngleCountsTheFlips) {
  Problem p = thrown(1.2, 3.0);
  p.twist.omega = 40;
  const auto result = fly(p);
  EXPECT_GT(result.landing.pose.theta, 10 * std::numbers::pi);
  EXPECT_NEAR(result.landing.pose.theta, 0.4 + 40 * result.landing.flight_time, 1e-13);
  EXPECT_NEAR(fly(by_integrator(p), kTight).landing.pose.theta, result.landing.pose.theta, 1e-10);
}

TEST(Projectile, TheIntegratorAgrees) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> height(0.05, 3), speed(-4, 6), tilt(-1, 1);
  for (int n = 0; n < 50; ++n) {
    Problem p = thrown(height(random), speed(random));
    p.gravity.x = tilt(random);
    const auto closed = fly(p), integrated = fly(by_integrator(p), kTight);
    ASSERT_EQ(closed.outcome, FlightOutcome::landed) << n;
    ASSERT_EQ(integrated.outcome, FlightOutcome::landed) << n;
    expect_near(integrated.landing, closed.landing, 1e-11);
  }
}

TEST(Projectile, StartsBelowTheHeightAndLandsOnTheWayDown) {
  for (const double vz : {3.2, 3.14, 5.0}) {  // apexes 21.9 mm and 2.5 mm above zero, and far above
    const Problem p = thrown(-0.5, vz);
    const double t = (vz + std::sqrt(vz * vz - g)) / g;
    const auto closed = fly(p), integrated = fly(by_integrator(p), kTight);
    ASSERT_EQ(closed.outcome, FlightOutcome::landed);
    ASSERT_EQ(integrated.outcome, FlightOutcome::landed);
    EXPECT_NEAR(closed.landing.flight_time, t, 1e-15);
    EXPECT_LT(closed.landing.twist.vz, 0);
    EXPECT_NEAR(integrated.landing.flight_time, t, 1e-10);
  }
}

TEST(Projectile, AShortVisitAboveTheHeightIsSeen) {
  // Above zero for 2 √(2 h/g), 0.3 ms to 9 ms, wherever in a step of up to 50 ms that falls.
  for (const double h : {1e-4, 1e-5, 1e-6, 1e-7})
    for (double z = -0.8; z < -0.3; z += 0.0013) {
      const auto result = fly(by_integrator(thrown(z, std::sqrt(2 * g * (h - z)))), kTight);
      ASSERT_EQ(result.outcome, FlightOutcome::landed) << h << " above, from " << z;
      // 1e-12 m of the integrator's at the apex.
      EXPECT_NEAR(result.landing.twist.vz, -std::sqrt(2 * g * h), 1e-12 * g / std::sqrt(2 * g * h) + 1e-10)
          << h << z;
    }
}

TEST(Projectile, NeverReachesAHeightAboveItsApex) {
  // From z = −0.5 with vz = 2.5 the apex is at −0.18. With z + max(vz, 0) for an event it would seem to land:
  // that passes zero downwards at vz = 0.18 m/s, while still rising.
  const auto printed = [](double vz) { return -0.5 + (2.5 * 2.5 - vz * vz) / (2 * g) + std::max(vz, 0.0); };
  EXPECT_GT(printed(0.19), 0);
  EXPECT_LT(printed(0.18), 0);
  for (const double vz : {2.5, 0.0, -1.0}) {
    EXPECT_EQ(fly(thrown(-0.5, vz)).outcome, FlightOutcome::never_reaches) << vz;
    Problem p = by_integrator(thrown(-0.5, vz));
    p.longest = 5;
    const auto result = fly(p);
    EXPECT_EQ(result.outcome, FlightOutcome::never_reaches) << vz;
    EXPECT_EQ(result.landing.flight_time, 0);
  }
}

TEST(Projectile, AFlightThatTakesTooLongReachesNothing) {
  Problem p = thrown(1.2, 3.0);
  const double t = (3 + std::sqrt(9 + 2 * g * 1.2)) / g;
  for (const bool closed : {true, false}) {
    p.longest = 1.001 * t;
    EXPECT_EQ(fly(closed ? p : by_integrator(p)).outcome, FlightOutcome::landed) << closed;
    p.longest = 0.999 * t;
    EXPECT_EQ(fly(closed ? p : by_integrator(p)).outcome, FlightOutcome::never_reaches) << closed;
  }
}

TEST(Projectile, AtTheHeightItself) {
  EXPECT_NEAR(fly(thrown(0, 2)).landing.flight_time, 4 / g, 1e-15);
  EXPECT_NEAR(fly(by_integrator(thrown(0, 2)), kTight).landing.flight_time, 4 / g, 1e-10);
  for (const Problem& p : {thrown(0, -2), by_integrator(thrown(0, -2))}) {
    const auto result = fly(p);
    EXPECT_EQ(result.outcome, FlightOutcome::landed);
    EXPECT_EQ(result.landing.flight_time, 0);
  }
}

TEST(Projectile, WithoutGravityOnlyAFallingObjectLands) {
  for (const double pull : {0.0, -0.5, 1e-18}) {
    Problem p = thrown(1, -2);
    p.gravity.z = -pull;
    const auto closed = fly(p), integrated = fly(by_integrator(p), kTight);
    ASSERT_EQ(closed.outcome, FlightOutcome::landed) << pull;
    expect_near(integrated.landing, closed.landing, 1e-11);
    EXPECT_NEAR(closed.landing.pose.z, 0, 1e-15);
    p.twist.vz = 2;
    if (pull <= 0) {
      EXPECT_EQ(fly(p).outcome, FlightOutcome::never_reaches) << pull;
    }
  }
  Problem p = thrown(1, -0.5);  // turned back before it arrives
  p.gravity.z = 0.5;
  EXPECT_EQ(fly(p).outcome, FlightOutcome::never_reaches);
}

TEST(Projectile, TiltedGravityBendsTheFlight) {
  const double angle = 0.1;
  Problem p = thrown(1, 2);
  p.gravity = {g * std::sin(angle), -g * std::cos(angle)};
  const double down = g * std::cos(angle), t = (2 + std::sqrt(4 + 2 * down)) / down;
  const auto result = fly(p);
  EXPECT_NEAR(result.landing.flight_time, t, 1e-15);
  EXPECT_NEAR(result.landing.pose.x, 0.2 + 1.5 * t + 0.5 * g * std::sin(angle) * t * t, 1e-14);
}

// ---------------------------------------------------------------- drag

/// Dropped from rest: v = v∞ tanh(g t/v∞) and h = v∞²/g ln cosh(g t/v∞), v∞ = √(g/k).
TEST(Drag, VerticalDrop) {
  Problem p = thrown(3, 0);
  p.twist.vx = 0;
  p.drag_k = 0.4;
  const double v_end = std::sqrt(g / 0.4), t = v_end / g * std::acosh(std::exp(3 * g / (v_end * v_end)));
  const auto result = fly(p, kTight);
  ASSERT_EQ(result.outcome, FlightOutcome::landed);
  EXPECT_NEAR(result.landing.flight_time, t, 1e-11);
  EXPECT_NEAR(result.landing.twist.vz, -v_end * std::tanh(g * t / v_end), 1e-10);
  EXPECT_NEAR(result.landing.pose.x, 0.2, 1e-15);
}

/// Thrown up it rises v∞²/(2g) ln(1 + v²/v∞²) and comes back with v/√(1 + v²/v∞²).
TEST(Drag, UpAndDownAgain) {
  Problem p = thrown(0, 4);
  p.twist.vx = 0;
  p.drag_k = 0.4;
  const double square = g / 0.4;
  const auto result = fly(p, kTight);
  EXPECT_NEAR(result.landing.twist.vz, -4 / std::sqrt(1 + 16 / square), 1e-10);
  p.pose.z = -square / (2 * g) * std::log1p(16 / square);  // the apex is the landing height
  p.pose.z -= 1e-4;
  p.longest = 5;
  EXPECT_EQ(fly(p, kTight).outcome, FlightOutcome::never_reaches);
  p.pose.z += 2e-4;
  EXPECT_EQ(fly(p, kTight).outcome, FlightOutcome::landed);
}

TEST(Drag, EndsAtTheTerminalVelocity) {
  Problem p = thrown(300, 5);
  p.drag_k = 0.4;
  p.longest = 100;
  const auto result = fly(p);
  EXPECT_NEAR(result.landing.twist.vz, -std::sqrt(g / 0.4), 1e-6);
  EXPECT_NEAR(result.landing.twist.vx, 0, 1e-6);
}

TEST(Drag, EnergyOnlyFalls) {
  Problem p = thrown(0, 5);
  p.drag_k = 0.3;
  double last = 0.5 * (1.5 * 1.5 + 25);
  for (double height = 0.7; height > -10; height -= 0.5) {
    p.landing_height = height;
    const auto result = fly(p, kTight);
    ASSERT_EQ(result.outcome, FlightOutcome::landed) << height;
    const auto& v = result.landing.twist;
    const double energy = 0.5 * (v.vx * v.vx + v.vz * v.vz) + g * height;
    EXPECT_LT(energy, last) << height;
    last = energy;
  }
}

/// The speed turns at the rate Ω = k_m ω about the drift (g/Ω, 0) in which lift and weight cancel:
/// v = v_d + R(Ωt)(v_0 − v_d). The object's path is a cycloid.
TEST(MagnusLift, IsACycloid) {
  for (const double omega : {-30.0, 12.0}) {
    Problem p = thrown(1.2, 3.0);
    p.twist.omega = omega;
    p.lift_km = 0.08;
    const auto result = fly(p, kTight);
    ASSERT_EQ(result.outcome, FlightOutcome::landed) << omega;
    const auto& end = result.landing;
    const double rate = p.lift_km * omega, t = end.flight_time, drift = g / rate;
    const Vec2<double> u{1.5 - drift, 3.0}, turned = dynamics::rotate(rate * t, u);
    // The integral of R(Ωs) u is [sin Ωt u + (1 − cos Ωt) J u]/Ω.
    const double sine = std::sin(rate * t) / rate, versine = (1 - std::cos(rate * t)) / rate;
    EXPECT_NEAR(end.pose.x, 0.2 + drift * t + sine * u.x - versine * u.z, 1e-9) << omega;
    EXPECT_NEAR(0, 1.2 + sine * u.z + versine * u.x, 1e-9) << omega;
    EXPECT_NEAR(end.twist.vx, drift + turned.x, 1e-9) << omega;
    EXPECT_NEAR(end.twist.vz, turned.z, 1e-9) << omega;
    EXPECT_NEAR(end.pose.theta, 0.4 + omega * t, 1e-9) << omega;
  }
}

// ---------------------------------------------------------------- tracked point

TEST(TrackedPoint, LandsInsteadOfTheCentreOfMass) {
  // The first downward passage of the tracked point against a scan of its closed form at 20 µs. Spins of up
  // to 80 rad/s take it across the height several times in a flight.
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> height(0.25, 1), speed(-2, 4), spin(-80, 80), offset(-0.15, 0.15);
  for (int n = 0; n < 60; ++n) {
    Problem p = thrown(height(random), speed(random));
    p.twist.omega = spin(random);
    p.tracked = {offset(random), offset(random)};
    const auto com = [&](double t) { return ballistic(p.pose, p.twist, p.gravity, t); };
    const auto z = [&](double t) { return com(t).pose.z + dynamics::rotate(com(t).pose.theta, p.tracked).z; };
    double t = 0;
    while (!(z(t) > 0 && z(t + 2e-5) <= 0)) t += 2e-5;
    const auto result = fly(p, kTight);
    ASSERT_EQ(result.outcome, FlightOutcome::landed) << n;
    const auto& landing = result.landing;
    EXPECT_NEAR(landing.flight_time, t + 1e-5, 1.1e-5) << n << " omega " << p.twist.omega;
    const Vec2<double> d = dynamics::rotate(landing.pose.theta, p.tracked);
    const auto at = com(landing.flight_time);
    EXPECT_NEAR(landing.pose.z, 0, 1e-10) << n;
    EXPECT_NEAR(landing.pose.x, at.pose.x + d.x, 1e-10) << n;
    EXPECT_NEAR(landing.twist.vx, at.twist.vx - p.twist.omega * d.z, 1e-9) << n;
    EXPECT_NEAR(landing.twist.vz, at.twist.vz + p.twist.omega * d.x, 1e-9) << n;
  }
}

TEST(TrackedPoint, LandsThoughTheCentreOfMassIsBelowTheHeight) {
  // Without spin the point falls as the object does: from 0.1 m above the height, with the CoM 0.05 m below.
  for (const double vz : {0.0, 1.0}) {
    Problem p = thrown(-0.05, vz);
    p.twist.omega = 0;
    p.tracked = dynamics::rotate(-p.pose.theta, Vec2<double>{0.03, 0.15});
    const auto result = fly(p, kTight);
    ASSERT_EQ(result.outcome, FlightOutcome::landed) << vz;
    EXPECT_NEAR(result.landing.flight_time, (vz + std::sqrt(vz * vz + 2 * g * 0.1)) / g, 1e-10) << vz;
    // and the other way round: the point starts below the height, and passes it upwards first
    p.pose.z = 0.05, p.twist.vz = 2;
    p.tracked = dynamics::rotate(-p.pose.theta, Vec2<double>{0.03, -0.15});
    const auto risen = fly(p, kTight);
    ASSERT_EQ(risen.outcome, FlightOutcome::landed);
    EXPECT_NEAR(risen.landing.flight_time, (2 + std::sqrt(4 - 2 * g * 0.1)) / g, 1e-10);
  }
}

TEST(TrackedPoint, AFastSpinHidesNoPassage) {
  // Half a turn takes 5 to 15 ms.
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> height(0.3, 1), speed(-1, 3), spin(200, 600);
  for (int n = 0; n < 12; ++n) {
    Problem p = thrown(height(random), speed(random));
    p.twist.omega = (n % 2 ? 1 : -1) * spin(random);
    p.tracked = {0.1, -0.06};
    const auto z = [&](double t) {
      const auto com = ballistic(p.pose, p.twist, p.gravity, t).pose;
      return com.z + dynamics::rotate(com.theta, p.tracked).z;
    };
    double t = 0;
    while (!(z(t) > 0 && z(t + 1e-5) <= 0)) t += 1e-5;
    const auto result = fly(p, kTight);
    ASSERT_EQ(result.outcome, FlightOutcome::landed) << n;
    EXPECT_NEAR(result.landing.flight_time, t + 5e-6, 6e-6) << n << " omega " << p.twist.omega;
  }
}

TEST(TrackedPoint, IsWhatFlyThroughReports) {
  Problem p = thrown(1, 2);
  p.tracked = {0.05, -0.02};
  const std::vector<double> times{0.3, 0.0, 0.7};
  const auto closed = fly_through(p, times), integrated = fly_through(by_integrator(p), times, kTight);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const auto at = ballistic(p.pose, p.twist, p.gravity, times[i]);
    const Vec2<double> d = dynamics::rotate(at.pose.theta, p.tracked);
    EXPECT_NEAR(closed[i].x, at.pose.x + d.x, 1e-15);
    EXPECT_NEAR(closed[i].z, at.pose.z + d.z, 1e-15);
    EXPECT_NEAR(integrated[i].x, closed[i].x, 1e-11);
    EXPECT_NEAR(integrated[i].z, closed[i].z, 1e-11);
    EXPECT_NEAR(integrated[i].theta, closed[i].theta, 1e-11);
  }
}

TEST(Flight, ErrorsNameWhatIsNotFinite) {
  Problem p = thrown(1, 2);
  p.twist.vz = NAN;
  EXPECT_EQ(support::refusal([&] { fly(p); }), "flight: twist vz = nan m/s is not finite");
}

// ---------------------------------------------------------------- in space

TEST(DragInSpace, IsThePlanarFlightInItsPlane) {
  Problem p = thrown(1, 2);
  p.drag_k = 0.3;
  const std::vector<double> times{0.5, 0.0, 0.2};
  const auto planar = fly_through(p, times, kTight);
  const double turn = 0.7, c = std::cos(turn), s = std::sin(turn);  // the plane, about the vertical
  const SpatialStart<double> start{.position = {0.2 * c, 0.2 * s, 1}, .velocity = {1.5 * c, 1.5 * s, 2}};
  const SpatialAir<double> air{.gravity = {0, 0, -g}, .drag_k = 0.3};
  const auto spatial = fly_in_space(start, air, times, kTight).states;
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_NEAR(spatial[i].position[0], planar[i].x * c, 1e-11);
    EXPECT_NEAR(spatial[i].position[1], planar[i].x * s, 1e-11);
    EXPECT_NEAR(spatial[i].position[2], planar[i].z, 1e-11);
  }
}

TEST(DragInSpace, AtNoDragIsTheParabolaWithADerivative) {
  const SpatialStart<Dual> start{.position = {Dual(0), Dual(0), Dual(1)},
                                 .velocity = {Dual(1), Dual(2), Dual(3)}};
  SpatialAir<Dual> air{.gravity = {Dual(0), Dual(0), Dual(-g)}};
  const std::vector<Dual> when{Dual(0.4)};
  const auto parabola = fly_in_space(start, air, when).states[0].position;
  air.drag_k = independent(0, 0);
  const auto with = fly_in_space(start, air, when, kTight).states[0].position;
  // Of first order in k the drag −k |v| v acts along the parabola: by T it has moved the object by
  // −k ∫ (T − t) |v| v dt.
  for (int i = 0; i < 3; ++i) {
    constexpr int kSteps = 200;  // Simpson's rule: 1e-12 here
    const double T = 0.4, h = T / kSteps;
    double moved = 0;
    for (int n = 0; n <= kSteps; ++n) {
      const double t = n * h, v[3] = {1, 2, 3 - g * t};
      const double weight = (n == 0 || n == kSteps ? 1 : n % 2 ? 4 : 2) * h / 3;
      moved -= weight * (T - t) * std::hypot(v[0], v[1], v[2]) * v[i];
    }
    EXPECT_NEAR(with[i].a, parabola[i].a, 1e-12);
    EXPECT_NEAR(with[i].v[0], moved, 1e-9);
  }
}

TEST(RecordedFlight, StepsAreNoLongerThanAsked) {
  Problem p = thrown(1, 2);
  p.drag_k = 0.3;
  dynamics::IntegratorOptions options;
  for (const double longest : {1e-3, 1e-2}) {
    options.longest_step = longest;
    options.step_budget = static_cast<long>(0.5 / longest) - 1;
    EXPECT_THROW(record_flight(p, 0.5, options), std::runtime_error) << longest << ": too few such steps";
    EXPECT_EQ(fly_in_space<double>({.velocity = {1, 2, 3}}, {.drag_k = 0.3}, {0.5}, options).outcome,
              dynamics::Outcome::step_budget_spent);
  }
}

TEST(Flights, RefuseWhatIsNoFlight) {
  Problem p = thrown(1, 2);
  p.drag_k = -0.1;
  EXPECT_THROW(fly(p), std::invalid_argument);
  p.drag_k = 0;
  p.twist.vx = NAN;
  EXPECT_THROW(fly(p), std::invalid_argument);
  // In closed form as by the integrator.
  for (const double drag : {0.0, 0.1}) {
    Problem q = thrown(1, 2);
    q.drag_k = drag;
    EXPECT_THROW(fly_through(q, {-0.1}), std::invalid_argument) << drag;
    EXPECT_THROW(fly_through(q, {NAN}), std::invalid_argument) << drag;
    for (const double longest : {0.0, -1.0, double(NAN)})
      EXPECT_THROW(record_flight(q, longest), std::invalid_argument) << drag << ' ' << longest;
    q.longest = NAN;
    EXPECT_THROW(fly(q), std::invalid_argument) << drag;
  }
}

}  // namespace
}  // namespace unhand::flight
