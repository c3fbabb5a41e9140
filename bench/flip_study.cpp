// Numbers of docs/throw-flip.md.
//
//   flip_study population [SEED]   27 commands, five throws each: landings, and what each parameter does
//   flip_study reach               which targets the commands reach with a bar of 12 and of 18 cm
//   flip_study targets [ROBOTS]    models 1, 2 and 4 at the four targets
//   flip_study support [ROBOTS]    models 1 and 2 by how far the four support commands are drawn in
//   flip_study shift [ROBOTS]      models 2, 3 and 4 after the centre of mass moved from 12 to 18 cm
//   flip_study all                 all of them
//
// A third argument, MINUTES: no further robot is begun after them.
#include <cstdlib>
#include <memory>
#include <optional>
#include <string_view>

#include "bench/flip_paths.hpp"
#include "planners/flip/release_learner.hpp"

namespace {

using namespace flip_bench;

/// Model 4 for the library's bar after throws of a bar, aimed at nothing in particular.
ReleaseLearner learned(const HandLibrary& library, const HandLibrary& old, const Gathered& thrown) {
  const ReleaseFit fit = fit_release(old, prior_card(old.robot()), thrown.data);
  return {
      library, fit, left_over(old, fit.card, thrown.data), scatter_of(thrown.trials, old.bar().com_offset),
      {},      3};
}

/// Has no command: where fewer than three of the known ones landed.
class Nothing final : public FlipLearner {
 public:
  std::optional<FlipCommand> next() override { return {}; }
  void observe(std::span<const FlipTrial>) override {}
};

/// Model 1 or 2.
std::unique_ptr<FlipLearner> cone(ForwardModel model, const Gathered& known, const FlipTarget& target,
                                  const CommandRange& range) {
  if (known.data.size() < 3) return std::make_unique<Nothing>();
  return std::make_unique<ConeLearner>(model, known.data, target, range);
}

void targets(const FlipRobot& robot, std::size_t robots, double minutes) {
  const Watch watch;
  const CommandRange& range = robot.motion.range;
  const HandLibrary library(robot, robot.bar);
  Contest contest({"model 1", "model 2", "model 4"}, paper_targets(), range);
  contest.run(robots, minutes, [&](std::uint64_t seed, auto& paths) {
    const FlipPlant plant(robot, seed);
    const Thrower thrower = thrower_of(plant, seed);
    const Gathered support = gather(thrower, "support", support_simplex(range), 3, robot.bar);
    const ReleaseLearner m4 = learned(library, library, support);
    for (std::size_t t = 0; t < contest.targets().size(); ++t) {
      const FlipTarget& target = contest.targets()[t].target;
      const auto path = [&](FlipLearner&& learner) {
        return learn(learner, target, support.data, robot.bar, thrower, {5, 3});
      };
      paths[0][t] = path(std::move(*cone(ForwardModel::landing, support, target, range)));
      paths[1][t] = path(std::move(*cone(ForwardModel::detach, support, target, range)));
      paths[2][t] = path(m4.aimed_at(target));
    }
  });
  fmt::print("{}\n{}\n{}\n{} robots, {}\n", contest.table(), contest.difference(1, 0),
             contest.difference(2, 1), contest.robots(), watch.text());
}

void support(const FlipRobot& robot, std::size_t robots, double minutes) {
  const Watch watch;
  const CommandRange& range = robot.motion.range;
  std::string rows;
  std::size_t thrown = 0;
  for (const double inset : {0.0, 0.1, 0.25}) {
    Contest contest({"model 1", "model 2"}, paper_targets(), range);
    contest.run(robots, minutes, [&](std::uint64_t seed, auto& paths) {
      const FlipPlant plant(robot, seed);
      const Thrower thrower = thrower_of(plant, seed);
      const Gathered known = gather(thrower, "support", support_simplex(range, inset), 3, robot.bar);
      for (std::size_t t = 0; t < contest.targets().size(); ++t)
        for (std::size_t m = 0; m < 2; ++m) {
          const FlipTarget& target = contest.targets()[t].target;
          const auto learner =
              cone(m == 0 ? ForwardModel::landing : ForwardModel::detach, known, target, range);
          paths[m][t] = learn(*learner, target, known.data, robot.bar, thrower, {5, 3});
        }
    });
    rows += contest.rows(fmt::format("{:.2f}", inset));
    thrown = contest.robots();
  }
  fmt::print("{}{}\n{} robots, {}\n", Paths::header("drawn in by | learner"), rows, thrown, watch.text());
}

/// How the same commands let two bars go: the state at detach of the bar's point between the pads, the longer
/// bar's minus the shorter one's, and by how much landings are missed that are transferred from one bar to
/// the other, or that model 4 forecasts.
struct Kept {
  Spread speed, omega, angle, transfer, forecast;
  void add(const Gathered& old, const Gathered& now, const Bar& was, const Bar& is,
           const ReleaseLearner& model4) {
    for (const FlipDatum& a : old.data)
      for (const FlipDatum& b : now.data) {
        if (!(a.command == b.command)) continue;
        const DetachVector from = shifted(a.detach, -was.com_offset), to = shifted(b.detach, -is.com_offset);
        speed.add(std::hypot(to[3] - from[3], to[4] - from[4]));
        omega.add(to[5] - from[5]);
        angle.add(to[2] - from[2]);
        const auto landing = fly_flip(shifted(a.detach, is.com_offset - was.com_offset));
        if (landing) transfer.add(normalized_error(*landing, {b.landing}));
        if (const auto said = model4.forecast(a.command))
          forecast.add(normalized_error(said->mean, {b.landing}));
      }
  }
};

void shift(const FlipRobot& robot, std::size_t robots, double minutes) {
  const Watch watch;
  const CommandRange& range = robot.motion.range;
  const Bar bar = shifted_bar(robot);
  const double moved = bar.com_offset - robot.bar.com_offset;
  const HandLibrary old(robot, robot.bar, 2), library(robot, bar);
  Contest contest({"model 2, anew", "model 3", "model 4, same throws", "model 4, four commands"},
                  shift_targets(), range);
  std::vector<Kept> kept(robots);
  contest.run(robots, minutes, [&](std::uint64_t seed, auto& paths) {
    const FlipPlant plant(robot, seed);
    const Thrower thrower = thrower_of(plant, seed);
    const Gathered past = gather(thrower, "population", population_grid(range), 5, robot.bar),
                   few = gather(thrower, "support", support_simplex(range), 3, robot.bar),
                   anew = gather(thrower, "support", support_simplex(range), 3, bar);
    const ReleaseLearner much = learned(library, old, past), little = learned(library, old, few);
    const auto known = transferred(past.data, moved), known_few = transferred(few.data, moved);
    kept[seed - 1].add(few, anew, robot.bar, bar, little);
    for (std::size_t t = 0; t < contest.targets().size(); ++t) {
      const FlipTarget& target = contest.targets()[t].target;
      const auto path = [&](FlipLearner&& learner, const std::vector<FlipDatum>& transferred_data) {
        return learn(learner, target, transferred_data, bar, thrower, {9, 3, true});
      };
      const auto m2 = cone(ForwardModel::detach, anew, target, range);
      paths[0][t] = learn(*m2, target, anew.data, bar, thrower, {9, 3});
      paths[1][t] = path(TransferLearner(past.data, moved, target, range), known);
      paths[2][t] = path(much.aimed_at(target), known);
      paths[3][t] = path(little.aimed_at(target), known_few);
    }
  });
  Spread speed, omega, angle, transfer, forecast;
  kept.resize(contest.robots());
  for (const Kept& one : kept) {
    speed.add(one.speed.mean()), omega.add(one.omega.mean()), angle.add(one.angle.mean());
    transfer.add(one.transfer.mean()), forecast.add(one.forecast.mean());
  }
  fmt::print("{}\n{}\n{}\n{}\n", contest.table(), contest.difference(1, 0), contest.difference(2, 1),
             contest.by_commands({4, 0, 0, 0}, {4, 5, 6, 9}));
  fmt::print(
      "Same command, longer bar: the point between the pads leaves {:.2f} m/s otherwise, turns {:+.2f} ± "
      "{:.2f} "
      "rad/s, stands {:+.1f} ± {:.1f} degrees further.\nLandings missed by {:.2f} ± {:.2f} (transferred), "
      "{:.2f} ± {:.2f} (forecast of model 4 from the same four commands).\n{} robots, {}\n",
      speed.mean(), omega.mean(), omega.error(), angle.mean() / kDegree, angle.error() / kDegree,
      transfer.mean(), transfer.error(), forecast.mean(), forecast.error(), contest.robots(), watch.text());
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc > 1 ? argv[1] : "";
  const FlipRobot robot = read_flip_robot("panda-flip");
  const auto number = [&](std::uint64_t otherwise) {
    const std::uint64_t given = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
    return given > 0 ? given : otherwise;
  };
  const double minutes = argc > 3 ? std::strtod(argv[3], nullptr) : 1e6;
  const bool all = what == "all";
  if (!all && what != "population" && what != "reach" && what != "targets" && what != "support" &&
      what != "shift") {
    fmt::print(stderr,
               "usage: flip_study population [SEED] | reach | targets [ROBOTS] | support [ROBOTS] | shift "
               "[ROBOTS] | all\n");
    return 2;
  }
  const Watch watch;
  if (all || what == "population") population(robot, number(1));
  if (all || what == "reach") reach(robot);
  if (all || what == "targets") targets(robot, number(100), minutes);
  if (all || what == "support") support(robot, number(20), minutes);
  if (all || what == "shift") shift(robot, number(100), minutes);
  if (all) fmt::print("The whole study: {}\n", watch.text());
}
