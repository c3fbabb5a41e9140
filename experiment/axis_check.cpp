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

double correlation(const std::vector<double>& a, const std::vector<double>& b, bool about_means) {
  const auto n = static_cast<double>(a.size());
  double ma = 0, mb = 0, aa = 0, ab = 0, bb = 0;
  if (about_means)
    for (std::size_t i = 0; i < a.size(); ++i) ma += a[i] / n, mb += b[i] / n;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - ma) * (a[i] - ma), bb += (b[i] - mb) * (b[i] - mb);
    ab += (a[i] - ma) * (b[i] - mb);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

double spread(const std::vector<double>& a) {
  double mean = 0, sum = 0;
  for (const double x : a) mean += x / static_cast<double>(a.size());
  for (const double x : a) sum += (x - mean) * (x - mean);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

/// fx and fz of all throws beside what the held objects need, as they stand and crossed.
class Crossing {
 public:
  void add(const HeldWrench& sample) {
    for (std::size_t c = 0; c < 2; ++c) {
      own_[c].push_back(sample.seen[c] - sample.needed[c]);
      reversed_[c].push_back(sample.seen[c] + sample.needed[c]);
      crossed_[c].push_back(sample.seen[1 - c] - sample.needed[c]);
      needed_[c].push_back(sample.needed[c]);
    }
  }
  /// Crossed they fit, and neither as they stand nor reversed; and not by a bias alone, which the means take
  /// out.
  bool fits_crossed() const {
    constexpr double kCloser = 0.5, kWithin = 0.6, kCloserAboutMeans = 0.8;
    if (needed_[0].empty()) return false;
    const auto both = [](double (*size)(const std::vector<double>&), const auto& of) {
      return std::hypot(size(of[0]), size(of[1]));
    };
    return both(rms, crossed_) < kCloser * std::min(both(rms, own_), both(rms, reversed_)) &&
           both(rms, crossed_) < kWithin * both(rms, needed_) &&
           both(spread, crossed_) < kCloserAboutMeans * both(spread, own_);
  }

 private:
  static double rms(const std::vector<double>& a) {
    double sum = 0;
    for (const double x : a) sum += x * x;
    return std::sqrt(sum / static_cast<double>(a.size()));
  }
  std::array<std::vector<double>, 2> own_, reversed_, crossed_, needed_;
};

std::optional<double> seen_grasp(const Throw& one, double opening) {
  if (!one.mocap) return one.grasp_angle;
  double sum = 0, n = 0;
  for (std::size_t i = 0; i < one.mocap->time.rows; ++i) {
    const double t = one.mocap->time(i);
    if (!one.mocap->is_valid(i) || t < one.hand->time(0) || t > opening) continue;
    sum += one.mocap->pose(i, 2) - hand_at(one.hand->time, one.hand->pose, t)[2], n += 1;
  }
  return n > 0 ? std::optional(sum / n) : one.grasp_angle;
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

std::vector<UnitDoubt> reversed_wrenches(const ThrowLog& log) {
  constexpr const char* kNames[] = {"fx", "fz", "tau"};
  constexpr double kAgainst = -0.9, kRaw = -0.5, kSize = 5, kCrossed = 0.95, kOwn = 0.9;
  constexpr std::size_t kEnough = 10;
  if (log.dimension != 2) return {};
  std::array<std::vector<double>, 3> about, raw, size;
  std::array<std::vector<double>, 2> crossed;
  Crossing crossing;
  int compared = 0;
  for (const auto& one : log.throws) {
    if (!one.hand || one.hand->time.rows < 3 || !one.ft) continue;
    const auto opening = opening_of(log, one);
    if (!opening || *opening <= one.hand->time(0) || *opening > one.hand->time(one.hand->time.rows - 1))
      continue;
    const auto held = held_wrenches(log, one, one.hand->time(0), *opening, seen_grasp(one, *opening));
    if (held.size() < kEnough) continue;
    const bool lever = lever_angle(log, one).has_value();
    std::array<std::vector<double>, 3> seen, needed;
    for (const auto& sample : held) {
      crossing.add(sample);
      for (std::size_t c = 0; c < 3; ++c)
        seen[c].push_back(sample.seen[c]), needed[c].push_back(sample.needed[c]);
    }
    ++compared;
    std::array<bool, 3> moves{};
    for (std::size_t c = 0; c < 3; ++c) {
      moves[c] = spread(needed[c]) > (c == 2 ? kShowsNewtonMetre : kShowsNewton);  // not if it is NaN
      if (!moves[c] || (c == 2 && !lever)) continue;
      about[c].push_back(correlation(seen[c], needed[c], true));
      raw[c].push_back(correlation(seen[c], needed[c], false));
      size[c].push_back(spread(seen[c]) / spread(needed[c]));
    }
    if (moves[0] && moves[1])
      for (std::size_t c = 0; c < 2; ++c)
        crossed[c].push_back(std::abs(correlation(seen[c], needed[1 - c], true)));
  }
  std::vector<UnitDoubt> out;
  const auto tell_swapped = [&] {
    out.push_back({"/throws/*/ft/wrench", "fx", 1, compared,
                   fmt::format("fx goes with the fz, and fz with the fx, that mass and motion of the held "
                               "object need ({} throws): axes swapped?",
                               compared)});
    return out;
  };
  // Where what they need goes opposite ways, a swap looks like a reversed sign, too.
  if (crossing.fits_crossed()) return tell_swapped();
  for (std::size_t c = 0; c < 3; ++c) {
    if (about[c].empty()) continue;
    const double against = dynamics::median(about[c]), ratio = dynamics::median(size[c]);
    if (against > kAgainst || dynamics::median(raw[c]) > kRaw || ratio > kSize || ratio < 1 / kSize) continue;
    const auto n =
        std::count_if(about[c].begin(), about[c].end(), [&](double each) { return each <= kAgainst; });
    out.push_back(
        {"/throws/*/ft/wrench", kNames[c], -ratio, static_cast<int>(n),
         fmt::format("{} goes against what mass and motion of the held object need (correlation {:.2f}, "
                     "median of {} throws, of which {} show it), and the wrench is the one that the pad "
                     "applies to the object, in "
                     "the hand frame: is the sign reversed, a reaction logged for the action, or that axis?",
                     kNames[c], against, about[c].size(), n)});
  }
  if (!out.empty() || crossed[0].empty()) return out;
  if (dynamics::median(crossed[0]) > kCrossed && dynamics::median(crossed[1]) > kCrossed &&
      std::abs(dynamics::median(about[0])) < kOwn && std::abs(dynamics::median(about[1])) < kOwn)
    return tell_swapped();
  return out;
}

std::vector<UnitDoubt> reversed_forces(const ThrowLog& log) {
  constexpr double kMost = 0.95;
  constexpr std::size_t kEnough = 10;
  std::vector<double> levels;  // of throws that show it
  std::vector<std::string> ids;
  std::size_t seen = 0;
  for (const auto& one : log.throws) {
    const auto opening = one.ft ? opening_of(log, one) : std::nullopt;
    if (!opening) continue;
    std::vector<double> held;
    for (std::size_t i = 0; i < one.ft->normal_force.rows && one.ft->time(i) < *opening; ++i)
      held.push_back(one.ft->normal_force(i));
    if (held.size() < kEnough) continue;
    ++seen;
    const auto below = std::count_if(held.begin(), held.end(), [](double f) { return f < 0; });
    if (static_cast<double>(below) < kMost * static_cast<double>(held.size())) continue;
    levels.push_back(dynamics::median(held));
    ids.push_back(one.id);
  }
  if (levels.empty()) return {};
  const bool most = 2 * levels.size() > seen;
  const double level = dynamics::median(levels);
  return {{fmt::format("/throws/{}/ft/normal_force", most ? "*" : ids.front()), "f_N", -1,
           static_cast<int>(levels.size()),
           fmt::format("f_N is {:.3g} N before the gripper opens (median of {} throws that show it, of {}), "
                       "and pads that hold an object press with more than 0 N: is the sign reversed?",
                       level, levels.size(), seen)}};
}

}  // namespace unhand::experiment
