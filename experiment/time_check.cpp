#include "experiment/time_check.hpp"

#include <fmt/core.h>

#include <cmath>
#include <functional>

#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {
namespace {

using datasets::Series;
using datasets::Throw;
using datasets::ThrowLog;

/// As the file counts, to the millisecond [s].
std::string in_file(const ThrowLog& log, double t) {
  return fmt::format("{:.13g}", std::round((log.clock_origin + t) * 1e3) / 1e3);
}

std::string span_of(const ThrowLog& log, const Series& time) {
  return fmt::format("{} to {} s", in_file(log, time(0)), in_file(log, time(time.rows - 1)));
}

bool covers(const Series& time, double t) { return t >= time(0) && t <= time(time.rows - 1); }

std::string outside_of_hand(const ThrowLog& log, const Throw& one, double t) {
  if (!one.hand || one.hand->time.empty() || covers(one.hand->time, t)) return {};
  return fmt::format("is {} s, and throw {} (hand/time) runs from {}", in_file(log, t), one.id,
                     span_of(log, one.hand->time));
}

std::string jumps_outside(const ThrowLog& log, const Throw& one) {
  for (const double t : one.hand_jump_times)
    if (auto said = outside_of_hand(log, one, t); !said.empty()) return said;
  return {};
}

}  // namespace

std::string landed_before(const ThrowLog& log, const Throw& one) {
  if (!one.landing || one.landing->time.empty()) return {};
  const double t = one.landing->time(0);
  const auto not_after = [&](double first, const char* what) {
    if (t > first) return std::string{};
    return fmt::format("is {} s, not after {} at {} s: nothing that follows it counts as flight",
                       in_file(log, t), what, in_file(log, first));
  };
  if (one.hand && !one.hand->time.empty()) {
    const auto opening = opening_of(log, one);
    if (opening && covers(one.hand->time, *opening)) return not_after(*opening, "the gripper's opening");
    return not_after(one.hand->time(0), "the first sample of the hand");
  }
  if (one.mocap && !one.mocap->time.empty())
    return not_after(one.mocap->time(0), "the first sample of motion capture");
  return {};
}

std::string clocks_apart(const ThrowLog& log, const Throw& one) {
  if (!one.hand || !one.mocap || one.hand->time.empty() || one.mocap->time.empty()) return {};
  constexpr double kGap = 1;  // s; a tracker may see the flight only, which begins soon after the hand's log
  const auto &hand = one.hand->time, &mocap = one.mocap->time;
  if (mocap(0) <= hand(hand.rows - 1) + kGap && mocap(mocap.rows - 1) >= hand(0)) return {};
  return fmt::format(
      "runs from {}, the robot's clock (hand/time) from {}: they do not overlap, and both are to "
      "count from the same instant",
      span_of(log, mocap), span_of(log, hand));
}

std::vector<LogNote> impossible_times(const ThrowLog& log) {
  struct Rule {
    const char* where;  ///< in a throw
    std::function<std::string(const Throw&)> said;
    bool of_log{false};  ///< where is in the log
  };
  const Rule rules[] = {
      {"/gripper@opening_command_time",
       [&](const Throw& one) {
         const bool given = log.gripper && log.gripper->opening_command_time;
         return given ? outside_of_hand(log, one, *log.gripper->opening_command_time) : std::string{};
       },
       true},
      {"@detach_time",
       [&](const Throw& one) {
         return one.detach_time ? outside_of_hand(log, one, *one.detach_time) : std::string{};
       }},
      {"@hand_jump_times", [&](const Throw& one) { return jumps_outside(log, one); }},
      {"/landing/time", [&](const Throw& one) { return landed_before(log, one); }},
      {"/mocap/time", [&](const Throw& one) { return clocks_apart(log, one); }},
  };
  std::vector<LogNote> out;
  for (const Rule& rule : rules) {
    LogNote note;
    for (const Throw& one : log.throws) {
      const auto said = rule.said(one);
      if (said.empty()) continue;
      if (note.throws++ == 0) {
        note.path = (rule.of_log ? "" : "/throws/" + one.id) + rule.where;
        note.said = said;
      }
    }
    if (note.throws > 0) out.push_back(std::move(note));
  }
  return out;
}

}  // namespace unhand::experiment
