// The limit surface of a disc pressed as (1 − (r/a)²)^s.
#include "contact/pressed_disc.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "contact/disc_friction.hpp"
#include "contact/patch.hpp"
#include "contact/pressed_disc_table.hpp"

namespace unhand::contact {
namespace {

using dynamics::Dual;
using dynamics::independent;
using std::numbers::pi;

const double kExponents[] = {-0.4, -0.21, 0.0, 0.13, 0.5, 1.0, 1.9, 3.0};

Vec3<double> random_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double spread = std::pow(10.0, normal(random));
  return {normal(random), normal(random), spread * normal(random)};
}

TEST(PressedDisc, TorqueFactorIsTheBetaFunctions) {
  for (const double s : kExponents) {
    const PressedDisc disc{Dual(s)};
    EXPECT_NEAR(disc.torque_factor().a, torque_factor(s), 1e-9) << s;
    const Vec3<double> spin = disc.resist(Vec3<double>{0, 0, 2}), slide = disc.resist(Vec3<double>{0, 3, 0});
    EXPECT_NEAR(spin[2], -1, 1e-14);
    EXPECT_NEAR(slide[1], -1, 1e-9);
  }
  EXPECT_NEAR(PressedDisc(Dual(0.5)).torque_factor().a, 3 * pi / 16, 1e-9);
}

/// Force and torque (about the centre, of a disc of radius 1) by summing over the disc in polar coordinates.
std::array<double, 2> summed(double s, double v, double omega) {
  constexpr int kRadii = 1500, kAngles = 1500;
  double force = 0, torque = 0;
  for (int i = 0; i < kRadii; ++i) {
    // equal loads: N(r) = 1 − (1 − r²)^(s+1)
    const double load = (i + 0.5) / kRadii, r = std::sqrt(1 - std::pow(1 - load, 1 / (s + 1)));
    for (int j = 0; j < kAngles; ++j) {
      const double angle = 2 * pi * (j + 0.5) / kAngles;
      const double x = v - omega * r * std::sin(angle), y = omega * r * std::cos(angle),
                   size = std::hypot(x, y);
      force += x / size;
      torque += r * (y * std::cos(angle) - x * std::sin(angle)) / size;
    }
  }
  return {force / (kRadii * kAngles), torque / (kRadii * kAngles)};
}

TEST(PressedDisc, IsTheSumOverTheDisc) {
  for (const double s : {-0.4, 0.5, 2.0})
    for (const double ratio : {0.2, 0.7, 1.0, 1.3, 4.0}) {
      const PressedDisc disc{Dual(s)};
      const double c = disc.torque_factor().a;
      const Vec3<double> w = disc.resist(Vec3<double>{ratio, 0, c});
      const auto [force, torque] = summed(s, ratio, 1);
      // the sum's own error: 1/1500² of order one, and the rim's and the centre's singularities
      EXPECT_NEAR(-w[0], force, 2e-5) << s << ' ' << ratio;
      EXPECT_NEAR(-w[2] * c, torque, 2e-5) << s << ' ' << ratio;
    }
}

TEST(PressedDisc, TheSeriesAreTheQuadrature) {
  double worst = 0, worst_slope = 0;
  for (double s = -0.4; s <= 3; s += 0.17) {
    const PressedSeriesAt series = pressed_series(s);
    for (const bool inner : {true, false})
      for (const double m : {1e-4, 0.03, 0.2, 0.5, 0.8, 0.95, 0.999, 1 - 1e-6, 1 - 1e-9}) {
        const auto exact = pressed_profile_exact(inner, m, s);
        const auto at = evaluate(inner ? series.value.inner : series.value.outer, m);
        for (int k = 0; k < 3; ++k)
          (k == 1 ? worst_slope : worst) = std::max(k == 1 ? worst_slope : worst, std::abs(at[k] - exact[k]));
      }
  }
  EXPECT_LT(worst, 1e-8);
  EXPECT_LT(worst_slope, 1e-7) << "singular at the rim as (1 − m)^(1 + s)";
}

TEST(PressedDisc, TheQuadratureIsTheClosedFormOfAUniformDisc) {
  for (const double m : {0.01, 0.3, 0.7, 0.99}) {
    const DiscProfile p = disc_profile(m);
    const auto inner = pressed_profile_exact(true, m, 0), outer = pressed_profile_exact(false, m, 0);
    EXPECT_NEAR(inner[0], p.slide, 1e-12);
    EXPECT_NEAR(inner[1], p.dslide, 1e-11);
    EXPECT_NEAR(inner[2], p.spin, 1e-12);
    EXPECT_NEAR(outer[0], p.slide, 1e-12);
    EXPECT_NEAR(outer[1], p.dslide, 1e-12);
    EXPECT_NEAR(outer[2], p.arm, 1e-12);
  }
}

TEST(PressedDisc, WithoutExponentIsTheUniformDisc) {
  const PressedDisc disc(independent(0.0, 0));
  std::mt19937_64 random(81);
  for (int i = 0; i < 200; ++i) {
    const auto u = random_vector(random), a = disc.resist(u), b = UniformDisc{}.resist(u);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], 1e-14);
    EXPECT_NEAR(disc.gauge(u), UniformDisc{}.gauge(u), 1e-13 * UniformDisc{}.gauge(u));
    const auto n = disc.slip_direction(u), m = UniformDisc{}.slip_direction(u);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(n[k], m[k], 1e-7);
  }
}

TEST(PressedDisc, GaugeAndDirectionInvertResist) {
  std::mt19937_64 random(82);
  for (const double s : kExponents) {
    const PressedDisc disc{Dual(s)};
    for (int i = 0; i < 100; ++i) {
      const auto u = random_vector(random);
      const auto w = disc.resist(u);
      EXPECT_NEAR(disc.gauge(w), 1, 1e-8);
      const double size = std::sqrt(dot3(u, u));
      const auto n = disc.slip_direction(w);
      // where the surface is flat the direction is sensitive: judged by the power it loses
      EXPECT_NEAR(dot3(disc.resist(n), n) - dot3(w, n), 0, 1e-8);
      EXPECT_GT(dot3(n, u), 0.999 * size) << s;
    }
  }
}

TEST(PressedDisc, DerivativesAreCentralDifferences) {
  std::mt19937_64 random(83);
  for (const double s : {-0.39, -0.2, 0.0, 0.5, 2.7})
    for (int i = 0; i < 60; ++i) {
      const auto u = random_vector(random);
      const PressedDisc disc(independent(s, 3));
      Vec3<Dual> x;
      for (int k = 0; k < 3; ++k) x[k] = independent(u[k], k);
      const Vec3<Dual> w = disc.resist(x);
      const Dual g = disc.gauge(x);
      const double size = std::sqrt(dot3(u, u));
      for (int j = 0; j < 4; ++j) {
        double best = 1e300, best_gauge = 1e300;
        for (const double h : {1e-3, 1e-4, 1e-5, 1e-6}) {
          auto above = u, below = u;
          const double step = j < 3 ? h * size : h, sign = j < 3 ? 1 : size;
          if (j < 3) above[j] += step, below[j] -= step;
          const PressedDisc up{Dual(j < 3 ? s : s + step)}, down{Dual(j < 3 ? s : s - step)};
          const auto a = up.resist(above), b = down.resist(below);
          double error = 0;
          for (int k = 0; k < 3; ++k)
            error = std::max(error, std::abs((a[k] - b[k]) / (2 * step) - w[k].v[j]) * size / sign);
          best = std::min(best, error);
          best_gauge = std::min(best_gauge,
                                std::abs((up.gauge(above) - down.gauge(below)) / (2 * step) - g.v[j]) / sign);
        }
        EXPECT_LT(best, 3e-6) << s << ' ' << j << " at " << u[0] << ' ' << u[1] << ' ' << u[2];
        EXPECT_LT(best_gauge, 3e-6) << s << ' ' << j;
      }
    }
}

TEST(PressedDisc, RefusesExponentsOutOfRange) {
  EXPECT_THROW(PressedDisc{Dual(-0.41)}, std::invalid_argument);
  EXPECT_THROW(PressedDisc{Dual(3.01)}, std::invalid_argument);
}

}  // namespace
}  // namespace unhand::contact
