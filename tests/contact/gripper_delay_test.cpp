// The model that carries the object until the gripper's delay has passed.
#include "contact/gripper_delay.hpp"

#include <gtest/gtest.h>

namespace unhand::contact {
namespace {

TEST(GripperDelay, SeparatesAtTheCommandAndTheDelayWhateverTheForceDoes) {
  const GripperDelay model(0.25, Dual(0.04, 3));
  const ProfileNormalForce early(OpeningProfile<double>{0.0, 20, 0, 0.05, 1});
  double t;
  model.separation(early, t);
  EXPECT_DOUBLE_EQ(t, 0.29);
  Dual with_slope;
  model.separation(early, with_slope);
  EXPECT_DOUBLE_EQ(with_slope.a, 0.29);
  EXPECT_EQ(with_slope.v[3], 1.0);
}

TEST(GripperDelay, IsCarriedAtRestInTheHand) {
  const GripperDelay model(0, Dual(0.1));
  State<double, 6> dy;
  dy.fill(1);
  model.rate(0, Scene<double>{}, Relative<double>{{0.1, 0.02}, 0.3, {0, 0}, 0}, dy);
  EXPECT_EQ(dy, (State<double, 6>{}));
  // what it carries with: hanging at rest, the weight and its lever's torque
  Scene<double> scene;
  scene.body = {0.4, 1e-3};
  scene.gravity = {0, -10};
  const auto f = model.wrench(0, scene, Relative<double>{{0.1, 0}, 0, {0, 0}, 0});
  EXPECT_NEAR(f.fx, 0, 1e-15);
  EXPECT_NEAR(f.fz, 4, 1e-15);
  EXPECT_NEAR(f.tau, 0.1 * 4,
              1e-15);  // the CoM lies ahead of the pads: they hold it up against a torque of −0.4 N m
}

}  // namespace
}  // namespace unhand::contact
