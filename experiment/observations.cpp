#include "experiment/observations.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "contact/patch.hpp"
#include "dynamics/median.hpp"
#include "dynamics/quantisation.hpp"
#include "dynamics/third_difference.hpp"
#include "experiment/landing_noise.hpp"

namespace unhand::experiment {

using datasets::Series;

std::string_view to_string(Channel channel) {
  constexpr std::string_view kNames[kChannelCount] = {
      "ft.fx",   "ft.fz",       "ft.tau",    "ft.normal_force", "mocap.x",
      "mocap.z", "mocap.theta", "landing.x", "landing.theta",   "landing.time"};
  return kNames[static_cast<int>(channel)];
}

namespace {

Channel next(Channel first, std::size_t k) {
  return static_cast<Channel>(static_cast<int>(first) + static_cast<int>(k));
}

/// 1 σ of white noise on a smooth column, from the median of its third differences.
double scatter_of(const Series& series, std::size_t column) {
  std::vector<double> variances;
  for (std::size_t i = 3; i < series.rows; ++i) {
    const double variance = dynamics::third_difference_variance(series(i - 3, column), series(i - 2, column),
                                                                series(i - 1, column), series(i, column));
    if (std::isfinite(variance)) variances.push_back(variance);
  }
  return variances.empty() ? 0 : 1.4826 * std::sqrt(dynamics::median(variances));
}

/// 1 σ of what rounding adds to the readings of a column; 0 where they lie on no grid, or are too few to
/// tell.
double rounding_of(const Series& series, std::size_t column) {
  constexpr std::size_t kEnough = 20;
  std::vector<double> readings;
  for (std::size_t i = 0; i < series.rows; ++i)
    if (std::isfinite(series(i, column))) readings.push_back(series(i, column));
  if (readings.size() < kEnough) return 0;
  return dynamics::rounding_sigma(dynamics::quantisation_step(std::move(readings)));
}

/// The declared σ is the sensor's before its readings are rounded; their scatter has the rounding in it.
double sigma_of(const Series& series, std::size_t column, double least) {
  const double rounding = rounding_of(series, column);
  const double declared = series.sigma_of(column);
  const double sigma =
      declared > 0 ? std::hypot(declared, rounding) : std::max(scatter_of(series, column), rounding);
  return std::max(sigma, least);
}

/// The least σ that a channel is trusted to [SI]: the integration and the smoothed inputs are no better.
constexpr double kLeastForce = 1e-4, kLeastTorque = 1e-6, kLeastLength = 1e-6, kLeastAngle = 1e-5;

bool is_near_jump(const std::vector<double>& jumps, double t, const ObservationOptions& options) {
  return std::any_of(jumps.begin(), jumps.end(), [&](double jump) {
    return t >= jump - options.before_jump - 1e-9 && t < jump + options.settling;
  });
}

void add_wrench(const datasets::FtLog& ft, const PreparedThrow& prepared, const ObservationOptions& options,
                Observations& out) {
  std::vector<double> jumps = prepared.hand.jumps();
  jumps.push_back(prepared.hand.begin());
  const double least[3] = {kLeastForce, kLeastForce, kLeastTorque};
  double sigma[3];
  for (std::size_t c = 0; c < 3; ++c) {
    sigma[c] = sigma_of(ft.wrench, c, least[c]);
    if (datasets::is_constant(ft.wrench, c)) {
      sigma[c] = 0;
      out.dead.push_back(next(Channel::wrench_fx, c));
    }
  }
  for (std::size_t i = 0; i < ft.time.rows; ++i) {
    const double t = ft.time(i);
    if (t < prepared.hand.begin() || t > prepared.hand.end() || is_near_jump(jumps, t, options)) continue;
    const double force = std::hypot(ft.wrench(i, 0), ft.wrench(i, 1));
    const double size[3] = {force, force, std::hypot(ft.wrench(i, 2), contact::kFingerLength * force)};
    for (std::size_t c = 0; c < 3; ++c)
      if (sigma[c] > 0)
        out.all.push_back({next(Channel::wrench_fx, c), t, ft.wrench(i, c),
                           std::hypot(sigma[c], options.wrench_trust * size[c])});
  }
}

/// After the release the true normal force is zero, so what is read there is the sensor's own.
void add_normal_force(const datasets::FtLog& ft, const PreparedThrow& prepared, Observations& out) {
  if (datasets::is_constant(ft.normal_force)) out.dead.push_back(Channel::normal_force);
  if (!prepared.normal_force || !std::isfinite(prepared.normal_force->release_time())) return;
  const double from = prepared.normal_force->release_time() + 0.005,
               sigma = sigma_of(ft.normal_force, 0, kLeastForce);
  for (std::size_t i = 0; i < ft.time.rows; ++i)
    if (ft.time(i) >= from) out.all.push_back({Channel::normal_force, ft.time(i), ft.normal_force(i), sigma});
}

void add_mocap(const datasets::ThrowLog& log, const datasets::Throw& logged, const PreparedThrow& prepared,
               Observations& out) {
  const auto& mocap = *logged.mocap;
  const double least[3] = {kLeastLength, kLeastLength, kLeastAngle};
  double sigma[3];
  for (std::size_t c = 0; c < 3; ++c) sigma[c] = sigma_of(mocap.pose, c, least[c]);
  const double until = flight_end(log, logged, prepared.measured.detach_time.value_or(prepared.open_command));
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (t >= until) break;
    if (!mocap.is_valid(i) || t < prepared.hand.begin()) continue;
    for (std::size_t c = 0; c < 3; ++c)
      out.all.push_back({next(Channel::mocap_x, c), t, mocap.pose(i, c), sigma[c]});
  }
}

void add_landing(const datasets::ThrowLog& log, const datasets::LandingLog& landing,
                 const ObservationOptions& options, Observations& out) {
  const double t = landing.time.empty() ? 0.0 : landing.time(0);
  constexpr double kLeast[2] = {1e-5, 1e-4};  // m, rad
  std::optional<double> sigma[2];
  const bool declared[2] = {declares_noise(landing, 0), declares_noise(landing, 1)};
  if (!declared[0] || !declared[1]) {
    const LandingNoise noise = options.landing_noise ? *options.landing_noise : landing_noise(log);
    if (noise.x) sigma[0] = std::max(*noise.x, kLeast[0]);
    if (noise.theta) sigma[1] = std::max(*noise.theta, kLeast[1]);
  }
  for (std::size_t c = 0; c < 2; ++c)
    if (declared[c]) sigma[c] = sigma_of(landing.pose, c, kLeast[c]);
  if (sigma[0]) out.all.push_back({Channel::landing_x, t, landing.pose(0, 0), *sigma[0]});
  if (sigma[1] && tells_angle(landing))
    out.all.push_back({Channel::landing_theta, t, landing.pose(0, 1), *sigma[1]});
  if (!landing.time.empty() && !landing.time.sigma.empty())
    out.all.push_back({Channel::landing_time, t, t, sigma_of(landing.time, 0, 1e-5)});
}

}  // namespace

Observations observe(const datasets::ThrowLog& log, const datasets::Throw& logged,
                     const PreparedThrow& prepared, const ObservationOptions& options) {
  Observations out;
  if (logged.ft && options.wrench) add_wrench(*logged.ft, prepared, options, out);
  if (logged.ft && options.normal_force) add_normal_force(*logged.ft, prepared, out);
  if (logged.mocap && options.mocap) add_mocap(log, logged, prepared, out);
  if (logged.landing && options.landing) add_landing(log, *logged.landing, options, out);
  return out;
}

}  // namespace unhand::experiment
