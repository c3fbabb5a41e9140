// How often the loop finds what is missing, on synthetic campaigns with a random effect, or with none:
//   build/release/bench/discovery_study [CAMPAIGNS [FIRST_SEED [NULL_SHARE]]]
// One line per campaign, then the rate by effect and by size (in typical steps of the effect's parameter),
// and the false discoveries among the campaigns without an effect.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/discover.hpp"

namespace {

using namespace unhand;

struct Tally {
  int campaigns{}, found{};
};

std::string id_of(const std::string& setting) { return setting.substr(0, setting.rfind('.')); }

/// The largest parameter, in typical steps from neutral.
double size_of(const experiment::EffectSettings& settings) {
  double out = 0;
  for (const auto& [name, value] : settings)
    if (const auto* p = experiment::find_parameter(experiment::without_object(name)); p && !p->is_shape())
      out = std::max(out, std::abs(value - p->neutral) / p->typical);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const int campaigns = argc > 1 ? std::atoi(argv[1]) : 20;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const double null_share = argc > 3 ? std::atof(argv[3]) : 0.25;
  std::map<std::string, Tally> by_effect, by_size;
  Tally nulls;
  double seconds = 0;
  for (int k = 0; k < campaigns; ++k) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(k);
    auto design = experiment::random_campaign(seed);
    const bool null = std::fmod(0.618034 * static_cast<double>(seed), 1.0) < null_share;
    if (!null) design.effects = experiment::random_effect(design, seed);
    const auto log = experiment::generate_campaign(design, seed);
    fitting::DiscoverOptions options;
    options.campaign.integrator.tolerances = {1e-5, 1e-8};
    const auto found = fitting::discover(log, "synthetic", options);
    seconds += found.seconds;
    std::string answer;
    for (const auto& effect : found.effects) {
      answer += (answer.empty() ? "" : ", ") + effect.id;
      for (const auto& [id, correlation] : effect.equivalent) answer += " = " + id;
    }
    if (null) {
      nulls.campaigns += 1;
      nulls.found += found.effects.empty() ? 0 : 1;
      fmt::print("seed {}: no effect -> {} {}\n", seed, to_string(found.verdict), answer);
      continue;
    }
    const std::string id = id_of(design.effects.begin()->first);
    const bool right = answer.find(id) != std::string::npos;
    const double size = size_of(design.effects);
    const std::string decade = size < 1    ? "below 1"
                               : size < 3  ? "1 to 3"
                               : size < 10 ? "3 to 10"
                                           : "above 10";
    for (auto* tally : {&by_effect[id], &by_size[decade]}) {
      tally->campaigns += 1;
      tally->found += right ? 1 : 0;
    }
    fmt::print("seed {}: {} ({:.2f} typical steps) -> {} {}\n", seed, id, size, to_string(found.verdict),
               answer);
  }
  fmt::print("\n| effect | campaigns | found |\n| --- | ---: | ---: |\n");
  for (const auto& [id, t] : by_effect) fmt::print("| {} | {} | {} |\n", id, t.campaigns, t.found);
  fmt::print("\n| size in typical steps | campaigns | found |\n| --- | ---: | ---: |\n");
  for (const auto& [size, t] : by_size) fmt::print("| {} | {} | {} |\n", size, t.campaigns, t.found);
  fmt::print("\nwithout an effect: {} campaigns, {} false discoveries; {:.1f} s per campaign\n",
             nulls.campaigns, nulls.found, seconds / std::max(1, campaigns));
}
