// Frames and the rigid body: signs by finite differences of a body that really moves, inverses, power, closed
// forms.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dynamics/frames.hpp"
#include "dynamics/rigid_body.hpp"

namespace unhand::dynamics {
namespace {

struct Sample {
  std::mt19937 random{7};
  double operator()() { return std::uniform_real_distribution<double>(-3, 3)(random); }
};

/// A body on a path with everything changing: CoM and angle as functions of time, and a point fixed in the
/// body.
struct Path {
  static double angle(double t) { return 0.3 + 1.7 * t + 0.9 * t * t - 0.4 * t * t * t; }
  static Vec2<double> com(double t) { return {std::sin(2 * t), 0.5 * t * t - std::cos(t)}; }
  Vec2<double> in_body{0.12, -0.31};
  Vec2<double> point(double t) const { return com(t) + rotate(angle(t), in_body); }
};

template <class F>
Vec2<double> first_difference(F f, double t, double h) {
  return (0.5 / h) * (f(t + h) - f(t - h));
}
template <class F>
Vec2<double> second_difference(F f, double t, double h) {
  return (1 / (h * h)) * (f(t + h) - f(t) - (f(t) - f(t - h)));
}

TEST(Frames, TheAccelerationOfAPointOfAMovingBodyDecidesTheSign) {
  const Path path;
  auto point = [&](double t) { return path.point(t); };
  for (const double t : {0.0, 0.4, 0.9, 1.3}) {
    const double h = 1e-4, omega = 1.7 + 1.8 * t - 1.2 * t * t, alpha = 1.8 - 2.4 * t;
    const Vec2<double> v = first_difference(Path::com, t, 1e-5), a = second_difference(Path::com, t, h);
    const Vec2<double> r = Path::com(t) - path.point(t);  // from the patch to the CoM
    const auto twist = twist_at_patch(Twist<double>{v.x, v.z, omega}, r);
    const auto acceleration = acceleration_at_patch(Acceleration<double>{a.x, a.z, alpha}, omega, r);
    const Vec2<double> v_point = first_difference(point, t, 1e-5), a_point = second_difference(point, t, h);
    EXPECT_NEAR(twist.vx, v_point.x, 1e-9);  // truncation 1e-10 times a third derivative of order ten
    EXPECT_NEAR(twist.vz, v_point.z, 1e-9);
    // Second differences: rounding 4e-16/1e-8, truncation 1e-9 times a fourth derivative of order hundred.
    EXPECT_NEAR(acceleration.ax, a_point.x, 5e-7);
    EXPECT_NEAR(acceleration.az, a_point.z, 5e-7);
    // The sign printed in the source misses by twice the terms, of order one here.
    const Vec2<double> printed{a.x - alpha * r.z - omega * omega * r.x,
                               a.z + alpha * r.x - omega * omega * r.z};
    EXPECT_GT(norm(printed - a_point), 0.1) << t;
  }
}

TEST(Frames, InversesAreInverses) {
  Sample draw;
  for (int k = 0; k < 100; ++k) {
    const Vec2<double> r{draw(), draw()};
    const double omega = draw();
    const Twist<double> v{draw(), draw(), draw()}, v2 = twist_at_com(twist_at_patch(v, r), r);
    const Acceleration<double> a{draw(), draw(), draw()};
    const auto a2 = acceleration_at_com(acceleration_at_patch(a, omega, r), omega, r);
    const Wrench<double> f{draw(), draw(), draw()}, f2 = wrench_at_patch(wrench_at_com(f, r), r);
    const Vec2<double> minus{-r.x, -r.z};
    const Twist<double> v3 = twist_at_patch(twist_at_patch(v, r), minus);  // G(−r) G(r) = 1
    // Rounding of numbers up to 3 + 3·3 + 9·3: a few times 1e-15.
    for (const double d :
         {v2.vx - v.vx, v2.vz - v.vz, v3.vx - v.vx, v3.vz - v.vz, a2.ax - a.ax, a2.az - a.az, f2.tau - f.tau})
      EXPECT_NEAR(d, 0, 2e-14) << "draw " << k;
  }
}

TEST(Frames, PowerIsTheSameAboutBothPoints) {
  Sample draw;
  for (int k = 0; k < 100; ++k) {
    const Vec2<double> r{draw(), draw()};
    const Twist<double> v_o{draw(), draw(), draw()}, v_c = twist_at_patch(v_o, r);
    const Wrench<double> f_c{draw(), draw(), draw()}, f_o = wrench_at_com(f_c, r);
    const double at_c = f_c.fx * v_c.vx + f_c.fz * v_c.vz + f_c.tau * v_c.omega;
    const double at_o = f_o.fx * v_o.vx + f_o.fz * v_o.vz + f_o.tau * v_o.omega;
    EXPECT_NEAR(at_c, at_o, 1e-13) << "draw " << k;  // sums of products up to 3·3·3
  }
}

TEST(Frames, RotationsAndPerpendiculars) {
  const Vec2<double> turned = rotate(0.5 * M_PI, Vec2<double>{2.0, 1.0});
  EXPECT_NEAR(turned.x, perp(Vec2<double>{2.0, 1.0}).x, 1e-15);  // cos(π/2) is 6e-17
  EXPECT_NEAR(turned.z, perp(Vec2<double>{2.0, 1.0}).z, 1e-15);
  // d/dt of a rotating vector is ω J a.
  const Vec2<double> a{0.3, -0.8};
  const Vec2<double> rate = first_difference([&](double t) { return rotate(1.3 * t, a); }, 0.7, 1e-5);
  const Vec2<double> expected = 1.3 * perp(rotate(1.3 * 0.7, a));
  EXPECT_NEAR(rate.x, expected.x, 1e-9);
  EXPECT_NEAR(rate.z, expected.z, 1e-9);
}

TEST(RigidBody, RequiredWrenchAndAccelerationAreInverse) {
  Sample draw;
  for (int k = 0; k < 100; ++k) {
    const RigidBody<double> body{0.2 + std::abs(draw()), 0.01 + 0.1 * std::abs(draw())};
    const Vec2<double> r{draw(), draw()}, gravity{draw(), -9.81};
    const Acceleration<double> a{draw(), draw(), draw()};
    const auto back = acceleration_under(body, required_wrench(body, a, r, gravity), r, gravity);
    EXPECT_NEAR(back.ax, a.ax, 1e-13) << "draw " << k;
    EXPECT_NEAR(back.az, a.az, 1e-13) << "draw " << k;
    EXPECT_NEAR(back.alpha, a.alpha, 1e-11) << "draw " << k;  // a torque of order 100 over an inertia of 0.01
  }
}

TEST(RigidBody, AtRestTheHandCarriesTheWeightAndItsLever) {
  const RigidBody<double> body{0.5, 0.002};
  const Vec2<double> r{0.1, 0.02};
  const auto f = required_wrench(body, Acceleration<double>{}, r, level_gravity(9.81));
  EXPECT_DOUBLE_EQ(f.fx, 0);
  EXPECT_DOUBLE_EQ(f.fz, 0.5 * 9.81);
  EXPECT_DOUBLE_EQ(f.tau, 0.1 * 0.5 * 9.81);  // a CoM in front of the pads wants a positive torque from them
}

TEST(RigidBody, TheTorqueOfStickingInClosedForm) {
  // τ_p = (I + m l²) α_h − m [z_r ax_h − x_r (az_h + g)]: the centripetal part has no torque about the patch.
  Sample draw;
  for (int k = 0; k < 100; ++k) {
    const double g = 9.81, omega = draw();
    const RigidBody<double> body{0.2 + std::abs(draw()), 0.01 + 0.1 * std::abs(draw())};
    const Vec2<double> r{draw(), draw()};
    const Acceleration<double> hand{draw(), draw(), draw()};
    const auto object = acceleration_at_com(hand, omega, r);
    const auto f = required_wrench(body, object, r, level_gravity(g));
    const double closed = (body.inertia + body.mass * dot(r, r)) * hand.alpha -
                          body.mass * (r.z * hand.ax - r.x * (hand.az + g));
    EXPECT_NEAR(f.tau, closed, 1e-12 * (1 + std::abs(closed)) + 1e-12)
        << "draw " << k;  // ω² l² m of order 500 cancels
  }
}

}  // namespace
}  // namespace unhand::dynamics
