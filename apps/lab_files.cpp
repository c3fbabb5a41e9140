#include "apps/lab_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

#include "apps/command.hpp"
#include "datasets/assemble.hpp"
#include "datasets/import_columns.hpp"
#include "datasets/import_motive.hpp"
#include "datasets/import_phyphox.hpp"

namespace unhand::apps {
namespace {

using datasets::Throw;
using datasets::ThrowLog;

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

}  // namespace

Reading read_lab_file(const std::string& format, const std::string& file, const ThrowLog& log,
                      const LabOptions& options) {
  if (format == "motive-csv") return read_motive(file, log, options);
  if (format == "phyphox") return read_phone(file, log, options);
  return read_columns(format, file, log, options);
}

}  // namespace unhand::apps
