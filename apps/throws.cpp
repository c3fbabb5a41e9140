#include "apps/throws.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "apps/command.hpp"
#include "apps/table.hpp"
#include "apps/tell.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/summary.hpp"
#include "experiment/declared_check.hpp"
#include "experiment/prepared_throw.hpp"
#include "experiment/time_check.hpp"
#include "experiment/unit_check.hpp"
#include "fitting/slips/slip_surface.hpp"

namespace unhand::apps {

namespace {

/// Takes out the throws for which `is_unusable` holds and says which, unless they are all there are.
template <class Unusable>
void leave_out(datasets::ThrowLog& log, const char* why, Unusable&& is_unusable) {
  std::vector<std::string> left_out;
  for (const auto& one : log.throws)
    if (is_unusable(one)) left_out.push_back(one.id);
  if (left_out.empty() || left_out.size() == log.throws.size()) return;
  constexpr std::size_t kNamed = 5;
  const std::size_t named = std::min(left_out.size(), kNamed);
  tell("unhand: left out {} of {} throws, which {}: {}{}\n", left_out.size(), log.throws.size(), why,
       fmt::join(left_out.begin(), left_out.begin() + named, ", "), named < left_out.size() ? ", ..." : "");
  std::erase_if(log.throws, [&](const auto& one) {
    return std::binary_search(left_out.begin(), left_out.end(), one.id);  // both are sorted by id
  });
}

/// Where no throw shows how it is held since motion capture keeps another time: Throws datasets::LogError.
void require_common_clock(const datasets::ThrowLog& log, const std::string& file) {
  if (std::any_of(log.throws.begin(), log.throws.end(),
                  [&](const auto& one) { return experiment::shows_grasp(log, one); }))
    return;
  for (const auto& one : log.throws)
    if (const auto apart = experiment::clocks_apart(log, one); !apart.empty())
      throw datasets::LogError(file, "/throws/" + one.id + "/mocap/time",
                               apart + ", so that nothing shows how the object is held");
}

}  // namespace

datasets::ThrowLog read_throws(const std::string& file) {
  if (datasets::read_schema_name(file) == "slip-log")
    throw datasets::LogError(file, "/@schema", "is a slip-log, which holds no throws");
  auto log = datasets::read_throw_log(file);
  if (log.throws.empty()) throw Unanswered(fmt::format("{}: holds no throws", file));
  experiment::require_units(log, file);
  require_common_clock(log, file);
  for (const auto& note : experiment::impossible_times(log))
    tell("unhand: {}: {}\n", file, note.in_words(log.throws.size()));
  if (std::any_of(log.throws.begin(), log.throws.end(), [](const auto& one) { return one.hand.has_value(); }))
    leave_out(log, "have no hand, which the others have",
              [](const auto& one) { return !one.hand.has_value(); });
  leave_out(log, "do not show the grasp (no motion capture before the gripper opens, no grasp_angle)",
            [&](const auto& one) { return !experiment::shows_grasp(log, one); });
  return log;
}

void leave_out_forceless(datasets::ThrowLog& log) {
  leave_out(log, "have no normal force, which the others have", [](const auto& one) { return !one.ft; });
}

std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return text;
}

std::string origin_text(const datasets::ThrowLog& log) {
  return printable(log.title + (log.title.empty() || log.source.empty() ? "" : "; ") + log.source);
}

std::string origin_text(const datasets::SlipLog& log) {
  const std::string count = plural(log.surfaces.size(), "surface");
  const std::string first = log.surfaces.empty() ? "" : log.surfaces.begin()->second.description;
  return first.empty() ? count : printable(fmt::format("{}, the first: {}", count, first));
}

std::size_t place_of(const datasets::ThrowLog& log, const std::string& id, const std::string& file) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    if (log.throws[i].id == id) return i;
    known.push_back(log.throws[i].id);
  }
  throw WrongUsage(datasets::unknown_name(fmt::format("--throw: {} has no throw '{}'", file, id), id, known));
}

bool is_of_flights(const datasets::ThrowLog& log) {
  return log.dimension == 3 || std::none_of(log.throws.begin(), log.throws.end(),
                                            [](const auto& one) { return one.hand.has_value(); });
}

void require_flights(const datasets::ThrowLog& log, const std::string& file) {
  for (const auto& one : log.throws)
    if (datasets::held_by(log, one).empty()) return;
  const auto& first = log.throws.front();
  throw datasets::LogError(
      file, "/throws/" + first.id + "@free_flight",
      fmt::format("missing: {} shows that the object is held at first, in every throw of this log, and "
                  "without a hand nothing says from when on it flies; declare free_flight (the seconds from "
                  "the detach to the landing, on the clock of mocap), or give the hand's motion",
                  datasets::held_by(log, first)));
}

datasets::SlipLog read_slips(const std::string& file) {
  auto log = datasets::read_slip_log(file);
  for (const auto& [name, surface] : log.surfaces)
    if (const double share = datasets::dissipation(surface); share < 0)
      throw datasets::LogError(file, "/surfaces/" + name, sign_doubt(share));
  return log;
}

datasets::Sku read_possible_sku(const std::string& file) {
  auto sku = datasets::read_sku(file);
  const std::string why = experiment::impossible_inertia(datasets::to_object(sku));
  if (!why.empty()) throw datasets::TomlError(file, 0, 0, "inertia_kg_m2", why);
  return sku;
}

datasets::Sku read_throwable_sku(const std::string& file) {
  auto sku = read_possible_sku(file);
  if (!sku.inertia)
    throw datasets::TomlError(file, 0, 0, "inertia_kg_m2", "missing: it, or shape and dims_m, are needed");
  return sku;
}

std::vector<std::string> surface_model_names() {
  std::vector<std::string> out;
  for (const auto model : fitting::surface_models) out.push_back(to_string(model));
  return out;
}

void require_of_slips(const std::string& model, const std::string& file) {
  const auto names = surface_model_names();
  if (std::ranges::find(names, model) == names.end())
    throw datasets::LogError(
        file, "/surfaces",
        fmt::format("slips, which {} does not predict; there are {}", model, fmt::join(names, ", ")));
}

void require_of_throws(const std::string& model, const std::string& file) {
  const auto names = surface_model_names();
  if (std::ranges::find(names, model) != names.end())
    throw datasets::LogError(file, "/throws",
                             fmt::format("throws, which {} does not predict: it is for slip-logs", model));
}

std::string sign_doubt(double dissipation) {
  return fmt::format(
      "friction would drive the object: wrench times twist is negative on the whole ({:+.2f} of its size), "
      "and the wrench is the one that the object applies to the surface: a sign reversed in wrench or twist?",
      dissipation);
}

}  // namespace unhand::apps
