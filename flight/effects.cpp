#include "flight/effects.hpp"

namespace unhand::flight {

using dynamics::AccelerationForm;

std::span<const dynamics::EffectOn<Air>> air_effects() {
  static const char* const kLonger = "motion capture of longer and faster flights";
  static const dynamics::EffectOn<Air> table[] = {
      {{.id = "flight.quadratic_drag",
        .mechanism = "quadratic drag, a = -k |v| v",
        .parameters = {{"k", "1/m", 0, 0, 10, 0.02}},
        .per_object = true,
        .form = AccelerationForm::quadratic,
        .remedy = kLonger},
       [](const auto& p, auto& air) { air.extra_drag = p["k"]; }},
      {{.id = "flight.magnus_lift",
        // One value for all objects, as outside tools read it from discovery.json; spatial_effects() has one
        // for each.
        .mechanism = "Magnus lift, a = k_m omega J v",
        .parameters = {{"k_m", "-", 0, -5, 5, 0.01}},
        .form = AccelerationForm::lift,
        .remedy = kLonger},
       [](const auto& p, auto& air) { air.lift = p["k_m"]; }},
      {{.id = "flight.wind",
        .mechanism = "constant air velocity, acting through the declared drag",
        .parameters = {{"w_x", "m/s", 0, -30, 30, 0.3}, {"w_z", "m/s", 0, -30, 30, 0.3}},
        .acts_through = "flight.quadratic_drag",
        .remedy = kLonger},
       [](const auto& p, auto& air) {
         air.wind = {p["w_x"], p["w_z"]};
       }},
  };
  return table;
}

}  // namespace unhand::flight
