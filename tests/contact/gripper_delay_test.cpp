// Delays of the gripper as distributions, and the model that carries the object until they have passed.
#include "contact/gripper_delay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace unhand::contact {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Mean of the normal density between 0 and T by Simpson's rule.
double mean_by_quadrature(double centre, double spread, double longest) {
  constexpr int kSteps = 20000;
  double mass = 0, moment = 0;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = longest * k / kSteps, z = (x - centre) / spread;
    const double weight = (k == 0 || k == kSteps ? 1 : k % 2 ? 4 : 2) * std::exp(-0.5 * z * z);
    mass += weight;
    moment += weight * x;
  }
  return moment / mass;
}

TEST(DelayDistribution, ANumberIsItself) {
  const auto d = DelayDistribution::number(0.03);
  EXPECT_EQ(d.mean(), 0.03);
  EXPECT_EQ(d.quantiles(7), std::vector<double>{0.03});
}

TEST(DelayDistribution, UniformMidpoints) {
  const auto d = DelayDistribution::uniform(0.08);
  EXPECT_DOUBLE_EQ(d.mean(), 0.04);
  const auto q = d.quantiles(4);
  ASSERT_EQ(q.size(), 4u);
  for (int k = 0; k < 4; ++k) EXPECT_DOUBLE_EQ(q[k], 0.08 * (k + 0.5) / 4);
}

TEST(DelayDistribution, AUniformOneHasItsCentreInTheMiddle) {
  const DelayDistribution off{DelayDistribution::Kind::uniform, 0.01, 0, 0.1};
  EXPECT_THROW(off.mean(), std::invalid_argument);
  EXPECT_THROW(off.quantiles(3), std::invalid_argument);
}

TEST(DelayDistribution, TheMeanOfATruncatedNormal) {
  // Simpson's rule with 20,000 points is exact to rounding for these
  for (const auto& [centre, spread, longest] : {std::array{0.03, 0.01, 0.08},
                                                {0.01, 0.02, 0.05},
                                                {0.05, 0.1, 0.05},
                                                {0.0, 0.01, 0.03},
                                                {0.02, 5.0, 0.1}}) {
    const double mean = DelayDistribution::normal(centre, spread, longest).mean();
    // the closed form subtracts two nearly equal densities where the interval is a small part of the spread
    EXPECT_NEAR(mean, mean_by_quadrature(centre, spread, longest), 1e-12 + 1e-14 * spread * spread / longest)
        << centre << ' ' << spread << ' ' << longest;
  }
}

TEST(DelayDistribution, QuantilesInvertTheDistribution) {
  const double centre = 0.03, spread = 0.015, longest = 0.06;
  const auto probability = [&](double x) {
    const auto phi = [&](double y) { return 0.5 * std::erfc(-(y - centre) / spread * M_SQRT1_2); };
    return (phi(x) - phi(0)) / (phi(longest) - phi(0));
  };
  const auto q = DelayDistribution::normal(centre, spread, longest).quantiles(101);
  ASSERT_EQ(q.size(), 101u);
  EXPECT_TRUE(std::is_sorted(q.begin(), q.end()));
  for (int k = 0; k < 101; ++k) {
    EXPECT_GE(q[k], 0);
    EXPECT_LE(q[k], longest);
    EXPECT_NEAR(probability(q[k]), (k + 0.5) / 101, 1e-13);  // rounding of erfc
  }
  EXPECT_NEAR(q[50], 0.03, 1e-15);  // symmetric: the median is the centre
}

TEST(DelayDistribution, TheirAverageTendsToTheMean) {
  const auto d = DelayDistribution::normal(0.02, 0.015, 0.05);
  double before = 1;
  for (const int n : {10, 100, 1000}) {
    double sum = 0;
    for (const double x : d.quantiles(n)) sum += x / n;
    const double error = std::abs(sum - d.mean());
    EXPECT_LT(
        error,
        0.1 * before);  // a midpoint rule of a bounded quantile function: second order, a hundredth each
    before = error;
  }
  EXPECT_LT(before, 1e-7);
}

TEST(DelayDistribution, WrongOnesAreRefused) {
  const auto refused = [](const DelayDistribution& d) { EXPECT_THROW(validate(d), std::invalid_argument); };
  refused(DelayDistribution::number(-0.01));
  refused(DelayDistribution::number(11));
  refused(DelayDistribution::number(kNaN));
  refused(DelayDistribution::normal(0.03, 0, 0.1));
  refused(DelayDistribution::normal(0.03, -1, 0.1));
  refused(DelayDistribution::normal(0.2, 0.01, 0.1));
  refused(DelayDistribution::uniform(-1));
  validate(DelayDistribution::normal(0.03, 0.01, 0.1));
  validate(DelayDistribution::uniform(0.1));
}

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

TEST(DelayDistribution, HasAMeanAndQuantilesOrIsRefused) {
  for (const auto& d : {DelayDistribution::normal(5, 0.01, 0.1), DelayDistribution::normal(0.03, kNaN, 0.1),
                        DelayDistribution::uniform(kNaN)}) {
    EXPECT_THROW(static_cast<void>(d.mean()), std::invalid_argument);
    EXPECT_THROW(static_cast<void>(d.quantiles(3)), std::invalid_argument);
  }
  EXPECT_THROW(static_cast<void>(DelayDistribution::uniform(0.1).quantiles(0)), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(DelayDistribution::number(0.1).quantiles(-1)), std::invalid_argument);
  // an interval that the normal does not resolve is evenly full
  const auto narrow = DelayDistribution::normal(0, 10, 1e-300);
  EXPECT_EQ(narrow.mean(), 5e-301);
  EXPECT_EQ(narrow.quantiles(1)[0], 5e-301);
}

}  // namespace
}  // namespace unhand::contact
