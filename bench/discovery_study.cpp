// How often the loop finds what is missing, on this library's own synthetic campaigns:
//   build/release/bench/discovery_study KIND [CAMPAIGNS [FIRST_SEED [WITHOUT]]]
// KIND: `one` effect of random size, from about what a campaign can show to twenty times that; `none`; `two`
// at once; `forgotten`, one effect that the catalogue is told to forget. One line per campaign, then tables:
// the detection rate by effect and size (in typical steps of its parameter), how many sizes came back within
// their intervals, and false discoveries. Of `two`, an effect that was missed is asked for again in the same
// campaign without the other one: was it too small to be seen there, or did the other one hide it? WITHOUT:
// "ft", "mocap", "landing" or several of them, sensors that the campaigns do not have.
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
using experiment::EffectSettings;

struct Tally {
  int campaigns{}, right{};
  void add(bool ok) { campaigns += 1, right += ok ? 1 : 0; }
  std::string text() const { return campaigns ? fmt::format("{}/{}", right, campaigns) : ""; }
};

std::string id_of(const std::string& setting) { return setting.substr(0, setting.rfind('.')); }

/// The largest parameter of an effect, in typical steps from neutral.
double size_of(const EffectSettings& settings, const std::string& id) {
  double out = 0;
  for (const auto& [name, value] : settings)
    if (const auto* p = experiment::find_parameter(experiment::without_object(name));
        p && !p->is_shape() && id_of(name) == id)
      out = std::max(out, std::abs(value - p->neutral) / p->typical);
  return out;
}

bool names(const fitting::Discovery& found, const std::string& id) {
  return std::any_of(found.effects.begin(), found.effects.end(), [&](const auto& effect) {
    return effect.id == id || std::any_of(effect.equivalent.begin(), effect.equivalent.end(),
                                          [&](const auto& e) { return e.first == id; });
  });
}

/// Campaigns in which what was named is there.
bool nothing_false(const fitting::Discovery& found, const EffectSettings& settings) {
  return std::all_of(found.effects.begin(), found.effects.end(), [&](const auto& effect) {
    return std::any_of(settings.begin(), settings.end(), [&](const auto& setting) {
      const std::string id = id_of(setting.first);
      return effect.id == id || std::any_of(effect.equivalent.begin(), effect.equivalent.end(),
                                            [&](const auto& e) { return e.first == id; });
    });
  });
}

/// The phase in which a forgotten effect first shows.
bool right_phase(const std::string& id, fitting::Phase phase) {
  using fitting::Phase;
  if (id.starts_with("flight.") && id != "flight.gravity_tilt")
    return phase == Phase::flight || phase == Phase::landing;
  if (id.starts_with("contact.")) return phase == Phase::release || phase == Phase::grasped;
  return true;
}

std::string answer_of(const fitting::Discovery& found) {
  std::string out = to_string(found.verdict);
  for (const auto& effect : found.effects) {
    out += fmt::format(" {} ({})", effect.id, effect.why);
    for (const auto& [id, correlation] : effect.equivalent) out += " = " + id;
  }
  if (found.unexplained)
    out +=
        fmt::format(" unexplained {} in {} ({:.3g} times the noise)", to_string(found.unexplained->channel),
                    to_string(found.unexplained->phase), found.unexplained->chi2_per_dof);
  return out;
}

/// The parameters of one of the effects.
EffectSettings only(const EffectSettings& settings, const std::string& id) {
  EffectSettings out;
  for (const auto& setting : settings)
    if (id_of(setting.first) == id) out.insert(setting);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string kind = argc > 1 ? argv[1] : "one";
  const int campaigns = argc > 2 ? std::atoi(argv[2]) : 20;
  const auto first = static_cast<std::uint64_t>(argc > 3 ? std::atoll(argv[3]) : 1);
  const std::string without = argc > 4 ? argv[4] : "";
  constexpr const char* kSizes[] = {"below 1", "1 to 3", "3 to 10", "above 10"};
  std::map<std::string, std::map<std::string, Tally>> by_effect;
  Tally all, nothing_wrong, within_95, within_3_sigma, missed_alone;
  double seconds = 0, longest = 0;
  for (int k = 0; k < campaigns; ++k) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(k);
    auto design = experiment::random_campaign(seed);
    design.sensors.ft = without.find("ft") == std::string::npos;
    design.sensors.mocap = without.find("mocap") == std::string::npos;
    design.sensors.landing = without.find("landing") == std::string::npos;
    if (kind != "none") design.effects = experiment::random_effect(design, seed);
    for (std::uint64_t more = 1; kind == "two" && more < 20; ++more) {
      const auto second = experiment::random_effect(design, seed + 1'000'000 * more);
      if (id_of(second.begin()->first) == id_of(design.effects.begin()->first)) continue;
      design.effects.insert(second.begin(), second.end());
      break;
    }
    datasets::ThrowLog log;
    try {
      log = experiment::generate_campaign(design, seed);
    } catch (const std::runtime_error& error) {  // a grip that these effects do not let hold, say
      fmt::print("seed {}: {}\n", seed, error.what());
      continue;
    }
    fitting::DiscoverOptions options;
    options.campaign.integrator.tolerances = {1e-5, 1e-8};
    if (kind == "forgotten") options.forget = {id_of(design.effects.begin()->first)};
    const auto found = fitting::discover(log, "synthetic", options);
    seconds += found.seconds, longest = std::max(longest, found.seconds);
    std::map<std::string, double> sizes;
    for (const auto& [name, value] : design.effects)
      sizes[id_of(name)] = size_of(design.effects, id_of(name));
    std::string truth;
    for (const auto& [id, size] : sizes) truth += fmt::format("{} ({:.2f} steps) ", id, size);
    fmt::print("seed {}: {}-> {}\n", seed, truth, answer_of(found));
    std::fflush(stdout);
    nothing_wrong.add(nothing_false(found, design.effects));
    for (const auto& [id, size] : sizes) {
      const bool ok = kind == "forgotten" ? found.unexplained && right_phase(id, found.unexplained->phase)
                                          : names(found, id);
      by_effect[id][kSizes[size < 1 ? 0 : size < 3 ? 1 : size < 10 ? 2 : 3]].add(ok);
      all.add(ok);
      if (kind != "two" || ok) continue;
      auto alone = design;
      alone.effects = only(design.effects, id);
      const auto again = fitting::discover(experiment::generate_campaign(alone, seed), "synthetic", options);
      fmt::print("  {} alone -> {}\n", id, answer_of(again));
      missed_alone.add(!names(again, id));
    }
    for (const auto& effect : found.effects)
      for (const auto& p : effect.parameters) {
        const auto setting = design.effects.find(effect.id + "." + p.name);
        const auto* known = experiment::find_parameter(experiment::without_object(effect.id + "." + p.name));
        if (setting == design.effects.end() || !known || known->is_shape()) continue;
        const double off = std::abs(p.value - setting->second);
        within_95.add(off <= 1.96 * p.sigma), within_3_sigma.add(off <= 3 * p.sigma);
      }
  }
  if (!by_effect.empty()) {
    fmt::print("\n| {} |",
               kind == "forgotten" ? "effect, forgotten: unexplained in its phase" : "effect: found");
    for (const char* size : kSizes) fmt::print(" {} |", size);
    fmt::print("\n| --- | ---: | ---: | ---: | ---: |\n");
    for (auto& [id, of] : by_effect) {
      fmt::print("| {} |", id);
      for (const char* size : kSizes) fmt::print(" {} |", of[size].text());
      fmt::print("\n");
    }
    fmt::print("\nall together {}; ", all.text());
    if (missed_alone.campaigns > 0)
      fmt::print("of those that were missed, missed alone, too {}; ", missed_alone.text());
  }
  fmt::print(
      "campaigns without a false name {}; sizes within 95 % {}, within 3 sigma {}; {:.1f} s per campaign, "
      "longest {:.1f} s\n",
      nothing_wrong.text(), within_95.text(), within_3_sigma.text(), seconds / std::max(1, campaigns),
      longest);
}
