// What every limit surface obeys: maximal dissipation, symmetry, the gauge, derivatives; and how far the
// ellipsoid is from the disc.
#include "contact/limit_surface_shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <iomanip>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "contact/convex_quartic.hpp"
#include "contact/disc_friction.hpp"
#include "contact/isotropic_quartic.hpp"

namespace {

using namespace unhand::contact;
using unhand::dynamics::Dual;
using unhand::dynamics::independent;

std::string text(const Vec3<double>& x) {
  std::ostringstream out;
  out << std::setprecision(17) << "(" << x[0] << ", " << x[1] << ", " << x[2] << ") ";
  return out.str();
}

// Random directions, and the places where a formula may break: axes, their neighbourhoods, the disc's ε = 1.
std::vector<Vec3<double>> slips() {
  std::vector<Vec3<double>> out;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 200; ++k) out.push_back({normal(random), normal(random), normal(random)});
  for (double tiny : {0.0, 1e-200, 1e-20, 1e-9, 1e-4}) {
    out.insert(out.end(),
               {{1, tiny, 0}, {tiny, -1, tiny}, {0, tiny, 1}, {tiny, tiny, -2}, {0.6, -0.8, tiny}});
    for (double side : {-1.0, 1.0}) out.push_back({0.9, 1.2, 1.0 + side * tiny});
  }
  return out;
}

Vec3<double> scaled(const Vec3<double>& x, double k) { return {k * x[0], k * x[1], k * x[2]}; }

template <class Shape>
Vec3<Dual> lifted(const Vec3<double>& x) {
  return {independent(x[0], 0), independent(x[1], 1), independent(x[2], 2)};
}

template <class T>
T make();
template <>
Ellipsoid make() {
  return {};
}
template <>
UniformDisc make() {
  return {};
}
template <>
ConvexQuartic make() {
  return ConvexQuartic::closest_to_disc();
}
template <>
IsotropicQuartic make() {
  return IsotropicQuartic::closest_to_disc();
}

template <class T>
class Shapes : public testing::Test {
 protected:
  T shape = make<T>();
};
using All = testing::Types<Ellipsoid, UniformDisc, ConvexQuartic, IsotropicQuartic>;
TYPED_TEST_SUITE(Shapes, All);

TYPED_TEST(Shapes, MaximalDissipation) {
  std::vector<Vec3<double>> surface;
  for (const auto& u : slips()) surface.push_back(this->shape.resist(u));
  for (const auto& u : slips()) {
    const Vec3<double> w = this->shape.resist(u);
    for (const auto& other : surface) {
      EXPECT_LE(dot3(w, u) - dot3(other, u), 1e-13 * std::sqrt(dot3(u, u))) << text(u);  // rounding
    }
  }
}

TYPED_TEST(Shapes, WrenchIsOnTheSurfaceAndSymmetric) {
  for (const auto& u : slips()) {
    const Vec3<double> w = this->shape.resist(u), back = this->shape.resist(scaled(u, -1.0));
    EXPECT_NEAR(this->shape.gauge(w), 1.0, 2e-14) << text(u);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(back[i], -w[i], 1e-13) << text(u);
  }
  EXPECT_NEAR(this->shape.resist(Vec3<double>{0.6, 0.8, 0})[0], -0.6, 1e-14);
  EXPECT_NEAR(this->shape.resist(Vec3<double>{0.6, 0.8, 0})[1], -0.8, 1e-14);
  EXPECT_NEAR(this->shape.resist(Vec3<double>{0, 0, -3})[2], 1.0, 1e-14);
}

TYPED_TEST(Shapes, GaugeAndWrenchAreHomogeneousAtAnyMagnitude) {
  for (const auto& u : slips()) {
    const Vec3<double> w = this->shape.resist(u);
    for (double k : {1e-300, 1e-100, 1e-12, 3.0, 1e90, 1e290}) {
      const Vec3<double> other = this->shape.resist(scaled(u, k));
      if (k >= 1e-100) {  // below, the tiny components of u are denormal
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(other[i], w[i], 2e-13) << text(u) << k;
      }
      EXPECT_NEAR(this->shape.gauge(scaled(w, k)) / k, 1.0, 2e-14) << text(u) << k;
    }
  }
}

TYPED_TEST(Shapes, SlipDirectionInvertsTheWrench) {
  for (const auto& u : slips()) {
    const Vec3<double> w = this->shape.resist(u), n = this->shape.slip_direction(scaled(w, 0.3));
    EXPECT_NEAR(dot3(n, n), 1.0, 1e-14);
    EXPECT_LT(dot3(n, w), 0.0);
    const Vec3<double> again = this->shape.resist(n);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(n[i], u[i] / std::sqrt(dot3(u, u)), 1e-11)
          << text(u);  // Newton's last step 1e-7, squared, × F″/F′
      EXPECT_NEAR(again[i], w[i], 1e-11) << text(u);
    }
  }
}

TYPED_TEST(Shapes, IsotropicInTheSlide) {
  for (const auto& u : slips()) {
    const Vec3<double> w = this->shape.resist(u);
    for (double angle : {0.3, 1.9, 4.0}) {
      const double c = std::cos(angle), s = std::sin(angle);
      const auto turn = [&](const Vec3<double>& x) {
        return Vec3<double>{c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]};
      };
      const Vec3<double> there = this->shape.resist(turn(u)), expected = turn(w);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(there[i], expected[i], 1e-13) << text(u);
      EXPECT_NEAR(this->shape.gauge(turn(w)), 1.0, 2e-14) << text(u);
    }
  }
}

// The best agreement with central differences over powers of ten of the step, for three scalar-valued maps at
// once.
template <class F>
double disagreement(const Vec3<double>& x, const std::vector<Dual>& y, F&& function) {
  double worst = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    for (int j = 0; j < 3; ++j) {
      double best = std::numeric_limits<double>::infinity();
      for (double h = 1e-2; h > 1e-9; h *= 0.1) {
        Vec3<double> up = x, down = x;
        up[j] += h;
        down[j] -= h;
        best = std::min(best, std::abs((function(up)[i] - function(down)[i]) / (2.0 * h) - y[i].v[j]));
      }
      worst = std::max(worst, best);
    }
  }
  return worst;
}

TYPED_TEST(Shapes, DerivativesEqualDifferences) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::vector<Vec3<double>> points{{1, 0, 0},         {0, -1, 0},    {0, 0, 1},       {0, 0, -1},
                                   {0.6, -0.8, 1e-9}, {1e-9, 0, -1}, {0.9, 1.2, 0.8}, {0.3, 0.4, -0.9}};
  for (int k = 0; k < 30; ++k) {
    Vec3<double> x{normal(random), normal(random), normal(random)};
    points.push_back(scaled(x, 1.0 / std::sqrt(dot3(x, x))));
  }
  for (const auto& x : points) {
    const auto dual = lifted<TypeParam>(x);
    const auto w = this->shape.resist(dual);
    const Dual g = this->shape.gauge(dual);
    const auto value = [](double v) { return std::vector<double>{v}; };
    const auto list = [](const Vec3<double>& v) { return std::vector<double>(v.begin(), v.end()); };
    // h² × the third derivative + rounding/h at its best; the third derivatives here reach some 50
    EXPECT_LT(
        disagreement(x, {w.begin(), w.end()}, [&](const auto& y) { return list(this->shape.resist(y)); }),
        2e-8)
        << text(x);
    EXPECT_LT(disagreement(x, {g}, [&](const auto& y) { return value(this->shape.gauge(y)); }), 2e-8)
        << text(x);
    EXPECT_EQ(g.a, this->shape.gauge(dual).a);
    EXPECT_NEAR(g.a, this->shape.gauge(x), 2e-14);
    // Euler: resist has degree 0, the gauge degree 1
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(w[i].v[0] * x[0] + w[i].v[1] * x[1] + w[i].v[2] * x[2], 0.0, 1e-12) << text(x);
      EXPECT_EQ(w[i].a, this->shape.resist(x)[i]);
    }
    EXPECT_NEAR(g.v[0] * x[0] + g.v[1] * x[1] + g.v[2] * x[2], g.a, 1e-12) << text(x);
  }
}

// resist is of degree 0, so its slopes are of degree −1.
TYPED_TEST(Shapes, SlopesAreHomogeneousAtAnyMagnitude) {
  for (const Vec3<double>& u : {Vec3<double>{0.9, 1.2, 0.8}, {0.3, 0.4, -0.9}, {-1, 0.2, 0.1}}) {
    const auto w = this->shape.resist(lifted<TypeParam>(u));
    for (const double k : {1e-100, 1e-12, 3.0, 1e90}) {
      const auto other = this->shape.resist(lifted<TypeParam>(scaled(u, k)));
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(k * other[i].v[j], w[i].v[j], 1e-11) << text(u) << k;
    }
  }
}

TYPED_TEST(Shapes, ZeroAndNotANumber) {
  const Vec3<Dual> zero = lifted<TypeParam>({0, 0, 0});
  EXPECT_EQ(this->shape.gauge(zero).a, 0.0);
  EXPECT_EQ(this->shape.gauge(zero).v.norm(), 0.0);
  for (const Dual& entry : this->shape.resist(zero)) {
    EXPECT_EQ(entry.a, 0.0);
    EXPECT_EQ(entry.v.norm(), 0.0);
  }
  EXPECT_EQ(this->shape.slip_direction({0, 0, 0}), (Vec3<double>{0, 0, 0}));
  const double nan = std::nan("");
  for (const Vec3<double>& x : {Vec3<double>{nan, 0, 0}, Vec3<double>{1, nan, 2}, Vec3<double>{0, 1, nan}}) {
    EXPECT_TRUE(std::isnan(this->shape.gauge(x)));
    EXPECT_TRUE(std::isnan(this->shape.resist(x)[0] + this->shape.resist(x)[2]));
    EXPECT_TRUE(std::isnan(this->shape.slip_direction(x)[0] + this->shape.slip_direction(x)[2]));
  }
}

TEST(UniformDisc, IsDiscFriction) {
  for (int k = -160; k <= 160; ++k) {
    const double epsilon = std::pow(10.0, k / 20.0);
    const DiscFriction f = disc_friction(epsilon);
    const Vec3<double> w =
        UniformDisc{}.resist(Vec3<double>{0.6 * 1.5 * epsilon, -0.8 * 1.5 * epsilon, -1.0});
    EXPECT_NEAR(w[0], -0.6 * f.force, 1e-14) << epsilon;
    EXPECT_NEAR(w[1], 0.8 * f.force, 1e-14) << epsilon;
    EXPECT_NEAR(w[2], 1.5 * f.torque, 1e-14) << epsilon;
  }
}

TEST(UniformDisc, JacobianIsSymmetricAndDissipative) {
  for (const auto& u : slips()) {  // resist = −∇ of the dissipated power, which is convex
    const auto w = UniformDisc{}.resist(lifted<UniformDisc>(u));
    const double size = std::sqrt(dot3(u, u));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        ASSERT_TRUE(std::isfinite(w[i].v[j])) << text(u);
        EXPECT_NEAR(w[i].v[j], w[j].v[i], 1e-12 / size) << text(u);
      }
    }
    for (const auto& d : slips()) {
      double curvature = 0.0;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) curvature += d[i] * w[i].v[j] * d[j];
      }
      EXPECT_LE(curvature, 1e-12 * dot3(d, d) / size) << text(u);
    }
  }
}

TEST(Ellipsoid, RadiusExceedsTheDiscsBySevenPerCent) {
  double worst = 0.0, where = 0.0;
  for (int k = 1; k < 20000; ++k) {
    const double epsilon = k * 1e-4;
    const Vec3<double> w = UniformDisc{}.resist(Vec3<double>{1.5 * epsilon, 0, 1});
    const double excess = 1.0 / std::sqrt(dot3(w, w)) - 1.0;  // radii along the same ray
    EXPECT_GE(excess, 0.0) << epsilon;
    if (excess > worst) {
      worst = excess;
      where = epsilon;
    }
  }
  EXPECT_NEAR(worst, 0.0704, 1e-4);
  EXPECT_NEAR(where, 0.766, 1e-3);
}

}  // namespace
