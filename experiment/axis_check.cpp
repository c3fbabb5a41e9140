#include "experiment/axis_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "dynamics/frames.hpp"
#include "dynamics/median.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/column_pair.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/unit_evidence.hpp"
#include "experiment/unit_rules.hpp"

namespace unhand::experiment {
namespace {

using datasets::Series;
using datasets::Throw;
using datasets::ThrowLog;

enum class Source { pose, twist, acceleration, mocap, landing, physics };

/// One axis of one dataset: 0 x, 1 z, 2 θ.
struct Axis {
  Source source;
  std::size_t column;
  auto operator<=>(const Axis&) const = default;
};

/// Two axes that tell the same.
using Link = std::pair<Axis, Axis>;
/// The first over the second, signed; by link.
using Links = std::map<Link, double>;

constexpr double kAgrees = 3;  ///< a factor up to which two say the same

const char* path_of(Source source) {
  constexpr const char* kPaths[] = {"hand/pose",  "hand/twist",   "hand/acceleration",
                                    "mocap/pose", "landing/pose", ""};
  return kPaths[static_cast<std::size_t>(source)];
}

std::string name_of(const Axis& axis) {
  constexpr const char* kPoses[] = {"x", "z", "theta"};
  constexpr const char* kTwists[] = {"vx", "vz", "omega"};
  constexpr const char* kAccelerations[] = {"ax", "az", "alpha"};
  const auto& names = axis.source == Source::twist          ? kTwists
                      : axis.source == Source::acceleration ? kAccelerations
                                                            : kPoses;
  return names[axis.column];
}

/// The mistake that makes an axis so many times too large; empty if none does.
std::string mistake_of(const Axis& axis, double ratio, double within) {
  struct Unit {
    double factor;
    const char *name, *si;
  };
  constexpr Unit kLengths[] = {{1e3, "mm", "m"}, {100, "cm", "m"}, {1 / 0.0254, "inches", "m"}};
  constexpr Unit kDegrees[] = {{180 / std::numbers::pi, "degrees", "rad"}};
  if (ratio < 0) return ratio > -2 && ratio < -0.5 ? "the axis points the other way" : "";
  const char* per = axis.source == Source::twist ? "/s" : axis.source == Source::acceleration ? "/s^2" : "";
  std::string out;
  double nearest = std::log(within);
  for (const auto& [factor, name, si] : axis.column == 2 ? std::span<const Unit>(kDegrees) : kLengths)
    for (const bool large : {true, false}) {
      const double off = std::abs(std::log(ratio) - (large ? 1 : -1) * std::log(factor));
      if (off >= nearest) continue;
      nearest = off;
      out = large ? fmt::format("{0}{2} for {1}{2}", name, si, per)
                  : fmt::format("{1}{2} declared as {0}{2}", name, si, per);
    }
  return out;
}

void keep(Links& out, const Axis& a, const Axis& b, std::optional<double> ratio) {
  if (ratio && std::isfinite(*ratio) && *ratio != 0) out[{a, b}] = *ratio;
}

/// A column's change beside its rate added up.
void check_sums(const Series& time, const Series& value, const Series& rate, Source of, Source from,
                double shows, double shows_turn, Links& out) {
  for (std::size_t c = 0; c < 3; ++c) {
    ColumnPair pairs;
    double sum = 0;
    for (std::size_t i = 1; i < time.rows; ++i) {
      sum += 0.5 * (rate(i, c) + rate(i - 1, c)) * (time(i) - time(i - 1));
      pairs.add(value(i, c) - value(0, c), sum);
    }
    keep(out, {of, c}, {from, c}, pairs.size_ratio(c == 2 ? shows_turn : shows));
  }
}

/// The held object's motion beside that of the hand's point at its lever.
void check_held(const ThrowLog& log, const Throw& one, double opening, Links& out) {
  const auto& mocap = *one.mocap;
  const auto& hand = *one.hand;
  const auto lever = log.objects.at(one.object).com_offset;
  struct Sample {
    std::size_t i;
    std::array<double, 3> pose;
  };
  std::vector<Sample> samples;
  double angle = 0;
  for (std::size_t i = 0; i < mocap.time.rows; ++i)
    if (mocap.is_valid(i) && mocap.time(i) >= hand.time(0) && mocap.time(i) <= opening) {
      samples.push_back({i, hand_at(hand.time, hand.pose, mocap.time(i))});
      angle += mocap.pose(i, 2) - samples.back().pose[2];
    }
  if (samples.empty()) return;
  angle /= static_cast<double>(samples.size());
  const auto arm = [&](const Sample& sample) {
    const auto d = dynamics::rotate(sample.pose[2] + angle, dynamics::Vec2<double>{lever.value_or(0), 0});
    return std::array<double, 3>{d.x, d.z, 0};
  };
  for (std::size_t c = 0; c < 3; ++c) {
    if (c < 2 && !lever) continue;
    // The lever is in the right unit, and stands on the side of the one that is, too.
    ColumnPair with_hand, with_object;
    for (const auto& s : samples) {
      const double seen = mocap.pose(s.i, c) - mocap.pose(samples[0].i, c),
                   moved = s.pose[c] - samples[0].pose[c], swung = arm(s)[c] - arm(samples[0])[c];
      with_hand.add(seen, moved + swung), with_object.add(seen - swung, moved);
    }
    const bool object = std::abs(with_object.cosine()) > std::abs(with_hand.cosine());
    keep(out, {Source::mocap, c}, {Source::pose, c},
         (object ? with_object : with_hand).size_ratio(c == 2 ? kShowsTurn : kShowsShift));
  }
}

/// The bend of the height that motion capture sees beside gravity's, once the hand is long gone.
void check_fall(const ThrowLog& log, const Throw& one, double opening, Links& out) {
  constexpr double kGone = 0.15;  // s
  constexpr std::size_t kEnough = 8;
  const auto& mocap = *one.mocap;
  std::vector<double> t, z, fall;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || mocap.time(i) < opening + kGone) continue;
    if (one.landing && !one.landing->time.empty() && mocap.time(i) > one.landing->time(0)) continue;
    t.push_back(mocap.time(i) - opening), z.push_back(mocap.pose(i, 1));
    fall.push_back(-0.5 * log.gravity * t.back() * t.back());
  }
  if (t.size() < kEnough) return;
  const auto straight = dynamics::fit_line(t, z), falls = dynamics::fit_line(t, fall);
  ColumnPair bend;
  for (std::size_t i = 0; i < t.size(); ++i) bend.add(z[i] - straight.at(t[i]), fall[i] - falls.at(t[i]));
  keep(out, {Source::mocap, 1}, {Source::physics, 1}, bend.size_ratio(kShowsBend));
}

/// The landing beside where motion capture leads within its last tenth of a second.
void check_landing(const Throw& one, double opening, Links& out) {
  constexpr double kGap = 0.15;  // s
  const auto& landing = *one.landing;
  if (landing.time.empty() || landing.pose.empty() || landing.time(0) <= opening) return;
  const auto track = track_before_landing(one, kGap);
  if (!track) return;
  ColumnPair there, turned;
  there.add(landing.pose(0, 0), dynamics::fit_line(track->time, track->x).at(landing.time(0)));
  keep(out, {Source::landing, 0}, {Source::mocap, 0}, there.size_ratio(10 * kShowsShift));
  if (!tells_angle(landing)) return;
  turned.add(landing.pose(0, 1), dynamics::fit_line(track->time, track->theta).at(landing.time(0)));
  keep(out, {Source::landing, 2}, {Source::mocap, 2}, turned.size_ratio(10 * kShowsTurn));
}

Links links_of(const ThrowLog& log, const Throw& one) {
  Links out;
  if (!one.hand || one.hand->time.rows < 3) return out;
  const auto& hand = *one.hand;
  check_sums(hand.time, hand.pose, hand.twist, Source::pose, Source::twist, kShowsShift, kShowsTurn, out);
  check_sums(hand.time, hand.twist, hand.acceleration, Source::twist, Source::acceleration, kShowsSpeed,
             kShowsSpin, out);
  const auto opening = opening_of(log, one);
  if (!opening || *opening <= hand.time(0) || *opening > hand.time(hand.time.rows - 1)) return out;
  if (one.mocap) check_held(log, one, *opening, out), check_fall(log, one, *opening, out);
  if (one.mocap && one.landing) check_landing(one, *opening, out);
  if (!one.landing || one.landing->pose.empty() || one.landing->time.empty()) return out;
  const double flown = one.landing->time(0) - *opening;
  ColumnPair flight;
  flight.add(one.landing->pose(0, 0) - hand_at(hand.time, hand.pose, *opening)[0],
             hand_at(hand.time, hand.twist, *opening)[0] * flown);
  if (flown > 0) keep(out, {Source::landing, 0}, {Source::twist, 0}, flight.size_ratio(10 * kShowsShift));
  return out;
}

bool same(double ratio) { return ratio > 1 / kAgrees && ratio < kAgrees; }

/// The axis that stands against the most others, again and again until none does.
struct Blame {
  Axis axis;
  double ratio;
  std::string mistake;
};

std::vector<Blame> blamed(Links links) {
  constexpr double kWithin = 1.5;
  std::vector<Blame> out;
  while (true) {
    std::map<Axis, int> score;
    std::map<Axis, std::vector<double>> off;
    for (const auto& [link, ratio] : links)
      for (const bool first : {true, false}) {
        const Axis& axis = first ? link.first : link.second;
        score[axis] += same(ratio) ? -1 : 1;
        if (!same(ratio)) off[axis].push_back(first ? ratio : 1 / ratio);
      }
    std::optional<Blame> worst;
    int most = 0;
    for (const auto& [axis, ratios] : off) {
      if (axis.source == Source::physics) continue;
      const double ratio = dynamics::median(ratios);
      auto mistake = mistake_of(axis, ratio, kWithin);
      // Where all of the hand agrees with itself, motion capture that agrees with gravity or the landing
      // speaks against it.
      if (mistake.empty() || score[axis] < (axis.source == Source::pose ? 0 : 1)) continue;
      if (!worst || score[axis] > most) most = score[axis], worst = Blame{axis, ratio, mistake};
    }
    if (!worst) return out;
    std::erase_if(links, [&](const auto& link) {
      return link.first.first == worst->axis || link.first.second == worst->axis;
    });
    out.push_back(*worst);
  }
}

/// Whether a throw by itself shows what an axis is blamed for.
bool shows(const Links& links, const Blame& blame) {
  return std::any_of(links.begin(), links.end(), [&](const auto& one) {
    const auto& [link, ratio] = one;
    if (link.first != blame.axis && link.second != blame.axis) return false;
    return !same(ratio) && same((link.first == blame.axis ? ratio : 1 / ratio) / blame.ratio);
  });
}

UnitDoubt doubt_of(const Blame& blame, const std::string& throws, int n, const std::string& of_what) {
  const std::string name = name_of(blame.axis);
  return {
      fmt::format("/throws/{}/{}", throws, path_of(blame.axis.source)), name, blame.ratio, n,
      fmt::format("{} {} is {:.3g} times what the channels that tell the same say, accepted are {:.3g} to "
                  "{:.3g}: {}?",
                  of_what, name, blame.ratio, 1 / kAgrees, kAgrees, blame.mistake)};
}

}  // namespace

std::vector<UnitDoubt> contradicted_axes(const ThrowLog& log) {
  if (log.dimension != 2) return {};
  std::vector<Links> each;
  std::map<Link, std::vector<double>> all;
  for (const auto& one : log.throws) {
    each.push_back(links_of(log, one));
    for (const auto& [link, ratio] : each.back()) all[link].push_back(ratio);
  }
  Links usual;
  for (const auto& [link, ratios] : all) usual[link] = dynamics::median(ratios);
  std::vector<UnitDoubt> out;
  for (const auto& blame : blamed(usual)) {
    const auto n = std::count_if(each.begin(), each.end(), [&](const Links& l) { return shows(l, blame); });
    out.push_back(
        doubt_of(blame, "*", static_cast<int>(n),
                 fmt::format("in the median over throws ({} of {} show it)", n, log.throws.size())));
  }
  if (!out.empty()) return out;
  for (std::size_t i = 0; i < each.size(); ++i) {
    // A throw that went wrong lands elsewhere, and its hand may have moved against its log.
    std::erase_if(each[i], [](const auto& link) {
      return link.second < 0 || link.first == Link{{Source::landing, 0}, {Source::twist, 0}};
    });
    for (const auto& blame : blamed(each[i]))
      out.push_back(doubt_of(blame, log.throws[i].id, 1, "in this throw"));
  }
  return out;
}

std::vector<UnitDoubt> turned_vertical(const ThrowLog& log) {
  constexpr double kNear = 1.5;
  constexpr const char* kHorizontal[] = {"x", "y"};
  const std::size_t axes = static_cast<std::size_t>(log.dimension), z = axes - 1;
  std::vector<std::vector<double>> falls(axes);  // by axis: what a flight bends along it, in units of g
  std::size_t flights = 0;
  for (const auto& one : log.throws) {
    const auto bends = flight_bends(log, one);
    flights += !bends.empty();
    for (std::size_t c = 0; c < bends.size(); ++c)
      if (const auto ratio = bends[c].size_ratio(kShowsBend)) falls[c].push_back(*ratio);
  }
  const auto usual = [&](std::size_t c) {
    return 2 * falls[c].size() > flights ? dynamics::median(falls[c]) : 0;
  };
  const auto near_gravity = [](double ratio) {
    return std::abs(ratio) > 1 / kNear && std::abs(ratio) < kNear;
  };
  if (flights == 0 || usual(z) > 1 / kNear) return {};
  for (std::size_t c = 0; c < axes; ++c) {
    const double ratio = usual(c);
    if (!near_gravity(ratio)) continue;
    const std::string name = c == z ? "z" : kHorizontal[c];
    return {{"/throws/*/mocap/pose", name, ratio, static_cast<int>(flights),
             fmt::format(
                 "free flights fall along {}{} (by {:.3g} of gravity, median of {} throws), and not along "
                 "-z: which axis of the file points up?",
                 ratio > 0 ? "-" : "+", name, std::abs(ratio), falls[c].size())}};
  }
  return {};
}

}  // namespace unhand::experiment
