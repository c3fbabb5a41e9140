// A falling accelerometer against closed forms.
#include "experiment/falling_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace unhand::experiment {
namespace {

using flight::Vec3;

constexpr double kG = 9.81;

FallSamples sampled(double rate, double duration, const Vec3<double>& omega = {}) {
  FallSamples out;
  for (int i = 0; i <= static_cast<int>(rate * duration); ++i) {
    const double t = i / rate;
    out.time.push_back(t);
    if (flight::norm(omega) == 0) continue;
    out.omega.push_back(omega);
    out.turned.push_back(flight::scaled(t, omega));
  }
  return out;
}

using Named = std::vector<std::pair<std::string, double>>;
std::vector<Vec3<double>> readings(const FallStart<double>& start, const FallSamples& samples,
                                   const Named& named) {
  std::vector<std::string> names;
  std::vector<double> values;
  for (const auto& [name, value] : named) names.push_back(name), values.push_back(value);
  return falling_readings<double>(start, samples, kG, {names, values});
}

void expect_near(const Vec3<double>& a, const Vec3<double>& b, double tolerance, double at) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << "axis " << i << ", t = " << at;
}

TEST(FallingSensor, APerfectOneReadsZero) {
  for (const auto& f : readings({-1.3, {0, 0.6, 0.8}, {1, 2, 3}}, sampled(200, 0.5, {0.4, 0, 7}), {}))
    EXPECT_EQ(f, (Vec3<double>{0, 0, 0}));
}

TEST(FallingSensor, QuadraticDragIsATanhOfTime) {
  constexpr double k = 0.4;  // v = -v_t tanh(g t/v_t) from rest, v_t² = g/k
  const double terminal = std::sqrt(kG / k);
  const Vec3<double> up{0.48, 0.6, 0.64};
  const auto samples = sampled(400, 1);
  const auto f = readings({0, up, {}}, samples, {{"flight.quadratic_drag.k", k}});
  for (std::size_t i = 0; i < f.size(); ++i) {
    const double t = samples.time[i], v = -terminal * std::tanh(kG * t / terminal);
    expect_near(f[i], flight::scaled(k * v * v, up), 4e-5, t);  // of Heun's steps of 2.5 ms
  }
}

TEST(FallingSensor, LinearDragIsAnExponentialUpwardsAndDownwards) {
  constexpr double c = 0.5, v0 = 3;  // past the apex at ln(1 + c v0/g)/c
  const Vec3<double> up{0, 0, 1};
  const auto samples = sampled(400, 0.8);
  const auto f = readings({v0, up, {}}, samples, {{"flight.linear_drag.c", c}});
  for (std::size_t i = 0; i < f.size(); ++i) {
    const double t = samples.time[i], v = (v0 + kG / c) * std::exp(-c * t) - kG / c;
    expect_near(f[i], flight::scaled(-c * v, up), 1e-6, t);
  }
}

TEST(FallingSensor, DragByAxisPushesAlongTheBodysAxes) {
  const Vec3<double> up{0.6, 0, 0.8};
  const double v = -2;
  flight::SpatialAir<double> air;
  air.drag_k = 0.3, air.axis_drag_x = 0.1, air.axis_drag_y = -0.25;
  const Vec3<double> k{0.4, 0.05, 0.45};
  const auto f = specific_force<double>({}, air, {0, v, up, {}, {}});
  for (std::size_t a = 0; a < 3; ++a) EXPECT_NEAR(f[a], -k[a] * std::abs(v) * v * up[a], 1e-15);
}

TEST(FallingSensor, ALeverArmFeelsTheTurnsOfTheBody) {
  const Vec3<double> r{0.02, -0.01, 0.03}, omega{0, 0, 6};
  const auto spun =
      readings({0, {0, 0, 1}, {}}, sampled(100, 0.1, omega),
               {{"sensor.lever_arm.x", r[0]}, {"sensor.lever_arm.y", r[1]}, {"sensor.lever_arm.z", r[2]}});
  for (const auto& f : spun) expect_near(f, {-36 * r[0], -36 * r[1], 0}, 1e-15, 0);
  Accelerometer<double> sensor;
  sensor.lever_arm = r;
  const auto started = specific_force<double>(sensor, {}, {0, 0, {0, 0, 1}, {}, {0, 0, 5}});
  expect_near(started, {-5 * r[1], 5 * r[0], 0}, 1e-15, 0);
}

TEST(FallingSensor, BiasDriftAndSettlingAddUp) {
  const auto samples = sampled(100, 0.3);
  const auto f = readings({-1, {0, 1, 0}, {}}, samples,
                          {{"sensor.accelerometer_bias.x", 0.2},
                           {"sensor.accelerometer_drift.y", -0.5},
                           {"sensor.settling.z", 0.8},
                           {"sensor.settling.tau", 0.1}});
  for (std::size_t i = 0; i < f.size(); ++i) {
    const double t = samples.time[i];
    expect_near(f[i], {0.2, -0.5 * t, 0.8 * std::exp(-t / 0.1)}, 1e-15, t);
  }
}

TEST(FallingSensor, TheVerticalTurnsAgainstTheBody) {
  // Turning by 90° about body x: what was up along z lies along y, whoever says so.
  const double rate = std::numbers::pi;
  const auto seen = sampled(100, 0.5, {rate, 0, 0}), unseen = sampled(100, 0.5);
  const Named drag{{"flight.linear_drag.c", 0.1}};
  for (const auto& f : {readings({-4, {0, 0, 1}, {}}, seen, drag).back(),
                        readings({-4, {0, 0, 1}, {rate, 0, 0}}, unseen, drag).back()}) {
    EXPECT_NEAR(f[0], 0, 1e-12);
    EXPECT_NEAR(f[2], 0, 1e-12);
    EXPECT_GT(f[1], 0.4);
  }
}

TEST(FallingSensor, OneSampleTurnsAndSizesAgree) {
  FallSamples one{{0}, {{0, 0, 4}}, {}, {{0, 0, 0}}};
  const Named named{{"sensor.lever_arm.x", 0.1}};
  const auto f = readings({0, {0, 0, 1}, {}}, one, named);
  ASSERT_EQ(f.size(), 1U);
  expect_near(f[0], {-0.1 * 16, 0, 0}, 1e-12, 0);  // ω × (ω × r), towards the axis
  one.omega_rate = {{0, 0, 5}};
  expect_near(readings({0, {0, 0, 1}, {}}, one, named)[0], {-0.1 * 16, 0.1 * 5, 0}, 1e-12,
              0);  // ω̇ × r beside it
  one.omega_rate.push_back({0, 0, 5});
  EXPECT_THROW(readings({0, {0, 0, 1}, {}}, one, named), std::invalid_argument);
  one.omega_rate.clear();
  one.turned.clear();
  one.omega.push_back({0, 0, 4});
  EXPECT_THROW(readings({0, {0, 0, 1}, {}}, one, named), std::invalid_argument);
  one.omega.clear();
  one.turned = {{0, 0, 0}, {0, 0, 0}};
  EXPECT_THROW(readings({0, {0, 0, 1}, {}}, one, named), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::experiment
