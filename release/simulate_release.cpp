#include "release/simulate_release.hpp"

#include <algorithm>
#include <cmath>

#include "release/release_system.hpp"

namespace unhand::release {

const char* to_string(ReleaseOutcome outcome) {
  constexpr const char* kNames[] = {"detached", "never_separated", "not_solved"};
  return kNames[static_cast<int>(outcome)];
}

const char* in_words(ReleaseOutcome outcome) {
  constexpr const char* kWords[] = {"the pads let go of the object",
                                    "the pads still press on the object where the hand's motion ends",
                                    "the simulation of the release stopped before the pads let go"};
  return kWords[static_cast<int>(outcome)];
}

namespace {

/// A detach that is not finite is none: poses do not pass through the integrator, which looks at what it
/// integrates.
template <class S>
void require_finite_detach(ReleaseResult<S>& result) {
  if (result.outcome != ReleaseOutcome::detached || is_finite(result.detach)) return;
  result.outcome = ReleaseOutcome::not_solved;
  result.integration = dynamics::Outcome::not_finite;
}

}  // namespace

template <class S>
ReleaseResult<S> simulate_release(const ReleaseProblem<S>& problem, const ReleaseOptions& options) {
  validate(problem);
  if (std::is_same_v<S, Dual> && options.ledger)
    throw std::invalid_argument(
        "release: ledger = true is not for problems with derivatives: simulate the values for it");
  const ReleaseSystem<S> system(problem);
  if (std::abs(system.separation() - problem.normal_force.release_time()) <= contact::kSameInstant)
    require_released(problem.normal_force, problem.hand.end());
  const auto& [offset, angle] = problem.grasp;
  const Relative<S> held{{offset, S(0)}, angle, problem.slip, problem.spin};
  std::vector<double> times;
  system.time_events(times);
  const auto next = std::upper_bound(times.begin(), times.end(), problem.start);
  const Window first{problem.start,
                     next == times.end() ? problem.hand.end() : std::min(*next, problem.hand.end())};

  ReleaseResult<S> result;
  Entry<S, 6> entry{system.free_mode(), S(problem.start), held.state(), S(0)};
  if (problem.start < system.separation()) entry = system.begin(first, held);
  result.slips_at_start = entry.mode != 0 && entry.mode != system.free_mode();

  dynamics::IntegratorOptions integrator = options.integrator;
  integrator.record = integrator.record || options.ledger;
  if (const auto* pads = giving(problem.contact); pads && problem.start < system.separation()) {
    std::vector<S> events;
    system.time_events(events);
    const GivingStart<S> start{held, system.template hold<S>(), std::move(events), system.separation(),
                               system.free_mode()};
    const bool slips = result.slips_at_start;
    result = simulate_giving_release(problem, *pads, system, start, {integrator, options.ledger});
    result.slips_at_start = slips;
    require_finite_detach(result);
    if constexpr (std::is_same_v<S, double>)
      if (options.ledger && !result.trajectory.empty()) result.ledger = energy_ledger(problem, result);
    return result;
  }
  // A release at the very end of the log still counts: the horizon lies one instant after.
  double horizon = problem.hand.end();
  if (system.separation() <= horizon)
    horizon = std::max(horizon, std::nextafter(system.separation(), HUGE_VAL) + 1e-9);
  dynamics::Solution<S, 6> solution = dynamics::integrate<S, 6>(system, entry, S(horizon), integrator);

  result.integration = solution.outcome;
  result.events = std::move(solution.events);
  result.trajectory = std::move(solution.trajectory);
  result.statistics = solution.statistics;
  if (entry.lead != S(0) || result.slips_at_start)
    result.events.insert(result.events.begin(), {dynamics::EventKind::time, -1, 0, entry.mode,
                                                 S(problem.start), entry.event_state()});
  switch (solution.outcome) {
    case dynamics::Outcome::finished:
      result.outcome = ReleaseOutcome::detached;
      break;
    case dynamics::Outcome::horizon:
      result.outcome = ReleaseOutcome::never_separated;
      break;
    default:
      result.outcome = ReleaseOutcome::not_solved;
  }
  const double at = value_of(solution.t);
  const auto after = std::lower_bound(times.begin(), times.end(), at - 1e-12);
  const Window last{after == times.begin() ? problem.start : *std::prev(after), at};
  const Scene<S> scene = system.scene(problem.start < system.separation() ? last : first, solution.t);
  result.relative = Relative<S>::from(solution.y);
  result.detach = {solution.t, object_pose(scene, result.relative), object_twist(scene, result.relative)};
  require_finite_detach(result);
  if constexpr (std::is_same_v<S, double>)
    if (options.ledger && !result.trajectory.empty()) result.ledger = energy_ledger(problem, result);
  return result;
}

template ReleaseResult<double> simulate_release(const ReleaseProblem<double>&, const ReleaseOptions&);
template ReleaseResult<Dual> simulate_release(const ReleaseProblem<Dual>&, const ReleaseOptions&);

}  // namespace unhand::release
