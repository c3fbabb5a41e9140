// The modes of the decoupled model: what leaves each, what follows, and the law at and between them.
#include "contact/sliding_pivot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <utility>

#include "contact/slip_stop.hpp"
#include "release/simulate_release.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::contact {
namespace {

enum Mode {
  kStick,
  kPivotPlus,
  kPivotMinus,
  kSlide,
  kSlidePlus,
  kSlideMinus,
  kBrake,
  kBrakePlus,
  kBrakeMinus
};
enum GuardIndex { kRotation, kTranslation, kAgain };

/// A world that does not change, but for what `drift` adds per second to the hand's acceleration.
class World final : public SceneSource {
 public:
  Scene<double> now;
  Acceleration<double> drift;
  Scene<double> scene(const Window&, double t) const override {
    Scene<double> s = now;
    s.hand_acceleration.ax += t * drift.ax;
    s.hand_acceleration.az += t * drift.az;
    s.hand_acceleration.alpha += t * drift.alpha;
    return s;
  }
  Scene<Dual> scene(const Window& w, const Dual& t) const override {
    const Scene<double> s = scene(w, t.a);
    return {{Dual(s.body.mass), Dual(s.body.inertia)},
            {Dual(s.gravity.x), Dual(s.gravity.z)},
            {Dual(s.hand.x), Dual(s.hand.z), Dual(s.hand.theta)},
            {Dual(s.hand_twist.vx), Dual(s.hand_twist.vz), Dual(s.hand_twist.omega)},
            {Dual(s.hand_acceleration.ax), Dual(s.hand_acceleration.az), Dual(s.hand_acceleration.alpha)},
            Dual(s.normal_force)};
  }
};

// 0.2 kg, 1e-3 kg m²; two pads of mu 0.5 pressed by 10 N: f_max = 10 N; 0.015 m · 2/3: τ_max = 0.1 N m.
constexpr double kForce = 10, kTorque = 0.1, kMass = 0.2, kInertia = 1e-3;
constexpr Window kWindow{0, 1};

/// Numbers of one seed.
class Uniform {
 public:
  explicit Uniform(unsigned seed) : random_(seed) {}
  double operator()(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }

 private:
  std::mt19937_64 random_;
};

class Pivot : public testing::Test {
 protected:
  Pivot() {
    world.now.body = {kMass, kInertia};
    world.now.normal_force = 10;
  }
  /// The mode that holds at rest, before any.
  int start(const Relative<double>& y = {}) const { return model.membership(-1, kWindow, world, 0, y).mode; }
  Entry<double, 6> leave(int mode, int guard, const Relative<double>& y = {},
                         const SlidingPivot* m = nullptr) const {
    return (m ? m : &model)->on_guard({mode, kWindow}, guard, world, 0, y);
  }
  double guard(int mode, int index, const Relative<double>& y = {}) const {
    double g[3];
    model.guards({mode, kWindow}, world, 0, y, g);
    return g[index];
  }
  Wrench<double> wrench(int mode, const Relative<double>& y = {}) const {
    return model.wrench(mode, world.now, y);
  }
  State<double, 6> rate(int mode, const Relative<double>& y = {}) const {
    State<double, 6> dy;
    model.rate(mode, world.now, y, dy);
    return dy;
  }

  /// A hand that turns, with accelerations up to those given [m/s², rad/s²].
  const Scene<double>& turn_at_random(Uniform& uniform, double acceleration, double alpha) {
    auto& s = world.now;
    s.gravity = {0, -9.81};
    s.hand.theta = uniform(-3, 3);
    s.hand_twist.omega = uniform(-5, 5);
    s.hand_acceleration = {uniform(-acceleration, acceleration), uniform(-acceleration, acceleration),
                           uniform(-alpha, alpha)};
    return s;
  }

  World world;
  Patch<double> patch{0.5, 0.015, 2.0 / 3, 2};
  SlidingPivot model{patch};
};

Relative<double> at(double x, double slip_x = 0, double slip_z = 0, double spin = 0) {
  return {{x, 0}, 0, {slip_x, slip_z}, spin};
}

// ---------------------------------------------------------------- where each guard leads

TEST_F(Pivot, SticksInsideBothLimits) {
  world.now.hand_acceleration = {kForce / kMass * 0.99, 0, -kTorque / kInertia * 0.99};
  EXPECT_EQ(start(), kStick);
  EXPECT_LT(guard(kStick, kTranslation), 0);
  EXPECT_LT(guard(kStick, kRotation), 0);
}

TEST_F(Pivot, TorqueBeyondItsLimitPivots) {
  world.now.hand_acceleration.alpha = kTorque / kInertia * 1.01;
  EXPECT_EQ(start(), kPivotMinus);  // the object lags behind a hand that turns up
  EXPECT_GT(guard(kStick, kRotation), 0);
  EXPECT_EQ(leave(kStick, kRotation).mode, kPivotMinus);
  world.now.hand_acceleration.alpha *= -1;
  EXPECT_EQ(start(), kPivotPlus);
  EXPECT_EQ(leave(kStick, kRotation).mode, kPivotPlus);
}

TEST_F(Pivot, ForceBeyondItsLimitSlides) {
  world.now.hand_acceleration.ax = kForce / kMass * 1.01;
  EXPECT_EQ(start(), kSlide);
  EXPECT_GT(guard(kStick, kTranslation), 0);
  EXPECT_EQ(leave(kStick, kTranslation).mode, kSlide);
}

TEST_F(Pivot, BothAtOnce) {
  world.now.hand_acceleration = {kForce / kMass * 1.01, 0, kTorque / kInertia * 1.5};
  EXPECT_EQ(start(), kSlideMinus);
}

TEST_F(Pivot, APivotThatStopsLocksOrTurnsRound) {
  world.now.hand_acceleration.alpha = kTorque / kInertia * 0.5;
  auto entry = leave(kPivotMinus, kRotation, at(0, 0, 0, -1e-17));
  EXPECT_EQ(entry.mode, kStick);
  EXPECT_EQ(entry.y[5], 0.0);  // exactly
  world.now.hand_acceleration.alpha = kTorque / kInertia * 1.5;
  entry = leave(kPivotPlus, kRotation, at(0, 0, 0, 1e-17));
  EXPECT_EQ(entry.mode, kPivotMinus);
  EXPECT_LT(entry.y[5], 0);
  EXPECT_GT(entry.lead, 0);
}

TEST_F(Pivot, ASlideWhoseForceSufficesBrakesAndThenSticks) {
  world.now.hand_acceleration.ax = kForce / kMass * 0.5;
  const auto braking = leave(kSlide, kTranslation, at(0, -0.3));
  EXPECT_EQ(braking.mode, kBrake);
  EXPECT_LT(guard(kSlide, kTranslation, at(0, -0.3)), 0);  // its guard falls: below zero is past it
  // braking: 10 N against the slip of −0.3 m/s, while the hand runs off at 25 m/s²
  EXPECT_NEAR(wrench(kBrake, at(0, -0.3)).fx, kForce, 1e-12);
  const auto stopped = leave(kBrake, kTranslation, at(0, -1e-7));
  EXPECT_EQ(stopped.mode, kStick);
  EXPECT_EQ(stopped.y[3], 0.0);
  EXPECT_NEAR(stopped.t, 1e-7 / (kForce / kMass * 0.5), 1e-15);
}

TEST_F(Pivot, ASlideThatNeverSlippedGoesBackToStick) {
  world.now.hand_acceleration.ax = kForce / kMass * 0.5;
  EXPECT_EQ(leave(kSlide, kTranslation).mode, kStick);
}

TEST_F(Pivot, APivotKeepsItsSpinThroughSlideAndBrake) {
  world.now.hand_acceleration.ax = kForce / kMass * 2;
  EXPECT_EQ(leave(kPivotPlus, kTranslation, at(0, 0, 0, 3)).mode, kSlidePlus);
  world.now.hand_acceleration.ax = 0;
  EXPECT_EQ(leave(kSlideMinus, kTranslation, at(0, 0.2, 0, -3)).mode, kBrakeMinus);
  EXPECT_EQ(leave(kBrakeMinus, kTranslation, at(0, 1e-9, 0, -3)).mode, kPivotMinus);
}

TEST_F(Pivot, TheSpinThatABrakeStartsIsTheSameForSlowSlips) {
  // 10 N at a lever of 0.1 m, against a torque limit of 0.1 N m; the slip ends within |v|/(150 m/s²).
  for (const double speed : {1e-1, 1e-3, 1e-4, 1e-5, 3e-6}) {
    const auto entry = leave(kBrake, kRotation, at(0.1, 0, speed));
    EXPECT_EQ(entry.mode, kBrakePlus) << speed << " m/s";
    EXPECT_GT(entry.y[5], 0) << speed << " m/s";
    EXPECT_GT(entry.y[4], 0.8 * speed) << "followed past its stop from " << speed << " m/s";
  }
}

TEST_F(Pivot, ABrakeThatBeginsAtRestIsOver) {
  // 1e-8 m/s at 150 m/s² is at rest within kStopTime: what is left is the spin that its last instants made.
  const auto entry = leave(kBrake, kRotation, at(0.1, 0, 1e-8));
  EXPECT_EQ(entry.mode, kPivotPlus);
  EXPECT_EQ(entry.y[4], 0.0);
  EXPECT_LT(entry.t, kStopTime);
  EXPECT_LT(std::abs(entry.y[5]), kForce * 0.1 / kInertia * kStopTime);
  const auto between = model.membership(kBrakeMinus, kWindow, world, 0, at(0.1, 0, 1e-8));
  EXPECT_EQ(between.mode, kPivotPlus);
  EXPECT_EQ(between.y[4], 0.0);
}

TEST_F(Pivot, WhatTurnsWhileABrakeStopsGoesOnTurning) {
  // The last 1e-8 m/s take a nanosecond or so, in which the object turns on and the arm moves half the way.
  const auto entry = leave(kBrakePlus, kTranslation, at(0.1, 0, 1e-8, 3));
  ASSERT_GT(entry.t, 0);
  EXPECT_EQ(entry.y[4], 0);
  EXPECT_NEAR(entry.y[2], 3 * entry.t, 1e-6 * 3 * entry.t);
  EXPECT_NEAR(entry.y[1], 0.5e-8 * entry.t, 1e-6 * 0.5e-8 * entry.t);
}

TEST_F(Pivot, WithoutFrictionNothingEndsASlide) {
  // Also where nothing is demanded: beside a hand in free fall.
  world.now.normal_force = 0;
  EXPECT_GT(guard(kSlide, kTranslation, at(0, 0.2)), 0);
  world.now.hand_acceleration.ax = 3;
  EXPECT_GT(guard(kSlide, kTranslation, at(0, 0.2)), 0);
}

TEST_F(Pivot, BothReadingsOfASlidesEnd) {
  // |f_p| grows beyond f_max again while the patch still slips.
  const SlidingPivot memoryless(patch, SlideEnd::memoryless);
  EXPECT_EQ(model.guard_count(kBrake), 2);  // latched: nothing but the stop and the rotation
  EXPECT_EQ(memoryless.guard_count(kBrake), 3);
  EXPECT_EQ(memoryless.guard(kBrake, kAgain).name, "force limit");
  world.now.hand_acceleration.ax = kForce / kMass * 1.5;
  const auto y = at(0, 0.2);
  EXPECT_EQ(leave(kBrake, kAgain, y, &memoryless).mode, kSlide);
  double g[3];
  memoryless.guards({kBrake, kWindow}, world, 0, y, g);
  EXPECT_GT(g[kAgain], 0) << "half as much again is demanded as friction can";
  const double demanded = std::exchange(world.now.hand_acceleration.ax, kForce / kMass * 0.9);
  memoryless.guards({kBrake, kWindow}, world, 0, y, g);
  EXPECT_LT(g[kAgain], 0);
  world.now.hand_acceleration.ax = demanded;
  // after a time event the latched brake goes on, the memoryless one reads |f_p| anew
  EXPECT_EQ(model.membership(kBrake, kWindow, world, 0, y).mode, kBrake);
  EXPECT_EQ(memoryless.membership(kBrake, kWindow, world, 0, y).mode, kSlide);
  // the force: latched against the slip, sliding along the demand
  EXPECT_NEAR(wrench(kBrake, y).fx, -kForce, 1e-12);
  EXPECT_NEAR(wrench(kSlide, y).fx, kForce, 1e-12);
}

TEST_F(Pivot, AtTheStartASlipBrakesOrSlides) {
  EXPECT_EQ(start(at(0, 0.2)), kBrake);
  EXPECT_EQ(start(at(0, 0.2, 0, 1)), kBrakePlus);
  world.now.hand_acceleration.ax = kForce / kMass * 1.5;
  EXPECT_EQ(start(at(0, 0.2)), kSlide);
}

// ---------------------------------------------------------------- the law

TEST_F(Pivot, KarnoppAtZeroSpin) {
  // ω_r = 0: the torque that is needed, whatever it is within the limit; none of it is wasted on the sign of
  // zero.
  for (const double share : {-0.99, -0.3, 0.0, 0.5, 0.99}) {
    world.now.hand_acceleration.alpha = share * kTorque / kInertia;
    EXPECT_EQ(start(), kStick) << share;
    EXPECT_NEAR(wrench(kStick).tau, share * kTorque, 1e-15) << share;
    EXPECT_EQ(rate(kStick), (State<double, 6>{})) << share;
  }
}

TEST_F(Pivot, ThePrintedExceptionIsNotThere) {
  // Eq. 22 as printed lets a pivot feel no friction where |τ_p| < τ_max: spinning, the torque is the full
  // limit always.
  world.now.hand_acceleration.alpha = 0.1 * kTorque / kInertia;
  EXPECT_NEAR(wrench(kPivotPlus, at(0, 0, 0, 2)).tau, -kTorque, 1e-15);
  EXPECT_NEAR(wrench(kPivotMinus, at(0, 0, 0, -2)).tau, kTorque, 1e-15);
}

TEST_F(Pivot, AccelerationAtTheOnsetOfAPivot) {
  // α_r = −sgn(τ_p)(|τ_p| − τ_max)/(m l² + I), at random poses and motions of the hand
  Uniform uniform(81);
  int seen = 0;
  for (int i = 0; i < 2000; ++i) {
    auto& s = world.now;
    s.gravity = {uniform(-1, 1), -9.81};
    s.hand.theta = uniform(-3, 3);
    s.hand_twist = {uniform(-2, 2), uniform(-2, 2), uniform(-5, 5)};
    s.hand_acceleration = {uniform(-10, 10), uniform(-10, 10), uniform(-80, 80)};
    const Relative<double> y{{uniform(0, 0.15), 0}, uniform(-0.3, 0.3), {0, 0}, 0};
    const double demand = sticking_wrench(s, y).tau;
    if (std::abs(demand) < kTorque) continue;
    ++seen;
    const int mode = demand > 0 ? kPivotMinus : kPivotPlus;
    const double expected =
        -std::copysign(1, demand) * (std::abs(demand) - kTorque) / (kMass * dot(y.arm, y.arm) + kInertia);
    EXPECT_NEAR(rate(mode, y)[5], expected, 1e-12 * (1 + std::abs(expected)) * 100)
        << "sample " << i << " of seed 81";
    EXPECT_EQ(rate(mode, y)[3], 0.0);
    EXPECT_EQ(rate(mode, y)[4], 0.0);
  }
  EXPECT_GT(seen, 500);
}

TEST_F(Pivot, ThePivotEquationIsNewtonsLaw) {
  // The wrench of the pivot moves the CoM so that the contact point goes with the hand.
  Uniform uniform(82);
  for (int i = 0; i < 200; ++i) {
    const auto& s = turn_at_random(uniform, 10, 80);
    const Relative<double> y{{uniform(0, 0.15), 0}, 0.1, {0, 0}, uniform(0.1, 5)};
    const auto dy = relative_rate(s, y, wrench(kPivotPlus, y));
    EXPECT_NEAR(dy[3], 0, 1e-11) << "sample " << i << " of seed 82";
    EXPECT_NEAR(dy[4], 0, 1e-11);
    EXPECT_NEAR(dy[5], rate(kPivotPlus, y)[5], 1e-10);
  }
}

TEST_F(Pivot, TheForceIsContinuousAtTheOnsetOfSlide) {
  // At |f_p| = f_max pivot and slide have the same force, so the object's acceleration does not jump; f_p
  // takes the pivot's own α, not the hand's.
  Uniform uniform(83);
  for (int i = 0; i < 200; ++i) {
    const auto& s = turn_at_random(uniform, 10, 80);
    const int spin = i % 2 ? 1 : -1;
    const Relative<double> y{{uniform(0.01, 0.15), 0}, 0.1, {0, 0}, spin * uniform(0.1, 5)};
    const auto f = wrench(spin > 0 ? kPivotPlus : kPivotMinus, y);
    // choose the friction so that the limit is exactly there, and the torque limit as it was
    Patch<double> p = patch;
    p.mu = norm(f.force()) / (2 * s.normal_force);
    p.radius = kTorque / (p.mu * 2 * s.normal_force) * 1.5;
    if (p.mu > 10 || p.radius > 1) continue;
    const SlidingPivot there(p);
    const auto g = there.wrench(spin > 0 ? kSlidePlus : kSlideMinus, s, y);
    EXPECT_NEAR(g.fx, f.fx, 1e-12 * (1 + std::abs(f.fx))) << "sample " << i << " of seed 83";
    EXPECT_NEAR(g.fz, f.fz, 1e-12 * (1 + std::abs(f.fz)));
    EXPECT_NEAR(g.tau, f.tau, 1e-14);
  }
}

TEST_F(Pivot, SlidesAlongTheDemandAndTurnsAboutItsOwnCentre) {
  // I α_O = τ + z_r fx − x_r fz with the capped force: the lost lever torque is divided by I
  world.now.gravity = {0, -9.81};
  world.now.hand_acceleration = {60, 20, 0};
  const auto y = at(0.1, 0.05, -0.02, 2);
  const auto f = wrench(kSlidePlus, y);
  EXPECT_NEAR(norm(f.force()), kForce, 1e-12);
  EXPECT_NEAR(f.tau, -kTorque, 1e-15);
  EXPECT_NEAR(rate(kSlidePlus, y)[5], (f.tau - 0.1 * f.fz) / kInertia, 1e-9);  // of some hundred rad/s²
  // the CoM's absolute acceleration is f/m + g, and the slip's follows from kinematics alone
  const auto dy = rate(kSlidePlus, y);
  const auto expected = relative_rate(world.now, y, f);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(dy[i], expected[i], 1e-12 * (1 + std::abs(expected[i])) * 10);
}

TEST_F(Pivot, MayFeedEnergyInSlideOnly) {
  for (int mode = 0; mode < model.mode_count(); ++mode)
    EXPECT_EQ(model.may_feed_energy(mode), model.mode_name(mode).starts_with("slide"))
        << model.mode_name(mode);
  // and does: slip along the demand
  world.now.hand_acceleration.ax = kForce / kMass * 1.5;
  EXPECT_GT(wrench(kSlide, at(0, 0.1)).fx * 0.1, 0);
}

TEST_F(Pivot, AZeroSpinThatAttractsFromBothSidesIsHeld) {
  // In slide f_p jumps with the rotation, so both spins may be driven back to zero where holding would take
  // more than τ_max by the hand's α. The rotation then stays at rest, by a torque and a force that friction
  // has.
  Uniform uniform(84);
  int attracting = 0;
  for (int i = 0; i < 20000; ++i) {
    turn_at_random(uniform, 100, 300);
    const Relative<double> y{{uniform(0.01, 0.15), 0}, 0, {uniform(-1, 1), uniform(-1, 1)}, 0};
    const int mode = start(y);
    if (!model.mode_name(mode).starts_with("slide")) continue;
    const double plus = rate(kSlidePlus, y)[5], minus = rate(kSlideMinus, y)[5];
    if (mode == kSlidePlus) {
      EXPECT_GT(plus, 0) << "sample " << i << " of seed 84";
    } else if (mode == kSlideMinus) {
      EXPECT_LT(minus, 0) << "sample " << i << " of seed 84";
    } else {
      EXPECT_EQ(rate(mode, y)[5], 0.0) << "sample " << i << " of seed 84";
      EXPECT_LE(std::abs(wrench(mode, y).tau), kTorque * (1 + 1e-12)) << "sample " << i << " of seed 84";
      EXPECT_LE(norm(wrench(mode, y).force()), kForce * (1 + 1e-12)) << "sample " << i << " of seed 84";
      attracting += std::abs(wrench(kSlide, y).tau) > kTorque && plus < 0 && minus > 0;
      if (mode != kSlide) {
        EXPECT_LT(guard(mode, kRotation, y), 0) << "stays, sample " << i << " of seed 84";
      }
    }
  }
  EXPECT_GT(attracting, 10) << "the case under test must occur";
}

TEST_F(Pivot, WhatIsSlidWithoutTorqueDoesNotSpinAtTheRelease) {
  // Held at the centre of mass in a hand that turns evenly: no torque is asked for, and the limit ends at
  // none. The pads of normal force f₀ u², u from 1 to 0 within T, slide from f_max = m b on, b the hand's
  // acceleration against gravity: u₁ = √(m b/(n μ f₀)). From then on the object gains b (T/3) u₁ along b.
  constexpr double kGrip = 30, kOpening = 0.07;
  const double ax = -8, apparent_z = 9.81 - 8, b = std::hypot(ax, apparent_z);
  const auto hand =
      release::PolynomialHand::segments(0, {0, 0, 0}, {2, 2, 1.5}, {{2 * kOpening, {ax, ax, 0}}});
  const ProfileNormalForce force(OpeningProfile<double>{0, kGrip, 0, kOpening, 2});
  const Dual mass = dynamics::independent(kMass, 0);
  const release::ReleaseProblem<Dual> problem{
      hand, force, model, {mass, Dual(kInertia)}, {Dual(0), Dual(-9.81)}, {Dual(0), Dual(0.3)}};
  const auto let_go = release::simulate_release(problem);
  ASSERT_EQ(let_go.outcome, release::ReleaseOutcome::detached);
  const auto events = release::mode_events(problem, let_go);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].mode, "slide");
  EXPECT_EQ(events[1].mode, "free");
  // v_x = 2 + ax T (1 − ⅔ u₁), and u₁ ~ √m; what the slid arm's turning adds to the demand is left out.
  const double u = std::sqrt(kMass * b / (2 * patch.mu * kGrip));
  EXPECT_NEAR(let_go.detach.twist.vx.a, 2 + ax * kOpening * (1 - u * 2 / 3), 1e-4);
  EXPECT_NEAR(let_go.detach.twist.vx.v[0], -ax * kOpening * u / (3 * kMass), 1e-3);
}

TEST_F(Pivot, DerivativesOfTheLaw) {
  // dual numbers against central differences in the state; the best of several steps, 1e-7 of the row's size
  world.now.gravity = {0, -9.81};
  world.now.hand_twist.omega = 2;
  world.now.hand_acceleration = {60, 20, 40};
  for (int mode = 1; mode < model.mode_count(); ++mode) {
    const double spin = mode % 3 == 0 ? 0 : mode % 3 == 1 ? 2 : -2;
    const Relative<double> y{{0.1, 0.01}, 0.2, {mode < kSlide ? 0 : 0.3, mode < kSlide ? 0 : -0.2}, spin};
    State<Dual, 6> exact;
    model.rate(mode, world.scene({}, Dual(0.0)), Relative<Dual>::from(support::seeded(y.state())), exact);
    const auto at = [&](const State<double, 6>& x) { return rate(mode, Relative<double>::from(x)); };
    for (int k = 0; k < 6; ++k) {
      if ((k == 3 || k == 4) && mode < kSlide) continue;  // stuck: the slip is zero and stays so
      const auto off = support::best_differences_by(k, at, y.state(), exact, 1e-3);
      for (int i = 0; i < 6; ++i)
        EXPECT_LT(off[i], 1e-7 * (1 + std::abs(exact[i].v[k])))
            << model.mode_name(mode) << " d rate " << i << " / d y " << k;
    }
  }
}

}  // namespace
}  // namespace unhand::contact
