#include "planners/arm/jerk_profile.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "planners/arm/dynamics.hpp"

namespace unhand::planners {

void JerkProfile::append(const std::vector<JerkPiece>& pieces) {
  for (const auto& [h, jerk] : pieces) {
    if (!(h >= 0 && std::isfinite(h)))
      throw std::invalid_argument(fmt::format("jerk profile: duration = {} is not in [0, inf) s", h));
    if (!std::isfinite(jerk))
      throw std::invalid_argument(fmt::format("jerk profile: jerk = {} rad/s³ is not finite", jerk));
    JointSample& from = knots_.back();
    from.jerk = jerk;
    knots_.push_back({from.q + h * (from.qd + h * (from.qdd / 2 + h * jerk / 6)),
                      from.qd + h * (from.qdd + h * jerk / 2), from.qdd + h * jerk, 0});
    times_.push_back(times_.back() + h);
  }
}

JointSample JerkProfile::at(double t) const {
  if (std::isnan(t)) throw std::invalid_argument("jerk profile: t = nan s is no instant");
  if (t < 0) return {knots_[0].q + t * knots_[0].qd, knots_[0].qd, 0, 0};
  if (t >= times_.back()) {
    const JointSample& last = knots_.back();
    return {last.q + (t - times_.back()) * last.qd, last.qd, t > times_.back() ? 0 : last.qdd, 0};
  }
  const auto next = std::upper_bound(times_.begin(), times_.end(), t);
  const auto i = static_cast<std::size_t>(next - times_.begin()) - 1;
  const double h = t - times_[i];
  const auto& [q, qd, qdd, jerk] = knots_[i];
  return {q + h * (qd + h * (qdd / 2 + h * jerk / 6)), qd + h * (qdd + h * jerk / 2), qdd + h * jerk, jerk};
}

void JerkProfile::extremes(std::vector<double>& out) const {
  for (std::size_t i = 0; i < times_.size(); ++i) {
    out.push_back(times_[i]);
    if (i + 1 == times_.size() || knots_[i].jerk == 0) continue;
    const double t = times_[i] - knots_[i].qdd / knots_[i].jerk;
    if (t > times_[i] && t < times_[i + 1]) out.push_back(t);
  }
}

namespace {

/// The velocity gained when the acceleration goes 0 → peak → a in `duration` with jerks of ±j.
double gained(double peak, double a, double duration, double j) {
  const double first = std::abs(peak) / j, last = std::abs(peak - a) / j;
  return 0.5 * peak * first + peak * (duration - first - last) + 0.5 * (peak + a) * last;
}
/// The peaks that `duration` and the limits allow.
std::pair<double, double> peaks(double a, double duration, const JointLimits& l) {
  return {std::max(-0.5 * (l.jerk * duration - a), -l.acceleration),
          std::min(0.5 * (l.jerk * duration + a), l.acceleration)};
}

constexpr int kHalvings = 60;  ///< of an interval: to rounding

void require_ramp(double v, double a, const JointLimits& limits) {
  if (!std::isfinite(v) || !std::isfinite(a))
    throw std::invalid_argument(fmt::format("velocity ramp: to {} rad/s with {} rad/s² is not finite", v, a));
  if (!(limits.acceleration > 0 && std::isfinite(limits.acceleration)) ||
      !(limits.jerk > 0 && std::isfinite(limits.jerk)))
    throw std::invalid_argument(
        fmt::format("velocity ramp: limits of {} rad/s² and {} rad/s³ are not in (0, inf)",
                    limits.acceleration, limits.jerk));
}

}  // namespace

std::optional<std::vector<JerkPiece>> velocity_ramp(double v, double a, double duration,
                                                    const JointLimits& limits) {
  require_ramp(v, a, limits);
  if (!(duration >= 0 && std::isfinite(duration)))
    throw std::invalid_argument(fmt::format("velocity ramp: duration = {} is not in [0, inf) s", duration));
  const double j = limits.jerk;
  if (std::abs(a) > limits.acceleration || duration * j < std::abs(a) * (1 - 1e-12)) return {};
  auto [low, high] = peaks(a, duration, limits);
  // The velocity gained grows with the peak; rounding at the shortest duration is forgiven.
  const double slack = 1e-9 * (1 + std::abs(v));
  if (gained(low, a, duration, j) > v + slack || gained(high, a, duration, j) < v - slack) return {};
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (gained(middle, a, duration, j) < v ? low : high) = middle;
  }
  const double peak = 0.5 * (low + high), first = std::abs(peak) / j, last = std::abs(peak - a) / j;
  return std::vector<JerkPiece>{{first, std::copysign(j, peak)},
                                {std::max(0.0, duration - first - last), 0.0},
                                {last, std::copysign(j, a - peak)}};
}

double shortest_ramp(double v, double a, const JointLimits& limits) {
  require_ramp(v, a, limits);
  if (std::abs(a) > limits.acceleration) return std::numeric_limits<double>::infinity();
  const auto possible = [&](double duration) {
    const auto [low, high] = peaks(a, duration, limits);
    return low <= high && gained(low, a, duration, limits.jerk) <= v &&
           gained(high, a, duration, limits.jerk) >= v;
  };
  double low = std::abs(a) / limits.jerk, high = low + 1e-3;
  if (possible(low)) return low;
  while (!possible(high) && high < 1e6) high *= 2;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (possible(middle) ? high : low) = middle;
  }
  return high;
}

std::vector<JerkPiece> rest_to_rest(double velocity, double acceleration, double jerk) {
  for (const auto& [name, value, unit] : {std::tuple{"velocity", velocity, "1/s"},
                                          {"acceleration", acceleration, "1/s²"},
                                          {"jerk", jerk, "1/s³"}})
    if (!(value > 0 && std::isfinite(value)))
      throw std::invalid_argument(
          fmt::format("motion from rest to rest: {} = {} is not in (0, inf) {}", name, value, unit));
  double v = velocity;
  const auto ramp = [&] {  // duration of one jerk piece, and of speeding up
    const double piece = v * jerk >= acceleration * acceleration ? acceleration / jerk : std::sqrt(v / jerk);
    return std::pair{piece, v * jerk >= acceleration * acceleration ? piece + v / acceleration : 2 * piece};
  };
  if (v * ramp().second > 1) {  // the top speed is not reached
    const double piece = acceleration / jerk;
    v = 0.5 * acceleration * (std::sqrt(piece * piece + 4 / acceleration) - piece);
    if (v * jerk < acceleration * acceleration) v = std::cbrt(jerk / 4);
  }
  const auto [piece, up] = ramp();
  const double j = v / (piece * (up - piece)), hold = up - 2 * piece, cruise = std::max(0.0, 1 / v - up);
  return {{piece, j}, {hold, 0}, {piece, -j}, {cruise, 0}, {piece, -j}, {hold, 0}, {piece, j}};
}

JointTrajectory::State JointTrajectory::at(double t) const {
  const auto n = static_cast<Eigen::Index>(joints.size());
  State out{JointVector<double>(n), JointVector<double>(n), JointVector<double>(n), JointVector<double>(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const JointSample s = joints[static_cast<std::size_t>(i)].at(t - begin);
    out.q[i] = s.q, out.qd[i] = s.qd, out.qdd[i] = s.qdd, out.jerk[i] = s.jerk;
  }
  return out;
}

bool LimitCheck::within(double tolerance) const {
  for (const LimitUse* use : {&position, &velocity, &acceleration, &jerk, &torque})
    if (!(use->fraction <= 1 + tolerance)) return false;
  return true;
}

std::string LimitCheck::worst(const Chain& chain) const {
  const std::pair<const LimitUse*, const char*> all[]{{&position, "position"},
                                                      {&velocity, "velocity"},
                                                      {&acceleration, "acceleration"},
                                                      {&jerk, "jerk"},
                                                      {&torque, "torque"}};
  const auto most = *std::max_element(std::begin(all), std::end(all), [](const auto& a, const auto& b) {
    return a.first->fraction < b.first->fraction;
  });
  if (most.first->joint < 0 || most.first->joint >= chain.size())
    throw std::invalid_argument(
        fmt::format("limit check: joint {} is not in [0, {}]", most.first->joint, chain.size() - 1));
  return fmt::format("{} of {} at {:.1f} % of its limit at {:.4f} s", most.second,
                     chain.joints[most.first->joint].name, 100 * most.first->fraction, most.first->time);
}

LimitCheck check_limits(const Chain& chain, const JointTrajectory& trajectory, double step) {
  if (!(step >= kLeastCheckStep && std::isfinite(step)))
    throw std::invalid_argument(
        fmt::format("limit check: step = {} is not in [{}, inf) s", step, kLeastCheckStep));
  if (static_cast<int>(trajectory.joints.size()) != chain.size())
    throw std::invalid_argument(fmt::format("limit check: the motion of {} joints is not one of {}",
                                            trajectory.joints.size(), chain.size()));
  LimitCheck out;
  out.lowest = std::numeric_limits<double>::infinity();
  const auto note = [](LimitUse& use, double fraction, int joint, double t) {
    if (!(fraction <= use.fraction)) use = {fraction, joint, t};
  };
  std::vector<double> times;
  for (const JerkProfile& joint : trajectory.joints) joint.extremes(times);
  for (double& t : times) t += trajectory.begin;
  const auto grid = times.size();  // from here on every `step`
  const int steps = static_cast<int>(std::ceil((trajectory.end() - trajectory.begin) / step));
  for (int k = 0; k < steps; ++k) times.push_back(trajectory.begin + k * step);
  JointVector<double> before;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const double t = times[k];
    const auto s = trajectory.at(t);
    const JointVector<double> torque =
        inverse_dynamics(chain, s.q, s.qd, s.qdd) + friction_torque(chain, s.qd);
    for (int i = 0; i < chain.size(); ++i) {
      const JointLimits& l = chain.joints[i].limits;
      if (std::isfinite(l.upper - l.lower))
        note(out.position, std::abs(2 * s.q[i] - l.lower - l.upper) / (l.upper - l.lower), i, t);
      note(out.velocity, std::abs(s.qd[i]) / l.velocity, i, t);
      note(out.acceleration, std::abs(s.qdd[i]) / l.acceleration, i, t);
      note(out.jerk, std::abs(s.jerk[i]) / l.jerk, i, t);
      note(out.torque, std::abs(torque[i]) / l.torque, i, t);
      if (k > grid)
        if (const double rate = std::abs(torque[i] - before[i]) / step; rate > out.torque_rate.value)
          out.torque_rate = {rate, i, t};
    }
    before = torque;
    out.lowest = std::min(out.lowest, lowest_height(chain, frames_of(chain, s.q)));
  }
  return out;
}

}  // namespace unhand::planners
