// What the steps of a release err by and cost, against their tolerance:
//   build/release/bench/step_error_study [THROWS]
// Random throws (the first ones of tests/crosscheck/cvode_test.cpp), smooth and shaken by turns; absolute =
// relative/100. The reference is Radau at 1e-12. Twist: largest error at detach over its components [m/s,
// rad/s]; event: largest error of an event's time [s]. Throws whose sequence of modes is another are counted,
// not compared.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "apps/table.hpp"
#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace {

using namespace unhand;
using dynamics::Method;
using Result = release::ReleaseResult<double>;

Result released(const support::RandomThrow& thrown, const char* name, Method method, double tolerance) {
  const auto model = contact::make_contact_model(name, support::parameters_of(thrown));
  release::ReleaseOptions options;
  options.integrator = support::tight(tolerance, 0.01 * tolerance);
  options.integrator.method = method;
  return simulate_release(support::problem_of(thrown, *model), options);
}

struct Errors {
  double evaluations{}, sum{}, worst{}, event{};
  int compared{}, others{};
};

void add(const Result& result, const Result& reference, Errors& errors) {
  errors.evaluations += static_cast<double>(result.statistics.flow_evaluations);
  const auto &a = result.events, &b = reference.events;
  if (!std::equal(a.begin(), a.end(), b.begin(), b.end(),
                  [](const auto& x, const auto& y) { return x.mode_after == y.mode_after; })) {
    ++errors.others;
    return;
  }
  const auto &twist = result.detach.twist, &exact = reference.detach.twist;
  const double error = std::max(
      {std::abs(twist.vx - exact.vx), std::abs(twist.vz - exact.vz), std::abs(twist.omega - exact.omega)});
  errors.sum += error;
  errors.worst = std::max(errors.worst, error);
  for (std::size_t k = 0; k < a.size(); ++k) errors.event = std::max(errors.event, std::abs(a[k].t - b[k].t));
  ++errors.compared;
}

struct Setting {
  const char* title;
  Method method;
  double tolerance;
};
constexpr Setting kSettings[] = {
    {"unhand", Method::automatic, 1e-4},      {"unhand", Method::automatic, 1e-6},
    {"unhand", Method::automatic, 1e-8},      {"unhand", Method::automatic, 1e-10},
    {"Rosenbrock", Method::rosenbrock, 1e-8}, {"CVODE", Method::cvode, 1e-9},
    {"CVODE", Method::cvode, 1e-11}};

}  // namespace

int main(int argc, char** argv) {
  const int throws = argc > 1 ? std::max(1, std::atoi(argv[1])) : 40;
  apps::Table table{
      {"model", "steppers, tolerance", "evaluations", "twist: mean", "worst", "event: worst", "other modes"},
      {},
      2};
  for (const char* name : {"sliding_pivot", "limit_surface", "limit_surface_disc"}) {
    std::vector<Errors> all(std::size(kSettings));
    std::mt19937_64 random(71);
    for (int i = 0; i < throws; ++i) {
      const auto thrown = support::random_throw(random, i % 2);
      const Result reference = released(thrown, name, Method::radau, 1e-12);
      for (std::size_t k = 0; k < all.size(); ++k)
        add(released(thrown, name, kSettings[k].method, kSettings[k].tolerance), reference, all[k]);
    }
    for (std::size_t k = 0; k < all.size(); ++k)
      table.rows.push_back({name, fmt::format("{} {:.0e}", kSettings[k].title, kSettings[k].tolerance),
                            fmt::format("{:.0f}", all[k].evaluations / throws),
                            fmt::format("{:.1e}", all[k].sum / std::max(1, all[k].compared)),
                            fmt::format("{:.1e}", all[k].worst), fmt::format("{:.1e}", all[k].event),
                            fmt::format("{}", all[k].others)});
  }
  fmt::print("{} random throws\n\n{}", throws, table.text());
}
