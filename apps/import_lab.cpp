#include "apps/import_lab.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <span>
#include <stdexcept>

#include "apps/command.hpp"
#include "apps/throws.hpp"
#include "datasets/assemble.hpp"
#include "datasets/import_columns.hpp"
#include "datasets/import_motive.hpp"
#include "datasets/import_phyphox.hpp"
#include "datasets/sku.hpp"

namespace unhand::apps {
namespace {

using datasets::Throw;
using datasets::ThrowLog;

/// What one file gave: throws without names, and a line to say of it.
struct Reading {
  std::vector<Throw> throws;
  std::string text;
  Json details;
  std::vector<std::string> notes;
};

bool given(const LabOptions& options, const char* name) { return options.parser->given(name); }

/// "a=b,c=d"; a part without '=' belongs to the value before it, so that values may hold commas.
std::map<std::string, std::string> parse_pairs(const char* option, const std::string& text) {
  std::map<std::string, std::string> out;
  std::string* last = nullptr;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, comma - begin);
    const std::size_t equals = part.find('=');
    begin = comma + 1;
    if (equals == std::string::npos && last != nullptr) {
      *last += "," + part;
      continue;
    }
    if (equals == std::string::npos || equals == 0 || equals + 1 == part.size())
      throw WrongUsage(fmt::format("{}: '{}' is not NAME=VALUE", option, part));
    const std::string name = part.substr(0, equals);
    if (out.contains(name)) throw WrongUsage(fmt::format("{}: '{}' is given twice", option, name));
    last = &(out[name] = part.substr(equals + 1));
  }
  return out;
}

std::map<std::string, double> parse_numbers(const char* option, const std::string& text) {
  std::map<std::string, double> out;
  for (const auto& [name, value] : parse_pairs(option, text)) {
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), out[name]);
    if (error != std::errc{} || end != value.data() + value.size() || !std::isfinite(out[name]))
      throw WrongUsage(fmt::format("{}: '{}' of {} is not a finite number", option, value, name));
  }
  return out;
}

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
          "a new log needs its object: --sku FILE or --mass KG (or --into LOG, to add to a log)");
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

/// What the options ask for beside the track itself: the landing, the free flight.
void take_from_track(const ThrowLog& log, const LabOptions& options, Throw& one, Reading& out) {
  if (options.landing) {
    one.landing = datasets::landing_of(*one.mocap, log.dimension, log.landing_height);
    out.text += one.landing ? fmt::format(", lands at {:.4f} s", one.landing->time(0))
                            : fmt::format(", no landing: the track does not pass {} m", log.landing_height);
    out.details["landing"] = one.landing.has_value();
  }
  if (!options.free_flight.empty()) one.free_flight = {options.free_flight[0], options.free_flight[1]};
}

Reading read_columns(const std::string& format, const std::string& file, const ThrowLog& log,
                     const LabOptions& options) {
  datasets::ColumnMap map{parse_pairs("--columns", options.columns), parse_pairs("--units", options.units),
                          parse_numbers("--sigma", options.sigma), options.time_offset};
  using datasets::TableKind;
  const TableKind kind = format == "hand-csv" ? TableKind::hand
                         : format == "ft-csv" ? TableKind::ft
                                              : TableKind::mocap;
  const std::string fault = fault_of(map, kind);
  if (!fault.empty()) throw WrongUsage("--" + fault);
  Reading out;
  Throw& one = out.throws.emplace_back();
  if (format == "hand-csv")
    one.hand = datasets::read_hand_csv(file, map);
  else if (format == "ft-csv")
    one.ft = datasets::read_ft_csv(file, map);
  else
    one.mocap = datasets::read_mocap_csv(file, map);
  const datasets::Series& time = one.hand ? one.hand->time : one.ft ? one.ft->time : one.mocap->time;
  out.text = fmt::format("{} samples, {:.6g} to {:.6g} s", time.rows, time.data.front(), time.data.back());
  out.details = {{"samples", time.rows}};
  if (!one.mocap) return out;
  if (log.dimension != 2)
    throw datasets::LogError(options.into, "/@dimension", "is 3, and mocap-csv is for planar logs (2)");
  const auto lost = std::count(one.mocap->valid.begin(), one.mocap->valid.end(), 0);
  out.text += fmt::format(", {} lost", lost);
  out.details["lost"] = lost;
  take_from_track(log, options, one, out);
  return out;
}

std::array<double, 3> triple(const std::vector<double>& values) {
  return values.empty() ? std::array<double, 3>{} : std::array<double, 3>{values[0], values[1], values[2]};
}

/// [deg], within ±180.
double between(double to, double from) { return std::remainder(to - from, 360.0); }

/// A planar log of a throw that goes elsewhere than --heading says is that throw's shadow: refused where
/// the two are far apart (unless --trust-heading), said where they are somewhat. Throws ImportError.
void check_heading(const std::string& file, const datasets::MotiveTake& take, const LabOptions& options,
                   std::vector<std::string>& notes) {
  constexpr double kRun = 0.1, kBeside = 0.05;               // m
  constexpr double kNoted = 3, kRefused = 15, kTurned = 15;  // deg
  if (!take.run) {
    notes.push_back(fmt::format(
        "{}: no free flight is seen {}: --heading is not checked{}", file,
        options.free_flight.empty() ? "of 0.1 s or longer" : "in --free-flight (fewer than two frames)",
        options.free_flight.empty() ? "; --free-flight T0,T1 says where it is" : ""));
  } else if (take.run->length >= kRun) {
    const double heading = options.heading, seen = take.run->heading * 180 / std::numbers::pi,
                 off = between(seen, heading);
    const double angle = std::min(std::abs(off), 180 - std::abs(off));  // to the plane, forwards or back
    const std::string numbers =
        fmt::format("the body flies {:.2f} m along a heading of {:.1f} deg, {:.1f} deg from --heading {:g}",
                    take.run->length, seen, std::abs(off), heading);
    const std::string advice = fmt::format("--heading {:.1f}", seen);
    if (angle > kRefused && !options.trust_heading)
      throw datasets::ImportError(
          file, fmt::format("rigid body {}, columns Position", take.body),
          fmt::format("{}: up to {:g} deg are accepted, since a planar log keeps x and z alone: {}? "
                      "--trust-heading takes it as it is",
                      numbers, kRefused, advice));
    if (angle > kNoted)
      notes.push_back(fmt::format("{}: {}; x is too short by {:.1f} %: {}?", file, numbers,
                                  100 * (1 - std::cos(angle * std::numbers::pi / 180)), advice));
    else if (std::abs(off) > 90)
      notes.push_back(fmt::format("{}: {}: it goes backwards: {}?", file, numbers, advice));
    if (take.run->beside > kBeside)
      notes.push_back(
          fmt::format("{}: the track is up to {:.2f} m beside any vertical plane: not a planar throw?", file,
                      take.run->beside));
  }
  const double angle = take.out_of_plane_angle * 180 / std::numbers::pi;
  if (angle > kTurned)
    notes.push_back(fmt::format(
        "{}: the body's x axis leaves the throwing plane by up to {:.0f} deg, and theta is the angle of "
        "its shadow: was the body created with its X along the object's x, in that plane?",
        file, angle));
}

Reading read_motive(const std::string& file, const ThrowLog& log, const LabOptions& options) {
  datasets::MotiveOptions motive;
  motive.body = options.body;
  motive.dimension = log.dimension;
  motive.heading = options.heading * std::numbers::pi / 180;
  motive.origin = triple(options.origin);
  motive.com = triple(options.com);
  motive.time_offset = options.time_offset;
  motive.gravity = log.gravity;
  if (!options.free_flight.empty()) motive.free_flight = {options.free_flight[0], options.free_flight[1]};
  if (options.landing) motive.landing_height = log.landing_height;
  for (const auto& [name, sigma] : parse_numbers("--sigma", options.sigma)) {
    if (name != "position" && name != "angle")
      throw WrongUsage(fmt::format("--sigma: '{}' is neither position (m) nor angle (rad)", name));
    (name == "position" ? motive.sigma_position : motive.sigma_angle) = sigma;
  }
  datasets::MotiveTake take;
  try {
    take = datasets::read_motive_csv(file, motive);
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--{}", error.what()));
  }
  Reading out;
  Throw& one = out.throws.emplace_back();
  out.text = fmt::format("rigid body {} of take {}, {} frames", take.body, take.name, take.mocap.time.rows);
  if (take.frame_rate > 0) out.text += fmt::format(" at {:.6g} Hz", take.frame_rate);
  out.text += fmt::format(", {} lost", take.lost);
  out.details = {
      {"take", take.name}, {"body", take.body}, {"frames", take.mocap.time.rows}, {"lost", take.lost}};
  if (log.dimension == 2) {
    const double angle = take.out_of_plane_angle * 180 / std::numbers::pi;
    out.text += fmt::format(", out of the plane by {:.3g} m and {:.3g} deg", take.out_of_plane, angle);
    out.details["out_of_plane_m"] = take.out_of_plane;
    out.details["out_of_plane_deg"] = angle;
    out.details["run_m"] = take.run ? Json(take.run->length) : Json(nullptr);
    out.details["run_heading_deg"] =
        take.run ? Json(take.run->heading * 180 / std::numbers::pi) : Json(nullptr);
    check_heading(file, take, options, out.notes);
  }
  one.mocap = std::move(take.mocap);
  take_from_track(log, options, one, out);
  return out;
}

/// What to say of a phone that reads no gravity while it is held, or nothing.
std::string odd_rest(const datasets::PhyphoxRecording& recording, double gravity) {
  constexpr double kOff = 0.1;  // as a share; a bias and a hand that moves make half of it
  if (!recording.rest || std::abs(*recording.rest - gravity) <= kOff * gravity) return {};
  return fmt::format(
      "outside of falls the phone reads {:.3g} m/s^2 (median), and held still it would read {:.3g}: was it "
      "shaken, or is its scale off?",
      *recording.rest, gravity);
}

Reading read_phone(const std::string& file, const ThrowLog& log, const LabOptions& options) {
  datasets::PhyphoxOptions phone;
  phone.min_duration = options.min_fall;
  phone.threshold = options.fall_threshold;
  phone.guard = std::min(phone.guard, phone.min_duration / 4);
  datasets::PhyphoxRecording recording = datasets::read_phyphox(file, phone);
  Reading out;
  out.text = fmt::format("{} samples, {} free fall{}", recording.samples, recording.falls.size(),
                         recording.falls.size() == 1 ? "" : "s");
  out.details = {
      {"samples", recording.samples}, {"falls", recording.falls.size()}, {"dropped", Json::array()}};
  for (const Throw& fall : recording.falls)
    out.text +=
        fmt::format("\n    falls from {:.3f} to {:.3f} s", fall.free_flight->first, fall.free_flight->second);
  for (const auto& dropped : recording.dropped) {
    out.text +=
        fmt::format("\n    not a fall, {:.3f} to {:.3f} s: {}", dropped.begin, dropped.end, dropped.reason);
    out.details["dropped"].push_back(
        {{"begin_s", dropped.begin}, {"end_s", dropped.end}, {"reason", dropped.reason}});
  }
  if (const std::string odd = odd_rest(recording, log.gravity); !odd.empty())
    out.notes.push_back(fmt::format("{}: {}", file, odd));
  out.throws = std::move(recording.falls);
  return out;
}

std::vector<std::string> phone_files(const std::vector<std::string>& named) {
  const std::vector<std::filesystem::path> paths(named.begin(), named.end());
  std::vector<std::string> out;
  for (const auto& file : datasets::phyphox_files(paths)) out.push_back(file.string());
  return out;
}

Reading read(const std::string& format, const std::string& file, const ThrowLog& log,
             const LabOptions& options) {
  if (format == "motive-csv") return read_motive(file, log, options);
  if (format == "phyphox") return read_phone(file, log, options);
  return read_columns(format, file, log, options);
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
    Reading reading = read(format, file, log, options);
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
