// Free flights: synthetic ones give back their truth within the predicted error, and measured ones obey
// physics.
#include "experiment/free_flight.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "datasets/import_cube_tosses.hpp"
#include "flight/fly.hpp"
#include "flight/spatial_flight.hpp"
#include "free_flight_campaigns.hpp"
#include "tests/support/data_folder.hpp"

namespace unhand::experiment {
namespace {

struct Body {
  const char* name;
  Vec3<double> inertia;
  double drag_k;
};
class SpatialFlight : public testing::TestWithParam<Body> {};
INSTANTIATE_TEST_SUITE_P(, SpatialFlight,
                         testing::Values(Body{"Cube", {8e-4, 8e-4, 8e-4}, 0},
                                         Body{"Box", {4e-4, 9e-4, 1.1e-3}, 0},
                                         Body{"CubeWithDrag", {8e-4, 8e-4, 8e-4}, 0.2}),
                         [](const auto& test) { return test.param.name; });

TEST_P(SpatialFlight, GivesBackTheTruthWithoutNoise) {
  const Campaign c = spatial(20, GetParam().inertia, GetParam().drag_k, 0);
  for (std::size_t i = 0; i < c.truth.size(); ++i) {
    const auto errors = free_flight_errors(c.log, c.log.throws[i]);
    ASSERT_EQ(errors.outcome, FreeFlightOutcome::fitted) << errors.reason;
    // The fit's integrator is good to 1e-10 of a state of order one to ten.
    EXPECT_LT(errors.trajectory_rms, 1e-9) << i;
    EXPECT_LT(errors.end_position_error, 1e-8) << i;
    EXPECT_LT(*errors.end_orientation_error, 1e-7) << i;
    EXPECT_LT(flight::norm(flight::difference(errors.whole.velocity, c.truth[i].velocity)), 1e-8) << i;
    EXPECT_LT(flight::norm(flight::difference(errors.whole.rotation.omega, c.truth[i].rotation.omega)), 1e-6)
        << i;
  }
}

// What a least-squares fit of the right model leaves is a χ², of which the mean is its degrees of freedom and
// the variance twice that: four standard deviations, here and below.
TEST_P(SpatialFlight, LeavesTheNoise) {
  const Campaign c = spatial(150, GetParam().inertia, GetParam().drag_k, 1);
  for (const double fraction : {1.0, 0.5}) {
    double chi2 = 0, chi2_rotation = 0, dof = 0;
    for (const Throw& one : c.log.throws) {
      const auto fit = fit_free_flight(c.log, one, fraction);
      ASSERT_EQ(fit.outcome, FreeFlightOutcome::fitted) << fit.reason;
      chi2 += chi2_of(fit.position_residuals, fit.fitted, {kSigmaP, kSigmaP, 2 * kSigmaP});
      chi2_rotation +=
          chi2_of(fit.orientation_residuals, fit.fitted, {2 * kSigmaQ, 2 * kSigmaQ, 2 * kSigmaQ});
      dof += 3 * (static_cast<double>(fit.fitted) - 2);
    }
    EXPECT_NEAR(chi2, dof, 4 * std::sqrt(2 * dof)) << fraction;
    EXPECT_NEAR(chi2_rotation, dof, 4 * std::sqrt(2 * dof)) << fraction;
  }
}

TEST(PlanarFlight, LeavesTheNoise) {
  for (const double drag_k : {0.0, 0.3}) {
    const Campaign c = planar(150, drag_k, 1);
    double chi2 = 0, chi2_rotation = 0;
    for (std::size_t i = 0; i < c.truth.size(); ++i) {
      const auto fit = fit_free_flight(c.log, c.log.throws[i], 1);
      ASSERT_EQ(fit.outcome, FreeFlightOutcome::fitted) << fit.reason;
      EXPECT_EQ(fit.position[1], 0);
      chi2 += chi2_of(fit.position_residuals, fit.fitted, {kSigmaP, kSigmaP, kSigmaP});
      chi2_rotation += chi2_of(fit.orientation_residuals, fit.fitted, {kSigmaQ, kSigmaQ, kSigmaQ});
      const auto& truth = c.truth[i].rotation.omega;         // (theta, −omega) is what `planar` keeps there
      EXPECT_NEAR(fit.theta, truth[0], 2 * kSigmaQ);         // 7 of its σ, 2/√50 of a sample's
      EXPECT_NEAR(fit.rotation.omega[1], truth[1], 4.2e-3);  // as many, of √(12/50)/0.42 s
    }
    const double dof = 150 * 48;
    EXPECT_NEAR(chi2, 2 * dof, 4 * std::sqrt(4 * dof)) << drag_k;
    EXPECT_NEAR(chi2_rotation, dof, 4 * std::sqrt(2 * dof));
  }
}

TEST(FreeFlight, AnotherGravityShowsInClosedForm) {
  // A flight under g + δ read with g leaves δ t²/2 less the line fitted to it. Over the whole flight T that
  // is the second Legendre polynomial, of root mean square δT²/(12 √5); a line through the first half misses
  // the end by 13/48 δT².
  constexpr double delta = 0.2, T = 0.4;
  Campaign c = planar(1, 0, 0);
  auto& mocap = *c.log.throws[0].mocap;
  const std::size_t n = 4001;  // sums are integrals to 1/n
  mocap.time = {n, 1, {}, {}};
  mocap.pose = {n, 3, {}, {1e-4, 1e-4, 1e-4}};
  for (std::size_t i = 0; i < n; ++i) {
    const double t = T * static_cast<double>(i) / (n - 1);
    mocap.time.data.push_back(t);
    for (const double x : {1 + 2 * t, 3 * t - 0.5 * (c.log.gravity + delta) * t * t, 5 * t})
      mocap.pose.data.push_back(x);
  }
  const auto errors = free_flight_errors(c.log, c.log.throws[0]);
  EXPECT_NEAR(errors.trajectory_rms / (delta * T * T / (12 * std::sqrt(5.0))), 1, 2e-3);
  EXPECT_NEAR(errors.end_position_error / (13.0 / 48 * delta * T * T), 1, 2e-3);
  EXPECT_EQ(errors.normalised_time.front(), 0);
  EXPECT_EQ(errors.normalised_time.back(), 1);
  EXPECT_LT(errors.whole.position_residuals.front()[2],
            0);  // more gravity: low at both ends, high in between
  EXPECT_GT(errors.whole.position_residuals[n / 2][2], 0);
}

/// The same flight seen from a world that is shifted, turned about the vertical and read on another clock.
TEST(FreeFlight, TheWorldAndItsClockDoNotMatter) {
  for (const double drag_k : {0.0, 0.2}) {
    Campaign c = spatial(6, {4e-4, 9e-4, 1.1e-3}, drag_k, 1);
    for (auto& one : c.log.throws) one.mocap->pose.sigma[2] = kSigmaP;
    ThrowLog moved = c.log;
    const Quaternion<double> turn = flight::exp(Vec3<double>{0, 0, 1.1});
    for (auto& one : moved.throws) {
      for (double& t : one.mocap->time.data) t += 2.0;
      auto& pose = one.mocap->pose;
      for (std::size_t i = 0; i < pose.rows; ++i) {
        const Vec3<double> p = rotate(turn, Vec3<double>{pose(i, 0), pose(i, 1), pose(i, 2)});
        const Quaternion<double> q =
            turn * Quaternion<double>{pose(i, 3), pose(i, 4), pose(i, 5), pose(i, 6)};
        const double row[7] = {p[0] + 3, p[1] - 2, p[2] + 0.5, q.w, q.x, q.y, q.z};
        for (std::size_t j = 0; j < 7; ++j) pose(i, j) = row[j];
      }
    }
    for (std::size_t k = 0; k < c.truth.size(); ++k) {
      const auto a = free_flight_errors(c.log, c.log.throws[k]);
      const auto b = free_flight_errors(moved, moved.throws[k]);
      EXPECT_NEAR(a.trajectory_rms, b.trajectory_rms, 1e-9);  // the integrator's 1e-10
      EXPECT_NEAR(a.end_position_error, b.end_position_error, 1e-8);
      EXPECT_NEAR(*a.end_orientation_error, *b.end_orientation_error, 1e-8);
    }
  }
}

TEST(FreeFlight, NeedsNoDeclaredSigma) {
  Campaign c = spatial(40, {8e-4, 8e-4, 8e-4}, 0, 1);
  for (auto& one : c.log.throws) {
    one.mocap->pose.sigma[2] = kSigmaP;
    const auto with = fit_free_flight(c.log, one, 1);
    one.mocap->pose.sigma.clear();
    const auto without = fit_free_flight(c.log, one, 1);
    EXPECT_LT(flight::norm(flight::difference(with.velocity, without.velocity)), 1e-12);
    EXPECT_LT(flight::norm(flight::difference(with.rotation.omega, without.rotation.omega)), 1e-6);
  }
}

TEST(FreeFlight, UsesOnlyWhatIsValidAndFree) {
  Campaign c = spatial(1, {8e-4, 8e-4, 8e-4}, 0, 0);
  Throw& one = c.log.throws[0];
  auto& mocap = *one.mocap;
  const std::size_t n = mocap.time.rows;
  mocap.valid.assign(n, 1);
  mocap.valid[11] = 0;
  for (std::size_t j = 0; j < 7; ++j) mocap.pose(11, j) = NAN;
  one.free_flight = {mocap.time(3), mocap.time(n - 5)};
  for (const std::size_t i : {std::size_t{0}, std::size_t{2}, n - 4, n - 1})
    mocap.pose(i, 0) += 1;  // held, or bounced
  const auto fit = fit_free_flight(c.log, one, 0.5);
  ASSERT_EQ(fit.outcome, FreeFlightOutcome::fitted);
  EXPECT_EQ(fit.times.size(), n - 8);
  EXPECT_EQ(fit.fitted, (n - 8 + 1) / 2);
  EXPECT_EQ(fit.times.front(), mocap.time(3));
  EXPECT_LT(flight::norm(fit.position_residuals.back()), 1e-10);
}

TEST(FreeFlight, PositionsAloneWillDo) {
  Campaign c = spatial(4, {8e-4, 8e-4, 8e-4}, 0, 1);
  for (auto& one : c.log.throws) {
    auto& pose = one.mocap->pose;
    std::vector<double> positions;
    for (std::size_t i = 0; i < pose.rows; ++i)
      for (std::size_t j = 0; j < 3; ++j) positions.push_back(pose(i, j));
    pose = {pose.rows, 3, positions, {kSigmaP, kSigmaP, 2 * kSigmaP}};
  }
  const auto comparison = compare_free_flights(c.log);
  EXPECT_EQ(comparison.train.n, 3u);
  EXPECT_EQ(comparison.train.end_position_error_m.n, 3u);
  EXPECT_EQ(comparison.train.end_orientation_error_deg.n, 0u);
  EXPECT_FALSE(comparison.each[0].end_orientation_error);
}

TEST(FreeFlight, WhatCannotBeFittedSaysWhy) {
  Campaign c = spatial(5, {8e-4, 8e-4, 8e-4}, 0, 1);
  auto& throws = c.log.throws;
  throws[0].mocap.reset();
  throws[1].hand.emplace();
  throws[2].free_flight = {throws[2].mocap->time(0), throws[2].mocap->time(2)};
  throws[4].hand.emplace();
  throws[4].free_flight = {throws[4].mocap->time(5), throws[4].mocap->time(35)};
  const auto comparison = compare_free_flights(c.log);
  EXPECT_EQ(comparison.each[0].outcome, FreeFlightOutcome::no_tracking);
  EXPECT_EQ(comparison.each[1].outcome, FreeFlightOutcome::not_free);
  EXPECT_EQ(comparison.each[2].outcome, FreeFlightOutcome::too_short);
  EXPECT_NE(comparison.each[2].reason.find("3 valid samples"), std::string::npos)
      << comparison.each[2].reason;
  EXPECT_EQ(comparison.each[3].outcome, FreeFlightOutcome::fitted);
  EXPECT_EQ(comparison.each[4].outcome, FreeFlightOutcome::fitted);
  EXPECT_EQ(comparison.skipped, 3u);
  EXPECT_EQ(comparison.train.n, 1u);
  EXPECT_EQ(comparison.test.n, 1u);

  EXPECT_THROW(fit_free_flight(c.log, throws[3], 0), std::invalid_argument);
  EXPECT_THROW(fit_free_flight(c.log, throws[3], 1.1), std::invalid_argument);
  EXPECT_THROW(compare_free_flights(c.log, -1), std::invalid_argument);
}

// Without a hand, what pressed on the object, opened or let go still tells that it was carried.
TEST(FreeFlight, WhatIsHeldAtFirstIsNotFree) {
  const Campaign c = spatial(1, {8e-4, 8e-4, 8e-4}, 0, 1);
  const auto& free = c.log.throws[0];
  const double first = free.mocap->time(0), late = first + 0.1;
  const auto outcome = [](const ThrowLog& log) { return fit_free_flight(log, log.throws[0], 1).outcome; };
  EXPECT_EQ(outcome(c.log), FreeFlightOutcome::fitted);
  ThrowLog pressed = c.log, opened = c.log, detached = c.log;
  pressed.throws[0].ft.emplace();
  opened.gripper.emplace().opening_command_time = late;
  detached.throws[0].detach_time = late;
  for (ThrowLog* log : {&pressed, &opened, &detached}) {
    EXPECT_EQ(outcome(*log), FreeFlightOutcome::not_free);
    EXPECT_EQ(compare_free_flights(*log).skipped, 1u);
    ThrowLog declared = *log;
    declared.throws[0].free_flight = {late, free.mocap->time(free.mocap->time.rows - 1)};
    EXPECT_EQ(outcome(declared), FreeFlightOutcome::fitted);
    EXPECT_GE(fit_free_flight(declared, declared.throws[0], 1).times.front(), late - 1e-9);
  }
  opened.gripper->opening_command_time = first - 0.1;  // before anything was seen
  EXPECT_EQ(outcome(opened), FreeFlightOutcome::fitted);
}

TEST(FreeFlight, TheAnswerDoesNotDependOnThreads) {
  const Campaign c = spatial(7, {4e-4, 9e-4, 1.1e-3}, 0.1, 1);  // no number of threads divides them
  const auto one = compare_free_flights(c.log, 1);
  for (const int threads : {0, 2, 3, 64}) {
    const auto more = compare_free_flights(c.log, threads);
    for (const auto part : {&FreeFlightComparison::train, &FreeFlightComparison::test}) {
      EXPECT_EQ((one.*part).n, (more.*part).n);
      EXPECT_EQ((one.*part).trajectory_rms_m, (more.*part).trajectory_rms_m);
      EXPECT_EQ((one.*part).end_position_error_m.mean, (more.*part).end_position_error_m.mean);
      EXPECT_EQ((one.*part).end_orientation_error_deg.std, (more.*part).end_orientation_error_deg.std);
    }
    for (std::size_t i = 0; i < one.each.size(); ++i) {
      EXPECT_EQ(one.each[i].id, more.each[i].id);
      EXPECT_EQ(one.each[i].end_position_error, more.each[i].end_position_error);
    }
  }
}

/// Tosses of a cube, measured. The bounds are what a tracker and still air leave: not numbers that were
/// fitted.
TEST(FreeFlightMeasured, CubeTosses) {
  const auto [csv, missing] = unhand::support::from_data_folder("measured/cube_tosses/cube_tosses.csv");
  if (!missing.empty()) GTEST_SKIP() << missing;
  datasets::ImportReport report;
  const ThrowLog log = datasets::import_cube_tosses(csv, {}, &report);
  const auto comparison = compare_free_flights(log, 2);
  EXPECT_EQ(comparison.skipped, 0u);
  EXPECT_EQ(comparison.train.n, static_cast<std::size_t>(report.train));
  EXPECT_EQ(comparison.test.n, static_cast<std::size_t>(report.test));
  for (const auto* part : {&comparison.train, &comparison.test}) {
    EXPECT_LT(part->trajectory_rms_m, 1e-3);
    EXPECT_LT(part->end_position_error_m.median, 2e-3);
    EXPECT_LT(part->end_orientation_error_deg.median, 0.2);
    // Not the whole truth: it misses by several times the tracker's scatter of 0.03 mm.
    EXPECT_GT(part->trajectory_rms_m, 0.1e-3);
  }
  // What is left has a shape: on average high at both ends of the flight and low in between, as if less than
  // the declared gravity acted.
  double ends = 0, middle = 0, n_ends = 0, n_middle = 0;
  for (const FreeFlightErrors& one : comparison.each)
    for (std::size_t i = 0; i < one.normalised_time.size(); ++i) {
      const double u = one.normalised_time[i], z = one.whole.position_residuals[i][2];
      if (u < 0.15 || u > 0.85)
        ends += z, ++n_ends;
      else if (u > 0.3 && u < 0.7)
        middle += z, ++n_middle;
    }
  EXPECT_GT(ends / n_ends, 0.05e-3);
  EXPECT_LT(middle / n_middle, -0.05e-3);
}

}  // namespace
}  // namespace unhand::experiment
