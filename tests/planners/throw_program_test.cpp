// Throws as optimal control: known optima, agreement with the integrator, limits between the points, order of
// the mesh.
#include "planners/elastic/throw_program.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "planners/elastic/throw_refinement.hpp"
#include "planners/elastic/throw_table.hpp"
#include "tests/planners/bsa3.hpp"

namespace unhand::planners::elastic {
namespace {

struct Rosenbrock {
  template <class S>
  void operator()(const S* x, S* f) const {
    const S a = x[1] - x[0] * x[0], b = 1.0 - x[0];
    f[0] = 100.0 * a * a + b * b;
  }
};
struct Circle {
  template <class S>
  void operator()(const S* x, S* f) const {
    f[0] = x[0] * x[0] + x[1] * x[1];
  }
};

TEST(NonlinearProgram, FindsKnownMinima) {
  NonlinearProgram program;
  program.add_variable(-10, 10, -1.2);
  program.add_variable(-10, 10, 1);
  program.minimise(std::make_unique<TermOf<2, 1, Rosenbrock>>(std::vector{0, 1}, Rosenbrock{}));
  const ProgramSummary free = solve(program);
  ASSERT_EQ(free.outcome, ProgramOutcome::solved);
  EXPECT_NEAR(free.x[0], 1, 1e-6);  // the optimality error of 1e-7 over a curvature of 0.4 along the valley
  EXPECT_NEAR(free.x[1], 1, 2e-6);
  program.constrain(std::make_unique<TermOf<2, 1, Circle>>(std::vector{0, 1}, Circle{}), {0}, {1});
  const ProgramSummary inside = solve(program);
  ASSERT_EQ(inside.outcome, ProgramOutcome::solved);
  // On the circle, x = cos a with the derivative along it zero: 0.786415, 0.617698 (a root found
  // independently).
  EXPECT_NEAR(inside.x[0], 0.7864151542, 1e-6);
  EXPECT_NEAR(inside.x[1], 0.6176983125, 1e-6);
}

TEST(NonlinearProgram, SaysWhenNothingIsFeasible) {
  NonlinearProgram program;
  program.add_variable(-1, 1, 0);
  program.add_variable(-1, 1, 0.1);
  program.minimise(std::make_unique<TermOf<2, 1, Rosenbrock>>(std::vector{0, 1}, Rosenbrock{}));
  program.constrain(std::make_unique<TermOf<2, 1, Circle>>(std::vector{0, 1}, Circle{}), {3}, {4});
  EXPECT_EQ(solve(program).outcome, ProgramOutcome::infeasible);
  program.lower[0] = 2;
  EXPECT_THROW(solve(program), std::invalid_argument);
}

ElasticThrow planned(Drive drive, int intervals, std::optional<Target> target = {}) {
  ThrowTask task;
  task.drive = drive;
  task.longest = 0.6;
  task.target = target;
  ThrowProgramOptions options;
  options.intervals = intervals;
  return plan_throw(bsa3(), task, options);
}

TEST(ElasticThrow, WithoutAPlanIsNothing) {
  EXPECT_FALSE(ElasticThrow{}.solved());
  EXPECT_EQ(ElasticThrow{}.duration(), 0);
}

TEST(ElasticThrow, TheIntegratorAgreesAndNoLimitIsExceeded) {
  std::map<Drive, double> speed;
  for (const Drive drive : {Drive::clutched, Drive::series, Drive::rigid}) {
    const ElasticThrow plan = planned(drive, 12);
    ASSERT_TRUE(plan.solved()) << to_string(drive);
    EXPECT_LT(plan.program.violation, 1e-6);
    const Replay run = replay(bsa3(), plan);
    EXPECT_EQ(run.outcome, dynamics::Outcome::horizon) << to_string(drive);
    // Hermite-Simpson on 24 steps of 25 ms under torques with corners: some 1e-3 of the speed.
    EXPECT_NEAR(std::hypot(run.release.vx, run.release.vz), plan.speed(), 0.01 * plan.speed())
        << to_string(drive);
    EXPECT_LE(run.use.largest(), 1) << to_string(drive);
    EXPECT_NEAR(run.unexplained(), 0, 1e-6 * std::abs(run.motor_work)) << to_string(drive);
    EXPECT_NEAR(plan.release.vz / plan.release.vx, 1, 1e-6);  // thrown at 45 degrees
    speed[drive] = plan.speed();
  }
  EXPECT_GT(speed[Drive::clutched], 1.05 * speed[Drive::rigid]) << "the spring that is let go is faster";
}

TEST(ElasticThrow, ASpringInTheWristIsFasterThanNone) {
  const auto wrist = [](Drive drive) {
    ThrowTask task;
    task.drive = drive;
    ThrowProgramOptions options;
    options.intervals = 6;
    const ClutchedArm arm = read_clutched_arm("vsa_wrist");
    const ElasticThrow plan = plan_throw(arm, task, options);
    EXPECT_TRUE(plan.solved());
    const Replay run = replay(arm, plan);
    EXPECT_NEAR(std::hypot(run.release.vx, run.release.vz), plan.speed(),
                0.02 * plan.speed());  // 12 intervals
    EXPECT_NEAR(run.unexplained(), 0, 1e-6 * std::abs(run.motor_work));
    return plan.speed();
  };
  EXPECT_GT(wrist(Drive::passive), 1.2 * wrist(Drive::locked));
}

// On a coarse mesh the plan of a stiff wrist promises a speed that the run does not reach; refined, it does.
TEST(ElasticThrow, IsRefinedUntilTheIntegratorConfirmsIt) {
  ClutchedArm arm = read_clutched_arm("vsa_wrist");
  arm.last.stiffness = 16;
  ThrowTask task;
  task.drive = Drive::passive;
  ThrowProgramOptions options;
  options.intervals = 4;
  const ElasticThrow coarse = plan_throw(arm, task, options);
  ASSERT_TRUE(coarse.solved());
  const auto shortfall = [&](const ElasticThrow& plan, const Replay& run) {
    return std::abs(plan.speed() - std::hypot(run.release.vx, run.release.vz)) / plan.speed();
  };
  ASSERT_GT(shortfall(coarse, replay(arm, coarse)), 5e-3);
  const ConfirmedThrow fine = confirm(arm, task, coarse, options);
  EXPECT_TRUE(fine.confirmed);
  EXPECT_GT(fine.intervals, 4);
  EXPECT_LE(shortfall(fine.plan, fine.run), 5.1e-3);
  EXPECT_LE(fine.run.use.largest(), 1);
  const auto& samples = fine.run.samples;
  for (std::size_t k = 0; k + 1 < samples.size(); ++k) {  // what the links do, by the speeds of the run
    const double dt = samples[k + 1].t - samples[k].t;
    for (int i = 0; i < kLinks && dt > 1e-6; ++i)
      EXPECT_LE(std::abs(samples[k + 1].rate[2 + i] - samples[k].rate[2 + i]) / dt,
                1.0001 * arm.chain.joints[i].limits.acceleration)
          << samples[k].t;
  }
  EXPECT_NEAR(fine.run.unexplained(), 0, 1e-9 * fine.run.motor_work);
  Refinement none;
  none.finest = 4;
  EXPECT_FALSE(confirm(arm, task, coarse, options, none).confirmed);
}

TEST(ElasticThrow, AFinerMeshHoldsTheSameMotion) {
  const ElasticThrow plan = planned(Drive::clutched, 12), finer = on_finer_mesh(plan);
  for (std::size_t i = 0; i < plan.phases.size(); ++i)
    ASSERT_EQ(finer.phases[i].points.size(), 2 * plan.phases[i].points.size() - 1);
  const Replay a = replay(bsa3(), plan), b = replay(bsa3(), finer);  // straight lines of torque are kept
  EXPECT_NEAR(a.release.vx, b.release.vx, 1e-8);
  EXPECT_NEAR(a.release.vz, b.release.vz, 1e-8);
}

// The smoothest throw is that of the least mean square over time, however long its phases are: one of them
// does not vanish.
TEST(ElasticThrow, IsSmoothOverTimeAndNotPhaseByPhase) {
  const ElasticThrow plan = planned(Drive::clutched, 12, Target{2.2, -0.5});
  ASSERT_TRUE(plan.solved());
  double integral = 0;
  for (const ThrowPhase& phase : plan.phases) {
    const double length = phase.points.back().t - phase.points.front().t;
    EXPECT_GT(length, 0.1);
    for (std::size_t k = 0; k + 2 < phase.points.size(); k += 2)
      for (const auto& [point, weight] : {std::pair(k, 1.0), std::pair(k + 1, 4.0), std::pair(k + 2, 1.0)}) {
        const auto& a = phase.points[point].acceleration;  // (θ, ψ, q₁, q₂, q₃); ψ moves with one of them
        const double squares = a[0] * a[0] + a[2] * a[2] + a[3] * a[3] + a[4] * a[4];
        integral += weight / 6 * (phase.points[k + 2].t - phase.points[k].t) * squares;
      }
  }
  EXPECT_NEAR(plan.program.objective, integral / (kAcceleration * kAcceleration) / plan.duration(),
              1e-6 * plan.program.objective);
}

TEST(ElasticThrow, LandsOnItsTarget) {
  const ElasticThrow plan = planned(Drive::clutched, 12, Target{2.2, -0.5});
  ASSERT_TRUE(plan.solved());
  const auto x = landing_x(plan.release, -0.5);
  ASSERT_TRUE(x);
  EXPECT_NEAR(*x, 2.2, 1e-6);
  const Replay run = replay(bsa3(), plan);
  EXPECT_NEAR(landing_x(run.release, -0.5).value_or(0), 2.2, 0.02);  // collocation's error
  EXPECT_LE(run.use.largest(), 1);
}

TEST(ElasticThrow, BetweenTheNodesOfATableNoLimitIsExceeded) {
  ThrowTask task;
  task.target = Target{2.2, -0.5};
  task.start = Links<double>(0.2, -1.0, -0.5);
  ThrowProgramOptions options;
  options.intervals = 10;
  const ThrowTable table = make_table(bsa3(), task, {2.0, 2.1, 2.2, 2.3, 2.4}, options, 2);
  for (const TableCheck& check : check_table(bsa3(), table, 17)) {
    EXPECT_TRUE(check.lands) << check.distance;
    EXPECT_LE(check.limit_use, 1) << check.distance;
    EXPECT_EQ(check.limit_use, replay(bsa3(), interpolate(table, check.distance)).use.largest());
    EXPECT_LT(std::abs(check.miss), 0.01)
        << check.distance;  // collocation's error, and cubic between nodes of 10 cm
  }
  // The release is the target's own, cubic between nodes of 10 cm as the states that it is made of.
  const ElasticThrow between = interpolate(table, 2.26);
  const ThrowPoint& end = between.phases.back().points.back();
  const auto tip = tip_of<double>(bsa3(), end.at.tail<3>(), end.rate.tail<3>());
  EXPECT_NEAR(between.release.x, tip.x, 1e-3);
  EXPECT_NEAR(between.release.z, tip.z, 1e-3);
  EXPECT_NEAR(between.speed(), std::hypot(tip.vx, tip.vz), 1e-3);
  EXPECT_THROW(interpolate(table, 1.9), std::invalid_argument);
}

// Finer meshes move objectives: what agrees after them is one basin, and no start is lost.
TEST(ElasticThrow, BasinsDifferByMoreThanAPercentAfterTheirConfirmation) {
  ThrowTask task;
  task.longest = 0.5;
  ThrowProgramOptions options;
  options.intervals = 6;
  const Basins coarse = find_basins(bsa3(), task, options, 5);
  const ConfirmedBasins fine = confirm_basins(bsa3(), task, coarse, options);
  int starts = coarse.failed;
  for (const ConfirmedBasin& basin : fine.found) {
    starts += basin.starts;
    EXPECT_TRUE(basin.best.confirmed);
  }
  EXPECT_EQ(starts, 5);
  EXPECT_LE(fine.found.size(), coarse.found.size());
  for (std::size_t k = 1; k < fine.found.size(); ++k)  // −v²
    EXPECT_GT(std::pow(fine.found[k - 1].best.plan.speed() / fine.found[k].best.plan.speed(), 2), 1.01);

  // Two that the first mesh told apart, one of them on a mesh that no run confirms.
  ASSERT_FALSE(fine.found.empty());
  Basins twice;
  twice.found = {{fine.found[0].best.plan, 2}, {coarse.found[0].best, 3}};
  twice.found[1].best.release.vx = 1.003 * twice.found[0].best.release.vx;
  twice.found[1].best.release.vz = 1.003 * twice.found[0].best.release.vz;
  ThrowProgramOptions as_it_is = options;
  as_it_is.intervals = fine.found[0].best.intervals;
  Refinement none;
  none.finest = 1;
  const ConfirmedBasins one = confirm_basins(bsa3(), task, twice, as_it_is, none);
  ASSERT_EQ(one.found.size(), 1u);
  EXPECT_EQ(one.found[0].starts, 5);
  EXPECT_TRUE(one.found[0].best.confirmed);
}

// On a coarse mesh runs land centimetres beside their targets; the table is refined as a whole until none
// does.
TEST(ElasticThrow, NodesOfATableAreRefinedUntilTheirRunsLandOnTheirTargets) {
  ThrowTask task;
  task.target = Target{2.2, -0.5};
  task.start = Links<double>(0.2, -1.0, -0.5);
  ThrowProgramOptions options;
  options.intervals = 4;
  const ThrowTable coarse = make_table(bsa3(), task, {2.0, 2.1, 2.2, 2.3}, options, 2);
  Refinement tight;
  tight.miss = 1e-3;
  tight.finest = 4;
  const ConfirmedTable as_it_is = confirm_table(bsa3(), task, coarse, options, tight);
  EXPECT_EQ(as_it_is.intervals, 4);
  int missed = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto x = landing_x(replay(bsa3(), coarse.throws[k]).release, -0.5);
    ASSERT_TRUE(x && as_it_is.nodes[k].miss);
    EXPECT_DOUBLE_EQ(*as_it_is.nodes[k].miss, *x - coarse.distances[k]);
    EXPECT_FALSE(as_it_is.nodes[k].confirmed && std::abs(*as_it_is.nodes[k].miss) > 1e-3);
    missed += !as_it_is.nodes[k].confirmed;
  }
  EXPECT_GT(missed, 0);
  ThrowTask elsewhere = task;  // the height is the table's
  elsewhere.target->z = 0.6;
  Refinement loose;
  loose.miss = 0.3, loose.speed_error = 1, loose.limit_use = 10, loose.finest = 4;
  for (const TableNode& node : confirm_table(bsa3(), elsewhere, coarse, options, loose).nodes)
    EXPECT_TRUE(node.confirmed);
  tight.finest = 64;
  const ConfirmedTable fine = confirm_table(bsa3(), task, coarse, options, tight);
  EXPECT_GT(fine.intervals, 4);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_TRUE(fine.nodes[k].confirmed) << k;
    EXPECT_LE(std::abs(fine.nodes[k].miss.value_or(1)), 1e-3) << k;
  }
  EXPECT_LT(std::abs(check_table(bsa3(), fine.table, 3)[1].miss), 0.01);
}

TEST(ElasticThrow, TellsWhichTargetIsOutOfReachAndWhichAreNot) {
  ThrowTask task;
  task.target = Target{9, -0.5};
  task.start = Links<double>(0.2, -1.0, -0.5);
  ThrowProgramOptions options;
  options.intervals = 4;
  try {
    make_table(bsa3(), task, {8.6, 8.8, 9.0, 9.2}, options, 1);
    FAIL();
  } catch (const OutOfReach& error) {
    EXPECT_EQ(error.distance, 9.0);
    EXPECT_THAT(error.what(), testing::Not(testing::HasSubstr("make_table")));
  }
  const auto reach = find_reach(bsa3(), task, options, 1);
  ASSERT_TRUE(reach);
  // Farther than the arm's length, and no farther than its fastest throw flies from its farthest reach.
  const double v = 8, length = 1.5, g = 9.81, down = length + 0.5;
  EXPECT_LT(reach->nearest, 1.8);
  EXPECT_GT(reach->farthest, 2.6);
  EXPECT_LT(reach->farthest, length + v / g * std::sqrt(v * v + 2 * g * down));
}

TEST(ElasticThrow, StartsFromNoSolutionOfOtherPhases) {
  ElasticThrow near = planned(Drive::series, 6);  // one phase of 12 intervals: as many points as below
  ThrowTask task;
  ThrowProgramOptions options;
  options.intervals = 12;
  options.near = &near;
  EXPECT_THAT([&] { plan_throw(bsa3(), task, options); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("1 phases; accepted: 2")));
  near.phases.clear();
  EXPECT_THROW(plan_throw(bsa3(), task, options), std::invalid_argument);
}

TEST(ElasticThrow, RefusesATaskWithoutSense) {
  ThrowTask task;
  task.margin = 0.7;
  EXPECT_THAT([&] { plan_throw(bsa3(), task); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("margin = 0.7")));
  task.margin = 0;
  task.target = Target{2.2, -0.5};
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const std::vector<double>& x : {std::vector<double>{2.0, 2.1, 2.1, 2.2}, {2.0, kNan, 2.1, 2.2}, {2.0}})
    EXPECT_THAT([&] { make_table(bsa3(), task, x, {}, 1); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("increasing distances")));
}

// A run confirms its plan by how it ends, where it lands, how fast it is and what it uses; each by itself may
// refuse it.
TEST(ElasticThrow, EachDoubtByItselfRefusesAPlan) {
  ThrowTask task;
  task.target = Target{2.2, -0.5};
  const double g = 9.81, up = 1.5, time = (up + std::sqrt(up * up + 2 * g * (0.8 + 0.5))) / g;
  ElasticThrow plan;
  Replay run;
  run.outcome = dynamics::Outcome::horizon;
  plan.release = run.release = {2.2 - 2 * time, 0.8, 2, up};
  run.use.brake = 0.99;
  EXPECT_TRUE(confirms(task, plan, run, {}));
  const auto refused = [&](auto&& change) {
    Replay other = run;
    change(other);
    return !confirms(task, plan, other, {});
  };
  EXPECT_TRUE(refused([](Replay& r) { r.outcome = dynamics::Outcome::finished; }));
  EXPECT_TRUE(refused([](Replay& r) { r.spring_stop = true; }));
  EXPECT_TRUE(refused([](Replay& r) { r.use.brake = 1.1; }));
  EXPECT_TRUE(refused([](Replay& r) { r.use.motor_torque = 1.1; }));
  EXPECT_TRUE(refused([](Replay& r) { r.release.x += 0.1; }));
  EXPECT_TRUE(refused([](Replay& r) {  // another speed that lands there, too
    r.release.vx *= 1.1, r.release.x -= 0.1 * 2 * 0.8;
  }));
}

TEST(ElasticThrow, CountsTheStartsThatFail) {
  ThrowTask task;
  ThrowProgramOptions options;
  options.intervals = 4;
  options.program.iterations = 2;  // of some fifty
  const Basins basins = find_basins(bsa3(), task, options, 3);
  EXPECT_EQ(basins.failed, 3);
  EXPECT_TRUE(basins.found.empty());
}

}  // namespace
}  // namespace unhand::planners::elastic
