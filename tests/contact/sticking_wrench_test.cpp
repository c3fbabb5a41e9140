// The wrench that carries an object with the hand.
#include <gtest/gtest.h>

#include <random>

#include "contact/contact_model.hpp"

namespace unhand::contact {
namespace {

/// Under it the material point at the pads moves as the hand does, and the rotation as fast as the hand's,
/// however the object spins against the hand: neither slip nor spin changes.
TEST(StickingWrench, LeavesNoSlipAcceleration) {
  std::mt19937_64 random(91);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 50; ++i) {
    const auto some = [&](double most) { return most * uniform(random); };
    const Scene<double> scene{{0.3 + 0.2 * uniform(random), 1e-3}, {some(2), -9.81},
                              {some(1), some(1), some(3)},         {some(2), some(2), some(8)},
                              {some(20), some(20), some(100)},     20};
    const Relative<double> y{{some(0.2), some(0.1)}, some(2), {0, 0}, i % 2 ? some(30) : 0};
    const auto rate = relative_rate(scene, y, sticking_wrench(scene, y));
    for (int k = 3; k < 6; ++k) EXPECT_NEAR(rate[k], 0, 1e-10) << k << " spin " << y.spin;
  }
}

}  // namespace
}  // namespace unhand::contact
