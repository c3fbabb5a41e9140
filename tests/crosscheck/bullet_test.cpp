// Bullet against closed forms and against the library, so that one knows which is wrong where they differ.
#include "crosscheck/bullet_release.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::crosscheck {
namespace {

// f_max = 4 N on 0.5 kg: 8 m/s²;  τ_max = 4 N × 2/3 × 2 cm = 0.0533 N m
const contact::Patch<double> kPatch{0.5, 0.02, 2.0 / 3, 2};
constexpr double kMass = 0.5, kInertia = 1e-3;

class Bullet : public testing::Test {
 protected:
  void SetUp() override {
    if (!has_bullet()) GTEST_SKIP() << "built without Bullet (libbullet-dev)";
    contact::ContactParameters<double> p;
    p.patch = kPatch;
    disc = contact::make_contact_model("limit_surface_disc", p);
  }
  release::ReleaseProblem<double> problem(const release::HandMotion& hand, dynamics::Vec2<double> gravity,
                                          double lever, dynamics::Vec2<double> slip, double spin,
                                          double inertia = kInertia) const {
    return {hand, force, *disc, {kMass, inertia}, gravity, {lever, 0}, 0.0, slip, spin};
  }
  static BulletOptions with(BulletPads pads, BulletFriction friction, double step = 1e-3) {
    return {step, pads, 3, 50, friction};
  }
  support::ConstantForce force{4.0};
  std::unique_ptr<contact::ContactModel> disc;
};

TEST_F(Bullet, SlidesAsCoulombSaysAlongItsOwnRow) {
  const auto hand = support::still_hand(0.1);
  for (const double direction : {0.0, 0.4, 0.785}) {
    const dynamics::Vec2<double> slip{std::cos(direction), std::sin(direction)};
    for (const auto pads : {BulletPads::pins, BulletPads::point}) {
      const auto r =
          simulate_in_bullet(problem(hand, {0, 0}, 0, slip, 0), kPatch, with(pads, BulletFriction::along));
      // uniform deceleration is exact for Euler steps; 1e-5: the contacts' own first-order effects
      EXPECT_NEAR(norm(r.relative.slip), 1 - 8 * 0.1, 1e-5) << to_string(pads) << " " << direction;
    }
  }
}

TEST_F(Bullet, RowsFixedInTheWorldMakeFrictionDependOnTheDirection) {
  // Each of two rows holds f_max: along the diagonal √2 f_max together. The library does not turn with the
  // world.
  const auto hand = support::still_hand(0.05);
  const double c = std::sqrt(0.5);
  const auto straight = simulate_in_bullet(problem(hand, {0, 0}, 0, {1, 0}, 0), kPatch,
                                           with(BulletPads::point, BulletFriction::fixed));
  const auto diagonal = simulate_in_bullet(problem(hand, {0, 0}, 0, {c, c}, 0), kPatch,
                                           with(BulletPads::point, BulletFriction::fixed));
  EXPECT_NEAR(norm(straight.relative.slip), 1 - 8 * 0.05, 1e-3);
  EXPECT_NEAR(norm(diagonal.relative.slip), 1 - 8 * std::sqrt(2.0) * 0.05, 1e-3);
}

TEST_F(Bullet, SpinsToRestAsThePatchSays) {
  const auto hand = support::still_hand(0.1);
  for (const auto pads : {BulletPads::pins, BulletPads::point}) {
    const auto r =
        simulate_in_bullet(problem(hand, {0, 0}, 0, {}, 10), kPatch, with(pads, BulletFriction::along));
    EXPECT_NEAR(r.relative.spin, 10 - 4.0 * 0.02 * 2 / 3 / kInertia * 0.1, 1e-5) << to_string(pads);
  }
  // the four points that Bullet takes of a cylinder's face are not its rim and not its area
  const auto r = simulate_in_bullet(problem(hand, {0, 0}, 0, {}, 10), kPatch,
                                    with(BulletPads::cylinder, BulletFriction::along));
  EXPECT_GT(std::abs(r.relative.spin - 4.6667), 1);
}

TEST_F(Bullet, HoldsOnlyWithTwoRows) {
  // An object held off its CoM at three quarters of what the patch can bear: two rows hold it exactly, the
  // one row of the default lets it creep. The library holds it exactly with one law.
  const auto hand = support::still_hand(0.5);
  const auto held = problem(hand, {0, -5.83}, 0.01, {}, 0);
  const auto creep = [&](BulletFriction friction) {
    const auto r = simulate_in_bullet(held, kPatch, with(BulletPads::pins, friction));
    return std::hypot(r.relative.arm.x - 0.01, r.relative.arm.z) +
           kPatch.length() * std::abs(r.relative.angle);
  };
  EXPECT_LT(creep(BulletFriction::across), 1e-12);
  EXPECT_LT(creep(BulletFriction::fixed), 1e-12);
  EXPECT_GT(creep(BulletFriction::along), 1e-4);
  release::ReleaseOptions options;
  EXPECT_EQ(simulate_release(held, options).relative.angle, 0.0);
}

TEST_F(Bullet, PinsTendToTheDiscAndASinglePointDoesNot) {
  // Slide and spin at once, ε = 1/2 at first. Rows along the slip are right here; a second row across it
  // keeps each pin from turning its slip.
  const auto hand = support::still_hand(0.1);
  const auto both = problem(hand, {0, 0}, 0, {0.5, 0}, 50, 2e-4);
  const auto exact = simulate_release(both).relative;
  const auto spin = [&](BulletPads pads, BulletFriction friction) {
    return simulate_in_bullet(both, kPatch, with(pads, friction, 1e-4)).relative.spin;
  };
  // 2 %: 27 pins miss 1 % (tests/truth/distributed_patch_test.cpp), and as much comes from steps and rows
  EXPECT_NEAR(spin(BulletPads::pins, BulletFriction::along), exact.spin, 0.02 * exact.spin);
  EXPECT_GT(std::abs(spin(BulletPads::pins, BulletFriction::across) - exact.spin), 0.03 * exact.spin);
  EXPECT_GT(std::abs(spin(BulletPads::point, BulletFriction::along) - exact.spin), 0.1 * exact.spin);
}

TEST_F(Bullet, ThrowsComeNearTheExactDiscAsTheStepShrinks) {
  std::mt19937_64 random(71);
  double coarse = 0, fine = 0;
  for (int k = 0; k < 3; ++k) {
    const auto thrown = support::random_throw(random, 0);
    const auto model = contact::make_contact_model("limit_surface_disc", support::parameters_of(thrown));
    const auto release = support::problem_of(thrown, *model);
    const auto exact = simulate_release(release).detach.twist;
    const auto error = [&](double step) {
      const auto r =
          simulate_in_bullet(release, thrown.patch, with(BulletPads::pins, BulletFriction::along, step))
              .detach.twist;
      return std::hypot(r.vx - exact.vx, r.vz - exact.vz, 0.1 * (r.omega - exact.omega)) / 3;
    };
    coarse += error(1e-3), fine += error(1e-4);
  }
  EXPECT_LT(fine,
            0.7 * coarse);  // slowly: its creep before the slip falls with the step, its rows' error does not
  EXPECT_LT(fine, 0.06);    // m/s, at 10 cm
}

// The pads have parted when it begins: it is free then and there, as simulate_release has it.
TEST_F(Bullet, ReleasesBeforeTheStartAreNoStepBackwards) {
  const auto hand = support::still_hand(0.2);
  const contact::ProfileNormalForce opening(contact::OpeningProfile<double>{0.0, 20, 0.02, 0.096, 1});
  const double release = opening.release_time();
  for (const double start : {release, 0.12}) {
    release::ReleaseProblem<double> late{hand,  opening, *disc, {kMass, kInertia}, {0, -9.81}, {0.1, 0.3},
                                         start, {},      0.0};
    const auto ours = release::simulate_release(late);
    const auto theirs = simulate_in_bullet(late, kPatch, with(BulletPads::pins, BulletFriction::along));
    EXPECT_EQ(ours.outcome, release::ReleaseOutcome::detached);
    EXPECT_EQ(theirs.outcome, ours.outcome);
    EXPECT_EQ(theirs.steps, 0);
    EXPECT_EQ(theirs.detach.time, start);
    EXPECT_NEAR(theirs.detach.pose.x, ours.detach.pose.x, 1e-15);
    EXPECT_NEAR(theirs.detach.pose.z, ours.detach.pose.z, 1e-15);
    EXPECT_NEAR(theirs.detach.pose.theta, ours.detach.pose.theta, 1e-15);
    EXPECT_NEAR(theirs.detach.twist.vz, ours.detach.twist.vz, 1e-15);
    EXPECT_NEAR(theirs.relative.arm.x, 0.1, 1e-15);
  }
}

// Slip and spin at the start are those between the pads: the centre of mass moves with the spin about them.
TEST_F(Bullet, BeginsWithTheSlipAndTheSpinOfTheProblem) {
  std::array<support::SwayingHand::Coordinate, 3> moving{};
  moving[0].a = 3, moving[1].a = -2, moving[2].a = 4;
  const support::SwayingHand hand(moving, 0.3);
  const contact::ProfileNormalForce opening(contact::OpeningProfile<double>{0.0, 20, 0.02, 0.096, 1});
  const release::ReleaseProblem<double> late{
      hand, opening, *disc, {kMass, kInertia}, {0, -9.81}, {0.1, 0.3}, 0.2, {0.3, -0.2}, 5.0};
  const auto ours = release::simulate_release(late);
  const auto theirs = simulate_in_bullet(late, kPatch, with(BulletPads::pins, BulletFriction::along));
  EXPECT_NEAR(theirs.detach.twist.vx, ours.detach.twist.vx, 1e-12);
  EXPECT_NEAR(theirs.detach.twist.vz, ours.detach.twist.vz, 1e-12);
  EXPECT_NEAR(theirs.detach.twist.omega, ours.detach.twist.omega, 1e-12);
  EXPECT_NEAR(theirs.relative.slip.x, 0.3, 1e-12);
  EXPECT_NEAR(theirs.relative.slip.z, -0.2, 1e-12);
  EXPECT_NEAR(theirs.relative.spin, 5, 1e-12);
}

// A firm grip takes the object round with the hand.
TEST_F(Bullet, PadsTurnWithTheHand) {
  const auto hand = support::accelerating_hand({0, 0, 20}, 0.2);  // to 0.4 rad and 4 rad/s, by 0.02 N m
  for (const auto pads : {BulletPads::pins, BulletPads::point}) {
    const auto r =
        simulate_in_bullet(problem(hand, {0, 0}, 0, {}, 0), kPatch, with(pads, BulletFriction::across, 1e-4));
    EXPECT_NEAR(r.detach.pose.theta, 0.4, 0.01) << to_string(pads);
    EXPECT_NEAR(r.detach.twist.omega, 4, 0.05) << to_string(pads);
  }
}

// What holds is friction times the number of pads.
TEST_F(Bullet, OnePadOfTwiceTheFrictionIsTwoPads) {
  const auto hand = support::still_hand(0.05);
  for (const auto pads : {BulletPads::pins, BulletPads::point}) {
    const auto slid = [&](int count) {
      contact::Patch<double> patch = kPatch;
      patch.mu = 1.0 / count, patch.pads = count;
      return simulate_in_bullet(problem(hand, {0, 0}, 0, {0.7, 0}, 8), patch,
                                with(pads, BulletFriction::along))
          .relative;
    };
    const auto two = slid(2);
    for (const int count : {1, 4}) {
      const auto other = slid(count);
      EXPECT_NEAR(other.slip.x, two.slip.x, 1e-9) << count << to_string(pads);
      EXPECT_NEAR(other.spin, two.spin, 1e-9) << count << to_string(pads);
    }
  }
}

TEST_F(Bullet, RefusesOptionsOutOfRange) {
  const auto hand = support::still_hand(0.1);
  const auto still = problem(hand, {0, 0}, 0, {}, 0);
  for (const BulletOptions& options :
       {BulletOptions{0}, BulletOptions{1}, BulletOptions{1e-3, BulletPads::pins, 0},
        BulletOptions{1e-3, BulletPads::pins, 3, 0}})
    EXPECT_THROW(simulate_in_bullet(still, kPatch, options), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::crosscheck
