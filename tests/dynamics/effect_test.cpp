// What descriptors of effects say about units and ranges.
#include "dynamics/effect.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "tests/support/refusal.hpp"

namespace unhand::dynamics {
namespace {

TEST(LengthPower, IsThatOfTheMetre) {
  for (const char* unit : {"m", "m/s", "m/s^2", "m/s^3", "m/N", "rad m", "N m"})
    EXPECT_EQ(length_power(unit), 1) << unit;
  for (const char* unit : {"-", "", "s", "rad", "rad/s^2", "1/s", "mm", "1/mm"})
    EXPECT_EQ(length_power(unit), 0) << unit;
  for (const char* unit : {"1/m", "s/m", "1/m s"}) EXPECT_EQ(length_power(unit), -1) << unit;
  EXPECT_EQ(length_power("kg m^2"), 2);
  EXPECT_EQ(length_power("s/m^2"), -2);
}

TEST(RequireInRange, TakesBothEndsAndTheLeast) {
  const Effect effect{.id = "contact.glue",
                      .mechanism = "",
                      .parameters = {{"force", "N", 0, -1, 5, 1},
                                     {.name = "share", .unit = "-", .high = 1, .typical = 0.1, .least = -2}}};
  const auto& [force, share] = std::tie(effect.parameters[0], effect.parameters[1]);
  for (const double x : {-1.0, 5.0}) EXPECT_NO_THROW(require_in_range(effect, force, x));
  for (const double x : {-2.0, 1.0}) EXPECT_NO_THROW(require_in_range(effect, share, x));
  const auto refusal = [&](const EffectParameter& p, double x) {
    return support::refusal([&] { require_in_range(effect, p, x); });
  };
  EXPECT_EQ(refusal(force, 5.5), "contact.glue.force = 5.5 is not in [-1, 5] N");
  EXPECT_EQ(refusal(share, -2.5), "contact.glue.share = -2.5 is not in [-2, 1]");
  EXPECT_THAT(refusal(force, std::nan("")), testing::HasSubstr("nan is not in"));
}

}  // namespace
}  // namespace unhand::dynamics
