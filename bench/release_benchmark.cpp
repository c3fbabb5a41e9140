// One release with its flight, per contact model and kind of throw, beside CVODE on the same throw in the
// same run:
//   build/release/bench/release_benchmark [--benchmark_filter=limit_surface]
// Two rows a case: the median and the minimum of nine repetitions. Columns:
//   cvode_us      CVODE's median CPU time [us], at a tenth of the tolerance: its global error is some ten
//                 times its local one
//   ratio         CVODE's time over ours
//   events        mode changes;  steps: accepted steps
//   event_err_s   largest error of an event's time [s] against Radau at 1e-12;  cvode_err_s: CVODE's
//   twist_err     largest error of the twist at detach [m/s, rad/s]
// Throws: calm and hard have a hand and a force in closed form (hard: shaken, the sliding pivot changes mode
// nine times or more), log is throw 150 of the campaign batch180 as experiment::prepare smooths it (splines
// of degree five; the slip stops and sets in again), log_growing throw 0, whose slip only grows. calm_scene
// etc. time one evaluation of the hand and the force. The tolerance of each case is the loosest decade that
// keeps event times to 1e-9 s; absolute = relative/100.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "contact/registry.hpp"
#include "dynamics/median.hpp"
#include "experiment/model.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"
#include "tests/support/random_throw.hpp"

namespace {

using namespace unhand;
using dynamics::Method;
using Problem = release::ReleaseProblem<double>;
using Result = release::ReleaseResult<double>;
constexpr double kGravity = 9.81;  // m/s²

/// A throw that any contact model can be tried on.
struct Throw {
  virtual ~Throw() = default;
  virtual std::unique_ptr<contact::ContactModel> model(const char* name) const = 0;
  virtual Problem problem(const contact::ContactModel&) const = 0;
};

struct AnalyticThrow final : Throw {
  explicit AnalyticThrow(const support::RandomThrow& drawn) : thrown(drawn) {}
  std::unique_ptr<contact::ContactModel> model(const char* name) const override {
    return contact::make_contact_model(
        name,
        contact::ContactParameters<double>{thrown.patch, contact::SlideEnd::latched_brake, {}, 0.02, 0.05});
  }
  Problem problem(const contact::ContactModel& contact) const override {
    return {thrown.hand, thrown.force, contact, thrown.body, {0, -kGravity}, thrown.grasp, 0.0, {}, 0.0};
  }
  support::RandomThrow thrown;
};

struct LoggedThrow final : Throw {
  explicit LoggedThrow(experiment::PreparedThrow logged) : prepared(std::move(logged)) {}
  std::unique_ptr<contact::ContactModel> model(const char* name) const override {
    return experiment::contact_model_for(prepared, name, {});
  }
  Problem problem(const contact::ContactModel& contact) const override {
    return experiment::release_problem(prepared, contact);
  }
  experiment::PreparedThrow prepared;
};

experiment::PreparedThrow logged(const experiment::CampaignDesign& design, int index) {
  return experiment::prepare(experiment::campaign_header(design, 1),
                             experiment::generate_throw(design, 1, index).record, design.name);
}

const Throw& calm() {
  static const AnalyticThrow thrown = [] {
    std::mt19937_64 random(7);
    return AnalyticThrow(support::random_throw(random, 0.0));
  }();
  return thrown;
}

/// The first shaken throw on which the sliding pivot changes mode at least nine times.
const Throw& hard() {
  static const AnalyticThrow thrown = [] {
    std::mt19937_64 random(7);
    for (;;) {
      AnalyticThrow drawn(support::random_throw(random, 1.0));
      const auto model = drawn.model("sliding_pivot");
      if (simulate_release(drawn.problem(*model)).events.size() >= 9) return drawn;
    }
  }();
  return thrown;
}

const Throw& log() {
  static const LoggedThrow thrown(logged(experiment::campaign_design("batch180"), 150));
  return thrown;
}
const Throw& log_growing() {
  static const LoggedThrow thrown(logged(experiment::campaign_design("batch180"), 0));
  return thrown;
}

Result release_and_fly(const Problem& problem, const release::ReleaseOptions& options) {
  Result result = simulate_release(problem, options);
  benchmark::DoNotOptimize(flight::fly(flight::FlightProblem<double>{
      result.detach.pose, result.detach.twist, problem.gravity, 0.0, -1.0, {}, 30}));
  return result;
}

release::ReleaseOptions options_of(Method method, double tolerance) {
  release::ReleaseOptions options;
  options.integrator.method = method;
  options.integrator.tolerances = {tolerance, 0.01 * tolerance};
  return options;
}

/// CPU time of this process [µs]: other processes may be at work.
double cpu_microseconds() { return 1e6 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// NaN where the two runs do not have the same events.
double event_error(const Result& result, const Result& reference) {
  if (result.events.size() != reference.events.size()) return std::numeric_limits<double>::quiet_NaN();
  double error = 0;
  for (std::size_t i = 0; i < result.events.size(); ++i)
    error = std::max(error, std::abs(result.events[i].t - reference.events[i].t));
  return error;
}

void release_case(benchmark::State& state, const Throw& (*thrown)(), const char* name, double tolerance) {
  const auto model = thrown().model(name);
  const Problem problem = thrown().problem(*model);
  const auto ours = options_of(Method::automatic, tolerance),
             cvode = options_of(Method::cvode, 0.1 * tolerance);
  const Result reference = simulate_release(problem, options_of(Method::radau, 1e-12));

  std::vector<double> times;  // of CVODE [us]
  Result theirs;
  for (int k = 0; k < 15; ++k) {
    const double begin = cpu_microseconds();
    theirs = release_and_fly(problem, cvode);
    times.push_back(cpu_microseconds() - begin);
  }
  const double usual = dynamics::median(times);

  Result result;
  const double begin = cpu_microseconds();
  for (auto _ : state) result = release_and_fly(problem, ours);
  const double mean = (cpu_microseconds() - begin) / static_cast<double>(state.iterations());

  const auto &a = result.detach.twist, &b = reference.detach.twist;
  state.counters["cvode_us"] = usual;
  state.counters["ratio"] = usual / mean;
  state.counters["events"] = static_cast<double>(result.events.size());
  state.counters["steps"] = static_cast<double>(result.statistics.steps);
  state.counters["event_err_s"] = event_error(result, reference);
  state.counters["cvode_err_s"] = event_error(theirs, reference);
  state.counters["twist_err"] =
      std::max({std::abs(a.vx - b.vx), std::abs(a.vz - b.vz), std::abs(a.omega - b.omega)});
}

/// One evaluation of the hand and the normal force.
void scene_case(benchmark::State& state, const Throw& (*thrown)()) {
  const auto model = thrown().model("sliding_pivot");
  const Problem problem = thrown().problem(*model);
  const dynamics::Window window{0.025, 0.06};
  double t = window.begin;
  for (auto _ : state) {
    t = t < 0.059 ? t + 1e-5 : window.begin;
    benchmark::DoNotOptimize(problem.hand.at(window, t));
    benchmark::DoNotOptimize(problem.normal_force.at(window, t));
  }
}

/// The 180 throws of the campaign batch180, each with three models, release and flight.
void campaign_case(benchmark::State& state) {
  static const std::vector<experiment::PreparedThrow> throws = [] {
    const auto design = experiment::campaign_design("batch180");
    std::vector<experiment::PreparedThrow> out;
    for (int i = 0; i < design.throws(); ++i) out.push_back(logged(design, i));
    return out;
  }();
  const auto options = options_of(Method::automatic, 1e-6).integrator;
  for (auto _ : state)
    for (const auto& thrown : throws)
      for (const char* model : {"gripper_delay", "sliding_pivot", "limit_surface"})
        benchmark::DoNotOptimize(experiment::predict(thrown, model, {}, options));
}

/// Of the aggregates, the medians and the minima: other processes may be at work.
class MedianReporter final : public benchmark::ConsoleReporter {
 public:
  MedianReporter() : ConsoleReporter(OO_Tabular) {}
  void ReportRuns(const std::vector<Run>& runs) override {
    std::vector<Run> medians;
    std::copy_if(runs.begin(), runs.end(), std::back_inserter(medians), [](const Run& run) {
      return run.aggregate_name == "median" || run.aggregate_name == "min";
    });
    ConsoleReporter::ReportRuns(medians);
  }
};

struct Kind {
  const char* name;
  const Throw& (*thrown)();
  double pivot, surface;  // tolerances
};
constexpr Kind kKinds[] = {{"calm", calm, 1e-4, 1e-4},
                           {"hard", hard, 1e-6, 1e-5},
                           {"log", log, 1e-6, 1e-4},
                           {"log_growing", log_growing, 1e-6, 1e-4}};
constexpr const char* kModels[] = {"sliding_pivot", "limit_surface", "limit_surface_disc",
                                   "limit_surface_quartic"};

void register_all() {
  const auto median = [](benchmark::internal::Benchmark* b) {
    b->Repetitions(9)->ReportAggregatesOnly(true)->ComputeStatistics(
        "min", [](const std::vector<double>& x) { return *std::min_element(x.begin(), x.end()); });
  };
  for (const Kind& kind : kKinds)
    for (const char* model : kModels) {
      const double tolerance = std::string_view(model) == "sliding_pivot" ? kind.pivot : kind.surface;
      median(benchmark::RegisterBenchmark((std::string(kind.name) + "/" + model).c_str(), release_case,
                                          kind.thrown, model, tolerance)
                 ->Unit(benchmark::kMicrosecond));
    }
  for (const Kind& kind : kKinds)
    median(
        benchmark::RegisterBenchmark((std::string(kind.name) + "_scene").c_str(), scene_case, kind.thrown));
  median(benchmark::RegisterBenchmark("campaign_180_throws_3_models", campaign_case)
             ->Unit(benchmark::kMillisecond)
             ->Iterations(1));
}

}  // namespace

int main(int argc, char** argv) {
  register_all();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  MedianReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
}
