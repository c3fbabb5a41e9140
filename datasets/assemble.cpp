#include "datasets/assemble.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "datasets/import_phyphox.hpp"
#include "datasets/median_step.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::datasets {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_mark(char c) { return c == '_' || c == '-' || c == ' ' || c == '.'; }

template <class Part>
bool move_channel(std::optional<Part>& to, std::optional<Part>& from, bool replace) {
  if (!from) return true;
  if (to && !replace) return false;
  to = std::move(from);
  return true;
}

}  // namespace

ThrowName name_of(const std::filesystem::path& file) {
  std::string stem = file.stem().string();
  if (phyphox_names_it(file) && file.has_parent_path() && !file.parent_path().filename().empty())
    stem = file.parent_path().filename().string();
  ThrowName out{stem, stem, 0};
  std::size_t digits = stem.size();
  while (digits > 0 && is_digit(stem[digits - 1]) && stem.size() - digits < 9) --digits;
  if (digits == stem.size()) return out;
  std::from_chars(stem.data() + digits, stem.data() + stem.size(), out.repetition);
  while (digits > 0 && is_mark(stem[digits - 1])) --digits;
  out.condition = digits == 0 ? "throw" : stem.substr(0, digits);
  return out;
}

void split_throws(ThrowLog& log, const SplitRule& rule) {
  if (rule.test_every != 0 && rule.test_every < 2)
    throw std::invalid_argument(fmt::format("test_every: {} is not 0 or >= 2", rule.test_every));
  std::map<std::string, std::vector<Throw*>> conditions;
  for (Throw& one : log.throws) conditions[one.condition].push_back(&one);
  std::vector<std::string> known;
  for (const auto& [name, throws] : conditions) known.push_back(name);
  for (const std::string& name : rule.test_conditions)
    if (!conditions.contains(name))
      throw std::invalid_argument(unknown_name(fmt::format("there is no condition '{}'", name), name, known));
  for (auto& [name, throws] : conditions) {
    std::sort(throws.begin(), throws.end(), [](const Throw* a, const Throw* b) {
      return std::tie(a->repetition, a->id) < std::tie(b->repetition, b->id);
    });
    const bool held_out = std::find(rule.test_conditions.begin(), rule.test_conditions.end(), name) !=
                          rule.test_conditions.end();
    const auto every = static_cast<std::size_t>(rule.test_every);
    for (std::size_t k = 0; k < throws.size(); ++k)
      throws[k]->split = held_out || (every > 0 && k % every == every - 1) ? Split::test : Split::train;
  }
}

void require_new(const ThrowLog& log, const std::string& id, const std::string& file) {
  for (const Throw& other : log.throws)
    if (other.id == id)
      throw ImportError(file, "", fmt::format("there is already a throw '{}': two files of one name?", id));
}

void add_throw(ThrowLog& log, Throw one, const std::string& file) {
  require_new(log, one.id, file);
  log.throws.push_back(std::move(one));
}

void fill_throw(ThrowLog& log, const std::string& id, Throw channels, bool replace,
                const std::string& log_file) {
  const auto found =
      std::find_if(log.throws.begin(), log.throws.end(), [&](const Throw& one) { return one.id == id; });
  if (found == log.throws.end()) {
    std::vector<std::string> known;
    for (const Throw& one : log.throws) known.push_back(one.id);
    throw LogError(log_file, "/throws", unknown_name(fmt::format("there is no throw '{}'", id), id, known));
  }
  const auto move = [&](auto& to, auto& from, const char* name) {
    if (!move_channel(to, from, replace))
      throw LogError(log_file, fmt::format("/throws/{}/{}", id, name),
                     "is there already: --replace puts the new one in its place");
  };
  move(found->hand, channels.hand, "hand");
  move(found->ft, channels.ft, "ft");
  move(found->mocap, channels.mocap, "mocap");
  move(found->landing, channels.landing, "landing");
  move(found->imu, channels.imu, "imu");
  if (channels.free_flight) found->free_flight = channels.free_flight;
}

std::optional<std::size_t> first_below(const MocapLog& mocap, int dimension, double height, double after) {
  const std::size_t up = dimension == 3 ? 2 : 1;
  std::optional<std::size_t> highest;
  for (std::size_t i = 0; i < mocap.time.rows; ++i)
    if (mocap.time(i) > after && mocap.is_valid(i) &&
        (!highest || mocap.pose(i, up) > mocap.pose(*highest, up)))
      highest = i;
  if (!highest || !(mocap.pose(*highest, up) > height)) return {};
  for (std::size_t k = *highest + 1; k < mocap.time.rows; ++k)
    if (mocap.is_valid(k) && mocap.pose(k, up) <= height) return k;
  return {};
}

std::optional<LandingLog> landing_of(const MocapLog& mocap, int dimension, double height) {
  const std::size_t up = dimension == 3 ? 2 : 1;
  const auto k = first_below(mocap, dimension, height);
  if (!k) return {};
  std::size_t i = *k - 1;  // the highest lies before
  while (!mocap.is_valid(i)) --i;
  if (mocap.time(*k) - mocap.time(i) > 1.5 * median_step(mocap.time)) return {};  // lost where it passes
  const double above = mocap.pose(i, up) - height, below = mocap.pose(*k, up) - height;
  const double s = above / (above - below);
  const auto at = [&](std::size_t j) { return (1 - s) * mocap.pose(i, j) + s * mocap.pose(*k, j); };
  // Of the two frames, and of the time of the passage that their heights tell.
  const auto noise = [&](std::initializer_list<std::size_t> columns) {
    std::vector<double> sigma;
    if (mocap.pose.sigma.size() != mocap.pose.cols) return sigma;
    for (const std::size_t j : columns) {
      const double per_height = j == up ? 0 : (mocap.pose(*k, j) - mocap.pose(i, j)) / (above - below);
      sigma.push_back(std::hypot(1 - s, s) *
                      std::hypot(mocap.pose.sigma[j], per_height * mocap.pose.sigma[up]));
    }
    return sigma;
  };
  LandingLog out;
  out.time = {1, 1, {(1 - s) * mocap.time(i) + s * mocap.time(*k)}, {}};
  if (dimension == 3)
    out.pose = {1, 3, {at(0), at(1), at(2)}, noise({0, 1, 2})};
  else
    out.pose = {1, 2, {at(0), at(2)}, noise({0, 2})};
  return out;
}

}  // namespace unhand::datasets
