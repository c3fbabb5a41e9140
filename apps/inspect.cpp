// unhand inspect: what is in a log.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <memory>

#include "apps/command.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "apps/throws.hpp"
#include "datasets/slip_log.hpp"
#include "datasets/summary.hpp"
#include "dynamics/median.hpp"
#include "experiment/force_sensor.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/prepared_throw.hpp"
#include "experiment/time_check.hpp"
#include "experiment/unit_check.hpp"
#include "fitting/measured/rest_heights.hpp"

namespace unhand::apps {
namespace {

Json note_json(const experiment::LogNote& note) {
  return {{"path", note.path}, {"reason", note.said}, {"throws", note.throws}};
}

struct InspectOptions {
  std::string log;
  std::string json;
  bool json_wanted{};
  int threads{0};
};

struct Inspection {
  std::string text, json;
};

std::string range(double low, double high) {
  return low == high ? fmt::format("{:.4g}", low) : fmt::format("{:.4g} to {:.4g}", low, high);
}

Table groups_of(const datasets::LogSummary& summary) {
  Table table{{"group", "throws", "samples", "rate [Hz]", "lost", "longest gap / step", "in throw"}, {}, 1};
  for (const auto& g : summary.groups)
    table.rows.push_back({g.group, fmt::to_string(g.throws), fmt::to_string(g.rows),
                          range(g.lowest_rate, g.highest_rate), fmt::to_string(g.lost),
                          fmt::format("{:.3g}", g.worst_gap_ratio), g.worst_gap_throw});
  return table;
}

/// Whether a column scatters by more than it declares, although that is not told to be its noise.
bool is_unjudged(const datasets::NoiseSummary& noise, std::size_t column) {
  return noise.ratio[column] > datasets::NoiseSummary::kMore && !noise.too_small[column];
}

bool has_unjudged(const datasets::LogSummary& summary) {
  for (const auto& noise : summary.noise)
    for (std::size_t j = 0; j < noise.ratio.size(); ++j)
      if (is_unjudged(noise, j)) return true;
  return false;
}

/// Columns, units, declared noise and scatter of every dataset that the log holds.
Table datasets_of(const datasets::LogSummary& summary) {
  Table table{{"dataset", "columns", "units", "throws", "declared sigma", "scatter"}, {}, 6};
  for (const auto& noise : summary.noise) {
    std::string sigma;
    for (std::size_t j = 0; j < noise.lowest.size(); ++j)
      sigma += (j > 0 ? ", " : "") + range(noise.lowest[j], noise.highest[j]);
    if (noise.declared > 0 && noise.declared < noise.throws)
      sigma += fmt::format(" (in {} throws)", noise.declared);
    std::string scatter;
    for (std::size_t j = 0; j < noise.scatter.size(); ++j)
      scatter +=
          fmt::format("{}{:.3g}{}", j > 0 ? ", " : "", noise.scatter[j], is_unjudged(noise, j) ? "*" : "");
    table.rows.push_back({noise.dataset, noise.columns, noise.units, fmt::to_string(noise.throws),
                          sigma.empty() ? "-" : sigma, scatter.empty() ? "-" : scatter});
  }
  return table;
}

/// What the samples say against the declared noise, a line each.
std::string noise_doubts(const datasets::LogSummary& summary) {
  std::string out;
  for (const auto& noise : summary.noise) {
    if (const std::string columns = noise.understated(); !columns.empty())
      out += fmt::format(
          "declared too small: {}: its samples scatter from one to the next by more than the declared "
          "sigma ({})\n",
          noise.dataset, columns);
    if (noise.zero > 0)
      out += fmt::format(
          "note: {} declares a sigma of 0 in {}: {}\n", noise.dataset, plural(noise.zero, "throw"),
          noise.scatter.empty() ? "it is believed, as far as 0.01 mm, 0.1 mrad and 0.01 ms"
                                : "treated as undeclared, the noise is taken from the scatter");
  }
  return out;
}

/// What the log holds that the schema does not know, a line.
std::string ignored_text(const std::map<std::string, std::size_t>& ignored) {
  constexpr std::size_t kShown = 12;
  std::vector<std::string> names;
  for (const auto& [path, places] : ignored) {
    if (names.size() == kShown) break;
    names.push_back(printable(path) + (places > 1 ? fmt::format(" ({} times)", places) : ""));
  }
  if (names.empty()) return {};
  return fmt::format("ignored, since the schema does not know it: {}{}\n", fmt::join(names, ", "),
                     ignored.size() > kShown ? fmt::format(", and {} more", ignored.size() - kShown) : "");
}

/// What the log says of objects and gripper; null where it says nothing.
void add_declared(Json& json, const datasets::ThrowLog& log) {
  const auto json_of = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
  Json& objects = json["declared_objects"] = Json::object();
  for (const auto& [name, object] : log.objects)
    objects[name] = {{"mass_kg", object.mass},
                     {"inertia_kg_m2", json_of(object.inertia)},
                     {"com_offset_m", json_of(object.com_offset)},
                     {"dims_m", json_of(object.dims)},
                     {"surface", json_of(object.surface)},
                     {"sku", json_of(object.sku)},
                     {"drag_k_1_m", json_of(object.drag_k)}};
  json["gripper"] = nullptr;
  if (!log.gripper) return;
  std::optional<double> opening = log.gripper->opening_command_time;
  if (opening) *opening += log.clock_origin;
  json["gripper"] = {{"n_pads", log.gripper->n_pads},
                     {"pad_radius_m", json_of(log.gripper->pad_radius)},
                     {"opening_command_time_s", json_of(opening)}};
}

/// What the JSON of both kinds of logs begins with.
Json head_of(const std::string& file, const std::string& log_schema) {
  Json json = json_head("inspect");
  json["log"] = std::filesystem::path(file).filename().string();
  json["log_schema"] = log_schema;
  return json;
}

Inspection inspect_throws(const std::string& file) {
  const auto log = datasets::read_throw_log(file);
  const auto summary = datasets::summarise(log);
  Inspection out;
  out.text = fmt::format("{}: throw-log, dimension {}\n  title    {}\n  source   {}\n", file,
                         summary.dimension, printable(summary.title), printable(summary.source));
  if (!summary.licence.empty()) out.text += fmt::format("  licence  {}\n", printable(summary.licence));
  out.text += fmt::format("  gravity {:.6g} m/s^2 (declared), landing height {:.6g} m\n", summary.gravity,
                          summary.landing_height);
  for (const auto& [name, object] : log.objects) {
    out.text += fmt::format("  object {}: mass {} kg", name, object.mass);
    if (object.inertia)
      for (std::size_t j = 0; j < object.inertia->size(); ++j)
        out.text += fmt::format("{}{:.6g}{}", j == 0 ? ", inertia " : ", ", (*object.inertia)[j],
                                j + 1 == object.inertia->size() ? " kg m^2" : "");
    if (object.com_offset) out.text += fmt::format(", CoM offset {} m", *object.com_offset);
    if (object.drag_k) out.text += fmt::format(", drag {} 1/m", *object.drag_k);
    out.text += "\n";
  }
  if (log.gripper) {
    out.text += fmt::format("  gripper: {}", plural(static_cast<std::size_t>(log.gripper->n_pads), "pad"));
    if (log.gripper->pad_radius) out.text += fmt::format(", radius {} m", *log.gripper->pad_radius);
    if (log.gripper->opening_command_time)
      out.text +=
          fmt::format(", told to open at {} s", log.clock_origin + *log.gripper->opening_command_time);
    out.text += "\n";
  }
  const std::size_t landed = static_cast<std::size_t>(
      std::count_if(summary.each.begin(), summary.each.end(), [](const auto& t) { return t.landing; }));
  out.text +=
      fmt::format("  {} ({} train, {} test), {}, {} with a landing, {}\n\n", plural(summary.throws, "throw"),
                  summary.train, summary.test, plural(summary.conditions.size(), "condition"), landed,
                  plural(summary.free_flights, "free flight"));
  out.text += groups_of(summary).text() + "\n" + datasets_of(summary).text();
  if (has_unjudged(summary))
    out.text +=
        "*: more than is declared, but mostly motion (or of too few samples): no measure of the noise\n";
  out.text += "\nno schema errors; times in s, values in SI units and radians as read\n";
  out.text += noise_doubts(summary);
  if (const int n = log.dimension == 2 ? experiment::landings_without_sigma(log) : 0; n > 0)
    out.text += fmt::format("note: {}\n", experiment::in_words(experiment::landing_noise(log), n));
  if (const auto n = std::count_if(log.throws.begin(), log.throws.end(),
                                   [&](const auto& one) { return !experiment::shows_grasp(log, one); }))
    out.text += fmt::format(
        "note: {} of {} throws do not show the grasp (no motion capture before the gripper opens, no "
        "grasp_angle): a release cannot be predicted from them\n",
        n, log.throws.size());
  if (const auto n = std::count_if(log.throws.begin(), log.throws.end(),
                                   [&](const auto& one) { return !datasets::held_by(log, one).empty(); }))
    out.text += fmt::format(
        "note: {} of {} throws have no hand and are held at first, and no free_flight says from when on they "
        "fly: neither a release nor a flight can be predicted from them\n",
        n, log.throws.size());
  const auto ignored = datasets::ignored_names(file);
  out.text += ignored_text(ignored);
  Json json = head_of(file, "throw-log");
  json.update(Json::parse(datasets::to_json(summary)));
  json["ignored"] = Json::array();
  for (const auto& [path, places] : ignored) json["ignored"].push_back({{"path", path}, {"places", places}});
  add_declared(json, log);
  json["impossible_times"] = Json::array();
  for (const auto& note : experiment::impossible_times(log)) {
    out.text += fmt::format("note: {}\n", note.in_words(log.throws.size()));
    json["impossible_times"].push_back(note_json(note));
  }
  if (const auto rests = fitting::rests_on_faces(log); rests.is_doubtful())
    out.text += fmt::format("note: {}\n", rests.in_words());
  const auto openings = experiment::force_openings(log);
  json["force_notes"] = Json::array();
  for (const auto& note : experiment::force_notes(log, openings)) {
    out.text += fmt::format("note: {}\n", note.in_words(log.throws.size()));
    json["force_notes"].push_back(note_json(note));
  }
  const auto untared = experiment::untared_force(openings);
  if (untared) out.text += fmt::format("note: {}\n", untared->in_words());
  json["untared_normal_force_N"] = untared ? Json(untared->level) : Json(nullptr);
  json["doubtful"] = Json::array();
  for (const auto& doubt : experiment::unit_doubts(log)) {
    out.text += fmt::format("doubtful: {}: {}\n", doubt.path, doubt.reason);
    json["doubtful"].push_back({{"path", doubt.path}, {"reason", doubt.reason}});
  }
  out.json = json_text(json);
  return out;
}

Inspection inspect_slips(const std::string& file) {
  const auto log = datasets::read_slip_log(file);
  Inspection out;
  Json json = head_of(file, "slip-log");
  Json& surfaces = json["surfaces"] = Json::object();
  Table table{
      {"surface", "mass [kg]", "length [m]", "slips", "train", "test", "samples", "rate [Hz]"}, {}, 1};
  std::string descriptions, doubts;
  for (const auto& [name, surface] : log.surfaces) {
    std::size_t train = 0, samples = 0;
    std::vector<double> steps;
    for (const auto& slip : surface.slips) {
      train += slip.split == datasets::Split::train;
      samples += slip.time.rows;
      for (std::size_t i = 1; i < slip.time.rows; ++i) steps.push_back(slip.time(i) - slip.time(i - 1));
    }
    const double rate = steps.empty() ? 0 : 1 / dynamics::median(steps);
    const std::size_t test = surface.slips.size() - train;
    surfaces[name] = {{"mass_kg", surface.mass},
                      {"characteristic_length_m", surface.characteristic_length},
                      {"description", surface.description},
                      {"licence", surface.licence.value_or("")},
                      {"slips", surface.slips.size()},
                      {"train", train},
                      {"test", test},
                      {"samples", samples},
                      {"rate_hz", rate}};
    table.rows.push_back({name, fmt::format("{}", surface.mass),
                          fmt::format("{}", surface.characteristic_length),
                          fmt::to_string(surface.slips.size()), fmt::to_string(train), fmt::to_string(test),
                          fmt::to_string(samples), fmt::format("{:.4g}", rate)});
    descriptions += fmt::format("  {}: {}\n", name, surface.description);
    if (const double share = datasets::dissipation(surface); share < 0)
      doubts += fmt::format("doubtful: /surfaces/{}: {}\n", name, sign_doubt(share));
  }
  out.json = json_text(json);
  out.text =
      fmt::format("{}: slip-log, {}\n{}\n{}\nno schema errors; wrench N, N, N m; twist m/s, m/s, rad/s\n",
                  file, plural(log.surfaces.size(), "surface"), descriptions, table.text()) +
      doubts;
  return out;
}

void inspect(InspectOptions options) {
  if (options.json == "-") options.json.clear();  // the standard output, as without a name
  require_outputs({{options.json}}, {options.log});
  const Inspection seen = datasets::read_schema_name(options.log) == "slip-log" ? inspect_slips(options.log)
                                                                                : inspect_throws(options.log);
  if (options.json_wanted && options.json.empty()) {
    fmt::print("{}", seen.json);
    return;
  }
  if (!options.json.empty()) {
    Outputs outputs{{options.log}};
    outputs.text(options.json, seen.json);
    outputs.commit();
  }
  fmt::print("{}", seen.text);
}

}  // namespace

Command inspect_command(Parser& root) {
  auto options = std::make_shared<InspectOptions>();
  Parser& parser =
      root.subcommand("inspect", "Show what is in a log: units, rates, gaps, noise, schema errors");
  parser.option("LOG", options->log, "A throw log or slip log").required();
  const Option json = parser
                          .option("--json", options->json,
                                  "Write it as JSON; without a file name, JSON on stdout (then after LOG)")
                          .expected(0, 1);
  add_one_thread(parser, options->threads);
  parser.footer("Examples:\n  unhand inspect campaign.h5\n  unhand inspect campaign.h5 --json campaign.json");
  return {&parser, [options, json] {
            options->json_wanted = json.given();
            inspect(*options);
          }};
}

}  // namespace unhand::apps
