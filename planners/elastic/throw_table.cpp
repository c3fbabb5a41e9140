#include "planners/elastic/throw_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace unhand::planners::elastic {
namespace {

/// Objectives that agree within 1 % of the larger one.
bool agree(double a, double b) {
  constexpr double kShare = 0.01;
  return std::abs(a - b) <= kShare * std::max(std::abs(a), std::abs(b));
}

/// What is to be small: −v² without a target, without the smoothing that only tells equals apart.
double value_of(const ThrowTask& task, const ElasticThrow& plan) {
  return task.target ? plan.program.objective : -plan.speed() * plan.speed();
}

const ElasticThrow& plan_of(const Basin& basin) { return basin.best; }
const ElasticThrow& plan_of(const ConfirmedBasin& basin) { return basin.best.plan; }

template <class B>
void sort_by_value(const ThrowTask& task, std::vector<B>& all) {
  std::stable_sort(all.begin(), all.end(), [&](const B& a, const B& b) {
    return value_of(task, plan_of(a)) < value_of(task, plan_of(b));
  });
}

/// Joins each with the first of those before it that it agrees with: no two that stay agree.
template <class B>
std::vector<B> without_doubles(const ThrowTask& task, std::vector<B> all) {
  std::vector<B> out;
  for (B& one : all) {
    const auto same = std::find_if(out.begin(), out.end(), [&](const B& other) {
      return agree(value_of(task, plan_of(one)), value_of(task, plan_of(other)));
    });
    if (same == out.end())
      out.push_back(std::move(one));
    else
      same->starts += one.starts;
  }
  return out;
}

/// The table's options for a throw that starts from another one.
ThrowProgramOptions beside(const ThrowProgramOptions& options, const ElasticThrow& other) {
  ThrowProgramOptions out = options;
  out.near = &other;
  out.program.warm = true;
  return out;
}

/// When the clutched drive lets its spring go; none of another drive.
std::optional<double> let_go_of(const ThrowTask& task, const ElasticThrow& plan) {
  if (task.drive != Drive::clutched) return {};
  return plan.phases.front().points.back().t;
}

}  // namespace

OutOfReach::OutOfReach(double x, double z)
    : std::runtime_error(fmt::format("no throw was found to a target at x = {:.4g} m, z = {:.4g} m", x, z)),
      distance(x) {}

Basins find_basins(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options,
                   int starts) {
  if (starts < 1)
    throw std::invalid_argument(fmt::format("find_basins: starts = {}; accepted: >= 1", starts));
  Basins out;
  for (int k = 0; k < starts; ++k) {
    ThrowProgramOptions one = options;
    one.seed = options.seed + static_cast<unsigned>(k);
    ElasticThrow plan = plan_throw(arm, task, one);
    out.longest = std::max(out.longest, plan.program.seconds);
    if (!plan.solved()) {
      ++out.failed;
      continue;
    }
    out.found.push_back({std::move(plan), 1});
  }
  sort_by_value(task, out.found);
  out.found = without_doubles(task, std::move(out.found));
  return out;
}

ConfirmedBasins confirm_basins(const ClutchedArm& arm, const ThrowTask& task, const Basins& basins,
                               const ThrowProgramOptions& options, const Refinement& refinement) {
  ConfirmedBasins out;
  out.longest = basins.longest;
  for (const Basin& basin : basins.found) {
    out.found.push_back({confirm(arm, task, basin.best, options, refinement), basin.starts});
    out.longest = std::max(out.longest, out.found.back().best.longest_solve);
  }
  sort_by_value(task, out.found);
  // A confirmed throw stands for those that agree with it.
  std::stable_partition(out.found.begin(), out.found.end(),
                        [](const ConfirmedBasin& one) { return one.best.confirmed; });
  out.found = without_doubles(task, std::move(out.found));
  sort_by_value(task, out.found);
  return out;
}

ThrowTable make_table(const ClutchedArm& arm, ThrowTask task, const std::vector<double>& distances,
                      const ThrowProgramOptions& options, int starts) {
  const auto not_less = [](double a, double b) { return !(a < b); };
  const bool increasing = std::adjacent_find(distances.begin(), distances.end(), not_less) == distances.end();
  if (distances.size() < 4 || !increasing || !task.target)
    throw std::invalid_argument(
        "make_table: at least four increasing distances, and a target that gives the height");
  ThrowTable out{task.target->z, distances, {}};
  out.throws.resize(distances.size());
  const std::size_t middle = distances.size() / 2;
  task.target->x = distances[middle];
  const Basins basins = find_basins(arm, task, options, starts);
  if (basins.found.empty()) throw OutOfReach(distances[middle], out.height);
  out.throws[middle] = basins.found.front().best;
  task.let_go = let_go_of(task, out.throws[middle]);
  const auto solve_beside = [&](std::size_t k, std::size_t neighbour) {
    ThrowTask there = task;
    there.target->x = distances[k];
    out.throws[k] = plan_throw(arm, there, beside(options, out.throws[neighbour]));
    if (!out.throws[k].solved() && there.let_go) {  // of another family, but a throw
      there.let_go.reset();
      out.throws[k] = plan_throw(arm, there, beside(options, out.throws[neighbour]));
    }
    if (!out.throws[k].solved()) throw OutOfReach(distances[k], out.height);
  };
  for (std::size_t k = middle + 1; k < distances.size(); ++k) solve_beside(k, k - 1);
  for (std::size_t k = middle; k-- > 0;) solve_beside(k, k + 1);
  return out;
}

ConfirmedTable confirm_table(const ClutchedArm& arm, ThrowTask task, ThrowTable table,
                             ThrowProgramOptions options, const Refinement& refinement) {
  const std::size_t n = table.distances.size();
  if (!task.target || table.throws.size() != n)
    throw std::invalid_argument("confirm_table: a task with a target, and a throw for each distance");
  task.target->z = table.height;
  const auto run = [&](const ThrowTable& of) {
    std::vector<TableNode> nodes;
    for (std::size_t k = 0; k < n; ++k) {
      task.target->x = of.distances[k];
      TableNode node{replay(arm, of.throws[k]), {}, false};
      if (const auto x = landing_x(node.run.release, of.height, task.gravity))
        node.miss = *x - task.target->x;
      node.confirmed = confirms(task, of.throws[k], node.run, refinement);
      nodes.push_back(std::move(node));
    }
    return nodes;
  };
  const auto confirmed = [](const TableNode& node) { return node.confirmed; };
  ConfirmedTable out{std::move(table), {}, options.intervals};
  out.nodes = run(out.table);
  while (!std::all_of(out.nodes.begin(), out.nodes.end(), confirmed) &&
         2 * out.intervals <= refinement.finest) {
    options.intervals = 2 * out.intervals;
    ThrowTable finer = out.table;
    for (std::size_t k = 0; k < n; ++k) {
      const ElasticThrow start = on_finer_mesh(out.table.throws[k]);
      task.target->x = finer.distances[k];
      task.let_go = let_go_of(task, start);
      finer.throws[k] = plan_throw(arm, task, beside(options, start));
      if (!finer.throws[k].solved()) return out;
    }
    out.nodes = run(finer);
    out.table = std::move(finer);
    out.intervals = options.intervals;
  }
  return out;
}

std::optional<Reach> find_reach(const ClutchedArm& arm, ThrowTask task, ThrowProgramOptions options,
                                int starts) {
  constexpr double kNearest = 0.05, kFarthest = 20, kFirstStep = 0.4, kTo = 0.05;  // [m]
  constexpr int kIterations = 150;  // most solves need less, and those that fail all that they get
  constexpr int kIntervals = 8;
  options.program.iterations = std::min(options.program.iterations, kIterations);
  options.intervals = std::min(options.intervals, kIntervals);
  if (!task.target) throw std::invalid_argument("find_reach: a target that gives the height");
  ElasticThrow first;
  for (const double x : {2.0, 1.0, 4.0, 0.5, 0.25, 8.0}) {
    task.target->x = x;
    const Basins basins = find_basins(arm, task, options, starts);
    if (basins.found.empty()) continue;
    first = basins.found.front().best;
    break;
  }
  if (!first.solved()) return {};
  const double begin = task.target->x;
  const auto walk = [&](double step) {
    ElasticThrow last = first;
    double x = begin;
    while (std::abs(step) >= kTo) {
      task.target->x = std::clamp(x + step, kNearest, kFarthest);
      ElasticThrow next;
      if (task.target->x != x) next = plan_throw(arm, task, beside(options, last));
      if (next.solved()) {
        x = task.target->x;
        last = std::move(next);
      } else {
        step /= 2;
      }
    }
    return x;
  };
  return Reach{walk(-kFirstStep), walk(kFirstStep)};
}

ElasticThrow interpolate(const ThrowTable& table, double distance) {
  const auto& x = table.distances;
  if (x.size() < 4 || !(distance >= x.front() && distance <= x.back()))
    throw std::invalid_argument(fmt::format("interpolate: distance = {} m; accepted: [{}, {}] of the table",
                                            distance, x.empty() ? 0 : x.front(), x.empty() ? 0 : x.back()));
  if (table.throws.size() != x.size())
    throw std::invalid_argument(fmt::format("interpolate: {} throws are not one for each of {} distances",
                                            table.throws.size(), x.size()));
  const std::size_t above =
      static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), distance) - x.begin());
  const std::size_t first = std::min(above > 2 ? above - 2 : 0, x.size() - 4);
  std::array<double, 4> weight;
  for (std::size_t i = 0; i < 4; ++i) {
    weight[i] = 1;
    for (std::size_t j = 0; j < 4; ++j)
      if (j != i) weight[i] *= (distance - x[first + j]) / (x[first + i] - x[first + j]);
  }
  ElasticThrow out = table.throws[first];
  out.program = {};
  out.program.outcome = ProgramOutcome::solved;
  out.release = {};
  for (std::size_t i = 0; i < 4; ++i) {
    const TipState<double>& tip = table.throws[first + i].release;
    out.release.x += weight[i] * tip.x, out.release.z += weight[i] * tip.z;
    out.release.vx += weight[i] * tip.vx, out.release.vz += weight[i] * tip.vz;
  }
  for (std::size_t p = 0; p < out.phases.size(); ++p)
    for (std::size_t k = 0; k < out.phases[p].points.size(); ++k) {
      ThrowPoint sum{0, Coordinates<double>::Zero(), Coordinates<double>::Zero(), Coordinates<double>::Zero(),
                     MotorTorques<double>::Zero()};
      for (std::size_t i = 0; i < 4; ++i) {
        const ThrowPoint& one = table.throws[first + i].phases[p].points[k];
        sum.t += weight[i] * one.t;
        sum.at += weight[i] * one.at;
        sum.rate += weight[i] * one.rate;
        sum.acceleration += weight[i] * one.acceleration;
        sum.torque += weight[i] * one.torque;
      }
      out.phases[p].points[k] = sum;
    }
  return out;
}

std::vector<TableCheck> check_table(const ClutchedArm& arm, const ThrowTable& table, int count,
                                    double gravity) {
  if (count < 2) throw std::invalid_argument(fmt::format("check_table: count = {}; accepted: >= 2", count));
  std::vector<TableCheck> out;
  for (int k = 0; k < count; ++k) {
    const double share = static_cast<double>(k) / (count - 1);
    const double distance = std::lerp(table.distances.front(), table.distances.back(), share);
    const Replay run = replay(arm, interpolate(table, distance));
    const auto x = landing_x(run.release, table.height, gravity);
    TableCheck check{distance, 0, run.use.largest(), x && run.outcome == dynamics::Outcome::horizon};
    if (check.lands) check.miss = *x - distance;
    out.push_back(check);
  }
  return out;
}

}  // namespace unhand::planners::elastic
