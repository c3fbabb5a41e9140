// What an accelerometer reads of a fall and before it, by hand; and boxes that lie still on their faces.
#include "fitting/measured/fall_readings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "fitting/measured/rest_heights.hpp"
#include "flight/quaternion.hpp"

namespace unhand::fitting {
namespace {

using flight::Vec3;

/// A recording at 100 Hz from `begin` to `end` [s].
datasets::ImuLog recorded(double begin, double end, const std::function<Vec3<double>(double)>& force,
                          const Vec3<double>& rate = {0, 0, 0}) {
  datasets::ImuLog out;
  out.time.cols = 1, out.specific_force.cols = out.angular_rate.cols = 3;
  for (int k = 0; begin + 0.01 * k < end + 1e-9; ++k) {
    const double t = begin + 0.01 * k;
    const auto f = force(t);
    out.time.data.push_back(t);
    out.specific_force.data.insert(out.specific_force.data.end(), f.begin(), f.end());
    out.angular_rate.data.insert(out.angular_rate.data.end(), rate.begin(), rate.end());
  }
  out.time.rows = out.specific_force.rows = out.angular_rate.rows = out.time.data.size();
  return out;
}

TEST(FallReadings, ASteadySpinTurnsByItselfTimesTheFall) {
  datasets::Throw one;
  one.imu = recorded(9.5, 10.8, [](double) { return Vec3<double>{0, 0, 0}; }, {1, -2, 3});
  one.free_flight = {10.0, 10.3};
  const FallReadings fall = readings_of(one);
  ASSERT_EQ(fall.force.size(), 31U);
  ASSERT_EQ(fall.samples.turned.size(), 31U);
  const auto& turned = fall.samples.turned.back();
  EXPECT_NEAR(turned[0], 0.3, 1e-9);
  EXPECT_NEAR(turned[1], -0.6, 1e-9);
  EXPECT_NEAR(turned[2], 0.9, 1e-9);
}

// A gyroscope's noise of 0.002 rad/s at 100 Hz is 0.14 rad/s² in a difference over two samples.
TEST(FallReadings, RatesOfTurnsAreNotItsNoise) {
  std::mt19937_64 random(91);
  std::normal_distribution<double> noise(0, 0.002);
  datasets::Throw one;
  one.imu = recorded(10.0, 10.6, [](double) { return Vec3<double>{0, 0, 0}; });
  one.free_flight = {10.0, 10.6};
  constexpr double kPhase[] = {0, 1, 2};
  for (std::size_t i = 0; i < one.imu->time.rows; ++i)
    for (std::size_t a = 0; a < 3; ++a)
      one.imu->angular_rate(i, a) = 2 * std::sin(3 * (one.imu->time(i) - 10) + kPhase[a]) + noise(random);
  const auto samples = readings_of(one).samples;
  ASSERT_EQ(samples.omega_rate.size(), samples.time.size());
  double square = 0;
  for (std::size_t i = 0; i < samples.time.size(); ++i)
    for (std::size_t a = 0; a < 3; ++a)
      square += std::pow(samples.omega_rate[i][a] - 6 * std::cos(3 * samples.time[i] + kPhase[a]), 2);
  EXPECT_LT(std::sqrt(square / (3 * static_cast<double>(samples.time.size()))), 0.03);
}

// The sensor reads 10 m/s² at rest, bias included; a push that reads 15 m/s² for a fifth of a second leaves
// at 1 m/s, whatever gravity is.
TEST(FallReadings, SpeedIsWhatAPushReadsAboveRest) {
  const auto imu = recorded(0, 0.8, [](double t) {
    return Vec3<double>{0, 0, t < 0.5 - 1e-6 ? 10.0 : 15.0};
  });
  const BeforeFall before = before_fall(imu, 70, 9.81);
  ASSERT_TRUE(before.quiet);
  EXPECT_NEAR(before.rest[2], 10, 1e-9);
  EXPECT_NEAR(before.speed, 5 * 0.2, 1e-9);
}

// A reading on a grid of 0.1 m/s² is uncertain by 0.1/√12 at least, however quiet the sensor is said to be.
TEST(FallReadings, AGridMakesReadingsUncertain) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  FallReadings fall;
  for (int k = 0; k < 50; ++k) {
    const auto reading = [&] { return 0.1 * std::round(10 * normal(random)); };
    fall.force.push_back({reading(), reading(), reading()});
  }
  const std::array<ForceAxis, 3> axes{{{-50, 50, 0.1, {}}, {-50, 50, 0, {}}, {-50, 50, 0.1, {}}}};
  const AxisUse use = axis_use(fall, {1e-3, 1e-3, 0.5}, axes);
  EXPECT_NEAR(use.sigma[0], 0.1 / std::sqrt(12), 1e-12);
  EXPECT_EQ(use.sigma[1], 1e-3);
  EXPECT_EQ(use.sigma[2], 0.5) << "noisier than its grid";
  EXPECT_EQ(use.coarse, std::vector<std::size_t>{0});
}

// An axis that is stuck in one of five falls is asked in the others; stuck in three, in none.
TEST(FallReadings, AnAxisIsFaultyWhereMostFallsSaySo) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (const int stuck : {0, 1, 2, 3, 5}) {
    datasets::ThrowLog log;
    for (int n = 0; n < 5; ++n) {
      auto& one = log.throws.emplace_back();
      one.object = "box";
      one.imu = recorded(0, 0.6, [&](double) {
        const double x = normal(random), y = normal(random), z = normal(random);
        return Vec3<double>{n < stuck ? 0.123 : x, y, z};
      });
      one.free_flight = {0.1, 0.5};
    }
    const auto axes = force_axes(log).at("box");
    EXPECT_EQ(axes[0].fault.empty(), stuck < 3) << stuck;
    EXPECT_TRUE(axes[1].fault.empty());
  }
}

// Of a tracked point that is off the middle, seen by a tracker whose lengths are 2 % too large, over a floor
// at 0.3 m: twelve boxes, two on each face, 0.1 mm above and below where they should be.
TEST(RestHeights, OppositeFacesGiveTheTrackedPointAndTheScale) {
  constexpr double kScale = 0.02, kFloor = 0.3, kOff = 1e-4;
  const Vec3<double> dims{0.10, 0.06, 0.04}, point{2e-3, -1e-3, 5e-4};
  datasets::ThrowLog log;
  log.dimension = 3;
  log.objects["box"].dims = {dims[0], dims[1], dims[2]};
  const double quarter = std::acos(0.0);
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int up : {1, -1})
      for (const double off : {kOff, -kOff}) {
        // Turns of the body that bring this axis upward.
        const Vec3<double> turn = axis == 0   ? Vec3<double>{0, -up * quarter, 0}
                                  : axis == 1 ? Vec3<double>{up * quarter, 0, 0}
                                              : Vec3<double>{up > 0 ? 0 : 2 * quarter, 0, 0};
        const auto q = flight::exp(turn);
        auto& one = log.throws.emplace_back();
        one.object = "box";
        auto& mocap = one.mocap.emplace();
        mocap.time.cols = 1, mocap.pose.cols = 7;
        const double height = kFloor + (1 + kScale) * (0.5 * dims[axis] + up * point[axis]) + off;
        for (int i = 0; i < 8; ++i) {
          mocap.time.data.push_back(0.01 * i);
          mocap.pose.data.insert(mocap.pose.data.end(), {1, 1, height, q.w, q.x, q.y, q.z});
        }
        mocap.time.rows = mocap.pose.rows = 8;
      }
  const auto found = rest_heights(log, "box", kFloor);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->n, 12);
  EXPECT_NEAR(found->scale, kScale, 1e-9);
  EXPECT_NEAR(found->above, kScale * 0.5 * (dims[0] + dims[1] + dims[2]) / 3, 1e-9);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(found->offset[axis].value(), (1 + kScale) * point[axis], 1e-9) << axis;
    // A mean of two that are 0.1 mm off either way is known to 0.1 mm; half the difference of two such.
    EXPECT_NEAR(found->offset_sigma[axis], kOff / std::sqrt(2), 1e-9) << axis;
  }
}

}  // namespace
}  // namespace unhand::fitting
