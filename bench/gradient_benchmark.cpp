// What derivatives of a release cost, beside the plain release and beside finite differences, in one run:
//   build/release/bench/gradient_benchmark
// One row a model and tolerance: the CPU time of a release in dual numbers (kDualSize derivatives, six of
// them used: mass, inertia, grasp offset, grasp angle, μ, radius of the pads), the median of nine
// repetitions.
//   plain_us      median CPU time of the release in double [us];  ratio: derivatives over plain
//   central_us    the same of central differences for the six: twelve plain releases
//   error         largest error of a derivative of the state at detach, relative to that state component's
//                 gradient, against a run at 1e-12;  central_error: that of central differences with steps of
//                 1e-4 of a parameter's size
// The throw is number 150 of the campaign batch180 (its slip stops and sets in again); absolute =
// relative/1000.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "contact/registry.hpp"
#include "dynamics/median.hpp"
#include "experiment/model.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "release/simulate_release.hpp"

namespace {

using namespace unhand;
using dynamics::Dual;
constexpr int kParameters = 6;
using Parameters = std::array<double, kParameters>;

const experiment::PreparedThrow& logged() {
  static const experiment::PreparedThrow thrown = [] {
    const auto design = experiment::campaign_design("batch180");
    return experiment::prepare(experiment::campaign_header(design, 1),
                               experiment::generate_throw(design, 1, 150).record, design.name);
  }();
  return thrown;
}

Parameters parameters() {
  const auto& t = logged();
  return {t.body.mass, t.body.inertia, t.grasp.com_offset, t.grasp.angle, 0.5, 0.0105};
}

template <class S>
using Detached = std::array<S, 7>;

/// Time, pose and twist at detach.
template <class S>
Detached<S> release_with(const char* model, const std::array<S, kParameters>& x, double tolerance) {
  const auto& t = logged();
  contact::ContactParameters<S> p;
  p.patch = {x[4], x[5], S(2.0 / 3.0), 2};
  p.open_command = t.open_command;
  const auto contact = contact::make_contact_model(model, p);
  release::ReleaseOptions options;
  options.integrator.tolerances = {tolerance, 1e-3 * tolerance};
  const auto result = simulate_release(release::ReleaseProblem<S>{t.hand,
                                                                  *t.normal_force,
                                                                  *contact,
                                                                  {x[0], x[1]},
                                                                  {S(t.gravity.x), S(t.gravity.z)},
                                                                  {x[2], x[3]},
                                                                  t.start,
                                                                  {},
                                                                  S(0)},
                                       options);
  const auto& [time, pose, twist] = result.detach;
  return {time, pose.x, pose.z, pose.theta, twist.vx, twist.vz, twist.omega};
}

Detached<Dual> with_derivatives(const char* model, double tolerance) {
  const Parameters at = parameters();
  std::array<Dual, kParameters> x;
  for (int k = 0; k < kParameters; ++k) x[k] = dynamics::independent(at[k], k);
  return release_with(model, x, tolerance);
}

double size_of(double parameter) { return std::max(std::abs(parameter), 1e-3); }

Detached<Dual> central_differences(const char* model, double tolerance) {
  const Parameters at = parameters();
  Detached<Dual> out;
  for (int k = 0; k < kParameters; ++k) {
    const double h = 1e-4 * size_of(at[k]);
    Parameters above = at, below = at;
    above[k] += h;
    below[k] -= h;
    const auto a = release_with(model, above, tolerance), b = release_with(model, below, tolerance);
    for (std::size_t i = 0; i < out.size(); ++i) out[i].v[k] = (a[i] - b[i]) / (2 * h);
  }
  return out;
}

/// Derivatives by the relative change of a parameter, so that they compare.
double error_of(const Detached<Dual>& found, const Detached<Dual>& exact) {
  const Parameters at = parameters();
  double worst = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    double missed = 0, size = 0;
    for (int k = 0; k < kParameters; ++k) {
      missed = std::max(missed, std::abs(found[i].v[k] - exact[i].v[k]) * size_of(at[k]));
      size = std::max(size, std::abs(exact[i].v[k]) * size_of(at[k]));
    }
    if (size > 0) worst = std::max(worst, missed / size);
  }
  return worst;
}

/// The median CPU time of 51 runs [µs]: other processes may be at work.
template <class Function>
double median_microseconds(Function&& function) {
  std::vector<double> times;
  for (int k = 0; k < 51; ++k) {
    const std::clock_t begin = std::clock();
    benchmark::DoNotOptimize(function());
    times.push_back(1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return dynamics::median(times);
}

void gradient_case(benchmark::State& state, const char* model, double tolerance) {
  const Detached<Dual> exact = with_derivatives(model, 1e-12);
  Detached<Dual> found, differences;
  for (auto _ : state) found = with_derivatives(model, tolerance);
  const double plain = median_microseconds([&] { return release_with(model, parameters(), tolerance); });
  const double central =
      median_microseconds([&] { return differences = central_differences(model, tolerance); });
  state.counters["plain_us"] = plain;
  state.counters["ratio"] = median_microseconds([&] { return with_derivatives(model, tolerance); }) / plain;
  state.counters["central_us"] = central;
  state.counters["error"] = error_of(found, exact);
  state.counters["central_error"] = error_of(differences, exact);
}

/// Of the aggregates, the medians only.
class MedianReporter final : public benchmark::ConsoleReporter {
 public:
  MedianReporter() : ConsoleReporter(OO_Tabular) {}
  void ReportRuns(const std::vector<Run>& runs) override {
    std::vector<Run> medians;
    std::copy_if(runs.begin(), runs.end(), std::back_inserter(medians),
                 [](const Run& run) { return run.aggregate_name == "median"; });
    ConsoleReporter::ReportRuns(medians);
  }
};

}  // namespace

int main(int argc, char** argv) {
  for (const char* model : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    for (const double tolerance : {1e-5, 1e-6, 1e-8})
      benchmark::RegisterBenchmark((std::string(model) + "/" +
                                    (tolerance == 1e-5   ? "1e-5"
                                     : tolerance == 1e-6 ? "1e-6"
                                                         : "1e-8"))
                                       .c_str(),
                                   gradient_case, model, tolerance)
          ->Unit(benchmark::kMicrosecond)
          ->MinTime(0.1)
          ->Repetitions(9)
          ->ReportAggregatesOnly(true);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  MedianReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
}
