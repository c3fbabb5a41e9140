// Numbers of docs/throw-flip.md.
//
//   flip_study population [SEED]   27 commands, five throws each: landings, and what each parameter does
//   flip_study targets [ROBOTS]    models 1, 2 and 4 at the four targets
//   flip_study support [ROBOTS]    models 1 and 2 by how far the four support commands are drawn in
//   flip_study shift [ROBOTS]      models 2, 3 and 4 after the centre of mass moved from 12 to 18 cm
#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string_view>

#include "experiment/parallel.hpp"
#include "planners/flip/release_learner.hpp"
#include "planners/flip/session.hpp"

namespace {

using namespace unhand::planners::flip;

constexpr double kDegree = std::numbers::pi / 180;

double seconds() {
  using clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(clock::now().time_since_epoch()).count();
}

struct Spread {
  double sum{}, squares{};
  int n{};
  void add(double x) { sum += x, squares += x * x, ++n; }
  double mean() const { return sum / n; }
  double variance() const { return n > 1 ? (squares - sum * sum / n) / (n - 1) : 0; }
};

/// How far a linear map of the commands misses the landings of a population: of the landing itself (model 1),
/// and of the detach state with flight behind it (model 2); normalised errors, root mean square.
struct Curvature {
  double landing{}, detach{};
};
Curvature curvature(const FlipRobot& robot, const std::vector<FlipDatum>& data) {
  const Eigen::Index n = static_cast<Eigen::Index>(data.size());
  Eigen::MatrixXd A(n, 4), y(n, 8);
  for (Eigen::Index i = 0; i < n; ++i) {
    const FlipDatum& one = data[static_cast<std::size_t>(i)];
    const auto f = robot.motion.range.fractions(one.command);
    A.row(i) << 1, f[0], f[1], f[2];
    for (Eigen::Index j = 0; j < 6; ++j) y(i, j) = one.detach[static_cast<std::size_t>(j)];
    y(i, 6) = one.landing.x, y(i, 7) = one.landing.angle;
  }
  const Eigen::MatrixXd fitted = A * A.householderQr().solve(y);
  Curvature out;
  for (Eigen::Index i = 0; i < n; ++i) {
    const FlipTarget seen{data[static_cast<std::size_t>(i)].landing};
    DetachVector d{};
    for (Eigen::Index j = 0; j < 6; ++j) d[static_cast<std::size_t>(j)] = fitted(i, j);
    const auto flown = fly_flip(d);
    if (!flown) continue;
    out.landing += std::pow(normalized_error({fitted(i, 6), fitted(i, 7)}, seen), 2) / static_cast<double>(n);
    out.detach += std::pow(normalized_error(*flown, seen), 2) / static_cast<double>(n);
  }
  return {std::sqrt(out.landing), std::sqrt(out.detach)};
}

void population(const FlipRobot& robot, std::uint64_t seed) {
  const FlipPlant plant(robot, seed);
  const auto grid = population_grid(robot.motion.range);
  const double begin = seconds();
  const Gathered thrown = gather(thrower_of(plant, seed), "past", grid, 5, robot.bar);
  const double each = (seconds() - begin) / static_cast<double>(thrown.trials.size());
  fmt::print(
      "| pitch [deg] | speed | damping | landing x [m] | angle [deg] | std x [cm] | std angle [deg] |\n"
      "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  double within_x = 0, within_angle = 0, torque = 0, velocity = 0, position = 0;
  int lost = 0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    Spread x, angle;
    for (std::size_t k = 5 * i; k < 5 * i + 5; ++k) {
      const FlipTrial& t = thrown.trials[k];
      torque = std::max(torque, t.use.torque);
      velocity = std::max(velocity, t.use.velocity);
      position = std::max(position, t.use.position);
      if (t.outcome != FlipOutcome::landed) {
        ++lost;
        continue;
      }
      x.add(t.landing.x);
      angle.add(t.landing.angle);
    }
    within_x += x.variance() / static_cast<double>(grid.size());
    within_angle += angle.variance() / static_cast<double>(grid.size());
    fmt::print("| {:.1f} | {:.3f} | {:.1f} | {:.3f} | {:.0f} | {:.1f} | {:.1f} |\n", grid[i].pitch / kDegree,
               grid[i].speed, grid[i].damping, x.mean(), angle.mean() / kDegree,
               100 * std::sqrt(x.variance()), std::sqrt(angle.variance()) / kDegree);
  }
  fmt::print(
      "\n| from low to high | x [m] | angle [deg] | pairs shorter | pairs more turned |\n"
      "| --- | ---: | ---: | ---: | ---: |\n");
  const char* names[]{"pitch", "speed", "damping"};
  const std::size_t strides[]{9, 3, 1};
  for (std::size_t p = 0; p < 3; ++p) {
    Spread x, angle;
    int shorter = 0, turned = 0;
    for (std::size_t i = 0; i + strides[p] < thrown.data.size(); ++i) {
      if ((i / strides[p]) % 3 == 2) continue;
      const FlipPose &a = thrown.data[i].landing, &b = thrown.data[i + strides[p]].landing;
      x.add(b.x - a.x), angle.add(b.angle - a.angle);
      shorter += b.x<a.x, turned += b.angle> a.angle;
    }
    fmt::print("| {} | {:+.3f} | {:+.0f} | {}/{} | {}/{} |\n", names[p], 2 * x.mean(),
               2 * angle.mean() / kDegree, shorter, x.n, turned, x.n);
  }
  for (int d = 0; d < 3; ++d) {
    double most = 0;
    for (std::size_t i = static_cast<std::size_t>(d); i < thrown.trials.size() / 5; i += 3)
      for (std::size_t k = 5 * i; k < 5 * i + 5; ++k) most = std::max(most, thrown.trials[k].landing.angle);
    fmt::print("damping {:.1f}: turned {:.0f} degrees at most\n", grid[static_cast<std::size_t>(d)].damping,
               most / kDegree);
  }
  const Curvature curved = curvature(robot, thrown.data);
  fmt::print(
      "linear over the whole range: landings missed by {:.2f} (landing linear), {:.2f} (detach state "
      "linear)\n",
      curved.landing, curved.detach);
  fmt::print(
      "repetitions scatter by {:.1f} cm and {:.1f} degrees (pooled 1 sigma); {} of {} throws lost\n"
      "limits used: position {:.0f} %, velocity {:.0f} %, torque {:.0f} %; {:.2f} ms a throw\n",
      100 * std::sqrt(within_x), std::sqrt(within_angle) / kDegree, lost, thrown.trials.size(),
      100 * position, 100 * velocity, 100 * torque, 1e3 * each);
}

/// Many learning paths of one learner at one target.
class Paths {
 public:
  void add(const LearningPath& path, const CommandRange& range) {
    for (const PathIteration& one : path.iterations) {
      const auto f = range.fractions(one.command);
      ++commands_;
      at_edge_ += std::any_of(f.begin(), f.end(), [](double x) { return x < 0.01 || x > 0.99; });
    }
    initial_.push_back(path.initial);
    first_.push_back(path.first());
    minimum_.push_back(path.minimum());
    two_.push_back(path.reached(2));
    three_.push_back(path.reached(3));
  }
  double initial() const { return mean(initial_); }
  /// Mean of this minus the other on the same robots and targets, with its standard error.
  std::string against(const Paths& other) const {
    Spread first, minimum;
    for (std::size_t i = 0; i < first_.size(); ++i) {
      first.add(std::min(first_[i], 20.0) - std::min(other.first_[i], 20.0));
      minimum.add(minimum_[i] - other.minimum_[i]);
    }
    return fmt::format("{:+.3f} ± {:.3f} after one iteration, {:+.3f} ± {:.3f} at the minimum", first.mean(),
                       std::sqrt(first.variance() / first.n), minimum.mean(),
                       std::sqrt(minimum.variance() / minimum.n));
  }
  std::string row() const {
    return fmt::format("{:.2f} | {:.2f} ± {:.2f} | {:.2f} ± {:.2f} | {} | {} | {} | {} | {:.0f} %", initial(),
                       mean(first_), error(first_), mean(minimum_), error(minimum_), reached(two_),
                       median(two_), reached(three_), median(three_),
                       100.0 * at_edge_ / std::max(1, commands_));
  }
  static const char* header() {
    return "initial error | after 1 iteration | minimum | 2/3 reached | median iterations | 3/3 reached | "
           "median iterations | commands at an edge";
  }

 private:
  static double mean(const std::vector<double>& x) {
    double sum = 0;
    for (const double one : x) sum += std::min(one, 20.0);  // a command whose throws never landed counts 20
    return sum / static_cast<double>(x.size());
  }
  /// Of the mean.
  static double error(const std::vector<double>& x) {
    Spread s;
    for (const double one : x) s.add(std::min(one, 20.0));
    return std::sqrt(s.variance() / static_cast<double>(x.size()));
  }
  static std::string reached(const std::vector<int>& x) {
    const auto n = std::count_if(x.begin(), x.end(), [](int i) { return i > 0; });
    return fmt::format("{:.0f} %", 100.0 * static_cast<double>(n) / static_cast<double>(x.size()));
  }
  /// Over all paths; those that never get there are infinite.
  static std::string median(std::vector<int> x) {
    for (int& i : x)
      if (i == 0) i = 1000;
    std::sort(x.begin(), x.end());
    const int middle = x[(x.size() - 1) / 2];
    return middle == 1000 ? "not reached" : std::to_string(middle);
  }

  std::vector<double> initial_, first_, minimum_;
  std::vector<int> two_, three_;
  int commands_{}, at_edge_{};  ///< of all; those within a hundredth of a limit of the range
};

const FlipTarget kTargets[]{
    {{1.2, 180 * kDegree}}, {{1.2, 360 * kDegree}}, {{1.4, 180 * kDegree}}, {{1.4, 360 * kDegree}}};
const char* kTargetNames[]{"(a) 1.2 m, 180°", "(b) 1.2 m, 360°", "(c) 1.4 m, 180°", "(d) 1.4 m, 360°"};

/// What model 4 knows after throws of the bar that the library is for.
struct Learned {
  ReleaseFit fit;
  std::vector<LeftOver> left;
  ThrowScatter scatter;
  Learned(const FlipRobot& robot, const HandLibrary& library, const Gathered& thrown)
      : fit(fit_release(library, prior_card(robot), thrown.data)),
        left(left_over(library, fit.card, thrown.data)),
        scatter(scatter_of(thrown.trials, library.bar().com_offset)) {}
};

void targets(const FlipRobot& robot, std::size_t robots) {
  const double begin = seconds();
  const CommandRange& range = robot.motion.range;
  const HandLibrary library(robot, robot.bar);
  const char* names[]{"model 1", "model 2", "model 4"};
  std::vector<std::array<std::array<LearningPath, 4>, 3>> paths(robots);
  unhand::experiment::parallel_for(robots, 0, [&](std::size_t k) {
    const std::uint64_t seed = k + 1;
    const FlipPlant plant(robot, seed);
    const Thrower thrower = thrower_of(plant, seed);
    const Gathered support = gather(thrower, "support", support_simplex(range), 3, robot.bar);
    const Learned learned(robot, library, support);
    for (std::size_t t = 0; t < 4; ++t) {
      const auto path = [&](FlipLearner& learner) {
        return learn(learner, kTargets[t], support.data, robot.bar, thrower, {5, 3, false});
      };
      ConeLearner m1(ForwardModel::landing, support.data, kTargets[t], range),
          m2(ForwardModel::detach, support.data, kTargets[t], range);
      ReleaseLearner m4(library, learned.fit.card, learned.left, learned.scatter, kTargets[t], 3);
      paths[k][0][t] = path(m1);
      paths[k][1][t] = path(m2);
      paths[k][2][t] = path(m4);
    }
  });
  fmt::print(
      "| target | learner | {} |\n| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
      Paths::header());
  for (std::size_t t = 0; t < 4; ++t)
    for (std::size_t m = 0; m < 3; ++m) {
      Paths at;
      for (const auto& one : paths) at.add(one[m][t], range);
      fmt::print("| {} | {} | {} |\n", kTargetNames[t], names[m], at.row());
    }
  Paths all[3];
  for (std::size_t m = 0; m < 3; ++m) {
    for (const auto& one : paths)
      for (const LearningPath& path : one[m]) all[m].add(path, range);
    fmt::print("| all | {} | {} |\n", names[m], all[m].row());
  }
  fmt::print("\nmodel 2 - model 1: {}\nmodel 4 - model 2: {}\n{} robots, {:.0f} s\n", all[1].against(all[0]),
             all[2].against(all[1]), robots, seconds() - begin);
}

void support(const FlipRobot& robot, std::size_t robots) {
  const CommandRange& range = robot.motion.range;
  fmt::print(
      "| drawn in by | learner | {} |\n| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: "
      "|\n",
      Paths::header());
  for (const double inset : {0.0, 0.1, 0.25}) {
    std::vector<std::array<std::array<LearningPath, 4>, 2>> paths(robots);
    unhand::experiment::parallel_for(robots, 0, [&](std::size_t k) {
      const FlipPlant plant(robot, k + 1);
      const Thrower thrower = thrower_of(plant, k + 1);
      const Gathered known = gather(thrower, "support", support_simplex(range, inset), 3, robot.bar);
      for (std::size_t t = 0; t < 4; ++t)
        for (std::size_t m = 0; m < 2; ++m) {
          ConeLearner learner(m == 0 ? ForwardModel::landing : ForwardModel::detach, known.data, kTargets[t],
                              range);
          paths[k][m][t] = learn(learner, kTargets[t], known.data, robot.bar, thrower, {5, 3, false});
        }
    });
    for (std::size_t m = 0; m < 2; ++m) {
      Paths all;
      for (const auto& one : paths)
        for (const LearningPath& path : one[m]) all.add(path, range);
      fmt::print("| {} | model {} | {} |\n", inset, m + 1, all.row());
    }
  }
}

void shift(const FlipRobot& robot, std::size_t robots) {
  const double begin = seconds();
  const CommandRange& range = robot.motion.range;
  Bar bar = robot.bar;
  bar.com_offset = 0.18;
  const HandLibrary old(robot, robot.bar, 2), library(robot, bar);
  const char* names[]{"model 2, anew", "model 3", "model 4, same throws", "model 4, four commands"};
  std::vector<std::array<std::array<LearningPath, 4>, 4>> paths(robots);
  unhand::experiment::parallel_for(robots, 0, [&](std::size_t k) {
    const std::uint64_t seed = k + 1;
    const FlipPlant plant(robot, seed);
    const Thrower thrower = thrower_of(plant, seed);
    const Gathered past = gather(thrower, "population", population_grid(range), 5, robot.bar),
                   few = gather(thrower, "support", support_simplex(range), 3, robot.bar),
                   anew = gather(thrower, "support", support_simplex(range), 3, bar);
    const Learned much(robot, old, past), little(robot, old, few);
    const double moved = bar.com_offset - robot.bar.com_offset;
    const auto known = transferred(past.data, moved), known_few = transferred(few.data, moved);
    for (std::size_t t = 0; t < 4; ++t) {
      const auto path = [&](FlipLearner& learner, const std::vector<FlipDatum>& begun) {
        return learn(learner, kTargets[t], begun, bar, thrower, {9, 3, false});
      };
      ConeLearner m2(ForwardModel::detach, anew.data, kTargets[t], range);
      TransferLearner m3(past.data, moved, kTargets[t], range);
      ReleaseLearner m4(library, much.fit.card, much.left, much.scatter, kTargets[t], 3),
          m4_few(library, little.fit.card, little.left, little.scatter, kTargets[t], 3);
      paths[k][0][t] = path(m2, anew.data);
      paths[k][1][t] = path(m3, known);
      paths[k][2][t] = path(m4, known);
      paths[k][3][t] = path(m4_few, known_few);
    }
  });
  fmt::print("| learner | {} |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
             Paths::header());
  Paths all[4];
  for (std::size_t m = 0; m < 4; ++m) {
    for (const auto& one : paths)
      for (const LearningPath& path : one[m]) all[m].add(path, range);
    fmt::print("| {} | {} |\n", names[m], all[m].row());
  }
  for (std::size_t t = 0; t < 4; ++t)
    for (std::size_t m = 0; m < 4; ++m) {
      Paths at;
      for (const auto& one : paths) at.add(one[m][t], range);
      fmt::print("| {}: {} | {} |\n", kTargetNames[t], names[m], at.row());
    }
  fmt::print("\nmodel 3 - model 2: {}\nmodel 4 - model 3: {}\n{} robots, {:.0f} s\n", all[1].against(all[0]),
             all[2].against(all[1]), robots, seconds() - begin);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc > 1 ? argv[1] : "";
  const FlipRobot robot = read_flip_robot("panda-flip");
  const std::uint64_t number = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
  if (what == "population")
    population(robot, number > 0 ? number : 1);
  else if (what == "targets")
    targets(robot, number > 0 ? number : 100);
  else if (what == "support")
    support(robot, number > 0 ? number : 20);
  else if (what == "shift")
    shift(robot, number > 0 ? number : 100);
  else
    return fmt::print(stderr,
                      "usage: flip_study population [SEED] | targets [ROBOTS] | support [ROBOTS] | shift "
                      "[ROBOTS]\n"),
           2;
}
