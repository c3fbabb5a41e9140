// One release with its flight, per contact model, beside CVODE on the same throw in the same run:
//   build/release/bench/release_benchmark
// `event_error_s` is the largest error of an event's time against a run at tolerance 1e-12.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"
#include "tests/support/random_throw.hpp"

namespace {

using namespace unhand;

contact::ContactParameters<double> parameters_of(const support::RandomThrow& thrown) {
  return {thrown.patch, contact::SlideEnd::latched_brake, {}, 0.02, 0.05};
}

release::ReleaseProblem<double> problem_of(const support::RandomThrow& thrown,
                                           const contact::ContactModel& model) {
  return {thrown.hand, thrown.force, model, thrown.body, {0, -9.81}, thrown.grasp, 0.0, {}, 0.0};
}

/// The first shaken throw on which the sliding pivot changes mode at least nine times; a calm throw has none
/// asked.
support::RandomThrow find_throw(bool hard) {
  std::mt19937_64 random(7);
  for (;;) {
    support::RandomThrow thrown = support::random_throw(random, hard ? 1.0 : 0.0);
    if (!hard) return thrown;
    const auto model = contact::make_contact_model("sliding_pivot", parameters_of(thrown));
    if (simulate_release(problem_of(thrown, *model)).events.size() >= 9) return thrown;
  }
}

void release_and_flight(benchmark::State& state, const char* name, bool hard, dynamics::Method method,
                        double tolerance) {
  const support::RandomThrow thrown = find_throw(hard);
  const auto model = contact::make_contact_model(name, parameters_of(thrown));
  const auto problem = problem_of(thrown, *model);
  release::ReleaseOptions exact, options;
  exact.integrator.tolerances = {1e-12, 1e-14};
  options.integrator.method = method;
  options.integrator.tolerances = {tolerance, 0.01 * tolerance};
  const auto reference = simulate_release(problem, exact);
  release::ReleaseResult<double> result;
  for (auto _ : state) {
    result = simulate_release(problem, options);
    benchmark::DoNotOptimize(flight::fly(flight::FlightProblem<double>{
        result.detach.pose, result.detach.twist, problem.gravity, 0.0, -1.0, {}, 30}));
  }
  double error = result.events.size() == reference.events.size() ? 0.0 : NAN;
  for (std::size_t i = 0; i < std::min(result.events.size(), reference.events.size()); ++i)
    error = std::max(error, std::abs(result.events[i].t - reference.events[i].t));
  state.counters["event_error_s"] = error;
  state.counters["events"] = static_cast<double>(result.events.size());
  state.counters["steps"] = static_cast<double>(result.statistics.steps);
}

using dynamics::Method;
BENCHMARK_CAPTURE(release_and_flight, sliding_pivot_hard, "sliding_pivot", true, Method::automatic, 1e-8);
BENCHMARK_CAPTURE(release_and_flight, sliding_pivot_hard_cvode, "sliding_pivot", true, Method::cvode, 1e-9);
BENCHMARK_CAPTURE(release_and_flight, sliding_pivot_calm, "sliding_pivot", false, Method::automatic, 1e-8);
BENCHMARK_CAPTURE(release_and_flight, limit_surface_hard, "limit_surface", true, Method::automatic, 1e-6);
BENCHMARK_CAPTURE(release_and_flight, limit_surface_hard_cvode, "limit_surface", true, Method::cvode, 1e-7);
BENCHMARK_CAPTURE(release_and_flight, limit_surface_calm, "limit_surface", false, Method::automatic, 1e-5);
BENCHMARK_CAPTURE(release_and_flight, limit_surface_disc_calm, "limit_surface_disc", false, Method::automatic,
                  1e-5);
BENCHMARK_CAPTURE(release_and_flight, limit_surface_calm_cvode, "limit_surface", false, Method::cvode, 1e-6);

}  // namespace
