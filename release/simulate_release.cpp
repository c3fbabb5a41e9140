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

/// Where a release begins.
template <class S>
struct Start {
  Relative<S> held;           ///< the object against the hand
  std::vector<double> times;  ///< [s], increasing: the time events
  Window first;               ///< from the start to the first of them after it
  Entry<S, 6> entry;          ///< the mode that the grip allows, and the state in it
  bool pressed{};             ///< the pads press on the object
  bool slips{};               ///< it is held, and slips or pivots at once
};

template <class S>
Start<S> start_of(const ReleaseProblem<S>& problem, const ReleaseSystem<S>& system) {
  const auto& [offset, angle, across] = problem.grasp;
  Start<S> start;
  start.held = {{offset, across}, angle, problem.slip, problem.spin};
  system.time_events(start.times);
  const auto next = std::upper_bound(start.times.begin(), start.times.end(), problem.start);
  const double end = problem.hand.end();
  start.first = {problem.start, next == start.times.end() ? end : std::min(*next, end)};
  start.pressed = problem.start < system.separation();
  start.entry = start.pressed ? system.begin(start.first, start.held)
                              : Entry<S, 6>{system.free_mode(), S(problem.start), start.held.state(), S(0)};
  start.slips = start.entry.mode != 0 && start.entry.mode != system.free_mode();
  return start;
}

/// What pads do that give at every point.
template <class S>
ReleaseResult<S> integrate_points(const ReleaseProblem<S>& problem, const contact::GivesAtPoints& pads,
                                  const ReleaseSystem<S>& system, const Start<S>& start,
                                  const ReleaseOptions& options) {
  std::vector<S> events;
  system.time_events(events);
  return simulate_giving_release(problem, pads, system,
                                 GivingStart<S>{start.held, system.template hold<S>(), std::move(events),
                                                system.separation(), system.free_mode()},
                                 options);
}

/// What a patch does that slips and sticks as one, mode by mode.
template <class S>
ReleaseResult<S> integrate_modes(const ReleaseProblem<S>& problem, const ReleaseSystem<S>& system,
                                 const Start<S>& start, const dynamics::IntegratorOptions& options) {
  // A release at the very end of the log still counts: the horizon lies one instant after.
  double horizon = problem.hand.end();
  if (system.separation() <= horizon)
    horizon = std::max(horizon, std::nextafter(system.separation(), HUGE_VAL) + 1e-9);
  dynamics::Solution<S, 6> solution = dynamics::integrate<S, 6>(system, start.entry, S(horizon), options);

  ReleaseResult<S> result;
  result.integration = solution.outcome;
  result.events = std::move(solution.events);
  result.trajectory = std::move(solution.trajectory);
  result.statistics = solution.statistics;
  if (start.entry.lead != S(0) || start.slips)
    result.events.insert(result.events.begin(), {dynamics::EventKind::time, -1, 0, start.entry.mode,
                                                 S(problem.start), start.entry.event_state()});
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
  const auto after = std::lower_bound(start.times.begin(), start.times.end(), at - 1e-12);
  const Window last{after == start.times.begin() ? problem.start : *std::prev(after), at};
  const Scene<S> scene = system.scene(start.pressed ? last : start.first, solution.t);
  result.relative = Relative<S>::from(solution.y);
  result.detach = {solution.t, object_pose(scene, result.relative), object_twist(scene, result.relative)};
  return result;
}

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
void validate(const ReleaseProblem<S>& problem) {
  if (!(std::abs(problem.start) <= 1e6))
    throw std::invalid_argument(
        fmt::format("release: start = {} is not in [-1e6, 1e6] s: a clock must begin near the throw, for its "
                    "times to be resolved",
                    problem.start));
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("release: {} = {} is not in {}", name, value, range));
  };
  const double m = value_of(problem.body.mass), I = value_of(problem.body.inertia);
  require(m > 0 && m <= 1e4, "mass", m, "(0, 1e4] kg");
  require(I > 0 && I <= 1e6, "inertia", I, "(0, 1e6] kg m²");
  const auto finite = [](const char* name, double value, const char* unit) {
    dynamics::require_finite("release", {{name, value, unit}});
  };
  finite("gravity x", value_of(problem.gravity.x), "m/s²");
  finite("gravity z", value_of(problem.gravity.z), "m/s²");
  require(std::abs(value_of(problem.grasp.com_offset)) <= 100, "com_offset",
          value_of(problem.grasp.com_offset), "[-100, 100] m");
  require(std::abs(value_of(problem.grasp.across)) <= 100, "across", value_of(problem.grasp.across),
          "[-100, 100] m");
  finite("grasp angle", value_of(problem.grasp.angle), "rad");
  finite("slip x", value_of(problem.slip.x), "m/s");
  finite("slip z", value_of(problem.slip.z), "m/s");
  finite("spin", value_of(problem.spin), "rad/s");
  const double begin = problem.hand.begin(), end = problem.hand.end();
  finite("begin of the hand's motion", begin, "s");
  finite("end of the hand's motion", end, "s");
  for (const double t : problem.hand.jumps()) finite("jump of the hand's motion", t, "s");
  for (const double t : problem.normal_force.kinks()) finite("kink of the normal force", t, "s");
  const double release = problem.normal_force.release_time();
  require(release > -std::numeric_limits<double>::infinity(), "release time of the normal force", release,
          "(-inf, inf] s");
  if (!(problem.start >= begin && problem.start < end))
    throw std::invalid_argument(
        fmt::format("release: start = {} is not in [{}, {}) s, where the hand's motion is known",
                    problem.start, begin, end));
}
template void validate(const ReleaseProblem<double>&);
template void validate(const ReleaseProblem<Dual>&);

template <class S>
ReleaseResult<S> simulate_release(const ReleaseProblem<S>& problem, const ReleaseOptions& given) {
  validate(problem);
  if (std::is_same_v<S, Dual> && given.ledger)
    throw std::invalid_argument(
        "release: ledger = true is not for problems with derivatives: simulate the values for it");
  const ReleaseSystem<S> system(problem);
  if (std::abs(system.separation() - problem.normal_force.release_time()) <= contact::kSameInstant)
    require_released(problem.normal_force, problem.hand.end());
  const Start<S> start = start_of(problem, system);
  ReleaseOptions options = given;
  options.integrator.record |= options.ledger;

  const auto* pads = giving(problem.contact);
  ReleaseResult<S> result = pads && start.pressed
                                ? integrate_points(problem, *pads, system, start, options)
                                : integrate_modes(problem, system, start, options.integrator);
  result.slips_at_start = start.slips;
  require_finite_detach(result);
  if constexpr (std::is_same_v<S, double>)
    if (options.ledger && !result.trajectory.empty()) result.ledger = energy_ledger(problem, result);
  return result;
}

template ReleaseResult<double> simulate_release(const ReleaseProblem<double>&, const ReleaseOptions&);
template ReleaseResult<Dual> simulate_release(const ReleaseProblem<Dual>&, const ReleaseOptions&);

}  // namespace unhand::release
