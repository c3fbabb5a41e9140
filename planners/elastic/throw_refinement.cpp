#include "planners/elastic/throw_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace unhand::planners::elastic {
namespace {

/// The middle of Hermite's cubic through two points a time h apart.
template <class V>
V hermite_middle(const V& a, const V& b, const V& a_rate, const V& b_rate, double h) {
  return 0.5 * (a + b) + (h / 8) * (a_rate - b_rate);
}

ThrowPoint between(const ThrowPoint& a, const ThrowPoint& b) {
  ThrowPoint out;
  const double h = b.t - a.t;
  out.t = 0.5 * (a.t + b.t);
  out.at = hermite_middle(a.at, b.at, a.rate, b.rate, h);
  out.rate = hermite_middle(a.rate, b.rate, a.acceleration, b.acceleration, h);
  out.acceleration = 0.5 * (a.acceleration + b.acceleration);
  out.torque = 0.5 * (a.torque + b.torque);
  return out;
}

}  // namespace

bool confirms(const ThrowTask& task, const ElasticThrow& plan, const Replay& run,
              const Refinement& refinement) {
  if (run.outcome != dynamics::Outcome::horizon || run.spring_stop) return false;
  if (task.target) {
    const auto x = landing_x(run.release, task.target->z, task.gravity);
    if (!x || !(std::abs(*x - task.target->x) <= refinement.miss)) return false;
  }
  const double speed = std::hypot(run.release.vx, run.release.vz);
  return std::abs(plan.speed() - speed) <= refinement.speed_error * speed &&
         run.use.largest() <= refinement.limit_use;
}

ElasticThrow on_finer_mesh(const ElasticThrow& plan) {
  ElasticThrow out = plan;
  for (std::size_t i = 0; i < plan.phases.size(); ++i) {
    const std::vector<ThrowPoint>& from = plan.phases[i].points;
    std::vector<ThrowPoint>& to = out.phases[i].points;
    to.clear();
    for (std::size_t k = 0; k < from.size(); ++k) {
      if (k > 0) to.push_back(between(from[k - 1], from[k]));
      to.push_back(from[k]);
    }
  }
  return out;
}

ConfirmedThrow confirm(const ClutchedArm& arm, const ThrowTask& task, ElasticThrow plan,
                       ThrowProgramOptions options, const Refinement& refinement) {
  ConfirmedThrow out;
  out.run = replay(arm, plan);
  out.plan = std::move(plan);
  out.intervals = options.intervals;
  while (!(out.confirmed = confirms(task, out.plan, out.run, refinement)) &&
         2 * out.intervals <= refinement.finest) {
    const ElasticThrow start = on_finer_mesh(out.plan);
    options.intervals = 2 * out.intervals;
    options.near = &start;
    ElasticThrow finer = plan_throw(arm, task, options);
    out.longest_solve = std::max(out.longest_solve, finer.program.seconds);
    if (!finer.solved()) break;
    out.run = replay(arm, finer);
    out.plan = std::move(finer);
    out.intervals = options.intervals;
  }
  return out;
}

}  // namespace unhand::planners::elastic
