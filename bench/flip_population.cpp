// What commands do: the population of landings, and which targets two bars reach.
#include "bench/flip_paths.hpp"
#include "dynamics/dense_solve.hpp"
#include "planners/flip/forecast.hpp"

namespace flip_bench {
namespace {

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
  const Eigen::MatrixXd fitted = unhand::dynamics::product(A, unhand::dynamics::least_squares(A, y));
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

/// What a step of one parameter does to the mean landings of the grid, all else equal.
void print_trends(const std::vector<FlipDatum>& grid) {
  fmt::print(
      "\n| from low to high | x [m] | angle [deg] | pairs shorter | pairs more turned |\n"
      "| --- | ---: | ---: | ---: | ---: |\n");
  const char* names[]{"pitch", "speed", "damping"};
  const std::size_t strides[]{9, 3, 1};
  for (std::size_t p = 0; p < 3; ++p) {
    Spread x, angle;
    int shorter = 0, turned = 0;
    for (std::size_t i = 0; i + strides[p] < grid.size(); ++i) {
      if ((i / strides[p]) % 3 == 2) continue;
      const FlipPose &a = grid[i].landing, &b = grid[i + strides[p]].landing;
      x.add(b.x - a.x), angle.add(b.angle - a.angle);
      shorter += b.x < a.x ? 1 : 0;
      turned += b.angle > a.angle ? 1 : 0;
    }
    fmt::print("| {} | {:+.3f} | {:+.0f} | {}/{} | {}/{} |\n", names[p], 2 * x.mean(),
               2 * angle.mean() / kDegree, shorter, x.n, turned, x.n);
  }
}

}  // namespace

void population(const FlipRobot& robot, std::uint64_t seed) {
  const Watch watch;
  constexpr std::size_t repeats = 5;
  const FlipPlant plant(robot, seed);
  const auto grid = population_grid(robot.motion.range);
  const Gathered thrown =
      gather(thrower_of(plant, seed), "population", grid, static_cast<int>(repeats), robot.bar);
  fmt::print(
      "| pitch [deg] | speed | damping | landing x [m] | angle [deg] | std x [cm] | std angle [deg] |\n"
      "| ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  Spread within_x, within_angle;
  double most[3]{};
  ArmUse use;
  int lost = 0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    Spread x, angle;
    for (std::size_t k = repeats * i; k < repeats * (i + 1); ++k) {
      const FlipTrial& t = thrown.trials[k];
      use.torque = std::max(use.torque, t.use.torque);
      use.velocity = std::max(use.velocity, t.use.velocity);
      use.position = std::max(use.position, t.use.position);
      if (t.outcome != FlipOutcome::landed) {
        ++lost;
        continue;
      }
      x.add(t.landing.x);
      angle.add(t.landing.angle);
      most[i % 3] = std::max(most[i % 3], t.landing.angle);
    }
    within_x.add(x.variance());
    within_angle.add(angle.variance());
    fmt::print("| {:.1f} | {:.3f} | {:.1f} | {:.3f} | {:.0f} | {:.1f} | {:.1f} |\n", grid[i].pitch / kDegree,
               grid[i].speed, grid[i].damping, x.mean(), angle.mean() / kDegree,
               100 * std::sqrt(x.variance()), std::sqrt(angle.variance()) / kDegree);
  }
  print_trends(thrown.data);
  fmt::print("\n");
  for (std::size_t d = 0; d < 3; ++d)
    fmt::print("- Damping {:.1f}: turned {:.0f} degrees at most.\n", grid[d].damping, most[d] / kDegree);
  const Curvature curved = curvature(robot, thrown.data);
  fmt::print(
      "- Linear over the whole range: landings missed by {:.2f} (landing linear), {:.2f} (detach state "
      "linear).\n"
      "- Repetitions scatter by {:.1f} cm and {:.1f} degrees (pooled 1 sigma); {} of {} throws lost.\n"
      "- Limits used: position {:.0f} %, velocity {:.0f} %, torque {:.0f} %.\n\n{}\n",
      curved.landing, curved.detach, 100 * std::sqrt(within_x.mean()),
      std::sqrt(within_angle.mean()) / kDegree, lost, thrown.trials.size(), 100 * use.position,
      100 * use.velocity, 100 * use.torque, watch.text());
}

Bar shifted_bar(const FlipRobot& robot) {
  Bar out = robot.bar;
  out.com_offset = 0.18;
  return out;
}

std::vector<NamedTarget> shift_targets() {
  return {target_at("(a)", 1.2, 180), target_at("(c)", 1.4, 180), target_at("(e)", 1.4, 270),
          target_at("(f)", 1.6, 360)};
}

void reach(const FlipRobot& robot) {
  const Watch watch;
  constexpr int per_side = 11;
  std::vector<NamedTarget> targets = paper_targets();
  for (const NamedTarget& one : shift_targets())
    if (std::none_of(targets.begin(), targets.end(), [&](const auto& t) { return t.name == one.name; }))
      targets.push_back(one);
  fmt::print("| bar |");
  for (const NamedTarget& one : targets) fmt::print(" {} |", one.name);
  fmt::print("\n| ---: |");
  for (std::size_t i = 0; i < targets.size(); ++i) fmt::print(" ---: |");
  fmt::print("\n");
  for (const Bar& bar : {robot.bar, shifted_bar(robot)}) {
    const HandLibrary library(robot, bar, per_side);
    std::vector<double> least(targets.size(), 20.0);
    for (const auto& landing : declared_landings(library))
      for (std::size_t t = 0; landing && t < targets.size(); ++t)
        least[t] = std::min(least[t], normalized_error(*landing, targets[t].target));
    fmt::print("| {:.0f} cm |", 100 * bar.com_offset);
    for (const double error : least) fmt::print(" {:.2f} |", error);
    fmt::print("\n");
  }
  fmt::print("\nDeclared robot without noise, {} commands; {}\n", per_side * per_side * per_side,
             watch.text());
}

}  // namespace flip_bench
