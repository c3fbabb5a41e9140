// What a tracker reports of a flight when its scale, its clock or its declared body is off.
#include "experiment/tracked_flight.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace {

using namespace unhand;
using namespace unhand::experiment;
using flight::Vec3;

constexpr double kG = 9.81;

TrackedFlight<double> tumbling() {
  TrackedFlight<double> out;
  out.start.position = {0.3, -0.2, 1.1}, out.start.velocity = {1.5, 0.4, 2.5};
  out.start.inertia = {1e-3, 2e-3, 2.6e-3};
  out.start.rotation = {flight::exp(Vec3<double>{0.4, -0.8, 0.3}), {3, -5, 2}};
  out.gravity = kG;
  return out;
}

TrackedPose<double> reported(const TrackedFlight<double>& flown, double time,
                             const std::vector<std::string>& names = {},
                             const std::vector<double>& values = {}) {
  return tracked_poses(flown, dynamics::Values<double>(names, values), {time},
                       dynamics::error_controlled({1e-11, 1e-13}))
      .at(0);
}

void expect_same(const TrackedPose<double>& a, const TrackedPose<double>& b, const char* what) {
  const auto turn = flight::rotation_between(a.attitude, b.attitude);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.position[i], b.position[i], 1e-10) << what << ' ' << i;
    EXPECT_NEAR(turn[i], 0, 1e-9) << what << ' ' << i;
  }
}

TEST(TrackedPoses, AreTheFlightWhereNothingIsOff) {
  const auto flown = tumbling();
  const auto seen = reported(flown, 0.4);
  EXPECT_NEAR(seen.position[0], 0.3 + 1.5 * 0.4, 1e-12);
  EXPECT_NEAR(seen.position[1], -0.2 + 0.4 * 0.4, 1e-12);
  EXPECT_NEAR(seen.position[2], 1.1 + 2.5 * 0.4 - 0.5 * kG * 0.16, 1e-12);
}

TEST(TrackedPoses, ALongerMetreAndAFasterClockAreReported) {
  const auto flown = tumbling();
  // a clock that runs fast by a fifth says 0.48 s when 0.4 s have passed
  expect_same(reported(flown, 0.48, {"sensor.time_scale.scale"}, {1.2}), reported(flown, 0.4), "clock");
  auto longer = reported(flown, 0.4);
  for (double& x : longer.position) x *= 1.05;
  expect_same(reported(flown, 0.4, {"sensor.length_scale.scale"}, {1.05}), longer, "metre");
}

TEST(TrackedPoses, ADeclaredCentreOfMassTurnsWithTheBody) {
  const auto flown = tumbling();
  const Vec3<double> off{0.03, -0.02, 0.05};  // true − declared, body axes
  auto expected = reported(flown, 0.4);
  expected.position = flight::difference(expected.position, rotate(expected.attitude, off));
  expect_same(reported(flown, 0.4, {"sensor.com_offset.x", "sensor.com_offset.y", "sensor.com_offset.z"},
                       {off[0], off[1], off[2]}),
              expected, "offset");
}

TEST(TrackedPoses, RatiosOfInertiaAreThoseOfTheirAxes) {
  const auto flown = tumbling();
  auto other = flown;
  other.start.inertia[1] *= 1.3, other.start.inertia[2] *= 0.8;
  expect_same(reported(flown, 0.4, {"sensor.inertia.ratio_y", "sensor.inertia.ratio_z"}, {1.3, 0.8}),
              reported(other, 0.4), "inertia");
  EXPECT_GT(
      flight::norm(flight::rotation_between(reported(flown, 0.4).attitude, reported(other, 0.4).attitude)),
      1e-2);
}

}  // namespace
