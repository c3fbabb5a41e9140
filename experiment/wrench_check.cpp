#include "experiment/wrench_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "dynamics/median.hpp"
#include "experiment/unit_evidence.hpp"
#include "experiment/unit_rules.hpp"

namespace unhand::experiment {
namespace {

using datasets::Throw;
using datasets::ThrowLog;

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
