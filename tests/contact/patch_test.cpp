// Patch limits, their validation, and torque factors against quadrature.
#include "contact/patch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <stdexcept>

namespace {

using namespace unhand::contact;
using unhand::dynamics::Dual;

// c = ∫ p ρ² dρ / ∫ p ρ dρ over ρ = r/a in [0, 1], by the tanh-sinh rule; p is given the distance 1 − ρ as
// well, since an edge singularity needs its digits.
double quadrature(const std::function<double(double rho, double rest)>& pressure) {
  double top = 0.0, bottom = 0.0;
  for (double t = -3.6; t < 3.6; t += 1.0 / 64) {
    const double s = 0.5 * std::numbers::pi * std::sinh(t);
    const double rho = 1.0 / (1.0 + std::exp(-2.0 * s)), rest = 1.0 / (1.0 + std::exp(2.0 * s));
    const double weight = std::cosh(t) * rho * rest, p = pressure(rho, rest);
    top += weight * p * rho * rho;
    bottom += weight * p * rho;
  }
  return top / bottom;
}

TEST(TorqueFactor, OfAPowerOfTheHertzianProfile) {
  EXPECT_NEAR(torque_factor(0.0), 2.0 / 3.0, 1e-15);
  EXPECT_NEAR(torque_factor(0.5), 3.0 * std::numbers::pi / 16.0, 1e-15);
  EXPECT_NEAR(torque_factor(-0.5), std::numbers::pi / 4.0, 1e-15);
  for (double s : {-0.5, -0.2, 0.0, 0.5, 1.0, 2.7, 30.0}) {
    const double expected =
        quadrature([s](double rho, double rest) { return std::pow(rest * (1.0 + rho), s); });
    EXPECT_NEAR(torque_factor(s), expected, 1e-9)
        << s;  // s = −1/2: the rule stops at 1 − ρ = 1e-24, worth its root
  }
  EXPECT_NEAR(torque_factor(-1.0 + 1e-9), 1.0, 1e-8);  // all pressure at the rim: a thin ring
}

TEST(TorqueFactor, OfThePowerFamily) {
  EXPECT_NEAR(torque_factor_power(1.0), 0.5, 1e-15);
  EXPECT_NEAR(torque_factor_power(2.0), 3.0 * std::numbers::pi / 16.0, 1e-15);
  EXPECT_NEAR(torque_factor_power(2.0), 0.58905, 5e-6);  // digits known
  EXPECT_NEAR(torque_factor_power(3.0), 0.62025, 5e-6);
  EXPECT_NEAR(torque_factor_power(4.0), 0.63541, 5e-6);
  EXPECT_NEAR(torque_factor_power(1e6), 2.0 / 3.0, 1e-6);
  for (double n : {0.5, 1.0, 2.0, 3.0, 4.0, 10.0}) {
    const double expected = quadrature(
        [n](double, double rest) { return std::pow(-std::expm1(n * std::log1p(-rest)), 1.0 / n); });
    EXPECT_NEAR(torque_factor_power(n), expected, 1e-12) << n;
  }
}

TEST(TorqueFactor, RefusesWhatIsNoPressure) {
  for (double s : {-1.0, -2.0, 2000.0, std::nan("")})
    EXPECT_THROW(torque_factor(s), std::invalid_argument) << s;
  for (double n : {0.0, -1.0, 1e7, std::nan("")})
    EXPECT_THROW(torque_factor_power(n), std::invalid_argument) << n;
}

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
  const auto message = [](const Patch<double>& p) -> std::string {
    try {
      validate(p);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message({0.0, 1.0, 1.0, 1}), "accepted");
  EXPECT_EQ(message({10.0, 1e-6, 1e-3, 4}), "accepted");
  EXPECT_THAT(message({-0.1, 0.01, 0.6, 2}), AllOf(HasSubstr("mu"), HasSubstr("-0.1"), HasSubstr("[0, 10]")));
  EXPECT_THAT(message({0.5, 0.0, 0.6, 2}), AllOf(HasSubstr("radius"), HasSubstr("(0, 1] m")));
  EXPECT_THAT(message({0.5, 12.0, 0.6, 2}), AllOf(HasSubstr("radius"), HasSubstr("12")));
  EXPECT_THAT(message({0.5, 0.01, 1.1, 2}), AllOf(HasSubstr("torque_factor"), HasSubstr("1.1")));
  EXPECT_THAT(message({0.5, 0.01, 0.6, 0}), HasSubstr("pads"));
  EXPECT_THAT(message({std::nan(""), 0.01, 0.6, 2}), HasSubstr("mu"));
}

}  // namespace
