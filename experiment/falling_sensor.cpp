#include "experiment/falling_sensor.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>
#include <utility>

namespace unhand::experiment {

using dynamics::Dual;
using dynamics::EffectParameter;
using dynamics::EffectValues;
using flight::Vec3;

namespace {

template <class S>
Vec3<S> vector_of(const EffectValues<S>& p) {
  return {p["x"], p["y"], p["z"]};
}

/// x, y and z of what is added to the reading of that axis alone.
std::vector<EffectParameter> on_each_axis(const char* unit, double limit) {
  std::vector<EffectParameter> out;
  for (std::size_t axis = 0; axis < 3; ++axis)
    out.push_back({.name = std::string(1, "xyz"[axis]),
                   .unit = unit,
                   .low = -limit,
                   .high = limit,
                   .typical = 0.1,
                   .on_axis = axis});
  return out;
}

}  // namespace

std::span<const dynamics::EffectOn<Accelerometer>> accelerometer_effects() {
  static const dynamics::EffectOn<Accelerometer> table[] = {
      {{.id = "sensor.accelerometer_bias",
        .mechanism = "constant bias of the accelerometer, body axes",
        .parameters = on_each_axis("m/s^2", 20)},
       [](const auto& p, auto& sensor) { sensor.bias = vector_of(p); }},
      {{.id = "sensor.accelerometer_drift",
        .mechanism = "the bias changes during a fall",
        .parameters = on_each_axis("m/s^3", 50)},
       [](const auto& p, auto& sensor) { sensor.drift = vector_of(p); }},
      {{.id = "sensor.settling",
        .mechanism = "the sensor recovers from the time before the fall, s exp(-t/tau)",
        .parameters =
            [] {
              auto all = on_each_axis("m/s^2", 50);
              all.push_back({"tau", "s", 0.05, 2e-3, 2, 0.02, {0.02, 0.08, 0.3}});
              return all;
            }()},
       [](const auto& p, auto& sensor) {
         sensor.settling = vector_of(p);
         sensor.settling_time = p["tau"];
       }},
      {{.id = "sensor.lever_arm",
        .mechanism = "the sensor is not at the CoM: w x (w x r) + dw/dt x r",
        .parameters = {{"x", "m", 0, -1, 1, 0.01}, {"y", "m", 0, -1, 1, 0.01}, {"z", "m", 0, -1, 1, 0.01}}},
       [](const auto& p, auto& sensor) { sensor.lever_arm = vector_of(p); }},
  };
  return table;
}

std::vector<dynamics::Effect> known_fall_effects() {
  const auto sensor = accelerometer_effects();
  // Of two that are the same in the data the first is named: a bias, then the air, then what changes in time.
  std::vector<dynamics::Effect> out{sensor.front().effect};
  for (const auto& entry : flight::spatial_effects())
    if (entry.effect.felt_in_fall) out.push_back(entry.effect);
  for (const auto& entry : sensor.subspan(1)) out.push_back(entry.effect);
  return out;
}

template <class S>
Vec3<S> specific_force(const Accelerometer<S>& sensor, const flight::SpatialAir<S>& air,
                       const FallingBody<S>& body) {
  using std::exp;
  const S decay = exp(-body.time / sensor.settling_time);
  Vec3<S> f = flight::body_drag(air, flight::scaled(body.velocity, body.up));
  for (std::size_t a = 0; a < 3; ++a)
    f[a] += sensor.bias[a] + sensor.drift[a] * body.time + sensor.settling[a] * decay;
  constexpr Vec3<double> kStill{};
  if (body.omega == kStill && body.omega_rate == kStill) return f;
  Vec3<S> omega, omega_rate;
  for (std::size_t a = 0; a < 3; ++a) omega[a] = S(body.omega[a]), omega_rate[a] = S(body.omega_rate[a]);
  const Vec3<S>& r = sensor.lever_arm;
  return flight::sum(
      f, flight::sum(flight::cross(omega, flight::cross(omega, r)), flight::cross(omega_rate, r)));
}

template <class S>
std::vector<FallingBody<S>> falling_bodies(const FallStart<S>& start, const FallSamples& samples,
                                           double gravity, const dynamics::Values<S>& values) {
  flight::SpatialAir<S> air;
  dynamics::apply_effects(flight::spatial_effects(), values, air);
  const auto& time = samples.time;
  for (const auto& [name, size] : {std::pair{"omega", samples.omega.size()},
                                   {"omega_rate", samples.omega_rate.size()},
                                   {"turned", samples.turned.size()}})
    if (size != 0 && size != time.size())
      throw std::invalid_argument(
          fmt::format("falling_bodies: {} has {} rows, and time {}", name, size, time.size()));
  std::vector<FallingBody<S>> out;
  out.reserve(time.size());
  FallingBody<S> body{0, start.velocity, start.up, {}, {}};
  for (std::size_t i = 0; i < time.size(); ++i) {
    body.time = time[i];
    Vec3<S> turned = flight::scaled(S(-time[i]), start.spin);
    if (!samples.turned.empty())
      for (std::size_t a = 0; a < 3; ++a) turned[a] -= samples.turned[i][a];
    body.up = flight::rotate(flight::exp(turned), start.up);
    if (i > 0) {  // Heun: drag changes by a hundredth of itself from sample to sample
      const double dt = time[i] - time[i - 1];
      const auto slope_at = [&](const S& v) {
        return S(flight::dot(flight::body_drag(air, flight::scaled(v, body.up)), body.up) - gravity);
      };
      const S& v = body.velocity;
      const S slope = slope_at(v), ahead = v + dt * slope;
      body.velocity += 0.5 * dt * (slope + slope_at(ahead));
    }
    if (!samples.omega.empty()) body.omega = samples.omega[i];
    if (!samples.omega_rate.empty()) body.omega_rate = samples.omega_rate[i];
    out.push_back(body);
  }
  return out;
}

template <class S>
std::vector<Vec3<S>> falling_readings(const FallStart<S>& start, const FallSamples& samples, double gravity,
                                      const dynamics::Values<S>& values) {
  Accelerometer<S> sensor;
  flight::SpatialAir<S> air;
  dynamics::apply_effects(accelerometer_effects(), values, sensor);
  dynamics::apply_effects(flight::spatial_effects(), values, air);
  std::vector<Vec3<S>> out;
  out.reserve(samples.time.size());
  for (const FallingBody<S>& body : falling_bodies(start, samples, gravity, values))
    out.push_back(specific_force(sensor, air, body));
  return out;
}

template Vec3<double> specific_force(const Accelerometer<double>&, const flight::SpatialAir<double>&,
                                     const FallingBody<double>&);
template Vec3<Dual> specific_force(const Accelerometer<Dual>&, const flight::SpatialAir<Dual>&,
                                   const FallingBody<Dual>&);
template std::vector<FallingBody<double>> falling_bodies(const FallStart<double>&, const FallSamples&, double,
                                                         const dynamics::Values<double>&);
template std::vector<FallingBody<Dual>> falling_bodies(const FallStart<Dual>&, const FallSamples&, double,
                                                       const dynamics::Values<Dual>&);
template std::vector<Vec3<double>> falling_readings(const FallStart<double>&, const FallSamples&, double,
                                                    const dynamics::Values<double>&);
template std::vector<Vec3<Dual>> falling_readings(const FallStart<Dual>&, const FallSamples&, double,
                                                  const dynamics::Values<Dual>&);

}  // namespace unhand::experiment
