// Published values of patch friction: the uniform disc, the ellipsoid beside it, and torque limits of round
// patches.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "contact/disc_friction.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "contact/patch.hpp"

namespace unhand::contact {
namespace {

TEST(DiscValues, AreThePublishedOnes) {
  // nine digits are known
  EXPECT_NEAR(disc_friction(0.3).force, 0.296585919, 1e-9);
  EXPECT_NEAR(disc_friction(0.3).torque, 0.622435826, 1e-9);
  EXPECT_NEAR(disc_friction(0.6530017892).force, 0.6160334132, 1e-9);
}

TEST(DiscValues, AtTheCornerOfTheRim) {
  // closed: E(1) = 1 and (1 − ε²) K → 0
  EXPECT_NEAR(disc_friction(1).force, 8 / (3 * M_PI), 1e-14);
  EXPECT_NEAR(disc_friction(1).torque, 8 / (9 * M_PI), 1e-14);
  EXPECT_NEAR(disc_friction(1).dforce, 4 / (3 * M_PI), 1e-14);
}

TEST(DiscValues, AtItsTwoEnds) {
  EXPECT_EQ(disc_friction(0).force, 0.0);
  EXPECT_NEAR(disc_friction(0).dforce, 1, 1e-15);
  EXPECT_NEAR(disc_friction(0).torque, 2.0 / 3, 1e-15);
  EXPECT_NEAR(disc_friction(1e9).force, 1, 1e-15);
  EXPECT_NEAR(disc_friction(1e9).torque * 1e9, 0.25, 1e-15);  // T → 1/(4ε)
  EXPECT_NEAR(disc_friction(INFINITY).force, 1, 1e-15);
  EXPECT_EQ(disc_friction(INFINITY).torque, 0.0);
  EXPECT_TRUE(std::isnan(disc_friction(std::nan("")).force));
}

TEST(EllipsoidBesideTheDisc, IsUpToSevenPercentTooLarge) {
  double most = 0, where = 0;
  for (double epsilon = 0.01; epsilon < 10; epsilon *= 1.0005) {
    const DiscFriction f = disc_friction(epsilon);
    const double excess = 1 / std::hypot(f.force, 1.5 * f.torque) - 1;
    EXPECT_GE(excess, 0) << "the ellipsoid lies outside the disc's surface, epsilon " << epsilon;
    if (excess > most) {
      most = excess;
      where = epsilon;
    }
  }
  EXPECT_NEAR(most, 0.0704, 5e-5);    // to the digits known
  EXPECT_NEAR(where, 0.766, 1.5e-3);  // to the digits known and the grid of 0.05 %
}

TEST(EllipsoidBesideTheDisc, TheGaugesSaySo) {
  const DiscFriction f = disc_friction(0.766);
  const double size = std::hypot(f.force, 1.5 * f.torque);
  const Vec3<double> on_ellipsoid{f.force / size, 0, 1.5 * f.torque / size};
  EXPECT_NEAR(Ellipsoid{}.gauge(on_ellipsoid), 1, 1e-15);
  EXPECT_NEAR(UniformDisc{}.gauge(on_ellipsoid), 1.0704, 5e-5);
}

/// ∫ p r² dr / ∫ p r dr over [0, 1], by the trapezoidal rule after r = ½ (1 + tanh(π/2 sinh x)): converges
/// exponentially whatever the pressure does at the rim. `pressure` takes r and 1 − r, since the latter
/// underflows first.
template <class Pressure>
double factor_by_quadrature(Pressure&& pressure) {
  double top = 0, bottom = 0;
  for (double x = -5.8; x <= 5.8; x += 1e-3) {
    const double s = 0.5 * M_PI * std::sinh(x);
    const double r = 1 / (1 + std::exp(-2 * s)), rest = 1 / (1 + std::exp(2 * s));
    const double p = pressure(r, rest) * r * rest * std::cosh(x);
    top += p * r * r;
    bottom += p * r;
  }
  return top / bottom;
}

TEST(TorqueFactor, PublishedValues) {
  EXPECT_NEAR(torque_factor_power(1), 0.5, 1e-14);
  EXPECT_NEAR(torque_factor_power(2), 3 * M_PI / 16, 1e-14);
  EXPECT_NEAR(torque_factor_power(3), 0.62025, 5e-6);  // to the digits published
  EXPECT_NEAR(torque_factor_power(4), 0.63541, 5e-6);
  EXPECT_NEAR(torque_factor_power(1e6), 2.0 / 3, 1e-6);  // uniform in the limit, the first order is 1/n²
  EXPECT_NEAR(torque_factor(0), 2.0 / 3, 1e-14);
  EXPECT_NEAR(torque_factor(0.5), 3 * M_PI / 16, 1e-14);
  EXPECT_NEAR(torque_factor(-0.5), M_PI / 4, 1e-14);
  EXPECT_NEAR(torque_factor(-1 + 1e-9), 1, 1e-8);  // a thin ring
}

TEST(TorqueFactor, IsTheIntegralOfThePressure) {
  // 1e-11: rounding in the sum and, for s = −0.9, the integrable pole at the rim
  for (const double n : {0.5, 1.0, 1.7, 2.0, 3.0, 4.0, 7.5, 10.0})
    EXPECT_NEAR(torque_factor_power(n), factor_by_quadrature([&](double r, double rest) {
                  // 1 − rⁿ without cancellation at the rim
                  return std::pow(rest < 0.5 ? -std::expm1(n * std::log1p(-rest)) : 1 - std::pow(r, n),
                                  1 / n);
                }),
                1e-11)
        << "n " << n;
  for (const double s : {-0.9, -0.5, -0.2, 0.0, 0.5, 1.0, 3.0, 30.0})
    EXPECT_NEAR(torque_factor(s),
                factor_by_quadrature([&](double r, double rest) { return std::pow(rest * (1 + r), s); }),
                1e-11)
        << "s " << s;
}

TEST(TorqueFactor, WhatHasNoPressureIsRejected) {
  for (const double n : {0.0, -1.0, 1e7, std::nan("")})
    EXPECT_THROW(torque_factor_power(n), std::invalid_argument) << n;
  for (const double s : {-1.0, -2.0, 2000.0, std::nan("")})
    EXPECT_THROW(torque_factor(s), std::invalid_argument) << s;
}

}  // namespace
}  // namespace unhand::contact
