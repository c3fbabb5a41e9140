// A disc whose friction depends on every point's own speed, against the integral over its points.
#include "contact/local_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "contact/giving_points.hpp"
#include "contact/pressed_disc.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::contact {
namespace {

constexpr double pi = std::numbers::pi;

SpeedDependence<double> dependence(double ratio, double stribeck_speed, double viscous) {
  FrictionVariation<double> v;
  v.static_ratio = ratio;
  v.stribeck_speed = stribeck_speed;
  v.viscous = viscous;
  return SpeedDependence<double>(v);
}

/// −∫ p v̂ μ(v)/μ dA, normalised, by the midpoint rule in rings of equal load. The law at rest, whose
/// direction turns at once at the centre of rotation, is left to the shape's own formula.
template <class Shape>
Vec3<double> integral(const Shape& shape, const SpeedDependence<double>& speed, const Vec3<double>& u,
                      int n = 500) {
  const double s = shape.exponent().a, c = shape.torque_factor().a, held = speed.factor(0), turn = u[2] / c;
  Vec3<double> out = shape.resist(u);
  for (double& each : out) each *= held;
  for (int i = 0; i < n; ++i) {
    const double r = std::sqrt(1 - std::pow(1 - (i + 0.5) / n, 1 / (s + 1)));
    for (int k = 0; k < n; ++k) {
      const double angle = 2 * pi * (k + 0.5) / n, x = r * std::cos(angle), z = r * std::sin(angle);
      const double vx = u[0] - turn * z, vz = u[1] + turn * x, square = vx * vx + vz * vz;
      const double share = (held - speed.factor(square)) / std::sqrt(square + 1e-300) / n / n;
      out[0] += share * vx;
      out[1] += share * vz;
      out[2] += share * (x * vz - z * vx) / c;
    }
  }
  return out;
}

template <class Shape>
Vec3<double> law(const Shape& shape, const SpeedDependence<double>& speed, const Vec3<double>& u) {
  Vec3<double> w = shape.resist(u);
  const Vec3<double> more = LocalFriction(shape.exponent(), shape.torque_factor()).wrench(speed, u);
  for (std::size_t i = 0; i < 3; ++i) w[i] += more[i];
  return w;
}

// The centre of rotation outside the disc, on its rim (u_τ = ±|v|·2/3), inside and at its middle.
constexpr Vec3<double> kSlips[] = {
    {0.06, -0.03, 0.01}, {0.3, 0.4, -0.02}, {0.03, 0.04, 0.1 / 3}, {0.02, 0.01, -0.08},    {0.002, 0, 0.3},
    {0, 0, 0.05},        {-0.05, 0.01, 0},  {1e-4, -2e-4, 1e-4},   {0.015, -0.02, 0.0175}, {0.5, -0.2, 1e-6}};

TEST(LocalFriction, IsTheIntegralOverAnEvenlyPressedDisc) {
  for (const auto& speed : {dependence(1.4, 0.05, 0), dependence(0.7, 0.01, 0), dependence(1, 0.02, 3),
                            dependence(1.3, 0.1, 2), dependence(1.2, 0.3, -0.9)})
    for (const auto& u : kSlips) {
      const auto w = law(UniformDisc{}, speed, u), exact = integral(UniformDisc{}, speed, u);
      for (std::size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(w[i], exact[i], 2e-5) << i << " at " << u[0] << ' ' << u[1] << ' ' << u[2];
    }
}

TEST(LocalFriction, InPureSpinItsTorqueIsAnErrorFunction) {
  // T = 2σ ∫₀¹ exp(−(Ωρ/v_s)²) ρ² dρ = 2σ q³ (√π/4 erf(1/q) − exp(−1/q²)/(2q)), q = v_s/Ω
  const double c = 2.0 / 3, excess = 0.4, v_s = 0.05;
  const LocalFriction local(Dual(0.0), Dual(c));
  for (const double q : {0.003, 0.05, 0.3, 1.0, 8.0}) {
    const double torque =
        2 * excess * q * q * q * (std::sqrt(pi) / 4 * std::erf(1 / q) - std::exp(-1 / (q * q)) / (2 * q));
    const auto w = local.wrench(dependence(1 + excess, v_s, 0), Vec3<double>{0, 0, c * v_s / q});
    EXPECT_EQ(w[0], 0);
    EXPECT_NEAR(w[2], -torque / c, 1e-9) << q;
  }
}

TEST(LocalFriction, FrictionIsNeverNegative) {
  const auto speed = dependence(1, 0.02, -0.9);  // 0 from 1.11 m/s on
  for (const Vec3<double>& u : {Vec3<double>{1.0, 0.3, 0.4}, {0.2, -0.1, 1.5}, {3, 0, 0.01}}) {
    const auto w = law(UniformDisc{}, speed, u), exact = integral(UniformDisc{}, speed, u);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(w[i], exact[i], 2e-3) << i << " at " << u[0];
  }
}

TEST(LocalFriction, IsTheIntegralOverAnUnevenlyPressedDisc) {
  for (const double s : {-0.3, 0.2, 0.5, 1.0, 2.0}) {
    const PressedDisc disc{Dual(s)};
    for (const auto& speed : {dependence(1.4, 0.05, 0), dependence(1, 0.02, 3)})
      for (const auto& u : kSlips) {
        const auto w = law(disc, speed, u), exact = integral(disc, speed, u);
        for (std::size_t i = 0; i < 3; ++i)
          EXPECT_NEAR(w[i], exact[i], speed.stribeck ? 5e-4 : 1e-4)
              << s << ": " << i << " at " << u[0] << ' ' << u[1] << ' ' << u[2];
      }
  }
}

TEST(LocalFriction, CarriesDerivativesOfSlipParametersAndExponent) {
  // central differences; the seeds of the slip (3), σ, v_s, 1/v₀ and s
  const std::array<double, 7> at{0.03, 0.012, -0.028, 0.35, 0.06, 1.5, 0.4};
  const auto wrench = [](const std::array<double, 7>& x) {
    const PressedDisc disc{Dual(x[6])};
    return LocalFriction(disc.exponent(), disc.torque_factor())
        .wrench(dependence(1 + x[3], x[4], x[5]), Vec3<double>{x[0], x[1], x[2]});
  };
  const std::array<Dual, 7> seeded = support::seeded(at);
  FrictionVariation<Dual> v;
  v.static_ratio = seeded[3] + 1.0;
  v.stribeck_speed = seeded[4];
  v.viscous = seeded[5];
  const PressedDisc disc{seeded[6]};
  const auto w = LocalFriction(disc.exponent(), disc.torque_factor())
                     .wrench(SpeedDependence<Dual>(v), Vec3<Dual>{seeded[0], seeded[1], seeded[2]});
  for (std::size_t k = 0; k < 7; ++k) {
    const auto off = support::best_differences_by(k, wrench, at, w, 1e-3);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_LT(off[i], 1e-5 * std::max(1.0, std::abs(w[i].v[static_cast<int>(k)]))) << i << " by " << k;
  }
}

TEST(LocalFriction, IsSmoothWhereTheCentreOfRotationCrossesTheRimAndGoesFar) {
  const auto speed = dependence(1.4, 0.05, 1);
  const LocalFriction local(Dual(0.0), Dual(2.0 / 3));
  for (const double ratio : {1.0, 1e4}) {  // d: on the rim; where the disc is taken to slide as a whole
    const double v = 0.05;
    const auto inside = local.wrench(speed, Vec3<double>{v * (1 - 1e-9), 0, v / ratio / 1.5}),
               outside = local.wrench(speed, Vec3<double>{v * (1 + 1e-9), 0, v / ratio / 1.5});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(inside[i], outside[i], 1e-8) << i << " at d = " << ratio;
  }
}

TEST(LocalFriction, PointsThatHaveLongSlippedCarryIt) {
  const double mu = 0.5, radius = 0.012, force = 40, length = 2.0 / 3 * radius;
  FrictionVariation<double> v;
  v.static_ratio = 1.3;
  v.stribeck_speed = 0.08;
  v.viscous = 2;
  v.compliance = 1e-7;
  GivingPoints<double> points(FrictionLimits<double>{{mu, radius}, v});
  const Vec3<double> slip{0.05, -0.02, 4.0};
  const auto w = law(UniformDisc{}, SpeedDependence<double>(v), {slip[0], slip[1], length * slip[2]});
  auto from = points.zero(), to = from;
  Vec3<double> carried{};
  for (int k = 0; k < 200; ++k) {
    constexpr double heavy = 1e6;
    auto at = slip;
    ASSERT_TRUE(
        points.step({1e-3, force, length, {{{heavy, 0, 0}, {0, heavy, 0}, {0, 0, heavy}}}, slip, slip}, from,
                    to, at, carried));
    std::swap(from, to);
  }
  EXPECT_NEAR(carried[0], force * w[0], 2e-3 * force);
  EXPECT_NEAR(carried[1], force * w[1], 2e-3 * force);
  EXPECT_NEAR(carried[2], force * length * w[2], 2e-3 * force * length);
}

}  // namespace
}  // namespace unhand::contact
