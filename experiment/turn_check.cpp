#include "experiment/turn_check.hpp"

#include <fmt/core.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "dynamics/straight_line.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/time_check.hpp"
#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

/// The whole turns of an angle, to 1 rad; 0 where it is nothing like that.
double turns(double angle) {
  const double n = std::round(angle / kTurn);
  return std::abs(angle - n * kTurn) < 1 ? n : 0;
}

/// What is wrong with a throw, and what might be the cause.
struct Oddity {
  std::string what, hint;
};
using Found = std::optional<Oddity>;
constexpr const char* kUnwrapped = "angles are logged unwrapped, without jumps of whole turns";

/// Where the angles of a series first jump.
Found jump_of(double clock_origin, const datasets::Series& time, const datasets::Series& pose,
              const std::function<bool(std::size_t)>& valid) {
  constexpr double kApart = 0.1;      // [s]: farther apart, the rate before says little
  constexpr double kBaseline = 0.01;  // [s]: over less than this, noise and uneven stamps make any rate
  std::vector<std::size_t> seen;
  std::size_t from = 0;  // in `seen`: where the rate begins
  for (std::size_t i = 0; i < time.rows; ++i) {
    if (!valid(i)) continue;
    if (!seen.empty()) {
      const std::size_t last = seen.back();
      while (from + 1 < seen.size() && time(last) - time(seen[from + 1]) >= kBaseline) ++from;
      const double dt = time(i) - time(last), step = pose(i, 2) - pose(last, 2),
                   baseline = time(last) - time(seen[from]);
      const double rate = baseline >= kBaseline ? (pose(last, 2) - pose(seen[from], 2)) / baseline : 0;
      if (const double n = dt < kApart ? turns(step - rate * dt) : 0; n != 0)
        return Oddity{
            fmt::format("theta goes from {:.4g} to {:.4g} rad within {:.3g} s (to t = {:.15g} s), a jump of "
                        "{} turn{}",
                        pose(last, 2), pose(i, 2), dt, std::round((clock_origin + time(i)) * 1e5) / 1e5,
                        std::abs(n), std::abs(n) == 1 ? "" : "s"),
            kUnwrapped};
    }
    seen.push_back(i);
  }
  return {};
}

/// How far a landing's angle is from where the track leads.
Found landing_off(const datasets::Throw& one) {
  constexpr double kGap = 0.3;  // [s]
  const auto& landing = *one.landing;
  if (landing.time.empty() || !tells_angle(landing)) return {};
  const auto track = track_before_landing(one, kGap);
  if (!track) return {};
  const double expected = dynamics::fit_line(track->time, track->theta).at(landing.time(0)),
               off = landing.pose(0, 1) - expected;
  if (!(std::abs(off) > 0.5 * kTurn)) return {};
  return Oddity{
      fmt::format("theta is {:.4g} rad, and the track before leads to {:.4g} rad, {:.2g} turns from it",
                  landing.pose(0, 1), expected, std::abs(off) / kTurn),
      turns(off) != 0 ? kUnwrapped
                      : "that is no whole turn: are x and theta in each other's place, is the landing of "
                        "another throw, or did the tracker take the object the other way round?"};
}

/// One doubt of a dataset, if `off` has words for any throw.
std::vector<UnitDoubt> first_found(const datasets::ThrowLog& log, const char* where,
                                   const std::function<Found(const datasets::Throw&)>& off) {
  UnitDoubt doubt{"", "theta", 1, 0, ""};
  std::string hint;
  if (log.dimension != 2) return {};
  for (const auto& one : log.throws) {
    const Found found = off(one);
    if (!found || doubt.throws++ > 0) continue;
    doubt.path = fmt::format("/throws/{}/{}", one.id, where);
    doubt.reason = found->what, hint = found->hint;
  }
  if (doubt.throws == 0) return {};
  if (doubt.throws > 1) doubt.reason += fmt::format("; so in {} throws in all", doubt.throws);
  doubt.reason += ": " + hint;
  return {doubt};
}

}  // namespace

std::vector<UnitDoubt> jumping_angles(const datasets::ThrowLog& log) {
  auto out = first_found(log, "hand/pose", [&](const datasets::Throw& one) {
    return one.hand
               ? jump_of(log.clock_origin, one.hand->time, one.hand->pose, [](std::size_t) { return true; })
               : Found{};
  });
  for (auto& doubt : first_found(log, "mocap/pose", [&](const datasets::Throw& one) {
         return one.mocap ? jump_of(log.clock_origin, one.mocap->time, one.mocap->pose,
                                    [&](std::size_t i) { return one.mocap->is_valid(i); })
                          : Found{};
       }))
    out.push_back(std::move(doubt));
  return out;
}

std::vector<UnitDoubt> landings_turns_off(const datasets::ThrowLog& log) {
  return first_found(log, "landing/pose", [&](const datasets::Throw& one) {
    return one.mocap && one.landing && landed_before(log, one).empty() ? landing_off(one) : Found{};
  });
}

}  // namespace unhand::experiment
