// What the library's answers can be held against, computed: what is expected, what it gives, how far apart
// they may be; and other engines on the same closed forms.
//   build/release/bench/validation > docs/validation.md
// Ends with 1 if a row fails. The tests in tests/truth ask more of each (directions, orders, every law).
#include <fmt/core.h>

#include <set>

#include "bench/peers/verdicts.hpp"
#include "bench/validation_rows.hpp"

namespace {

using namespace unhand;

struct Count {
  int holds{}, all{};
};

Count print(const bench::Section& section) {
  Count count;
  fmt::print(
      "\n## {}\n\n| truth | from | expected | got | difference | tolerance | |\n| --- | --- | ---: | ---: | "
      "---: | ---: | --- |\n",
      section.title);
  for (const auto& row : section.rows) {
    ++count.all;
    count.holds += row.holds() ? 1 : 0;
    fmt::print("| {} | {} | {:.10g} | {:.10g} | {:.1e} | {:.0e} | {} |\n", row.truth, row.source,
               row.expected, row.got, std::abs(row.got - row.expected), row.tolerance,
               row.holds() ? "pass" : "**FAIL**");
  }
  return count;
}

void print_peers() {
  fmt::print(
      "\n## Other engines on closed forms\n\n"
      "Error against the closed form at each engine's most accurate setting, and what unhand makes of it: "
      "how "
      "many times more accurate\n"
      "in no more time, how many times faster at no more error. The goal is 100 times or 10 times; the last "
      "column counts the settings of\n"
      "that engine, coarse ones too, against which it is met. Times are of another run than those of "
      "[peers.md](peers.md), which says how fair this is:\n"
      "settings near the goal fall on either side of it.\n\n"
      "| motion | engine | its setting | its error [m] | unhand's in that time [m] | more accurate by | "
      "faster "
      "by | goal | settings |\n| --- | --- | --- | ---: | ---: | ---: | ---: | --- | ---: |\n");
  std::set<std::string> engines;
  for (const auto& v : bench::verdicts(bench::run_all())) {
    engines.insert(v.best.engine);
    fmt::print("| {} | {} | {} | {:.1e} | {} | {} | {} | {} | {} of {} |\n", v.best.truth, v.best.engine,
               v.best.setting, v.best.error, v.in_time ? fmt::format("{:.1e}", v.in_time->error) : "-",
               v.accuracy_words(), v.speed_words(), v.goal() ? "met" : "**not met**", v.met, v.settings);
  }
  for (const std::string engine : {"MuJoCo", "Bullet", "Siconos"})
    if (!engines.count(engine)) fmt::print("\n{} was not installed where this page was made.\n", engine);
}

}  // namespace

int main() {
  fmt::print(
      "# Validation\n\n```sh\nbuild/release/bench/validation > docs/validation.md\n```\n\n"
      "What the numbers can be held against, computed by the library as it is built: closed forms, other "
      "codes, other engines (those that are\n"
      "installed; on Debian libmujoco-dev and libsiconos-kernel-dev bring two that `./setup` does not). More "
      "about\n"
      "each, over directions, orders and laws, is in [tests/truth](../tests/truth), "
      "[tests/dynamics](../tests/dynamics) and [tests/contract](../tests/contract).\n");
  Count count;
  for (const auto& section :
       {bench::friction_and_release(), bench::integrator_and_flight(), bench::other_codes()}) {
    const Count here = print(section);
    count.holds += here.holds, count.all += here.all;
  }
  fmt::print("\n{} of {} hold.\n", count.holds, count.all);
  print_peers();
  fmt::print(
      "\n## Beyond this page\n\n"
      "- Other integrators: 1,000 random throws of the sliding pivot and of the ellipsoid, 200 of the disc "
      "and "
      "100 of the quartic agree with CVODE to 1e-7;\n"
      "  throws in which a mode is only just touched (at most 1 %) may differ in their modes, and are "
      "counted, "
      "not compared\n"
      "  (`ctest --preset release -R crosscheck.*Cvode`); `unhand crosscheck log.h5 --engine cvode` does so "
      "on your log.\n"
      "- Other physics: a patch of points that knows no limit surface, and where each model holds against "
      "it:\n"
      "  [where-the-models-hold.md](where-the-models-hold.md).\n"
      "- Another engine: Bullet in double precision, throw by throw, and where it departs: "
      "[crosscheck.md](crosscheck.md). Its pads are rigid: pads that give or shrink are not checked by it.\n"
      "- Measured flights, falls and pushes, which none of this replaces: "
      "[measured-data.md](measured-data.md). "
      "No measured release is among them.\n"
      "- Every law on random and extreme input: energy, cone, symmetry, derivatives, typed outcomes\n"
      "  (`ctest --preset release -L contract`); readers on damaged files (`-L fuzz`) and under libFuzzer "
      "([tests/fuzz/run](../tests/fuzz/run);\n  executions and findings: "
      "[tests/fuzz](../tests/fuzz/README.md)).\n"
      "- Threads: fits, the twin, the corners of fit and discover, campaigns, comparisons, the planners and "
      "the child that reads HDF5\n"
      "  under the thread sanitizer without a report (`cmake --preset tsan`; `test_fitting "
      "--gtest_filter='*Thread*:Twin.*:Corner*'`,\n"
      "  `test_dynamics --gtest_filter='ParallelFor.*'`, `test_experiment "
      "--gtest_filter='*ampaign*:FreeFlight*'`, `test_planners`, `test_flip`, `test_datasets`).\n"
      "- Lines that the tests run, by folder: [coverage.md](coverage.md).\n");
  return count.holds == count.all ? 0 : 1;
}
