// How often the loop finds what is missing in synthetic free flights in space, by size, and how often it
// finds something in flights that miss nothing:
//   build/release/bench/flight_discovery_study [LOGS_PER_SIZE [NULLS]]
// Each log: 25 flights of 40 samples. Sizes are in typical steps of the effect.
#include <fmt/core.h>

#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "fitting/measured/measured_discovery.hpp"
#include "tests/support/spatial_flights.hpp"

namespace {

using namespace unhand;

bool names(const fitting::MeasuredDiscovery& found, const std::string& id) {
  for (const auto& effect : found.effects) {
    if (effect.id == id) return true;
    for (const auto& [other, correlation] : effect.equivalent)
      if (other == id) return true;
  }
  return false;
}

struct Effect {
  std::string id;
  double typical;
  std::function<void(test::SpatialTruth&, double)> set;
};

}  // namespace

int main(int argc, char** argv) {
  const int logs = argc > 1 ? std::atoi(argv[1]) : 10, nulls = argc > 2 ? std::atoi(argv[2]) : 100;
  test::SpatialDesign design;
  design.flights = 25;
  design.samples = 40;
  const std::vector<Effect> effects{
      {"flight.quadratic_drag", 0.02, [](test::SpatialTruth& t, double x) { t.drag = x; }},
      {"flight.magnus_lift", 0.01, [](test::SpatialTruth& t, double x) { t.lift = x; }},
      {"flight.gravity_tilt", 0.01, [](test::SpatialTruth& t, double x) { t.tilt_x = x; }},
      {"flight.cubic_drag", 0.05, [](test::SpatialTruth& t, double x) { t.cubic_drag = x; }},
      {"flight.spin_damping", 0.02, [](test::SpatialTruth& t, double x) { t.spin_damping = x; }},
      {"sensor.length_scale", 2e-3, [](test::SpatialTruth& t, double x) { t.length_scale = x; }},
      {"sensor.com_offset", 1e-3,
       [](test::SpatialTruth& t, double x) {
         t.com = {0, 0, x};
       }},
      {"sensor.inertia", 0.02, [](test::SpatialTruth& t, double x) {
         t.inertia = {1, 1 + x, 1};
       }}};
  const std::vector<double> sizes{0.1, 0.3, 1, 3};
  fmt::print("| effect | {} |\n| --- | {} |\n", "0.1 typical steps | 0.3 | 1 | 3",
             "---: | ---: | ---: | ---:");
  int more = 0, all = 0;
  unsigned seed = 1000;
  for (const auto& effect : effects) {
    std::string row = fmt::format("| `{}` |", effect.id);
    for (const double size : sizes) {
      int found_it = 0;
      for (int k = 0; k < logs; ++k) {
        test::SpatialTruth truth;
        effect.set(truth, size * effect.typical);
        const auto found = fitting::discover_flights(test::spatial_flights(truth, design, ++seed), {});
        const bool right = names(found, effect.id);
        found_it += right ? 1 : 0;
        more += static_cast<int>(found.effects.size()) > (right ? 1 : 0) ? 1 : 0;
        ++all;
      }
      row += fmt::format(" {}/{} |", found_it, logs);
    }
    fmt::print("{}\n", row);
  }
  fmt::print("\n{} of {} logs with an effect were given another one, too\n", more, all);
  int alarms = 0;
  for (int k = 0; k < nulls; ++k)
    alarms +=
        fitting::discover_flights(test::spatial_flights({}, design, ++seed), {}).effects.empty() ? 0 : 1;
  fmt::print("{} of {} logs without an effect were given one (designed: 2 %)\n", alarms, nulls);
}
