#include "experiment/prepared_throw.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "datasets/assemble.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/seen_grasp.hpp"

namespace unhand::experiment {

using datasets::LogError;
using datasets::Series;
using dynamics::Window;

namespace {

std::array<double, 3> sigma_of(const Series& series) {
  return {series.sigma_of(0), series.sigma_of(1), series.sigma_of(2)};
}

/// The state at `detach` of the free flight that explains the motion capture from `from` on. Drag enters as a
/// correction to the samples, by iteration: the difference of the flights with and without it from the same
/// state.
void measure_flight(const datasets::ThrowLog& log, const datasets::Throw& logged, double from, double detach,
                    PreparedThrow& out) {
  std::vector<double> t, x, z, theta;
  const auto& mocap = *logged.mocap;
  const double until = flight_end(log, logged, detach);
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || mocap.time(i) < from || mocap.time(i) >= until) continue;
    t.push_back(mocap.time(i) - detach);
    x.push_back(mocap.pose(i, 0));
    z.push_back(mocap.pose(i, 1));
    theta.push_back(mocap.pose(i, 2));
  }
  if (t.size() < 4) return;
  std::vector<double> drag_x(t.size()), drag_z(t.size()), xs(t.size()), zs(t.size());
  dynamics::Pose<double> pose;
  dynamics::Twist<double> twist;
  constexpr int kMostIterations = 100;  // each takes off a share of about k |v| times the flight's duration
  constexpr double kSettled = 1e-9;     // [m/s]
  double change = HUGE_VAL;
  for (int iteration = 0; iteration < kMostIterations && change > kSettled; ++iteration) {
    for (std::size_t i = 0; i < t.size(); ++i) {
      xs[i] = x[i] - drag_x[i] - 0.5 * out.gravity.x * t[i] * t[i];
      zs[i] = z[i] - drag_z[i] - 0.5 * out.gravity.z * t[i] * t[i];
    }
    const auto lx = dynamics::fit_line(t, xs), lz = dynamics::fit_line(t, zs),
               lt = dynamics::fit_line(t, theta);
    change = std::hypot(lx.slope - twist.vx, lz.slope - twist.vz);
    pose = {lx.at(0), lz.at(0), lt.at(0)};
    twist = {lx.slope, lz.slope, lt.slope};
    if (out.drag_k <= 0) {
      change = 0;
      break;
    }
    const flight::FlightProblem<double> with{pose, twist, out.gravity, out.drag_k, out.landing_height,
                                             {},   30};
    const auto poses = flight::fly_through(with, t);
    for (std::size_t i = 0; i < t.size(); ++i) {
      const auto free = flight::ballistic(pose, twist, out.gravity, t[i]).pose;
      drag_x[i] = poses[i].x - free.x;
      drag_z[i] = poses[i].z - free.z;
    }
  }
  if (!(change <= kSettled)) return;  // a drag that stops the object before the flight ends
  out.measured.detach_pose = pose;
  out.measured.detach_twist = twist;
}

/// The log, one of its throws, and how to refuse it.
struct LoggedThrow {
  const datasets::ThrowLog& log;
  const datasets::Throw& logged;
  const std::string& file;
  std::string path() const { return "/throws/" + logged.id; }
  [[noreturn]] void reject(const std::string& where, const std::string& why) const {
    throw LogError(file, where, why);
  }
};

release::HandFit fitted_hand(const LoggedThrow& source) {
  const datasets::HandLog& hand = *source.logged.hand;
  try {
    return release::fit_hand_motion({hand.time.data, hand.pose.data, hand.twist.data, hand.acceleration.data,
                                     sigma_of(hand.pose), sigma_of(hand.twist), sigma_of(hand.acceleration)},
                                    source.logged.hand_jump_times);
  } catch (const std::invalid_argument& error) {
    source.reject(source.path() + "/hand", error.what());
  }
}

/// Whether the log shows that the pads let go: a landing, a free flight, or an object that motion capture
/// last sees elsewhere in the hand than first.
bool lets_go(const LoggedThrow& source, const release::HandMotion& hand) {
  if (source.logged.landing || source.logged.free_flight) return true;
  if (!source.logged.mocap) return false;
  constexpr double kGone = 0.05;  // [m]
  const datasets::MocapLog& mocap = *source.logged.mocap;
  const Window whole{hand.begin(), hand.end()};
  std::optional<double> first;
  double last = 0;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (!mocap.is_valid(i) || t < hand.begin() || t > hand.end()) continue;
    const auto pose = hand.at(whole, t).pose;
    last = std::hypot(mocap.pose(i, 0) - pose.x, mocap.pose(i, 1) - pose.z);
    if (!first) first = last;
  }
  return first && std::abs(last - *first) > kGone;
}

void smooth_force(const LoggedThrow& source, PreparedThrow& out) {
  if (!source.logged.ft || datasets::is_constant(source.logged.ft->normal_force)) return;
  const auto& series = source.logged.ft->normal_force;
  contact::NormalForceOptions options;
  if (lets_go(source, out.hand)) options.max_tail_bias = 0.5;  // what is left then is the sensor's
  try {
    auto force =
        contact::smooth_normal_force(source.logged.ft->time.data, series.data, series.sigma_of(), options);
    out.normal_force = std::move(force.force);
    out.force_fit = force.summary;
  } catch (const std::invalid_argument& error) {
    source.reject(source.path() + "/ft/normal_force", error.what());
  }
}

/// When the gripper is told to open [s]: declared, seen in the smoothed normal force, or else at detach.
double opening_command(const LoggedThrow& source, const PreparedThrow& prepared) {
  const auto& gripper = source.log.gripper;
  if (gripper && gripper->opening_command_time) return *gripper->opening_command_time;
  if (std::isfinite(prepared.force_fit.opening_start) && prepared.normal_force)
    return prepared.force_fit.opening_start;
  if (!source.logged.detach_time)
    source.reject(
        "/gripper@opening_command_time",
        "missing, and " + source.path() + " has neither a normal force that opens nor a detach_time");
  return *source.logged.detach_time;
}

/// The grasp: as declared, or the mean that motion capture saw while the object was held.
release::Grasp<double> grasp_of(const LoggedThrow& source, const PreparedThrow& prepared) {
  double angle = 0, offset_x = 0;
  int seen = 0;
  each_seen_in_hand(source.logged, prepared.hand, prepared.open_command,
                    [&](double turned, const dynamics::Vec2<double>& at) {
                      angle += turned, offset_x += at.x;
                      ++seen;
                    });
  release::Grasp<double> out;
  if (seen > 0)
    out.angle = angle / seen;
  else if (source.logged.grasp_angle)
    out.angle = *source.logged.grasp_angle;
  else
    source.reject(source.path() + "@grasp_angle", "missing, and no motion capture before the gripper opens");
  if (const auto& declared = source.log.objects.at(source.logged.object).com_offset)
    out.com_offset = *declared;
  else if (seen > 0)
    out.com_offset = offset_x / seen;
  else
    source.reject("/objects/" + source.logged.object + "@com_offset",
                  "missing, and no motion capture before the gripper opens");
  return out;
}

/// From when on the normal force is below 3 σ [s], `release` or later: the first of three samples in a row,
/// as one alone may be noise.
double quiet_from(const datasets::FtLog& ft, const contact::NormalForceSummary& fit, double release) {
  constexpr std::size_t kInARow = 3;
  std::size_t quiet = 0;
  for (std::size_t i = 0; i < ft.time.rows; ++i) {
    if (ft.time(i) < release) continue;
    quiet = ft.normal_force(i) - fit.tail_mean < 3 * fit.sigma ? quiet + 1 : 0;
    if (quiet == kInARow) return std::max(release, ft.time(i + 1 - kInARow));
  }
  return release;
}

/// Detach, flight and landing as measured.
void measure_outcome(const LoggedThrow& source, PreparedThrow& out) {
  const datasets::Throw& logged = source.logged;
  double flight_from = 0;
  if (out.normal_force && std::isfinite(out.normal_force->release_time())) {
    out.measured.detach_time = out.normal_force->release_time();
    flight_from = quiet_from(*logged.ft, out.force_fit, *out.measured.detach_time);
  } else if (logged.detach_time) {
    out.measured.detach_time = flight_from = *logged.detach_time;
  }
  if (logged.mocap && out.measured.detach_time)
    measure_flight(source.log, logged, flight_from, *out.measured.detach_time, out);
  if (logged.landing) {
    out.measured.landing_x = logged.landing->pose(0, 0);
    if (tells_angle(*logged.landing)) out.measured.landing_theta = logged.landing->pose(0, 1);
  }
}

/// When motion capture first sees the object back down at the landing height [s]; infinite where it never
/// does.
double first_landing(const datasets::MocapLog& mocap, double height, double since) {
  constexpr double kAbove = 0.01;  // [m]: noise at the height itself is no flight
  bool risen = false;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || mocap.time(i) < since) continue;
    if (mocap.pose(i, 1) > height + kAbove) risen = true;
    if (risen && mocap.pose(i, 1) <= height) return mocap.time(i);
  }
  return HUGE_VAL;
}

}  // namespace

double flight_end(const datasets::ThrowLog& log, const datasets::Throw& logged, double since) {
  constexpr double kRounding = 1e-9;  // [s]: a sample at the end still flies
  const auto& mocap = *logged.mocap;
  double end = HUGE_VAL;
  if (logged.landing && !logged.landing->time.empty()) {
    const auto& time = logged.landing->time;
    const double blur = 3 * time.sigma_of();
    const bool goes_on = mocap.time(mocap.time.rows - 1) > time(0) + std::max(blur, kRounding);
    end = time(0) + (goes_on ? -blur : kRounding);
  }
  end = std::min(end, first_landing(mocap, log.landing_height, since));
  if (logged.free_flight) end = std::min(end, logged.free_flight->second + kRounding);
  return end;
}

bool shows_grasp(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  if (log.dimension != 2 || !logged.hand) return true;
  if (logged.grasp_angle && log.objects.at(logged.object).com_offset) return true;
  if (!logged.mocap) return false;
  const auto& hand = logged.hand->time;
  const auto& mocap = *logged.mocap;
  double opening = hand(hand.rows - 1);
  if (log.gripper && log.gripper->opening_command_time)
    opening = std::min(opening, *log.gripper->opening_command_time);
  else if (logged.detach_time)
    opening = std::min(opening, *logged.detach_time);
  for (std::size_t i = 0; i < mocap.time.rows; ++i)
    if (mocap.is_valid(i) && mocap.time(i) >= hand(0) && mocap.time(i) < opening) return true;
  return false;
}

PreparedThrow prepare(const datasets::ThrowLog& log, const datasets::Throw& logged, const std::string& file) {
  const LoggedThrow source{log, logged, file};
  if (log.dimension != 2) source.reject("/@dimension", "a release needs a planar log (dimension 2)");
  if (!logged.hand) source.reject(source.path() + "/hand", "missing: a release needs the hand's motion");
  const datasets::Object& object = log.objects.at(logged.object);
  if (!object.inertia)
    source.reject("/objects/" + logged.object + "@inertia", "missing: a release needs the moment of inertia");
  release::HandFit fit = fitted_hand(source);
  PreparedThrow out{logged.id,
                    logged.object,
                    logged.condition,
                    logged.split,
                    std::move(fit.motion),
                    fit.summary,
                    {},
                    {},
                    {object.mass, object.inertia->front()},
                    dynamics::level_gravity(log.gravity),
                    object.drag_k.value_or(0),
                    log.landing_height,
                    {},
                    0,
                    0,
                    {}};
  out.start = out.hand.begin();
  smooth_force(source, out);
  out.open_command = opening_command(source, out);
  out.grasp = grasp_of(source, out);
  measure_outcome(source, out);
  return out;
}

}  // namespace unhand::experiment
