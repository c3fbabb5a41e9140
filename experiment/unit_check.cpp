#include "experiment/unit_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"
#include "experiment/axis_check.hpp"
#include "experiment/declared_check.hpp"
#include "experiment/glitches.hpp"
#include "experiment/time_check.hpp"
#include "experiment/turn_check.hpp"
#include "experiment/unit_evidence.hpp"
#include "experiment/unit_outliers.hpp"
#include "experiment/unit_rules.hpp"
#include "experiment/wrench_check.hpp"

namespace unhand::experiment {

namespace {

std::string path_of(const ColumnSide& side) {
  return side.path[0] == '/' ? side.path : fmt::format("/throws/*/{}", side.path);
}

/// A height that throws do not come by, or do not land at; or, behind that, the clock that landings are timed
/// by.
std::vector<UnitDoubt> doubtful_landing_height(const datasets::ThrowLog& log) {
  std::vector<double> seen, tolerances;
  std::optional<double> highest;
  UnitDoubt clock{"", "t", 1, 0, ""};
  for (const auto& one : log.throws) {
    if (const auto top = highest_point(log, one)) highest = std::max(highest.value_or(*top), *top);
    const auto timed = log.dimension == 2 ? timed_landing(log, one) : std::nullopt;
    if (!timed) continue;
    seen.push_back(timed->height), tolerances.push_back(timed->tolerance);
    const auto apart = clocks_apart(log, one);
    if (!apart.empty() && clock.throws++ == 0)
      clock.path = fmt::format("/throws/{}/mocap/time", one.id), clock.reason = apart;
  }
  const auto doubt = [&](double accepted, std::size_t throws, const std::string& reason) {
    return std::vector{UnitDoubt{
        "/@landing_height", "landing_height", log.landing_height / accepted, static_cast<int>(throws),
        fmt::format("landing_height is {:.6g} m, and {}: another unit than m, another frame, or another "
                    "gravity than the declared {:.6g} m/s^2?",
                    log.landing_height, reason, log.gravity)}};
  };
  if (!seen.empty()) {
    const double height = dynamics::median(seen), most = dynamics::median(tolerances);
    const bool off = std::abs(log.landing_height - height) > most;
    if (off && 2 * clock.throws > static_cast<int>(seen.size())) {
      clock.reason += fmt::format(
          "; by the robot's clock, free flights from the opening to landing/time end at {:.3g} m, and not at "
          "landing_height = {:.6g} m: are landings timed by the tracker's clock?",
          height, log.landing_height);
      return {clock};
    }
    if (off)
      return doubt(height, seen.size(),
                   fmt::format("free flights from the opening to landing/time end at {:.3g} m (median of {} "
                               "throws), accepted are {:.3g} to {:.3g} m",
                               height, seen.size(), height - most, height + most));
  }
  constexpr double kAbove = 1;  // [m] more than any object's size
  if (highest && log.landing_height > *highest + kAbove)
    return doubt(*highest, log.throws.size(),
                 fmt::format("the highest point of all throws is at {:.3g} m, accepted is at most {:.3g} m",
                             *highest, *highest + kAbove));
  return {};
}

std::vector<UnitDoubt> doubtful_gravity(const datasets::ThrowLog& log) {
  constexpr double kMostGravity = 100;  // [m/s²]
  if (!(log.gravity > kMostGravity)) return {};
  return {{"/@gravity", "gravity", log.gravity, 1,
           fmt::format("gravity is {:.6g} m/s², more than {}: mm/s² or cm/s² for m/s²?", log.gravity,
                       kMostGravity)}};
}

using RatiosByColumn = std::map<SizedColumn, std::vector<double>>;

/// Columns whose size is by the factor of a unit another one than what others make of it.
std::vector<UnitDoubt> disproportionate_columns(const RatiosByColumn& ratios) {
  std::vector<UnitDoubt> out;
  for (const auto& [column, all] : ratios) {
    const auto found = unit_rules().find(column);
    if (found == unit_rules().end()) continue;
    const UnitRule& rule = found->second;
    const double ratio = dynamics::median(all);
    const auto doubt = [&](const ColumnSide& side, const ColumnSide& other, double size) {
      const OtherUnit* unit = explaining_unit(side.units, size, rule.within);
      if (!unit) return;
      const std::string path = path_of(side);
      if (std::any_of(out.begin(), out.end(),
                      [&](const auto& told) { return told.path == path && told.column == side.column; }))
        return;
      out.push_back({path, side.column, size, static_cast<int>(all.size()),
                     fmt::format("{} is {:.3g} times what {} (median of {} throws): {}?", side.column, size,
                                 rule.said_by(other), all.size(), unit->words)});
    };
    doubt(rule.seen, rule.expected, ratio);
    doubt(rule.expected, rule.seen, 1 / ratio);
    if (column == SizedColumn::hand_clock && !out.empty()) return out;  // it is behind all that follows
  }
  return out;
}

/// An accelerometer that reads nothing at rest and gravity in a fall.
std::vector<UnitDoubt> gravity_taken_out(const datasets::ThrowLog& log) {
  constexpr double kLeast = 0.3, kNear = 0.3;  // of gravity
  std::vector<double> before, fall;
  for (const auto& one : log.throws)
    if (const auto levels = force_levels(one)) before.push_back(levels->before), fall.push_back(levels->fall);
  if (before.empty()) return {};
  const double rest = dynamics::median(before), falling = dynamics::median(fall), g = log.gravity;
  if (!(rest < kLeast * g && std::abs(falling - g) < kNear * g)) return {};
  return {
      {"/throws/*/imu/specific_force", "f", falling / g, static_cast<int>(before.size()),
       fmt::format("an accelerometer reads {:.3g} m/s^2 before the falls and {:.3g} m/s^2 in them (medians "
                   "of {} throws), where {:.3g} and 0 are expected: gravity taken out, as phones do for "
                   "\"linear acceleration\"?",
                   rest, falling, before.size(), g)}};
}

std::vector<UnitDoubt> turned_grasps(const datasets::ThrowLog& log) {
  std::vector<double> angles;
  for (const auto& one : log.throws)
    if (one.grasp_angle) angles.push_back(std::abs(*one.grasp_angle));
  const double turn = angles.size() < 2 ? 0 : dynamics::median(angles);
  if (!(turn > 2 * std::numbers::pi)) return {};
  return {{"/throws/*@grasp_angle", "grasp_angle", turn, static_cast<int>(angles.size()),
           fmt::format("grasp_angle is {:.3g} rad (median of {} throws), more than a whole turn: degrees "
                       "for rad?",
                       turn, angles.size())}};
}

/// How far a hand moves along a column of its pose while motion capture sees the object in it.
double hand_moves(const datasets::ThrowLog& log, const datasets::Throw& one, std::size_t column) {
  double opening = one.hand->time(one.hand->time.rows - 1), low = HUGE_VAL, high = -HUGE_VAL,
         first = HUGE_VAL;
  if (log.gripper && log.gripper->opening_command_time)
    opening = *log.gripper->opening_command_time;
  else if (one.detach_time)
    opening = *one.detach_time;
  for (std::size_t i = one.mocap->time.rows; i-- > 0;)
    if (one.mocap->is_valid(i)) first = one.mocap->time(i);
  for (std::size_t i = 0; i < one.hand->time.rows; ++i) {
    if (one.hand->time(i) < first || one.hand->time(i) > opening) continue;
    low = std::min(low, one.hand->pose(i, column)), high = std::max(high, one.hand->pose(i, column));
  }
  return std::max(0.0, high - low);
}

/// Columns of a tracked pose that read one value although the hand that holds the object moves along them.
std::vector<UnitDoubt> dead_tracks(const datasets::ThrowLog& log) {
  constexpr double kMoves[3] = {0.01, 0.01, 0.05};  // m, m, rad
  constexpr const char *kNames[3] = {"x", "z", "theta"}, *kUnits[3] = {"m", "m", "rad"};
  constexpr std::size_t kFewest = 10;  // samples
  std::vector<UnitDoubt> out;
  if (log.dimension != 2) return out;
  for (std::size_t c = 0; c < 3; ++c) {
    UnitDoubt doubt;
    for (const auto& one : log.throws) {
      if (!one.hand || one.hand->pose.empty() || !one.mocap) continue;
      std::set<double> seen;
      std::size_t samples = 0;
      for (std::size_t i = 0; i < one.mocap->time.rows && seen.size() < 2; ++i)
        if (one.mocap->is_valid(i)) seen.insert(one.mocap->pose(i, c)), ++samples;
      if (seen.size() != 1 || samples < kFewest) continue;
      const double moves = hand_moves(log, one, c);
      if (moves < kMoves[c] || doubt.throws++ > 0) continue;
      doubt.path = "/throws/" + one.id + "/mocap/pose";
      doubt.column = kNames[c];
      doubt.reason = fmt::format(
          "{} is {:.6g} {} in every sample, while the hand that holds the object moves by "
          "{:.3g} {}",
          kNames[c], *seen.begin(), kUnits[c], moves, kUnits[c]);
    }
    if (doubt.throws == 0) continue;
    doubt.reason += fmt::format(
        " (so in {} of {} throws): not tracked? Leave such a mocap out of the log; predictions then need the "
        "throw's grasp_angle",
        doubt.throws, log.throws.size());
    out.push_back(std::move(doubt));
  }
  return out;
}

/// Whether wrenches of slipping pads go with the normal force, as in any unit they do. A bias of either, or a
/// force that acts later than it says, counts for more the less is left of it.
bool is_one_factor(const RatiosByColumn& ratios) {
  constexpr double kGrowth = 1.5;
  const auto found = ratios.find(SizedColumn::slip_growth);
  if (found == ratios.end()) return true;
  const double growth = dynamics::median(found->second);
  return growth < kGrowth && growth > 1 / kGrowth;
}

std::vector<UnitDoubt> doubtful_friction(const RatiosByColumn& ratios) {
  const auto found = ratios.find(SizedColumn::slip_force);
  if (found == ratios.end()) return {};
  const auto& friction = found->second;
  const double mu = dynamics::median(friction);
  const bool dead = mu == 0;  // a wrench that says nothing is no unit
  if (dead || !is_one_factor(ratios) || (mu >= kLeastFriction && mu <= kMostFriction)) return {};
  return {{"/throws/*/ft/normal_force", "f_N", mu, static_cast<int>(friction.size()),
           fmt::format("where the pads slip their wrench takes a friction of {:.3g} of it (median of {} "
                       "throws), and there are pads of {} to {}: {}?",
                       mu, friction.size(), kLeastFriction, kMostFriction,
                       mu > 1 ? "kgf, lbf or kN for N" : "mN for N")}};
}

}  // namespace

std::vector<UnitDoubt> unit_doubts(const datasets::ThrowLog& logged) {
  datasets::ThrowLog log = logged;  // a frame in which the tracker was elsewhere is in no unit
  mark_glitches(log);
  // What one check finds makes the later ones compare with what is wrong: the first that finds something is
  // the last.
  for (const auto check : {doubtful_gravity, impossible_declarations, gravity_taken_out, dead_tracks,
                           jumping_angles, reversed_forces})
    if (auto out = check(log); !out.empty()) return out;
  std::vector<SizeRatios> throws;
  RatiosByColumn ratios;
  for (const auto& one : log.throws) {
    throws.push_back(compare_sizes(log, one));
    for (const auto& [column, ratio] : throws.back()) ratios[column].push_back(ratio);
  }
  auto out = disproportionate_columns(ratios);
  for (auto& doubt : turned_grasps(log)) out.push_back(std::move(doubt));
  if (out.empty()) out = doubtful_friction(ratios);
  if (out.empty()) out = outlying_throws(log, throws);
  if (!out.empty()) return out;
  for (const auto check : {turned_vertical, contradicted_axes, turned_levers, reversed_wrenches,
                           landings_turns_off, doubtful_landing_height, contradicted_landing_height})
    if (auto found = check(log); !found.empty()) return found;
  return {};
}

void require_units(const datasets::ThrowLog& log, const std::string& file) {
  const auto doubts = unit_doubts(log);
  if (doubts.empty()) return;
  constexpr std::size_t kTold = 8;
  std::string reason = doubts.front().reason;
  for (std::size_t i = 1; i < std::min(doubts.size(), kTold); ++i)
    reason += "; " + doubts[i].path + ": " + doubts[i].reason;
  if (doubts.size() > kTold) reason += fmt::format("; and {} more columns", doubts.size() - kTold);
  throw datasets::LogError(file, doubts.front().path, reason);
}

}  // namespace unhand::experiment
