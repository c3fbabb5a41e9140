#include "experiment/prepared_throw.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "datasets/assemble.hpp"
#include "dynamics/straight_line.hpp"

namespace unhand::experiment {

using datasets::LogError;
using datasets::Series;
using dynamics::Window;

namespace {

std::array<double, 3> sigma_of(const Series& series) {
  if (series.sigma.size() == 3) return {series.sigma[0], series.sigma[1], series.sigma[2]};
  if (series.sigma.size() == 1) return {series.sigma[0], series.sigma[0], series.sigma[0]};
  return {0, 0, 0};
}

/// The state at `detach` of the free flight that explains the motion capture from `from` on. Drag enters as a
/// correction to the samples, by iteration: the difference of the flights with and without it from the same
/// state.
void measure_flight(const datasets::ThrowLog& log, const datasets::Throw& logged, double from, double detach,
                    PreparedThrow& out) {
  std::vector<double> t, x, z, theta;
  const auto& mocap = *logged.mocap;
  const double until = logged.landing && !logged.landing->time.empty()
                           ? logged.landing->time(0) + 1e-9
                           : first_below_landing(log, mocap, out.open_command);
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
  constexpr int kMost = 100;         // each takes off a share of about k |v| times the flight's duration
  constexpr double kSettled = 1e-9;  // [m/s]
  double change = HUGE_VAL;
  for (int iteration = 0; iteration < kMost && change > kSettled; ++iteration) {
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

}  // namespace

double first_below_landing(const datasets::ThrowLog& log, const datasets::MocapLog& mocap, double opening) {
  const auto i = datasets::first_below(mocap, log.dimension, log.landing_height, opening);
  return i ? mocap.time(*i) : HUGE_VAL;
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
  const std::string path = "/throws/" + logged.id;
  const auto reject = [&](const std::string& where, const std::string& why) {
    throw LogError(file, path + where, why);
  };
  if (log.dimension != 2) throw LogError(file, "/@dimension", "a release needs a planar log (dimension 2)");
  if (!logged.hand) reject("/hand", "missing: a release needs the hand's motion");
  const datasets::Object& object = log.objects.at(logged.object);
  if (!object.inertia)
    throw LogError(file, "/objects/" + logged.object + "@inertia",
                   "missing: a release needs the moment of inertia");

  const datasets::HandLog& hand = *logged.hand;
  release::HandFit fit = [&] {
    try {
      return release::fit_hand_motion(
          {hand.time.data, hand.pose.data, hand.twist.data, hand.acceleration.data, sigma_of(hand.pose),
           sigma_of(hand.twist), sigma_of(hand.acceleration)},
          logged.hand_jump_times);
    } catch (const std::invalid_argument& error) {
      throw LogError(file, path + "/hand", error.what());
    }
  }();
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

  if (logged.ft) {
    const auto& series = logged.ft->normal_force;
    try {
      auto force = contact::smooth_normal_force(logged.ft->time.data, series.data,
                                                series.sigma.empty() ? 0.0 : series.sigma.front());
      out.normal_force = std::move(force.force);
      out.force_fit = force.summary;
    } catch (const std::invalid_argument& error) {
      reject("/ft/normal_force", error.what());
    }
  }

  if (log.gripper && log.gripper->opening_command_time)
    out.open_command = *log.gripper->opening_command_time;
  else if (std::isfinite(out.force_fit.opening_start) && out.normal_force)
    out.open_command = out.force_fit.opening_start;
  else if (!logged.detach_time)
    throw LogError(file, "/gripper@opening_command_time",
                   "missing, and " + path + " has neither a normal force that opens nor a detach_time");
  else
    out.open_command = *logged.detach_time;

  // The grasp: what motion capture saw while the object was held.
  double angle = 0, offset_x = 0;
  int seen = 0;
  if (logged.mocap) {
    const Window whole{out.hand.begin(), out.hand.end()};
    for (std::size_t i = 0; i < logged.mocap->time.rows; ++i) {
      const double t = logged.mocap->time(i);
      if (!logged.mocap->is_valid(i) || t < out.hand.begin() || t >= out.open_command || t > out.hand.end())
        continue;
      const auto pose = out.hand.at(whole, t).pose;
      const dynamics::Vec2<double> r{logged.mocap->pose(i, 0) - pose.x, logged.mocap->pose(i, 1) - pose.z};
      angle += logged.mocap->pose(i, 2) - pose.theta;
      offset_x += dynamics::rotate(-logged.mocap->pose(i, 2), r).x;
      ++seen;
    }
  }
  if (seen > 0)
    out.grasp.angle = angle / seen;
  else if (logged.grasp_angle)
    out.grasp.angle = *logged.grasp_angle;
  else
    reject("@grasp_angle", "missing, and no motion capture before the gripper opens");
  if (object.com_offset)
    out.grasp.com_offset = *object.com_offset;
  else if (seen > 0)
    out.grasp.com_offset = offset_x / seen;
  else
    throw LogError(file, "/objects/" + logged.object + "@com_offset",
                   "missing, and no motion capture before the gripper opens");

  // The outcome.
  double flight_from = 0;
  if (out.normal_force && std::isfinite(out.normal_force->release_time())) {
    out.measured.detach_time = out.normal_force->release_time();
    flight_from = *out.measured.detach_time;
    const double quiet = 3 * out.force_fit.sigma;
    const auto& ft = *logged.ft;
    for (std::size_t i = ft.time.rows; i-- > 0 && ft.normal_force(i) - out.force_fit.tail_mean < quiet;)
      if (ft.time(i) >= out.open_command) flight_from = std::max(*out.measured.detach_time, ft.time(i));
  } else if (logged.detach_time) {
    out.measured.detach_time = flight_from = *logged.detach_time;
  }
  if (logged.mocap && out.measured.detach_time)
    measure_flight(log, logged, flight_from, *out.measured.detach_time, out);
  if (logged.landing) {
    out.measured.landing_x = logged.landing->pose(0, 0);
    out.measured.landing_theta = logged.landing->pose(0, 1);
  }
  return out;
}

}  // namespace unhand::experiment
