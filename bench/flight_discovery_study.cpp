// How often the loop finds what is missing in synthetic free flights in space, by size, and how often it
// finds something in flights that miss nothing:
//   build/release/bench/flight_discovery_study [LOGS_PER_SIZE [NULLS [PAIRS]]]
// Each log: 25 flights of 40 samples. Sizes are in typical steps of the effect. PAIRS logs miss two effects
// at once, from half a step to five.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>
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

/// What the loop says where two effects are missing at once; a line for each log of which something is wrong.
void pairs(const std::vector<Effect>& effects, const test::SpatialDesign& design, int logs, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> index(0, effects.size() - 1);
  std::uniform_real_distribution<double> exponent(std::log(0.5), std::log(5));
  int found_them = 0, false_names = 0, unexplained = 0;
  for (int k = 0; k < logs; ++k) {
    const std::size_t a = index(random);
    std::size_t b = index(random);
    while (b == a) b = index(random);
    test::SpatialTruth truth;
    std::string text;
    for (const std::size_t i : {a, b}) {
      const double size = std::exp(exponent(random));
      effects[i].set(truth, size * effects[i].typical);
      text += fmt::format("{}{} {:.2f} steps", text.empty() ? "" : " and ", effects[i].id, size);
    }
    const auto found = fitting::discover_flights(test::spatial_flights(truth, design, ++seed), {});
    const int right = names(found, effects[a].id) + names(found, effects[b].id),
              wrong = std::max(0, static_cast<int>(found.effects.size()) - right);
    found_them += right, false_names += wrong, unexplained += found.unexplained ? 1 : 0;
    if (right == 2 && wrong == 0 && !found.unexplained) continue;
    text += found.effects.empty() ? ": no name" : ": called";
    for (const auto& effect : found.effects) text += ' ' + effect.id;
    fmt::print("{}{}\n", text, found.unexplained ? " and unexplained" : "");
  }
  fmt::print("of {} effects in {} logs with two, {} were found; {} false names, {} logs unexplained\n",
             2 * logs, logs, found_them, false_names, unexplained);
}

}  // namespace

int main(int argc, char** argv) {
  const int logs = argc > 1 ? std::atoi(argv[1]) : 10, nulls = argc > 2 ? std::atoi(argv[2]) : 100,
            logs_of_two = argc > 3 ? std::atoi(argv[3]) : 60;
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

  std::vector<Effect> more_effects = effects;
  more_effects.push_back(
      {"flight.linear_drag", 0.02, [](test::SpatialTruth& t, double x) { t.linear_drag = x; }});
  pairs(more_effects, design, logs_of_two, 5000);
}
