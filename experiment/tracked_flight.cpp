#include "experiment/tracked_flight.hpp"

namespace unhand::experiment {

using dynamics::Dual;
using flight::Vec3;

namespace {

dynamics::EffectParameter in_space_only(dynamics::EffectParameter parameter) {
  parameter.in_space_only = true;
  return parameter;
}

}  // namespace

std::span<const dynamics::EffectOn<Tracking>> tracking_effects() {
  static const dynamics::EffectOn<Tracking> table[] = {
      {{.id = "sensor.length_scale",
        .mechanism = "the tracker's metric scale is off",
        .parameters = {{"scale", "-", 1, 0.1, 10, 2e-3}}},
       [](const auto& p, auto& tracking) { tracking.length_scale = p["scale"] - 1.0; }},
      {{.id = "sensor.time_scale",
        .mechanism = "the tracker's clock runs fast or slow",
        .parameters = {{"scale", "-", 1, 0.3, 3, 1e-3}}},
       [](const auto& p, auto& tracking) { tracking.time_scale = p["scale"] - 1.0; }},
      {{.id = "sensor.com_offset",
        .mechanism = "the tracked point is not the CoM: true - declared CoM in body axes",
        .parameters = {{"x", "m", 0, -0.1, 0.1, 1e-3},
                       in_space_only({"y", "m", 0, -0.1, 0.1, 1e-3}),
                       {"z", "m", 0, -0.1, 0.1, 1e-3}},
        .per_object = true,
        .needs = {.attitude = true},
        .about_declaration = true},
       [](const auto& p, auto& tracking) {
         tracking.com_offset = {p["x"], p["y"], p["z"]};
       }},
      {{.id = "sensor.inertia",
        .mechanism = "the declared ratios of the moments of inertia are off",
        .parameters = {in_space_only({"ratio_y", "-", 1, 0.2, 5, 0.02}),
                       in_space_only({"ratio_z", "-", 1, 0.2, 5, 0.02})},
        .per_object = true,
        .needs = {.attitude = true},
        .about_declaration = true},
       [](const auto& p, auto& tracking) {
         tracking.inertia_y = p["ratio_y"] - 1.0;
         tracking.inertia_z = p["ratio_z"] - 1.0;
       }},
  };
  return table;
}

std::vector<dynamics::Effect> known_flight_effects() {
  std::vector<dynamics::Effect> out;
  for (const auto& entry : tracking_effects()) out.push_back(entry.effect);
  for (const auto& entry : flight::spatial_effects()) out.push_back(entry.effect);
  return out;
}

template <class S>
std::vector<TrackedPose<S>> tracked_poses(const TrackedFlight<S>& declared, const dynamics::Values<S>& values,
                                          const std::vector<double>& times,
                                          const dynamics::IntegratorOptions& options) {
  Tracking<S> tracking;
  dynamics::apply_effects(tracking_effects(), values, tracking);
  flight::SpatialAir<S> air;
  air.gravity = {S(0.0), S(0.0), S(-declared.gravity)};
  air.drag_k = S(declared.drag_k);
  dynamics::apply_effects(flight::spatial_effects(), values, air);
  flight::SpatialStart<S> start = declared.start;
  start.inertia[1] *= 1.0 + tracking.inertia_y;
  start.inertia[2] *= 1.0 + tracking.inertia_z;
  std::vector<S> true_times;
  for (const double t : times) true_times.push_back(t / (1.0 + tracking.time_scale));
  std::vector<TrackedPose<S>> out;
  for (const auto& state : flight::fly_in_space(start, air, true_times, options).states) {
    const Vec3<S> point =
        flight::difference(state.position, rotate(state.rotation.attitude, tracking.com_offset));
    out.push_back({flight::scaled(S(1.0 + tracking.length_scale), point), state.rotation.attitude});
  }
  return out;
}

template std::vector<TrackedPose<double>> tracked_poses(const TrackedFlight<double>&,
                                                        const dynamics::Values<double>&,
                                                        const std::vector<double>&,
                                                        const dynamics::IntegratorOptions&);
template std::vector<TrackedPose<Dual>> tracked_poses(const TrackedFlight<Dual>&,
                                                      const dynamics::Values<Dual>&,
                                                      const std::vector<double>&,
                                                      const dynamics::IntegratorOptions&);

}  // namespace unhand::experiment
