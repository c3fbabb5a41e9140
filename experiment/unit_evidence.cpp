#include "experiment/unit_evidence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "contact/patch.hpp"
#include "datasets/summary.hpp"
#include "dynamics/frames.hpp"
#include "dynamics/median.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/column_pair.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/unit_rules.hpp"

namespace unhand::experiment {

using datasets::Series;
using dynamics::Vec2;

std::array<double, 3> hand_at(const Series& time, const Series& values, double t) {
  const auto after = std::upper_bound(time.data.begin() + 1, time.data.end() - 1, t);
  const auto b = static_cast<std::size_t>(after - time.data.begin()), a = b - 1;
  const double s = std::clamp((t - time(a)) / (time(b) - time(a)), 0.0, 1.0);
  std::array<double, 3> out{};
  for (std::size_t c = 0; c < 3; ++c) out[c] = values(a, c) + s * (values(b, c) - values(a, c));
  return out;
}

std::optional<double> opening_of(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  if (log.gripper && log.gripper->opening_command_time) return log.gripper->opening_command_time;
  if (!logged.ft || logged.ft->normal_force.empty()) return logged.detach_time;
  const auto& force = logged.ft->normal_force.data;
  const auto most = std::max_element(force.begin(), force.end());
  const auto half = std::find_if(most, force.end(), [&](double f) { return f < 0.5 * *most; });
  if (half == force.end()) return logged.detach_time;
  return logged.ft->time(static_cast<std::size_t>(half - force.begin()));
}

std::vector<HeldWrench> held_wrenches(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                      double begin, double end, std::optional<double> grasp_angle) {
  const auto& object = log.objects.at(logged.object);
  const auto& ft = *logged.ft;
  const auto& hand = *logged.hand;
  const double pads = log.gripper ? log.gripper->n_pads : 2;
  // d: from the pads' centre to the CoM, in the hand frame.
  const Vec2<double> d = grasp_angle && object.com_offset
                             ? dynamics::rotate(*grasp_angle, Vec2<double>{*object.com_offset, 0})
                             : Vec2<double>{0, 0};
  const bool turns = grasp_angle && object.com_offset && object.inertia && object.inertia->size() == 1;
  std::vector<HeldWrench> out;
  for (std::size_t i = 0; i < ft.time.rows; ++i) {
    if (ft.time(i) < begin || ft.time(i) > end) continue;
    const auto pose = hand_at(hand.time, hand.pose, ft.time(i)),
               twist = hand_at(hand.time, hand.twist, ft.time(i)),
               a = hand_at(hand.time, hand.acceleration, ft.time(i));
    const Vec2<double> free = dynamics::rotate(-pose[2], Vec2<double>{a[0], a[1] + log.gravity});
    const double w2 = twist[2] * twist[2];
    const Vec2<double> f{object.mass * (free.x - a[2] * d.z - w2 * d.x),
                         object.mass * (free.z + a[2] * d.x - w2 * d.z)};
    out.push_back({{pads * ft.wrench(i, 0), pads * ft.wrench(i, 1), pads * ft.wrench(i, 2)},
                   {f.x, f.z, turns ? object.inertia->front() * a[2] + d.x * f.z - d.z * f.x : NAN}});
  }
  return out;
}

std::vector<ColumnPair> flight_bends(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  constexpr std::size_t kEnough = 8;
  if (logged.hand || !logged.mocap || !datasets::held_by(log, logged).empty()) return {};
  const auto& mocap = *logged.mocap;
  const auto axes = static_cast<std::size_t>(log.dimension);
  std::vector<double> time, fall;
  std::vector<std::vector<double>> position(axes);
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (!mocap.is_valid(i)) continue;
    if (logged.free_flight && (t < logged.free_flight->first || t > logged.free_flight->second)) continue;
    time.push_back(t);
    const double since = t - time.front();
    fall.push_back(-0.5 * log.gravity * since * since);
    for (std::size_t c = 0; c < axes; ++c) position[c].push_back(mocap.pose(i, c));
  }
  if (time.size() < kEnough) return {};
  const auto falls = dynamics::fit_line(time, fall);
  std::vector<ColumnPair> out(axes);
  for (std::size_t c = 0; c < axes; ++c) {
    const auto straight = dynamics::fit_line(time, position[c]);
    for (std::size_t i = 0; i < time.size(); ++i)
      out[c].add(position[c][i] - straight.at(time[i]), fall[i] - falls.at(time[i]));
  }
  return out;
}

std::optional<ForceLevels> force_levels(const datasets::Throw& logged) {
  constexpr double kMemory = 3, kWindow = 0.2;  // s
  constexpr std::size_t kEnough = 8;
  if (!logged.imu || !logged.free_flight) return {};
  const auto& [time, force, rate] = *logged.imu;
  const auto size = [&](std::size_t i) { return std::hypot(force(i, 0), force(i, 1), force(i, 2)); };
  std::vector<double> falling;
  std::size_t first = time.rows;  // of the fall
  for (std::size_t i = 0; i < time.rows; ++i) {
    if (time(i) < logged.free_flight->first || time(i) > logged.free_flight->second) continue;
    first = std::min(first, i);
    falling.push_back(size(i));
  }
  if (falling.size() < kEnough) return {};
  std::optional<ForceLevels> out;
  for (std::size_t begin = 0, end = 0; begin < first; ++begin) {
    if (time(first) - time(begin) > kMemory) continue;
    while (end < first && time(end) - time(begin) < kWindow) ++end;
    if (end == first) break;
    const auto n = static_cast<double>(end - begin);
    if (end - begin < kEnough) continue;
    std::array<double, 3> mean{};
    double squares = 0;
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t a = 0; a < 3; ++a) mean[a] += force(i, a) / n;
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t a = 0; a < 3; ++a) squares += (force(i, a) - mean[a]) * (force(i, a) - mean[a]) / n;
    const ForceLevels here{std::hypot(mean[0], mean[1], mean[2]), std::sqrt(squares), 0};
    if (!out || here.scatter < out->scatter) out = here;
  }
  if (out) out->fall = dynamics::median(falling);
  return out;
}

namespace {

/// Every sample of `value` minus the first, beside its derivative added up (trapezoids).
std::optional<double> ratio_to_integral(const Series& time, const Series& value, const Series& rate,
                                        std::size_t first, std::size_t last, double shows) {
  ColumnPair pairs;
  std::vector<double> sum(last - first, 0.0);
  for (std::size_t i = 1; i < time.rows; ++i)
    for (std::size_t c = first; c < last; ++c) {
      sum[c - first] += 0.5 * (rate(i, c) + rate(i - 1, c)) * (time(i) - time(i - 1));
      pairs.add(value(i, c) - value(0, c), sum[c - first]);
    }
  return pairs.fitted_ratio(shows);
}

void keep(SizeRatios& out, SizedColumn column, std::optional<double> ratio) {
  if (ratio && std::isfinite(*ratio)) out[column] = *ratio;
}

void check_hand(const datasets::HandLog& hand, SizeRatios& out) {
  const auto shift = ratio_to_integral(hand.time, hand.pose, hand.twist, 0, 2, kShowsShift),
             turn = ratio_to_integral(hand.time, hand.pose, hand.twist, 2, 3, kShowsTurn),
             speed = ratio_to_integral(hand.time, hand.twist, hand.acceleration, 0, 2, kShowsSpeed),
             spin = ratio_to_integral(hand.time, hand.twist, hand.acceleration, 2, 3, kShowsSpin);
  // A wrong clock makes every sum wrong alike.
  if (shift && speed) keep(out, SizedColumn::hand_clock, 1 / std::sqrt(*shift * *speed));
  keep(out, SizedColumn::hand_shift, shift);
  keep(out, SizedColumn::hand_turn, turn);
  keep(out, SizedColumn::hand_speed, speed);
  keep(out, SizedColumn::hand_spin, spin);
}

/// A throw while its object is held.
struct Held {
  const datasets::ThrowLog& log;
  const datasets::Throw& logged;
  const datasets::HandLog& hand;
  double begin, end;  ///< [s]

  const datasets::Object& object() const { return log.objects.at(logged.object); }
  /// From the pads' centre to the CoM [m], as far as anyone has said.
  double lever() const { return object().com_offset.value_or(0.1); }
  bool covers(double t) const { return t >= begin && t <= end; }
};

/// θ_O − θ_H while the object is held: motion capture's word, else the log's [rad].
std::optional<double> check_mocap(const Held& held, SizeRatios& out) {
  if (!held.logged.mocap) return held.logged.grasp_angle;
  const auto& mocap = *held.logged.mocap;
  ColumnPair shift, turn;
  double farthest = 0, widest = 0, angle = 0, distance = 0, n = 0;
  std::optional<std::pair<std::size_t, std::array<double, 3>>> first;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || !held.covers(mocap.time(i))) continue;
    const auto pose = hand_at(held.hand.time, held.hand.pose, mocap.time(i));
    angle += mocap.pose(i, 2) - pose[2], n += 1;
    distance += std::hypot(mocap.pose(i, 0) - pose[0], mocap.pose(i, 1) - pose[1]);
    if (!first) first = {i, pose};
    const auto& [i0, from] = *first;
    for (std::size_t c = 0; c < 2; ++c) shift.add(mocap.pose(i, c) - mocap.pose(i0, c), pose[c] - from[c]);
    turn.add(mocap.pose(i, 2) - mocap.pose(i0, 2), pose[2] - from[2]);
    farthest = std::max(farthest, std::hypot(pose[0] - from[0], pose[1] - from[1]));
    widest = std::max(widest, std::abs(pose[2] - from[2]));
  }
  // Where the hand hardly moves but turns, the object moves by its lever.
  if (farthest > held.lever() * std::min(widest, 2.0))
    keep(out, SizedColumn::held_shift, shift.fitted_ratio(kShowsShift));
  keep(out, SizedColumn::held_turn, turn.fitted_ratio(kShowsTurn));
  if (const auto offset = held.object().com_offset; offset && n > 0 && distance > n * kShowsLever)
    keep(out, SizedColumn::lever, std::abs(*offset) * n / distance);
  return n > 0 ? std::optional(angle / n) : held.logged.grasp_angle;
}

/// Newton and Euler for the held body, about the pads' centre, in the hand frame.
void check_wrench(const Held& held, std::optional<double> grasp_angle, SizeRatios& out) {
  ColumnPair force, torque;
  for (const auto& [seen, needed] : held_wrenches(held.log, held.logged, held.begin, held.end, grasp_angle)) {
    force.add(seen[0], needed[0]);
    force.add(seen[1], needed[1]);
    if (std::isfinite(needed[2])) torque.add(seen[2], needed[2]);
  }
  keep(out, SizedColumn::force, force.fitted_ratio(kShowsNewton));
  keep(out, SizedColumn::torque, torque.fitted_ratio(kShowsNewtonMetre));
}

/// A free flight of the pads' centre from the end of the grasp.
void check_landing(const Held& held, SizeRatios& out) {
  const auto& landing = *held.logged.landing;
  const auto from = hand_at(held.hand.time, held.hand.pose, held.end),
             with = hand_at(held.hand.time, held.hand.twist, held.end);
  const double g = held.log.gravity, drop = from[1] - held.log.landing_height,
               under = with[1] * with[1] + 2 * g * drop;
  if (!(under >= 0) || !(g > 0) || landing.pose.empty()) return;
  const double fall = (with[1] + std::sqrt(under)) / g;
  ColumnPair x;
  x.add(landing.pose(0, 0), from[0] + with[0] * fall);
  keep(out, SizedColumn::landing_x, x.fitted_ratio(5 * kShowsShift));
  if (landing.time.empty()) return;
  if (held.end + fall > 0) keep(out, SizedColumn::landing_clock, landing.time(0) / (held.end + fall));
  if (!held.logged.mocap || !tells_angle(landing)) return;
  // On from the last two samples that lie far enough apart for a rate.
  const auto& mocap = *held.logged.mocap;
  constexpr double kApart = 0.02;  // s
  std::optional<std::size_t> last;
  for (std::size_t i = mocap.time.rows; i-- > 0;) {
    if (!mocap.is_valid(i) || mocap.time(i) > landing.time(0) || mocap.time(i) < held.end) continue;
    if (!last) last = i;
    const double apart = mocap.time(*last) - mocap.time(i), left = landing.time(0) - mocap.time(*last);
    if (apart < kApart) continue;
    if (left > 5 * kApart) return;
    const double rate = (mocap.pose(*last, 2) - mocap.pose(i, 2)) / apart;
    ColumnPair turn;
    turn.add(landing.pose(0, 1), mocap.pose(*last, 2) + rate * left);
    keep(out, SizedColumn::landing_turn, turn.fitted_ratio(10 * kShowsTurn));
    return;
  }
}

/// What a series reads at its end: median of its last samples.
double at_the_end(const Series& series) {
  constexpr std::ptrdiff_t kLast = 9;
  const auto n = static_cast<std::ptrdiff_t>(series.data.size());
  return dynamics::median(std::vector<double>(series.data.end() - std::min(n, kLast), series.data.end()));
}

/// The pads slip while the normal force falls through its last fifth, down to where it stays. Their torque,
/// where a declared radius tells what it counts for, uses up friction, too: of an ellipsoid, and within
/// sqrt(2) of any other law.
void check_friction(const datasets::ThrowLog& log, const datasets::FtLog& ft, double opening,
                    SizeRatios& out) {
  const double length =
      contact::kUniformDisc * (log.gripper ? log.gripper->pad_radius.value_or(HUGE_VAL) : HUGE_VAL);
  const auto& force = ft.normal_force;
  if (force.empty()) return;
  const double most = *std::max_element(force.data.begin(), force.data.end()), sigma = force.sigma_of(),
               low = std::max(0.0, at_the_end(force)) + std::max(0.02 * most, 4 * sigma);
  std::vector<std::pair<double, double>> slips;  // normal force, and friction
  for (std::size_t i = 0; i < ft.time.rows; ++i)
    if (ft.time(i) > opening && force(i) > low && force(i) < 0.2 * most)
      slips.emplace_back(force(i),
                         std::hypot(ft.wrench(i, 0), ft.wrench(i, 1), ft.wrench(i, 2) / length) / force(i));
  if (slips.empty()) return;
  std::sort(slips.begin(), slips.end());
  const auto friction = [&](std::size_t from, std::size_t to) {
    std::vector<double> of;
    for (std::size_t i = from; i < to; ++i) of.push_back(slips[i].second);
    return dynamics::median(of);
  };
  const std::size_t n = slips.size();
  keep(out, SizedColumn::slip_force, friction(0, n));
  if (n >= 2) keep(out, SizedColumn::slip_growth, friction((n + 1) / 2, n) / friction(0, n / 2));
}

/// Whether a sensor may sample a throw at these times [s]: 10 Hz to 50 kHz.
bool is_a_pace(const Series& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.rows; ++i) steps.push_back(time(i) - time(i - 1));
  const double step = dynamics::median(steps);
  return step >= 2e-5 && step <= 0.1;
}

}  // namespace

SizeRatios compare_sizes(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  SizeRatios out;
  if (const auto bends = flight_bends(log, logged); !bends.empty())
    keep(out, SizedColumn::fall, bends.back().fitted_ratio(kShowsBend));
  if (const auto levels = force_levels(logged); levels && levels->at_rest() && log.gravity > 0)
    out[SizedColumn::rest] = levels->before / log.gravity;
  if (log.dimension != 2 || !logged.hand || logged.hand->time.rows < 3) return out;
  const auto& hand = *logged.hand;
  check_hand(hand, out);
  const double begin = hand.time(0), end = hand.time(hand.time.rows - 1);
  for (const auto& [rule, time] :
       {std::pair{SizedColumn::ft_clock, logged.ft ? &logged.ft->time : nullptr},
        std::pair{SizedColumn::mocap_clock, logged.mocap ? &logged.mocap->time : nullptr}})
    // A recording may be as long as it likes, if a sensor may have its pace.
    if (time && time->rows > 1)
      keep(out, rule,
           is_a_pace(*time) && is_a_pace(hand.time) ? 1
                                                    : ((*time)(time->rows - 1) - (*time)(0)) / (end - begin));
  const auto opening = opening_of(log, logged);
  if (!opening || *opening <= begin || *opening > end) return out;
  const Held held{log, logged, hand, begin, *opening};
  const auto grasp_angle = check_mocap(held, out);
  if (logged.ft) {
    check_wrench(held, grasp_angle, out);
    check_friction(log, *logged.ft, *opening, out);
  }
  if (logged.landing) check_landing(held, out);
  return out;
}

std::optional<double> lever_angle(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  if (log.dimension != 2 || !logged.hand || logged.hand->time.rows < 3 || !logged.mocap) return {};
  const auto& hand = *logged.hand;
  const auto& mocap = *logged.mocap;
  const auto offset = log.objects.at(logged.object).com_offset;
  const auto opening = opening_of(log, logged);
  if (!offset || std::abs(*offset) < kShowsLever || !opening) return {};
  const double begin = hand.time(0), end = std::min(*opening, hand.time(hand.time.rows - 1));
  Vec2<double> sum{0, 0};
  double n = 0;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || mocap.time(i) < begin || mocap.time(i) > end) continue;
    const auto pose = hand_at(hand.time, hand.pose, mocap.time(i));
    const auto d = dynamics::rotate(-mocap.pose(i, 2),
                                    Vec2<double>{mocap.pose(i, 0) - pose[0], mocap.pose(i, 1) - pose[1]});
    sum.x += d.x, sum.z += d.z, n += 1;
  }
  const double ratio = n > 0 ? std::hypot(sum.x, sum.z) / (n * std::abs(*offset)) : 0;
  if (!(ratio > 0.5 && ratio < 2)) return {};
  const double sign = *offset > 0 ? 1 : -1;
  return std::atan2(sign * sum.z, sign * sum.x);
}

std::optional<TimedLanding> timed_landing(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  if (!logged.hand || logged.hand->time.rows < 3 || !logged.landing || logged.landing->time.empty())
    return {};
  const auto& hand = *logged.hand;
  const auto opening = opening_of(log, logged);
  if (!opening || *opening <= hand.time(0) || *opening > hand.time(hand.time.rows - 1)) return {};
  const double t = logged.landing->time(0) - *opening;
  if (!(t > 0)) return {};
  const double z = hand_at(hand.time, hand.pose, *opening)[1],
               vz = hand_at(hand.time, hand.twist, *opening)[1], fall = 0.5 * log.gravity * t * t;
  return TimedLanding{z + vz * t - fall, 1 + 0.5 * fall};
}

std::optional<LastTrack> track_before_landing(const datasets::Throw& logged, double gap) {
  constexpr double kLast = 0.1;  // s
  const auto& mocap = *logged.mocap;
  const double landed = logged.landing->time(0);
  LastTrack out;
  for (std::size_t i = mocap.time.rows; i-- > 0;) {
    if (!mocap.is_valid(i) || mocap.time(i) > landed) continue;
    if (!out.time.empty() && mocap.time(i) < out.time.front() - kLast) break;
    out.time.push_back(mocap.time(i));
    out.x.push_back(mocap.pose(i, 0)), out.theta.push_back(mocap.pose(i, 2));
  }
  if (out.time.size() < 4 || landed - out.time.front() > gap) return {};
  return out;
}

std::optional<double> highest_point(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  std::optional<double> out;
  const auto at_least = [&](double z) { out = std::max(out.value_or(z), z); };
  if (logged.mocap)
    for (std::size_t i = 0; i < logged.mocap->time.rows; ++i)
      if (logged.mocap->is_valid(i)) at_least(logged.mocap->pose(i, log.dimension == 2 ? 1 : 2));
  if (log.dimension == 2 && logged.hand)
    for (std::size_t i = 0; i < logged.hand->time.rows; ++i) {
      const double rise = std::max(0.0, logged.hand->twist(i, 1));
      at_least(logged.hand->pose(i, 1) + (log.gravity > 0 ? rise * rise / (2 * log.gravity) : 0.0));
    }
  return out;
}

}  // namespace unhand::experiment
