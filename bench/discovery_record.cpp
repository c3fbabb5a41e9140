#include "discovery_record.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

namespace unhand {

using experiment::EffectSettings;
using nlohmann::json;

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Planted, id, size, right, asked_again, found_again, evident)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Estimated, name, truth, value, sigma)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StudyRecord, kind, without, seed, answer, made, false_name, unexplained,
                                   effects, estimates, cpu_seconds, seconds)

namespace {

/// The largest parameter of an effect, in typical steps from neutral.
double size_of(const EffectSettings& settings, const std::string& id) {
  double out = 0;
  for (const auto& [name, value] : settings)
    if (const auto* p = experiment::find_parameter(experiment::without_object(name));
        p && !p->is_shape() && id_of(name) == id)
      out = std::max(out, std::abs(value - p->neutral) / p->typical);
  return out;
}

bool names(const fitting::AcceptedEffect& effect, const std::string& id) {
  return effect.id == id || std::any_of(effect.equivalent.begin(), effect.equivalent.end(),
                                        [&](const auto& e) { return e.first == id; });
}

/// The phase in which a forgotten effect first shows.
bool right_phase(const std::string& id, fitting::Phase phase) {
  using fitting::Phase;
  if (id.starts_with("flight.") && id != "flight.gravity_tilt")
    return phase == Phase::flight || phase == Phase::landing;
  if (id.starts_with("contact.")) return phase == Phase::release || phase == Phase::grasped;
  return true;
}

struct Tally {
  int campaigns{}, right{};
  void add(bool ok) { campaigns += 1, right += ok ? 1 : 0; }
  std::string text() const { return campaigns ? fmt::format("{}/{}", right, campaigns) : ""; }
};

constexpr std::array<const char*, 4> kSizes{"below 1", "1 to 3", "3 to 10", "above 10"};
std::size_t size_class(double steps) { return steps < 1 ? 0 : steps < 3 ? 1 : steps < 10 ? 2 : 3; }

void print_table(const std::string& kind, const std::vector<StudyRecord>& records) {
  std::map<std::string, std::array<Tally, kSizes.size()>> by_effect;
  std::array<Tally, kSizes.size()> by_size;
  Tally all, nothing_false, silent, within_95, within_3_sigma, found_again, evident;
  int not_made = 0;
  std::vector<double> cpu;
  for (const auto& r : records) {
    if (!r.made) {
      ++not_made;
      continue;
    }
    nothing_false.add(!r.false_name);
    silent.add(!r.false_name && !r.unexplained);
    cpu.push_back(r.cpu_seconds);
    for (const auto& effect : r.effects) {
      by_effect[effect.id][size_class(effect.size)].add(effect.right);
      by_size[size_class(effect.size)].add(effect.right);
      all.add(effect.right);
      if (kind == "one" && !effect.right) evident.add(effect.evident);
      if (effect.asked_again) found_again.add(effect.found_again);
    }
    for (const auto& e : r.estimates) {
      const double off = std::abs(e.value - e.truth);
      within_95.add(off <= 1.96 * e.sigma), within_3_sigma.add(off <= 3 * e.sigma);
    }
  }
  if (cpu.empty()) return;
  std::sort(cpu.begin(), cpu.end());
  if (all.campaigns > 0) {
    fmt::print("\n| {} |",
               kind == "forgotten" ? "effect, forgotten: unexplained in its phase" : "effect: found");
    for (const char* size : kSizes) fmt::print(" {} |", size);
    fmt::print("\n| --- | ---: | ---: | ---: | ---: |\n");
    by_effect["all together"] = by_size;
    for (const auto& [id, of] : by_effect) {
      fmt::print("| {} |", id);
      for (const Tally& tally : of) fmt::print(" {} |", tally.text());
      fmt::print("\n");
    }
    fmt::print("\nfound {}; ", all.text());
  }
  if (evident.campaigns > 0)
    fmt::print("of those that were missed, called evident but too small to matter {}; ", evident.text());
  if (found_again.campaigns > 0)
    fmt::print("of those that were missed, found {} {}; ",
               kind == "forgotten" ? "where the catalogue has them" : "alone", found_again.text());
  fmt::print("campaigns without a false name {}", nothing_false.text());
  if (kind == "none") fmt::print(", and with nothing called unexplained {}", silent.text());
  if (within_95.campaigns > 0)
    fmt::print("; sizes within 95 % {}, within 3 sigma {}", within_95.text(), within_3_sigma.text());
  fmt::print("; CPU time of a campaign {:.1f} s in the median, {:.1f} s at most", cpu[cpu.size() / 2],
             cpu.back());
  if (not_made > 0) fmt::print("; {} campaigns could not be made", not_made);
  fmt::print("\n");
}

}  // namespace

bool names(const fitting::Discovery& found, const std::string& id) {
  return std::any_of(found.effects.begin(), found.effects.end(),
                     [&](const auto& effect) { return names(effect, id); });
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

void StudyRecord::judge(const EffectSettings& truth, const fitting::Discovery& found) {
  answer = answer_of(found);
  unexplained = found.unexplained.has_value();
  seconds = found.seconds;
  std::map<std::string, double> sizes;
  for (const auto& setting : truth) sizes[id_of(setting.first)] = size_of(truth, id_of(setting.first));
  for (const auto& [id, size] : sizes) {
    const bool right = kind == "forgotten" ? found.unexplained && right_phase(id, found.unexplained->phase)
                                           : names(found, id);
    effects.push_back({id, size, right, false, false, !right && found.small && found.small->id == id});
  }
  for (const auto& effect : found.effects) {
    false_name = false_name || std::none_of(sizes.begin(), sizes.end(),
                                            [&](const auto& s) { return names(effect, s.first); });
    for (const auto& p : effect.parameters) {
      const std::string name = effect.id + "." + p.name;
      const auto setting = truth.find(name);
      const auto* known = experiment::find_parameter(experiment::without_object(name));
      if (setting == truth.end() || !known || known->is_shape()) continue;
      estimates.push_back({name, setting->second, p.value, p.sigma});
    }
  }
}

std::string StudyRecord::line() const { return json(*this).dump(); }

StudyRecord StudyRecord::parse(const std::string& line) { return json::parse(line).get<StudyRecord>(); }

std::vector<StudyRecord> read_records(const std::string& file) {
  std::vector<StudyRecord> out;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);)
    if (!line.empty()) out.push_back(StudyRecord::parse(line));
  return out;
}

void print_tables(const std::vector<StudyRecord>& records) {
  std::map<std::pair<std::string, std::string>, std::vector<StudyRecord>> groups;
  for (const auto& r : records) groups[{r.kind, r.without}].push_back(r);
  for (const auto& [of, group] : groups) {
    fmt::print("\n{}{}: {} campaigns\n", of.first, of.second.empty() ? "" : " without " + of.second,
               group.size());
    print_table(of.first, group);
  }
}

}  // namespace unhand
