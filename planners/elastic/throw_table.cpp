#include "planners/elastic/throw_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace unhand::planners::elastic {

Basins find_basins(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options,
                   int starts) {
  constexpr double kShare = 0.01;  // of objectives that agree
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
    const double value = plan.program.objective;
    const auto same = std::find_if(out.found.begin(), out.found.end(), [&](const Basin& basin) {
      const double there = basin.best.program.objective;
      return std::abs(value - there) <= kShare * std::max(std::abs(value), std::abs(there));
    });
    if (same == out.found.end()) {
      out.found.push_back({std::move(plan), 1});
      continue;
    }
    ++same->starts;
    if (value < same->best.program.objective) same->best = std::move(plan);
  }
  std::sort(out.found.begin(), out.found.end(), [](const Basin& a, const Basin& b) {
    return a.best.program.objective < b.best.program.objective;
  });
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
  const auto none = [&](double x) {
    throw std::runtime_error(
        fmt::format("make_table: no throw to x = {:.4g} m, z = {:.4g} m was found", x, out.height));
  };
  if (basins.found.empty()) none(distances[middle]);
  out.throws[middle] = basins.found.front().best;
  const auto solve_beside = [&](std::size_t k, std::size_t neighbour) {
    ThrowProgramOptions near = options;
    near.near = &out.throws[neighbour];
    near.program.warm = true;
    task.target->x = distances[k];
    out.throws[k] = plan_throw(arm, task, near);
    if (!out.throws[k].solved()) none(distances[k]);
  };
  for (std::size_t k = middle + 1; k < distances.size(); ++k) solve_beside(k, k - 1);
  for (std::size_t k = middle; k-- > 0;) solve_beside(k, k + 1);
  return out;
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
