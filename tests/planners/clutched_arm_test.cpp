// The arm with a clutched spring: constraints, impacts, energy, and what a run by the integrator makes of a
// plan.
#include "planners/elastic/clutched_arm.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "datasets/log_error.hpp"
#include "planners/elastic/replay.hpp"
#include "planners/elastic/second_dual.hpp"
#include "tests/planners/bsa3.hpp"

namespace unhand::planners::elastic {
namespace {

constexpr ClutchMode kModes[]{ClutchMode::free, ClutchMode::hold, ClutchMode::sea, ClutchMode::brk,
                              ClutchMode::rigid};

struct RandomState {
  Coordinates<double> at, rate;
  MotorTorques<double> torque;
};
RandomState state_of(std::mt19937_64& random) {
  std::uniform_real_distribution<double> one(-1, 1);
  RandomState s;
  for (int i = 0; i < kCoordinates; ++i) s.at[i] = one(random), s.rate[i] = 5 * one(random);
  for (int i = 0; i < 3; ++i) s.torque[i] = 10 * one(random);
  return s;
}

TEST(ClutchedArm, AnArmOfTheLibraryIsItsFile) {
  const auto read = read_clutched_arm(std::string(UNHAND_ELASTIC_ARMS) + "/vsa_wrist.toml");
  const auto named = read_clutched_arm("vsa_wrist");
  EXPECT_EQ(read.last.stiffness, named.last.stiffness);
  EXPECT_EQ(read.last.deflection, named.last.deflection);
  ASSERT_EQ(read.chain.size(), named.chain.size());
  for (int i = 0; i < read.chain.size(); ++i)
    EXPECT_EQ(read.chain.joints[i].link.mass, named.chain.joints[i].link.mass);
  EXPECT_THROW(read_clutched_arm("bsa4"), datasets::TomlError);
}

TEST(ClutchedArm, ClosingClutchesLosesTheEnergyOfTheLostVelocities) {
  const ClutchedArm arm = bsa3();
  std::mt19937_64 random(1);
  for (const ClutchMode mode : kModes)
    for (int k = 0; k < 50; ++k) {
      const auto [at, rate, torque] = state_of(random);
      const Coordinates<double> after = engage<double>(arm, mode, at, rate),
                                again = engage<double>(arm, mode, at, after);
      const auto P = inertia_of<double>(arm, at.tail<3>());
      const auto Z = free_velocities(mode);
      // Rounding of sums of order 10 with a reduced inertia of condition 1e3.
      const Coordinates<double> taken = P * (rate - after);
      double along_free = 0;
      for (int c = 0; c < Z.cols(); ++c) along_free = std::max(along_free, std::abs(Z.col(c).dot(taken)));
      EXPECT_LE(along_free, 1e-12 * (P * rate).norm()) << to_string(mode);
      EXPECT_LE((again - after).norm(), 1e-11 * rate.norm()) << to_string(mode);
      const Coordinates<double> lost = rate - after;
      const double before_J = 0.5 * rate.dot(P * rate), after_J = 0.5 * after.dot(P * after),
                   carnot = 0.5 * lost.dot(P * lost);
      EXPECT_NEAR(before_J - after_J, carnot, 1e-12 * before_J) << to_string(mode);
      if (mode == ClutchMode::free) {
        EXPECT_LE(lost.norm(), 1e-11 * rate.norm());
      }
    }
}

TEST(ClutchedArm, ClutchesHoldWhatTheySay) {
  const ClutchedArm arm = bsa3();
  std::mt19937_64 random(2);
  for (int k = 0; k < 50; ++k) {
    const auto [at, rate, torque] = state_of(random);
    const auto in = [&](ClutchMode mode) {
      return acceleration_in<double>(arm, mode, at, engage<double>(arm, mode, at, rate), torque);
    };
    EXPECT_EQ(in(ClutchMode::hold)[1], 0);
    EXPECT_EQ(in(ClutchMode::sea)[1], in(ClutchMode::sea)[4]);
    EXPECT_EQ(in(ClutchMode::brk)[1], 0);
    EXPECT_EQ(in(ClutchMode::brk)[4], 0);
    EXPECT_EQ(in(ClutchMode::rigid)[0], in(ClutchMode::rigid)[4]);
    // All open, the equations are those of the arm and of two bodies with a spring between them.
    const Coordinates<double> a = in(ClutchMode::free);
    const double spring = arm.last.stiffness * (at[0] - at[1]) + arm.last.damping * (rate[0] - rate[1]);
    EXPECT_NEAR(arm.last.motor_inertia * a[0], torque[2] - spring, 1e-12 * (1 + std::abs(spring)));
    EXPECT_NEAR(arm.last.spring_inertia * a[1], spring, 1e-12 * (1 + std::abs(spring)));
    const Links<double> tau = joint_torque<double>(arm, at.tail<3>(), rate.tail<3>(), a.tail<3>());
    EXPECT_NEAR(tau[0], torque[0], 1e-11 * (1 + tau.norm()));
    EXPECT_NEAR(tau[1], torque[1], 1e-11 * (1 + tau.norm()));
    EXPECT_NEAR(tau[2], 0, 1e-11 * (1 + tau.norm()));
  }
}

/// A motion that goes through several modes, two of them entered with an impact.
Replay tour(const ClutchedArm& arm, int intervals, int samples = 21,
            const MotorTorques<double>& torque = {12, 6, 1.5}) {
  ElasticThrow plan;
  const double length = 0.05;
  double t = 0;
  for (const ClutchMode mode :
       {ClutchMode::free, ClutchMode::sea, ClutchMode::hold, ClutchMode::brk, ClutchMode::sea}) {
    ThrowPhase& phase = plan.phases.emplace_back();
    phase.mode = mode;
    for (int k = 0; k <= 2 * intervals; ++k) {
      ThrowPoint p{t + length * k / (2 * intervals), Coordinates<double>::Zero(), Coordinates<double>::Zero(),
                   Coordinates<double>::Zero(), torque};
      p.at.tail<3>() << 0.4, 0.6, -0.3;
      p.at[0] = p.at[1] = -0.3;
      phase.points.push_back(p);
    }
    t += length;
  }
  return replay(arm, plan, samples);
}

TEST(ClutchedArm, TheLedgerOfARunCloses) {
  const Replay run = tour(bsa3(), 2);
  EXPECT_EQ(run.outcome, dynamics::Outcome::horizon);
  EXPECT_FALSE(run.spring_stop);
  EXPECT_GT(run.impacts, 1e-3);  // two of the switches close clutches on moving parts
  EXPECT_GT(run.motor_work, 0.1);
  // The integrator's tolerance is 1e-10; Gauss's rule on its pieces of quartics is of order 6, pieces are
  // below 5 ms.
  EXPECT_NEAR(run.unexplained(), 0, 1e-6 * run.motor_work);
}

TEST(ClutchedArm, ARunIsRecordedAsOftenAsItIsAsked) {
  constexpr int kPhases = 5, kIntervals = 2;
  constexpr double kLength = 0.05 / kIntervals;
  for (const int n : {2, 3, 7, 21}) {
    const Replay run = tour(bsa3(), kIntervals, n);
    ASSERT_EQ(run.samples.size(), static_cast<std::size_t>(kPhases * kIntervals * n)) << n;
    for (int i = 0; i < kPhases * kIntervals; ++i)
      for (int k = 0; k < n; ++k) {
        const ReplaySample& s = run.samples[static_cast<std::size_t>(i * n + k)];
        EXPECT_NEAR(s.t, kLength * (i + static_cast<double>(k) / (n - 1)), 1e-14) << n;
        if (k == 0 && i > 0) {  // nothing but rates jumps where two intervals meet
          EXPECT_EQ(s.at, run.samples[static_cast<std::size_t>(i * n - 1)].at) << n;
        }
      }
    EXPECT_NEAR(run.unexplained(), 0, 1e-6 * run.motor_work) << n;
  }
  EXPECT_THROW(tour(bsa3(), kIntervals, 1), std::invalid_argument);
}

TEST(ClutchedArm, APhaseBeginsWhereItSaysAlsoWithinAnIntervalOfTorques) {
  const ClutchedArm arm = bsa3();
  const MotorTorques<double> none(0, 0, 0);
  const ClutchedArmSystem system(arm, {{ClutchMode::free, 0.0}, {ClutchMode::sea, 0.037}},
                                 {{0.0, 0.1, none, none, none}});
  dynamics::State<double, kStates> y{};
  y[2] = 0.3, y[kCoordinates + 4] = 1;  // the last link turns, the spring's end does not
  dynamics::IntegratorOptions options;
  options.record = true;
  const auto run = dynamics::integrate<double, kStates>(system, {0, 0.0, y, 0.0}, 0.1, options);
  ASSERT_EQ(run.outcome, dynamics::Outcome::horizon);
  EXPECT_EQ(run.mode, 1);
  for (const auto& piece : run.trajectory.pieces) EXPECT_EQ(piece.phase.mode, piece.t0 < 0.037 ? 0 : 1);
}

TEST(ClutchedArm, ASpringAtItsStopEndsTheRun) {
  ClutchedArm arm = bsa3();
  arm.last.deflection = 0.02;
  const Replay run = tour(arm, 2);
  EXPECT_EQ(run.outcome, dynamics::Outcome::finished);
  EXPECT_TRUE(run.spring_stop);
  const ReplaySample& last = run.samples.back();
  EXPECT_NEAR(std::abs(last.at[0] - last.at[1]), 0.02, 1e-9);  // the polished root
}

TEST(ClutchedArm, TheTipMovesAsItsPositionDoes) {
  const ClutchedArm arm = bsa3();
  std::mt19937_64 random(4);
  const auto [at, rate, torque] = state_of(random);
  const Links<double> q = at.tail<3>(), qd = rate.tail<3>();
  const auto tip = tip_of<double>(arm, q, qd);
  double best = 1;
  for (double h = 1e-2; h > 1e-8; h /= 10) {  // central differences over powers of ten
    const auto a = tip_of<double>(arm, q + h * qd, qd), b = tip_of<double>(arm, q - h * qd, qd);
    best = std::min(best, std::hypot((a.x - b.x) / (2 * h) - tip.vx, (a.z - b.z) / (2 * h) - tip.vz));
  }
  EXPECT_LT(best, 1e-8);  // h^2 against rounding/h meet near 1e-9
}

TEST(ClutchedArm, SecondDerivativesAreThoseOfTheFirst) {
  const ClutchedArm arm = bsa3();
  std::mt19937_64 random(5);
  const auto [at, rate, torque] = state_of(random);
  using Second = SecondDual<9>;
  const auto law = [&](auto x) {  // the torque of joint 1
    using S = std::decay_t<decltype(x[0])>;
    return joint_torque<S>(arm, Links<S>(x[0], x[1], x[2]), Links<S>(x[3], x[4], x[5]),
                           Links<S>(x[6], x[7], x[8]))[0];
  };
  std::array<double, 9> x{};
  for (int i = 0; i < 3; ++i) x[i] = at[2 + i], x[3 + i] = rate[2 + i], x[6 + i] = 3.0 * torque[i];
  std::array<Second, 9> seeded;
  for (int i = 0; i < 9; ++i) seeded[i] = Second::independent(x[i], i);
  const Second exact = law(seeded);
  EXPECT_NEAR(exact.a, law(x), 1e-12 * std::abs(exact.a));
  for (int i = 0, k = 0; i < 9; ++i)
    for (int j = 0; j <= i; ++j, ++k) {
      double best = 1e9;
      for (double h = 1e-1; h > 1e-6; h /= 10) {  // of the gradient
        auto a = seeded, b = seeded;
        a[j].a += h;
        b[j].a -= h;
        best = std::min(best, std::abs((law(a).v[i] - law(b).v[i]) / (2 * h) - exact.h[k]));
      }
      EXPECT_LT(best, 1e-7 * (1 + std::abs(exact.h[k]))) << i << ' ' << j;
    }
}

TEST(ClutchedArm, RefusesWhatIsNone) {
  const auto refused = [](ClutchedArm arm, const char* why) {
    EXPECT_THAT([&] { validate(arm); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(why)));
  };
  ClutchedArm arm = bsa3();
  arm.last.stiffness = 0;
  refused(arm, "stiffness = 0; accepted: > 0");
  arm = bsa3();
  arm.chain.joints.pop_back();
  refused(arm, "2 joints; accepted: 3");
  arm = bsa3();
  arm.rotor_inertia[2] = 0.1;
  refused(arm, "behind the spring");
  arm = bsa3();
  arm.chain.joints[0].origin.R.setIdentity();
  refused(arm, "the axis of joint 'shoulder' is not");
}

// What a run says that it used, against its own record: angles, rates and their differences, torques, and
// what the brake adds to the spring to hold the last link.
TEST(ClutchedArm, SharesOfTheLimitsAreThoseOfItsRecord) {
  ClutchedArm arm = bsa3();
  arm.last.deflection = 3;  // no stop on the way
  arm.last.damping = 0.4;
  for (int i = 0; i < kLinks; ++i) arm.chain.joints[i].limits.acceleration = 50.0 * (i + 1);
  for (const MotorTorques<double>& torque :
       {MotorTorques<double>(12, 1, 0.5), MotorTorques<double>(1, 6, 2.5)}) {
    const Replay run = tour(arm, 2, 101, torque);
    ASSERT_FALSE(run.spring_stop);
    UsedShares most;
    const auto note = [](double& share, double value) { share = std::max(share, std::abs(value)); };
    const auto& all = run.samples;
    for (std::size_t k = 0; k < all.size(); ++k) {
      const ReplaySample& s = all[k];
      for (int i = 0; i < kLinks; ++i) {
        const JointLimits& l = arm.chain.joints[i].limits;
        note(most.angle, (s.at[2 + i] - 0.5 * (l.lower + l.upper)) / (0.5 * (l.upper - l.lower)));
        note(most.speed, s.rate[2 + i] / l.velocity);
        if (i < 2) note(most.torque, torque[i] / l.torque);
      }
      note(most.motor_speed, s.rate[0] / arm.last.motor_speed);
      note(most.motor_torque, torque[2] / arm.last.motor_torque);
      note(most.deflection, (s.at[0] - s.at[1]) / arm.last.deflection);
      if (k == 0 || k + 1 == all.size() || all[k - 1].mode != s.mode || all[k + 1].mode != s.mode ||
          !(all[k + 1].t - s.t > 1e-9 && s.t - all[k - 1].t > 1e-9))
        continue;
      const Links<double> qdd = (all[k + 1].rate - all[k - 1].rate).tail<3>() / (all[k + 1].t - all[k - 1].t);
      for (int i = 0; i < kLinks; ++i)
        note(most.acceleration, qdd[i] / arm.chain.joints[i].limits.acceleration);
      if (s.mode != ClutchMode::brk) continue;
      const double spring =
          arm.last.stiffness * (s.at[0] - s.at[1]) + arm.last.damping * (s.rate[0] - s.rate[1]);
      const Links<double> needs = joint_torque<double>(arm, s.at.tail<3>(), s.rate.tail<3>(), qdd);
      note(most.brake, (needs[2] - spring) / arm.last.brake_torque);
    }
    EXPECT_NEAR(run.use.angle, most.angle, 1e-9);
    EXPECT_NEAR(run.use.speed, most.speed, 1e-9);
    EXPECT_NEAR(run.use.torque, most.torque, 1e-9);
    EXPECT_NEAR(run.use.motor_speed, most.motor_speed, 1e-9);
    EXPECT_NEAR(run.use.motor_torque, most.motor_torque, 1e-9);
    EXPECT_NEAR(run.use.deflection, most.deflection, 1e-9);
    EXPECT_NEAR(run.use.acceleration, most.acceleration, 0.03 * most.acceleration);  // of differences
    EXPECT_NEAR(run.use.brake, most.brake, 0.03 * most.brake);
    EXPECT_GT(most.brake, 0);
  }
}

// On the Moon it flies six times as long.
TEST(ClutchedArm, LandingsAreParabolasUnderAnyGravity) {
  const TipState<double> release{0.3, 0.8, 2.0, 1.5};
  for (const double g : {9.81, 1.62}) {
    const double time = (1.5 + std::sqrt(1.5 * 1.5 + 2 * g * (0.8 + 0.5))) / g;
    EXPECT_NEAR(landing_x(release, -0.5, g).value_or(0), 0.3 + 2 * time, 1e-12) << g;
  }
  EXPECT_FALSE(landing_x(release, 2.0));
}

}  // namespace
}  // namespace unhand::planners::elastic
