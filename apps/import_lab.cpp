#include "apps/import_lab.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <span>
#include <stdexcept>

#include "apps/command.hpp"
#include "apps/lab_files.hpp"
#include "apps/throws.hpp"
#include "datasets/assemble.hpp"
#include "datasets/import_phyphox.hpp"
#include "datasets/sku.hpp"

namespace unhand::apps {
namespace {

using datasets::Throw;
using datasets::ThrowLog;

bool given(const LabOptions& options, const char* name) { return options.parser->given(name); }

constexpr const char* new_log_options[] = {"--title",     "--source",       "--licence",
                                           "--gravity",   "--pads",         "--pad-radius",
                                           "--dimension", "--opening-time", "--landing-height"};
constexpr const char* new_throws_options[] = {"--sku",       "--mass",       "--object",
                                              "--condition", "--test-every", "--test-conditions"};

/// Whether the files are throws that a log does not have: of a new log, or of another object of one.
bool brings_throws(const LabOptions& options) {
  return options.into.empty() || given(options, "--sku") || given(options, "--mass");
}

/// The options that are for some of these formats only.
struct Rule {
  const char* option;
  std::vector<std::string_view> formats;
};
const std::vector<Rule>& rules() {
  static const std::vector<Rule> list = {
      {"--columns", {"hand-csv", "ft-csv", "mocap-csv"}},
      {"--units", {"hand-csv", "ft-csv", "mocap-csv"}},
      {"--sigma", {"hand-csv", "ft-csv", "mocap-csv", "motive-csv"}},
      {"--time-offset", {"hand-csv", "ft-csv", "mocap-csv", "motive-csv"}},
      {"--into", {"hand-csv", "ft-csv", "mocap-csv", "motive-csv"}},
      {"--replace", {"hand-csv", "ft-csv", "mocap-csv", "motive-csv"}},
      {"--throw", {"hand-csv", "ft-csv", "mocap-csv", "motive-csv", "phyphox"}},
      {"--body", {"motive-csv"}},
      {"--dimension", {"motive-csv"}},
      {"--heading", {"motive-csv"}},
      {"--trust-heading", {"motive-csv"}},
      {"--origin", {"motive-csv"}},
      {"--com", {"motive-csv"}},
      {"--landing", {"mocap-csv", "motive-csv"}},
      {"--free-flight", {"mocap-csv", "motive-csv"}},
      {"--min-fall", {"phyphox"}},
      {"--fall-threshold", {"phyphox"}}};
  return list;
}

void refuse_others(const std::string& format, const LabOptions& options) {
  for (const Rule& rule : rules())
    if (given(options, rule.option) &&
        std::find(rule.formats.begin(), rule.formats.end(), format) == rule.formats.end())
      throw WrongUsage(fmt::format("{} is not for {}", rule.option, format));
}

/// Only those that `format` takes may be given, and those of a new log not with a log to add to.
void require_options(const std::string& format, const LabOptions& options) {
  refuse_others(format, options);
  if (brings_throws(options)) {
    if (given(options, "--replace")) throw WrongUsage("--replace goes with --into, and without a new object");
    if (given(options, "--sku") == given(options, "--mass"))
      throw WrongUsage(
          "new throws need one object: --sku FILE or --mass KG (or --into LOG alone, to add to a log's "
          "throws)");
  }
  if (options.into.empty()) return;
  for (const char* name : new_log_options)
    if (given(options, name)) throw WrongUsage(fmt::format("{} is for a new log, not for --into", name));
  for (const char* name : new_throws_options)
    if (given(options, name) && !brings_throws(options))
      throw WrongUsage(
          fmt::format("{} is for throws that {} does not have: of an object that --sku or --mass names", name,
                      options.into));
}

const std::string kUntitled = "imported from ";

/// The name and the declarations of the object that --sku or --mass is about.
std::pair<std::string, datasets::Object> new_object(const std::string& format, const LabOptions& options,
                                                    int dimension) {
  datasets::Object object;
  std::string name = format == "phyphox" ? "phone" : "object";
  if (options.sku.empty()) {
    object.mass = options.mass;
  } else {
    const datasets::Sku sku = read_possible_sku(options.sku);
    object = datasets::to_object(sku, dimension);
    name = sku.name;
  }
  return {options.object.empty() ? name : options.object, object};
}

/// Adds the object, which may be there already as it is. Throws datasets::LogError where it is another one.
void add_object(ThrowLog& log, const std::pair<std::string, datasets::Object>& object,
                const std::string& log_file) {
  const auto [at, is_new] = log.objects.insert(object);
  if (!is_new && !(at->second == object.second))
    throw datasets::LogError(log_file, "/objects/" + object.first,
                             "is there already with other declarations: --object gives the new one a name");
}

ThrowLog new_log(const std::string& format, const LabOptions& options, const std::string& source) {
  ThrowLog log;
  log.dimension = format == "phyphox" ? 3 : format == "motive-csv" ? options.dimension : 2;
  log.title = options.title.empty() ? kUntitled + format : options.title;
  log.source = options.source.empty() ? source : options.source;
  if (!options.licence.empty()) log.licence = options.licence;
  log.gravity = options.gravity;
  log.landing_height = options.landing_height;
  if (given(options, "--pads") || given(options, "--pad-radius") || given(options, "--opening-time")) {
    datasets::Gripper& gripper = log.gripper.emplace();
    gripper.n_pads = options.pads;
    if (given(options, "--pad-radius")) gripper.pad_radius = options.pad_radius;
    if (given(options, "--opening-time")) gripper.opening_command_time = options.opening_time;
  }
  return log;
}

std::vector<std::string> phone_files(const std::vector<std::string>& named) {
  const std::vector<std::filesystem::path> paths(named.begin(), named.end());
  std::vector<std::string> out;
  for (const auto& file : datasets::phyphox_files(paths)) out.push_back(file.string());
  return out;
}

std::string source_of(const std::string& format, std::size_t files, const char* kind = "measured: ") {
  return fmt::format(
      "{}{} file{} imported by unhand import {}{}", kind, files, files == 1 ? "" : "s", format,
      format == "phyphox" ? "; sigma estimated by the importer from the scatter in the falls" : "");
}

/// What to say of a new log whose throws are all of one split.
std::string one_sided(const std::string& out, const ThrowLog& log, std::ptrdiff_t train,
                      const LabOptions& options) {
  if (train == 0)
    return fmt::format(
        "{}: all throws are held out: fit and discover need train throws (--test-every, --test-conditions)",
        out);
  std::map<std::string, int> conditions;
  int most = 0;
  for (const Throw& one : log.throws) most = std::max(most, ++conditions[one.condition]);
  const std::string why = options.test_every == 0
                              ? std::string()
                              : fmt::format(
                                    ": --test-every {} holds out one in {} throws of a condition, and no "
                                    "condition has more than {} throw{}",
                                    options.test_every, options.test_every, most, most == 1 ? "" : "s");
  return fmt::format(
      "{}: no throw is held out{}; errors on unseen throws, and discover, need some: {}more throws", out, why,
      most > 1                ? fmt::format("--test-every {}, or ", most)
      : conditions.size() > 1 ? "--test-conditions NAME, or "
                              : "");
}

}  // namespace

void refuse_lab_options(const std::string& format, const LabOptions& options) {
  refuse_others(format, options);
  for (const std::span<const char* const> names :
       {std::span<const char* const>(new_log_options), {new_throws_options}})
    for (const char* name : names)
      if (given(options, name)) throw WrongUsage(fmt::format("{} is not for {}", name, format));
}

Imported import_lab(const std::string& format, const std::vector<std::string>& named, const std::string& out,
                    const LabOptions& options, Outputs& outputs) {
  require_options(format, options);
  const std::vector<std::string> inputs = format == "phyphox" ? phone_files(named) : named;
  for (const char* single : {"--throw", "--free-flight"})
    if (inputs.size() != 1 && given(options, single))
      throw WrongUsage(fmt::format("{} goes with one input, not {}", single, inputs.size()));
  if (!options.free_flight.empty() && !(options.free_flight[0] < options.free_flight[1]))
    throw WrongUsage(
        fmt::format("--free-flight: {} is not before {}", options.free_flight[0], options.free_flight[1]));
  const bool adding = !options.into.empty(), bringing = brings_throws(options);
  ThrowLog log = adding ? datasets::read_throw_log(options.into)
                        : new_log(format, options, source_of(format, inputs.size()));
  ThrowLog brought;  // its throws are split among themselves, whatever the log has
  std::string object;
  if (bringing) {
    const auto entry = new_object(format, options, log.dimension);
    add_object(log, entry, options.into);
    object = entry.first;
  }
  Imported imported;
  imported.details["files"] = Json::array();
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const std::string& file = inputs[k];
    Reading reading = read_lab_file(format, file, log, options);
    const datasets::ThrowName name = datasets::name_of(file);
    const std::string id = options.throw_id.empty() ? name.id : options.throw_id;
    for (std::size_t j = 0; j < reading.throws.size(); ++j) {
      Throw& one = reading.throws[j];
      if (adding) datasets::move_clock(one, log.clock_origin);
      if (!bringing) {
        fill_throw(log, id, std::move(one), options.replace, options.into);
        continue;
      }
      one.id = reading.throws.size() == 1 ? id : fmt::format("{}-{}", id, j + 1);
      one.object = object;
      one.condition = options.condition.empty() ? name.condition : options.condition;
      one.repetition = name.repetition;
      if (adding) datasets::require_new(log, one.id, file);
      add_throw(brought, std::move(one), file);
    }
    imported.text +=
        fmt::format("  {}: {}{}\n", file, adding ? fmt::format("throw {}, ", id) : "", reading.text);
    imported.notes.insert(imported.notes.end(), reading.notes.begin(), reading.notes.end());
    reading.details["file"] = file;
    imported.details["files"].push_back(reading.details);
  }
  if (log.throws.empty() && brought.throws.empty()) {
    std::string why = "holds no free fall";
    for (const Json& dropped : imported.details["files"].front().value("dropped", Json::array()))
      why += fmt::format("; {:.3f} s: {}", dropped["begin_s"].get<double>(),
                         dropped["reason"].get<std::string>());
    throw datasets::ImportError(inputs.front(), "line 1",
                                why + (inputs.size() > 1 ? "; nor do the other inputs" : ""));
  }
  try {
    if (bringing) split_throws(brought, {options.test_every, options.test_conditions});
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--test-every, --test-conditions: {}", error.what()));
  }
  log.throws.insert(log.throws.end(), std::make_move_iterator(brought.throws.begin()),
                    std::make_move_iterator(brought.throws.end()));
  if (adding) {
    // --source is for new logs; of one that says something else than "measured" the files may be of that,
    // too.
    const std::string added =
        source_of(format, inputs.size(), log.source.starts_with("measured") ? "measured: " : "");
    if (log.source.find(added) == std::string::npos) log.source += "; " + added;
    if (log.title.starts_with(kUntitled) && log.title.find(format) == std::string::npos)
      log.title += ", " + format;
  }
  datasets::validate(log, out);
  if (adding) {
    for (const std::string& path : outputs.log(out, log, options.into))
      imported.notes.push_back(
          fmt::format("{}: {}: not in {}: it refers to other objects of its file", options.into, path, out));
  } else {
    outputs.log(out, log);
  }
  const auto train = std::count_if(log.throws.begin(), log.throws.end(),
                                   [](const Throw& one) { return one.split == datasets::Split::train; });
  const auto test = static_cast<std::ptrdiff_t>(log.throws.size()) - train;
  imported.text = fmt::format("{}: {} throw{} ({} train, {} test)\n{}", out, log.throws.size(),
                              log.throws.size() == 1 ? "" : "s", train, test, imported.text);
  imported.details["throws"] = log.throws.size();
  imported.details["train"] = train;
  imported.details["test"] = test;
  if (!adding && (test == 0 || train == 0)) imported.notes.push_back(one_sided(out, log, train, options));
  return imported;
}

}  // namespace unhand::apps
