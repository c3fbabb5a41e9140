// Computed torque in the task, adaptive and plain: perfect models track, adaptation learns the load, V ends
// below its start.
#include "planners/control/task_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "planners/control/throw_study.hpp"

namespace unhand::planners::control {
namespace {

TEST(MinimumJerk, MeetsItsEndsAndIsItsOwnDerivative) {
  const MinimumJerk course{{0.1, 0.2, 0.3}, {0.1, 0, -0.2}, {0.5, -0.1, 0.6}, {1, 0.5, 0.7}, 0.8};
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  EXPECT_LE((course.at(0, R).position - course.from).norm(), 1e-15);
  EXPECT_LE((course.at(0.8, R).position - course.to).norm(), 1e-14);
  EXPECT_LE((course.at(0.8, R).velocity - course.to_velocity).norm(), 1e-13);
  EXPECT_LE(course.at(0, R).acceleration.norm() + course.at(0.8, R).acceleration.norm(), 1e-12);
  double best_velocity = 1, best_acceleration = 1;
  for (double h = 1e-1; h > 1e-7; h /= 10) {  // central differences
    const TaskReference a = course.at(0.4 + h, R), b = course.at(0.4 - h, R), m = course.at(0.4, R);
    best_velocity = std::min(best_velocity, ((a.position - b.position) / (2 * h) - m.velocity).norm());
    best_acceleration =
        std::min(best_acceleration, ((a.velocity - b.velocity) / (2 * h) - m.acceleration).norm());
  }
  EXPECT_LT(best_velocity, 1e-9);  // h² against rounding/h
  EXPECT_LT(best_acceleration, 1e-8);
}

/// A robot without noise, whose friction is the model's.
StudyOptions ideal() {
  StudyOptions o;
  o.angle_noise = o.rate_noise = o.torque_noise = o.friction_error = o.release_jitter = o.grasp_offset = 0;
  return o;
}

TEST(ThrowStudy, WithoutAnUnknownLoadEvenLowGainsTrack) {
  const Payload feather{"feather", 1e-6, 0.05};
  StudyOptions once = ideal();
  once.repetitions = 0;
  const StudyThrow run = run_throw({"plain", 30, 10, false}, feather, once, 1);
  ASSERT_TRUE(run.lands);
  // What is left is the zero-order hold of 1 ms: half of it, at 1.3 m/s and 10 m/s².
  EXPECT_LT(run.release_position_error, 1e-3);
  EXPECT_LT(run.release_velocity_error, 2e-2);
}

TEST(ThrowStudy, AdaptationLearnsTheLoadAndTracksFiveTimesBetter) {
  for (const Payload& payload : reported_payloads()) {
    const StudyThrow adaptive = run_throw({"adaptive", 30, 10, true}, payload, ideal(), 1, true);
    StudyOptions once = ideal();
    once.repetitions = 0;  // nothing is learned from more
    const StudyThrow plain = run_throw({"plain", 30, 10, false}, payload, once, 1);
    EXPECT_NEAR(adaptive.estimate[0], payload.mass, 0.15 * payload.mass) << payload.name;
    EXPECT_LT(adaptive.rms_error.back(), 0.2 * plain.rms_error.back()) << payload.name;
    // V after the repetitions is below V at their start; within a period the printed α is not the rate of β,
    // and V may rise.
    EXPECT_LT(adaptive.history.back().lyapunov, adaptive.history.front().lyapunov) << payload.name;
    EXPECT_LT(adaptive.torque_use, 1);
  }
}

TEST(ThrowStudy, IsRepeatable) {
  const Payload tube = reported_payloads().back();
  StudyOptions o;
  o.repetitions = 0;
  const ControllerChoice high{"plain", 300, 40, false};
  EXPECT_EQ(run_throw(high, tube, o, 7).miss, run_throw(high, tube, o, 7).miss);
  EXPECT_NE(run_throw(high, tube, o, 7).miss, run_throw(high, tube, o, 8).miss);
  o.repetitions = -1;
  EXPECT_THROW(run_throw(high, tube, o, 7), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::planners::control
