// Patch limits and their validation.
#include "contact/patch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/refusal.hpp"

namespace {

using namespace unhand::contact;
using unhand::dynamics::Dual;

TEST(Patch, LimitsAndTheirDerivatives) {
  const Patch<double> patch{0.5, 0.012, 0.6, 2};
  EXPECT_NEAR(patch.f_max(20.0), 20.0, 1e-14);
  EXPECT_NEAR(patch.tau_max(20.0), 0.144, 1e-15);
  EXPECT_NEAR(patch.length(), 0.0072, 1e-17);
  const Patch<Dual> dual{Dual(0.5, 0), Dual(0.012, 1), Dual(0.6, 2), 2};
  const Dual tau = dual.tau_max(Dual(20.0, 3));
  const double expected[] = {0.144 / 0.5, 0.144 / 0.012, 0.144 / 0.6,
                             0.144 / 20.0};  // a product of powers of one
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(tau.v[k], expected[k], 1e-13);
}

TEST(Patch, ValidationNamesParameterValueAndRange) {
  using testing::AllOf, testing::HasSubstr;
  const auto message = [](const Patch<double>& p) { return unhand::support::refusal([&] { validate(p); }); };
  EXPECT_EQ(message({0.0, 1.0, 1.0, 1}), "accepted");
  EXPECT_EQ(message({10.0, 1e-6, 1e-3, 4}), "accepted");
  EXPECT_THAT(message({-0.1, 0.01, 0.6, 2}), AllOf(HasSubstr("mu"), HasSubstr("-0.1"), HasSubstr("[0, 10]")));
  EXPECT_THAT(message({0.5, 0.0, 0.6, 2}), AllOf(HasSubstr("radius"), HasSubstr("[1e-12, 1] m")));
  EXPECT_THAT(message({0.5, 12.0, 0.6, 2}), AllOf(HasSubstr("radius"), HasSubstr("12")));
  EXPECT_THAT(message({0.5, 0.01, 1.1, 2}), AllOf(HasSubstr("torque_factor"), HasSubstr("1.1")));
  EXPECT_THAT(message({0.5, 0.01, 0.6, 0}), HasSubstr("pads"));
  EXPECT_THAT(message({std::nan(""), 0.01, 0.6, 2}), HasSubstr("mu"));
}

}  // namespace
