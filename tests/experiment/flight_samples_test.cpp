// What is read of a tracked flight, and how its samples scatter.
#include "experiment/flight_samples.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "experiment/free_flight.hpp"

namespace unhand::experiment {
namespace {

using flight::Vec3;

/// A planar throw of n frames at 100 Hz that turns at 4 rad/s.
datasets::ThrowLog planar_flight(std::size_t n) {
  datasets::ThrowLog log;
  log.objects["ball"].mass = 0.1;
  datasets::Throw one;
  one.id = "001", one.object = "ball";
  datasets::MocapLog mocap;
  mocap.time = {n, 1, {}, {}};
  mocap.pose = {n, 3, {}, {1e-4, 2e-4, 3e-3}};
  for (std::size_t i = 0; i < n; ++i) {
    const double t = 0.01 * static_cast<double>(i);
    mocap.time.data.push_back(5 + t);
    mocap.pose.data.insert(mocap.pose.data.end(),
                           {0.2 + 1.5 * t, 1 + 2 * t - 0.5 * log.gravity * t * t, 0.4 + 4 * t});
  }
  one.mocap = mocap;
  one.free_flight = {mocap.time(0), mocap.time(n - 1)};
  log.throws = {one};
  return log;
}

TEST(FlightSamples, APlaneLiesInXAndZAndKeepsTheNoiseOfItsColumns) {
  const auto log = planar_flight(12);
  const auto s = read_flight_samples(log, log.throws[0]);
  ASSERT_EQ(s.position.size(), 12u);
  EXPECT_TRUE(s.declared);
  EXPECT_EQ(s.sigma[0], 1e-4);
  EXPECT_EQ(s.sigma[2], 2e-4);
  EXPECT_EQ(s.sigma_angle, 3e-3);
  EXPECT_NEAR(s.position[4][0], 0.2 + 1.5 * 0.04, 1e-12);
  EXPECT_EQ(s.position[4][1], 0);
  EXPECT_NEAR(s.theta[4], 0.4 + 4 * 0.04, 1e-12);
  EXPECT_NEAR(s.elapsed[4], 0.04, 1e-12);
}

/// Noise of σ on each part of a quaternion moves it by σ along each way that a rotation can, which is half
/// the rotation's angle.
TEST(FlightSamples, AQuaternionsNoiseIsHalfTheAngles) {
  datasets::ThrowLog log = planar_flight(400);
  log.dimension = 3;
  auto& mocap = *log.throws[0].mocap;
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 1e-3);
  mocap.pose = {400, 7, {}, {1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-3}};
  for (std::size_t i = 0; i < 400; ++i) {
    auto q = flight::exp(Vec3<double>{0.03 * static_cast<double>(i), 0, 0});
    q = flight::normalised(flight::Quaternion<double>{q.w + noise(random), q.x + noise(random),
                                                      q.y + noise(random), q.z + noise(random)});
    mocap.pose.data.insert(mocap.pose.data.end(), {0, 0, 0, q.w, q.x, q.y, q.z});
  }
  const auto s = read_flight_samples(log, log.throws[0]);
  EXPECT_NEAR(s.sigma_angle, 2e-3, 1e-12);
  // of some 400 third differences on three axes: 3 %
  EXPECT_NEAR(scatter_of(s).angle, 2e-3, 0.12 * 2e-3);
}

TEST(FlightSamples, TheScatterOfFlightsWeighsTheirDifferences) {
  FlightScatter few, many;
  few.n = 10, few.angle = 1, few.position = {2, 1, 0};
  many.n = 30, many.angle = 2, many.position = {0, 1, 4};
  const auto both = pooled({few, many});
  EXPECT_EQ(both.n, 40u);
  EXPECT_NEAR(both.angle, std::sqrt((10 * 1 + 30 * 4) / 40.0), 1e-12);
  EXPECT_NEAR(both.position[0], std::sqrt(10 * 4 / 40.0), 1e-12);
  EXPECT_NEAR(both.position[1], 1, 1e-12);
  EXPECT_NEAR(both.position[2], std::sqrt(30 * 16 / 40.0), 1e-12);
}

TEST(FlightSamples, WithoutItsFirstFrameAFlightBeginsAtTheSecond) {
  auto log = planar_flight(30);
  log.throws[0].mocap->pose(0, 0) += 3;  // the tracker was elsewhere
  auto s = read_flight_samples(log, log.throws[0]);
  ASSERT_EQ(remove_glitches(s), 1u);
  ASSERT_EQ(s.elapsed.size(), 29u);
  for (std::size_t i = 0; i < s.elapsed.size(); ++i) {
    EXPECT_NEAR(s.elapsed[i], s.times[i] - s.times.front(), 1e-12);
    EXPECT_NEAR(s.theta[i], 0.4 + 4 * (s.times[i] - 5), 1e-12);
  }
}

/// In the x-z plane an angle θ, from x to z, is a rotation by −θ about y.
TEST(FreeFlightOfAPlane, ItsAngleIsARotationInSpace) {
  const auto log = planar_flight(21);
  const auto fit = fit_free_flight(log, log.throws[0], 1);
  ASSERT_EQ(fit.outcome, FreeFlightOutcome::fitted) << fit.reason;
  EXPECT_NEAR(fit.theta, 0.4, 1e-12);
  const auto x = rotate(fit.rotation.attitude, Vec3<double>{1, 0, 0});
  EXPECT_NEAR(x[0], std::cos(0.4), 1e-12);
  EXPECT_NEAR(x[2], std::sin(0.4), 1e-12);
  // it turns as x does: dx/dt = ω × x
  const auto rate = flight::cross(fit.rotation.omega, x);
  EXPECT_NEAR(rate[0], -4 * std::sin(0.4), 1e-9);
  EXPECT_NEAR(rate[2], 4 * std::cos(0.4), 1e-9);
}

TEST(FreeFlightOfAPlane, TheSpreadOfEndErrorsIsThatOfTheFlights) {
  auto log = planar_flight(21);
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0, 1e-3);
  const datasets::Throw one = log.throws[0];
  log.throws.clear();
  for (int k = 0; k < 3; ++k) {
    log.throws.push_back(one);
    log.throws.back().id = std::to_string(k), log.throws.back().split = datasets::Split::test;
    for (std::size_t i = 0; i < 21; ++i) log.throws.back().mocap->pose(i, 0) += noise(random);
  }
  const auto all = compare_free_flights(log, 1);
  ASSERT_EQ(all.test.n, 3u);
  double mean = 0, squares = 0;
  for (const auto& each : all.each) mean += each.end_position_error / 3;
  for (const auto& each : all.each) squares += std::pow(each.end_position_error - mean, 2);
  EXPECT_GT(mean, 0);
  EXPECT_NEAR(all.test.end_position_error_m.mean, mean, 1e-12);
  EXPECT_NEAR(all.test.end_position_error_m.std, std::sqrt(squares / 2), 1e-12);
}

TEST(FreeFlightOfAPlane, AFractionOfTheSamplesIsRoundedUp) {
  const auto log = planar_flight(21);
  EXPECT_EQ(fit_free_flight(log, log.throws[0], 0.5).fitted, 11u);
  EXPECT_EQ(fit_free_flight(log, log.throws[0], 1).fitted, 21u);
  const auto even = planar_flight(20);
  EXPECT_EQ(fit_free_flight(even, even.throws[0], 0.5).fitted, 10u);
}

}  // namespace
}  // namespace unhand::experiment
