// How often the loop finds what is missing, on this library's own synthetic campaigns:
//   build/release/bench/discovery_study FILE KIND [CAMPAIGNS [FIRST_SEED [WITHOUT]]]
//   build/release/bench/discovery_study FILE...
//   build/release/bench/discovery_study --figure OUT_DIRECTORY FILE...
// KIND: `one` effect of random size, from about what a campaign can show to twenty times that; `none`; `two`
// at once; `forgotten`, one effect that the catalogue is told to forget. Every campaign adds a line to FILE;
// what the file has already is not run again. Of `two`, an effect that was missed is asked for again in the
// same campaign without the other one: was it too small to be seen there, or did the other one hide it? Of
// `forgotten`, one that passed unnoticed is asked for again by the whole catalogue: would anybody have seen
// it? WITHOUT: "ft", "mocap", "landing" or several of them, sensors that the campaigns do not have. Files
// alone: the tables over all their lines; with --figure, also the detection rate over the size, from the
// campaigns of `one` that have all sensors, as a figure with its data and script in the directory. One thread
// a campaign; several processes may share a file's seeds.
#include <fmt/core.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "bench/discovery_figure.hpp"
#include "bench/discovery_record.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace {

using namespace unhand;
using experiment::EffectSettings;

/// The parameters of one of the effects.
EffectSettings only(const EffectSettings& settings, const std::string& id) {
  EffectSettings out;
  for (const auto& setting : settings)
    if (id_of(setting.first) == id) out.insert(setting);
  return out;
}

experiment::CampaignDesign design_of(const StudyRecord& r) {
  auto design = experiment::random_campaign(r.seed);
  const auto has = [&](const char* sensor) { return r.without.find(sensor) == std::string::npos; };
  design.sensors.ft = has("ft"), design.sensors.mocap = has("mocap"), design.sensors.landing = has("landing");
  if (r.kind != "none") design.effects = experiment::random_effect(design, r.seed);
  for (std::uint64_t more = 1; r.kind == "two" && more < 20; ++more) {
    const auto second = experiment::random_effect(design, r.seed + 1'000'000 * more);
    if (id_of(second.begin()->first) == id_of(design.effects.begin()->first)) continue;
    design.effects.insert(second.begin(), second.end());
    break;
  }
  return design;
}

void run(StudyRecord& r) {
  const auto design = design_of(r);
  datasets::ThrowLog log;
  try {
    log = experiment::generate_campaign(design, r.seed);
  } catch (const std::runtime_error& error) {  // a grip that these effects do not let hold, say
    r.made = false, r.answer = error.what();
    return;
  }
  fitting::DiscoverOptions options;
  options.campaign.integrator.tolerances = {1e-5, 1e-8};
  options.fit.threads = 1;
  if (r.kind == "forgotten") options.forget = {id_of(design.effects.begin()->first)};
  const std::clock_t begin = std::clock();
  const auto found = fitting::discover(log, "synthetic", options);
  r.cpu_seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  r.judge(design.effects, found);
  options.forget.clear();
  for (Planted& effect : r.effects) {
    if ((r.kind != "two" && r.kind != "forgotten") || effect.right) continue;
    auto alone = design;
    alone.effects = only(design.effects, effect.id);
    effect.asked_again = true;
    effect.found_again = names(
        fitting::discover(experiment::generate_campaign(alone, r.seed), "synthetic", options), effect.id);
  }
}

void print(const StudyRecord& r) {
  fmt::print("{} {} {}: ", r.kind, r.seed, r.without);
  for (const auto& effect : r.effects) fmt::print("{} ({:.2f} steps) ", effect.id, effect.size);
  fmt::print("-> {} ({:.1f} s)\n", r.answer, r.cpu_seconds);
  std::fflush(stdout);
}

int study(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  const bool draws = !arguments.empty() && arguments[0] == "--figure";
  if (arguments.empty() || (draws && arguments.size() < 3)) {
    fmt::print(
        stderr,
        "usage: discovery_study FILE KIND [CAMPAIGNS [FIRST_SEED [WITHOUT]]] | [--figure OUT_DIRECTORY] "
        "FILE...\n");
    return 2;
  }
  std::filesystem::path out;
  if (draws) {
    out = arguments[1];
    arguments.erase(arguments.begin(), arguments.begin() + 2);
  }
  const auto argument = [&](std::size_t k, const char* otherwise) {
    return arguments.size() > k ? arguments[k] : std::string(otherwise);
  };
  const std::string& file = arguments[0];
  const std::string kind = argument(1, "");
  if (draws || (kind != "one" && kind != "none" && kind != "two" && kind != "forgotten")) {
    std::vector<StudyRecord> all;
    for (const auto& name : arguments)
      for (auto& r : read_records(name)) all.push_back(std::move(r));
    print_tables(all);
    if (draws) {
      std::filesystem::create_directories(out);
      apps::draw(detection_figure(all), out, "synthetic campaigns, bench/discovery_study");
      fmt::print("\n{}\n", (out / "detection.png").string());
    }
    return 0;
  }
  const auto campaigns = std::stoull(argument(2, "20")), first = std::stoull(argument(3, "1"));
  const std::string without = argument(4, "");
  for (auto seed = first; seed < first + campaigns; ++seed) {
    const auto known = read_records(file);
    if (std::any_of(known.begin(), known.end(), [&](const StudyRecord& r) {
          return r.kind == kind && r.seed == seed && r.without == without;
        }))
      continue;
    StudyRecord record;
    record.kind = kind, record.without = without, record.seed = seed;
    run(record);
    std::ofstream(file, std::ios::app) << record.line() + "\n";
    print(record);
  }
  print_tables(read_records(file));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return study(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "discovery_study: {}\n", error.what());
    return 1;
  }
}
