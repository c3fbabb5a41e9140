#include "experiment/sensing.hpp"

namespace unhand::experiment {

using dynamics::AccelerationForm;

std::span<const dynamics::EffectOn<Sensing>> sensor_effects() {
  static const char *const kMoved = "motion capture while the object is held by a moving hand",
                           *const kUnloaded = "F/T samples after the release, or with empty pads";
  static const dynamics::EffectOn<Sensing> table[] = {
      {{.id = "sensor.mocap_time_offset",
        .mechanism = "motion-capture stamps are late against the robot's clock",
        .parameters = {{"offset", "s", 0, -0.05, 0.05, 1e-3}},
        .needs = {.mocap = true},
        .remedy = kMoved},
       [](const auto& p, auto& sensing) { sensing.mocap_time_offset = p["offset"]; }},
      {{.id = "sensor.ft_time_offset",
        .mechanism = "force/torque stamps, of wrench and normal force, are late against the robot's clock",
        .parameters = {{"offset", "s", 0, -0.05, 0.05, 5e-4}},
        .needs = {.wrench = true, .normal_force = true}},
       [](const auto& p, auto& sensing) { sensing.ft_time_offset = p["offset"]; }},
      {{.id = "sensor.length_scale",
        .mechanism = "the tracker's metric scale is off",
        .parameters = {{"scale", "-", 1, 0.8, 1.2, 2e-3},
                       {.name = "landing_share",
                        .unit = "-",
                        .high = 1,
                        .typical = 0.1,
                        .grid = {0, 1},
                        .remedy = "landings measured by another instrument than the tracker"}},
        .form = AccelerationForm::along_z,
        .needs = {.mocap = true},
        .remedy = kMoved},
       [](const auto& p, auto& sensing) {
         sensing.length_scale = p["scale"] - 1.0;
         sensing.landing_share = p["landing_share"];
       }},
      {{.id = "sensor.com_offset",
        .mechanism = "the declared CoM is off along the object's x axis",
        .parameters = {{"offset", "m", 0, -0.1, 0.1, 1e-3}},
        .form = AccelerationForm::centripetal_x,
        .about_declaration = true,
        .remedy = "grasps at other places on the object",
        .untracked_remedy = "motion capture of the turning flight"},
       [](const auto& p, auto& sensing) { sensing.com_offset = p["offset"]; }},
      {{.id = "sensor.inertia",
        .mechanism = "the declared inertia is off",
        .parameters = {{"ratio", "-", 1, 0.1, 6, 0.02}},
        .about_declaration = true,
        .remedy = "the torque behind a pad while the held object turns, or a weighed inertia"},
       [](const auto& p, auto& sensing) { sensing.inertia = p["ratio"] - 1.0; }},
      {{.id = "sensor.mass",
        .mechanism = "the declared mass is off",
        .parameters = {{"ratio", "-", 1, 0.1, 6, 0.02}},
        .about_declaration = true,
        .remedy = "the force behind a pad while the object is held, or a weighing"},
       [](const auto& p, auto& sensing) { sensing.mass = p["ratio"] - 1.0; }},
      {{.id = "sensor.ft_bias",
        .mechanism = "constant bias of the F/T sensor",
        .parameters = {{"fx", "N", 0, -20, 20, 0.05},
                       {"fz", "N", 0, -20, 20, 0.05},
                       {"tau", "N m", 0, -2, 2, 5e-4}},
        .needs = {.wrench = true},
        .remedy = kUnloaded},
       [](const auto& p, auto& sensing) {
         sensing.bias_fx = p["fx"];
         sensing.bias_fz = p["fz"];
         sensing.bias_tau = p["tau"];
       }},
      {{.id = "sensor.normal_force_bias",
        .mechanism = "constant bias of the measured normal force",
        .parameters = {{"bias", "N", 0, -10, 10, 0.1}},
        .needs = {.normal_force = true},
        .remedy = kUnloaded},
       [](const auto& p, auto& sensing) { sensing.normal_force_bias = p["bias"]; }},
  };
  return table;
}

}  // namespace unhand::experiment
