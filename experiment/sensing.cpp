#include "experiment/sensing.hpp"

namespace unhand::experiment {
namespace {

using dynamics::Dual;
using dynamics::EffectValues;

template <class S>
void mocap_time_offset(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.mocap_time_offset = p["offset"];
}
template <class S>
void length_scale(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.length_scale = p["scale"] - 1.0;
  sensing.landing_share = p["landing_share"];
}
template <class S>
void com_offset(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.com_offset = p["offset"];
}
template <class S>
void inertia(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.inertia = p["ratio"] - 1.0;
}
template <class S>
void mass(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.mass = p["ratio"] - 1.0;
}
template <class S>
void ft_bias(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.bias_fx = p["fx"];
  sensing.bias_fz = p["fz"];
  sensing.bias_tau = p["tau"];
}
template <class S>
void normal_force_bias(const EffectValues<S>& p, Sensing<S>& sensing) {
  sensing.normal_force_bias = p["bias"];
}

}  // namespace

std::span<const dynamics::EffectOn<Sensing>> sensor_effects() {
  static const dynamics::EffectOn<Sensing> table[] = {
      {{"sensor.mocap_time_offset",
        "motion-capture stamps are late against the robot's clock",
        {{"offset", "s", 0, -0.05, 0.05, 1e-3}}},
       &mocap_time_offset<double>,
       &mocap_time_offset<Dual>},
      {{"sensor.length_scale",
        "the tracker's metric scale is off",
        {{"scale", "-", 1, 0.8, 1.2, 2e-3}, {"landing_share", "-", 0, 0, 1, 0.1, {0, 1}}},
        false,
        false,
        "1 along z"},
       &length_scale<double>,
       &length_scale<Dual>},
      {{"sensor.com_offset",
        "the declared CoM is off along the object's x axis",
        {{"offset", "m", 0, -0.1, 0.1, 1e-3}},
        false,
        false,
        "omega^2 along the object's x"},
       &com_offset<double>,
       &com_offset<Dual>},
      {{"sensor.inertia", "the declared inertia is off", {{"ratio", "-", 1, 0.1, 6, 0.02}}},
       &inertia<double>,
       &inertia<Dual>},
      {{"sensor.mass", "the declared mass is off", {{"ratio", "-", 1, 0.1, 6, 0.02}}},
       &mass<double>,
       &mass<Dual>},
      {{"sensor.ft_bias",
        "constant bias of the F/T sensor",
        {{"fx", "N", 0, -20, 20, 0.05}, {"fz", "N", 0, -20, 20, 0.05}, {"tau", "N m", 0, -2, 2, 5e-4}}},
       &ft_bias<double>,
       &ft_bias<Dual>},
      {{"sensor.normal_force_bias",
        "constant bias of the measured normal force",
        {{"bias", "N", 0, -10, 10, 0.1}}},
       &normal_force_bias<double>,
       &normal_force_bias<Dual>},
  };
  return table;
}

}  // namespace unhand::experiment
