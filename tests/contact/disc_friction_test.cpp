// The sliding and spinning disc against its definition: quadrature over the patch, and elliptic integrals.
#include "contact/disc_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace {

using namespace unhand::contact;
constexpr double kPi = std::numbers::pi;

// The patch in polar coordinates about its centre, point by point: friction against the local velocity. The
// integrand has a corner where that velocity vanishes, so this is good to some 1e-6, and owes nothing to any
// formula.
DiscFriction by_patch(double epsilon) {
  constexpr int kRadii = 1500, kAngles = 1500;
  double force = 0.0, torque = 0.0;
  for (int i = 0; i < kRadii; ++i) {
    const double r = (i + 0.5) / kRadii;
    for (int k = 0; k < kAngles; ++k) {
      const double angle = 2.0 * kPi * (k + 0.5) / kAngles, vx = epsilon - r * std::sin(angle),
                   vz = r * std::cos(angle);
      const double weight = 2.0 * r / (kRadii * kAngles) / std::hypot(vx, vz);
      force += weight * vx;
      torque += weight * r * (vz * std::cos(angle) - vx * std::sin(angle));
    }
  }
  return {force, torque, 0.0};
}

// The patch in polar coordinates about the instantaneous centre of rotation, radius integrated out: what is
// left is periodic and smooth, so the trapezoidal rule converges exponentially, as |m|^n for m = ε² or 1/ε².
DiscFriction by_centre(double epsilon) {
  const bool inner = epsilon <= 1.0;
  const double m = inner ? epsilon * epsilon : 1.0 / (epsilon * epsilon);
  constexpr int kPoints = 4000;
  long double phi = 0.0, spin = 0.0, arm = 0.0;  // 4000 roundings would show
  for (int k = 0; k < kPoints; ++k) {
    const double s = std::sin(2.0 * kPi * k / kPoints), c2 = 1.0 - s * s, root = std::sqrt(1.0 - m * s * s);
    phi += c2 * root;
    spin += root * root * root;
    arm += c2 * c2 / root;
  }
  phi *= 2.0 / kPoints;
  spin *= 2.0 / (3.0 * kPoints);
  arm *= 2.0 / (3.0 * kPoints);
  const double a = static_cast<double>(phi), b = static_cast<double>(inner ? spin : arm);
  return inner ? DiscFriction{epsilon * a, b, 0.0} : DiscFriction{a, b / epsilon, 0.0};
}

// The closed form with K and E by the arithmetic-geometric mean, in long double: the standard library's own
// elliptic integrals are good to 1e-12 only.
DiscFriction by_mean(double epsilon) {
  if (epsilon == 1.0) return {8.0 / (3.0 * kPi), 8.0 / (9.0 * kPi), 0.0};
  const long double e = epsilon, e2 = e * e, k2 = e <= 1.0L ? e2 : 1.0L / e2,
                    pi = std::numbers::pi_v<long double>;
  long double a = 1.0L, b = std::sqrt(e <= 1.0L ? (1.0L - e) * (1.0L + e) : (e - 1.0L) * (e + 1.0L) / e2);
  long double sum = 0.5L * k2, power = 1.0L;
  for (int n = 0; n < 10; ++n, power *= 2.0L) {
    const long double c = 0.5L * (a - b), mean = 0.5L * (a + b);
    b = std::sqrt(a * b);
    a = mean;
    sum += power * c * c;
  }
  const long double K = 0.5L * pi / a, E = K * (1.0L - sum);
  const long double force =
      e <= 1.0L ? ((1.0L + e2) * E - (1.0L - e2) * K) / e : (e2 + 1.0L) * E - (e2 - 1.0L) * K;
  const long double torque = e <= 1.0L ? (4.0L - 2.0L * e2) * E - (1.0L - e2) * K
                                       : e * ((4.0L - 2.0L * e2) * E + (2.0L * e2 - 5.0L + 3.0L / e2) * K);
  return {static_cast<double>(4.0L / (3.0L * pi) * force), static_cast<double>(4.0L / (9.0L * pi) * torque),
          0.0};
}

TEST(DiscFriction, IsTheIntegralOverThePatch) {
  for (double epsilon : {0.05, 0.3, 0.766, 1.0, 1.4, 6.0}) {
    const DiscFriction f = disc_friction(epsilon), sum = by_patch(epsilon);
    EXPECT_NEAR(f.force, sum.force, 2e-6) << epsilon;  // the sum's own error at 1500 × 1500 points
    EXPECT_NEAR(f.torque, sum.torque, 2e-6) << epsilon;
  }
}

TEST(DiscFriction, AccurateOverSixteenDecades) {
  for (int k = -800; k <= 800; ++k) {
    const double epsilon = std::pow(10.0, k / 100.0);
    const DiscFriction f = disc_friction(epsilon);
    // Near 1 the trapezoidal rule is slow, elsewhere the elliptic formulas cancel: each is the oracle where
    // it is good.
    const bool near = std::abs(std::log(epsilon)) < 0.02;
    const auto [force, torque, unused] = near ? by_mean(epsilon) : by_centre(epsilon);
    EXPECT_NEAR(f.force, force, 2e-14) << epsilon;
    EXPECT_NEAR(f.torque, torque, 2e-14) << epsilon;
    EXPECT_NEAR(f.force / force, 1.0, 1e-13) << epsilon;  // small values keep their digits
    EXPECT_NEAR(f.torque / torque, 1.0, 1e-13) << epsilon;
  }
}

TEST(DiscFriction, AccurateAtTheLogarithm) {
  for (int k = 2; k <= 16; ++k) {
    for (double side : {-1.0, 1.0}) {
      const double epsilon = 1.0 + side * std::pow(10.0, -k);
      const DiscFriction f = disc_friction(epsilon);
      EXPECT_NEAR(f.force, by_mean(epsilon).force, 2e-14) << epsilon - 1.0;
      EXPECT_NEAR(f.torque, by_mean(epsilon).torque, 2e-14) << epsilon - 1.0;
    }
  }
}

TEST(DiscFriction, DissipatesMostAtItsOwnSlip) {
  // ε F′ + T′ = 0 with both slopes by differences, and F′ itself; F″ is O(ln|1 − ε|), so h² ln h is the
  // error.
  for (double epsilon : {0.01, 0.2, 0.69, 0.72, 0.9, 0.99, 1.01, 1.2, 1.41, 1.42, 3.0, 30.0}) {
    double best_slope = 1.0, best_identity = 1.0;
    for (double h = 1e-2; h > 1e-8; h *= 0.1) {
      const DiscFriction up = disc_friction(epsilon + h * epsilon),
                         down = disc_friction(epsilon - h * epsilon);
      const double df = (up.force - down.force) / (2.0 * h * epsilon);
      const double dt = (up.torque - down.torque) / (2.0 * h * epsilon);
      best_slope = std::min(best_slope, std::abs(df - disc_friction(epsilon).dforce));
      best_identity = std::min(best_identity, std::abs(epsilon * disc_friction(epsilon).dforce + dt));
    }
    EXPECT_LT(best_slope, 2e-9) << epsilon;  // (rounding/h + h²) at its best over the steps
    EXPECT_LT(best_identity, 2e-9) << epsilon;
  }
}

TEST(DiscFriction, OddForceEvenTorqueMonotone) {
  double force = -1.0, torque = 1.0;
  for (int k = -300; k <= 300; ++k) {
    const double epsilon = std::pow(10.0, k / 60.0);
    const DiscFriction f = disc_friction(epsilon), back = disc_friction(-epsilon);
    EXPECT_EQ(back.force, -f.force);
    EXPECT_EQ(back.torque, f.torque);
    EXPECT_EQ(back.dforce, f.dforce);
    EXPECT_GT(f.force, force) << epsilon;
    EXPECT_LT(f.torque, torque) << epsilon;
    EXPECT_GT(f.dforce, 0.0) << epsilon;
    force = f.force;
    torque = f.torque;
  }
}

// A free disc, k = I/(mR²): v̇ = −F, (ωR)˙ = −T/k in units of μg, so d(ln ε)/ds ∝ −F/ε + T/k. Both stop
// together at the ε where F/ε = T/k. [Farkas2003]
TEST(DiscFriction, FreeDiscStopsAtTheKnownRatio) {
  for (const auto& [k, expected] :
       {std::pair{0.5, 0.6530017892}, std::pair{0.4, 0.853513}, std::pair{0.6, 0.404383}}) {
    double low = 1e-3, high = 1e3;
    for (int i = 0; i < 200; ++i) {
      const double e = std::sqrt(low * high);
      const DiscFriction f = disc_friction(e);
      (f.force / e < f.torque / k ? low : high) = e;  // ε grows while T/k > F/ε
    }
    EXPECT_NEAR(low, expected, k == 0.5 ? 1e-10 : 1e-6) << k;  // digits given
  }
}

}  // namespace
