#include "flight/spatial_effects.hpp"

namespace unhand::flight {

std::span<const dynamics::EffectOn<SpatialAir>> spatial_effects() {
  static const dynamics::EffectOn<SpatialAir> table[] = {
      {{.id = "flight.quadratic_drag",
        .mechanism = "quadratic drag, a = -k |v| v",
        .parameters = {{"k", "1/m", 0, 0, 10, 0.02}},
        .per_object = true,
        .felt_in_fall = true},
       [](const auto& p, auto& air) { air.drag_k += p["k"]; }},
      {{.id = "flight.linear_drag",
        .mechanism = "drag in proportion to speed, a = -c v",
        .parameters = {{"c", "1/s", 0, 0, 10, 0.02}},
        .per_object = true,
        .felt_in_fall = true},
       [](const auto& p, auto& air) { air.linear_drag = p["c"]; }},
      {{.id = "flight.magnus_lift",
        .mechanism = "Magnus lift, a = k_m omega x v",
        .parameters = {{"k_m", "-", 0, -5, 5, 0.01}},
        .per_object = true,
        .needs = {.attitude = true}},
       [](const auto& p, auto& air) { air.lift = p["k_m"]; }},
      {{.id = "flight.wind",
        .mechanism = "constant air velocity, acting through the declared drag",
        .parameters =
            {{"w_x", "m/s", 0, -30, 30, 0.3},
             {.name = "w_y", .unit = "m/s", .low = -30, .high = 30, .typical = 0.3, .in_space_only = true},
             {"w_z", "m/s", 0, -30, 30, 0.3}}},
       [](const auto& p, auto& air) {
         air.wind = {p["w_x"], p["w_y"], p["w_z"]};
       }},
      {{.id = "flight.gravity",
        .mechanism = "gravity's magnitude is not the declared one, true/declared",
        .parameters = {{"ratio", "-", 1, 0.1, 10, 2e-3}}},
       [](const auto& p, auto& air) { air.gravity = scaled(p["ratio"], air.gravity); }},
      {{.id = "flight.gravity_tilt",
        .mechanism = "the base frame is not level: gravity leans towards +x and +y",
        .parameters = {{"toward_x", "rad", 0, -0.5, 0.5, 0.01},
                       {.name = "toward_y",
                        .unit = "rad",
                        .low = -0.5,
                        .high = 0.5,
                        .typical = 0.01,
                        .in_space_only = true}}},
       [](const auto& p, auto& air) {
         using std::cos, std::sin;
         const auto x = p["toward_x"], y = p["toward_y"], g = norm(air.gravity);
         air.gravity = {g * sin(x) * cos(y), g * sin(y), -g * cos(x) * cos(y)};
       }},
      {{.id = "flight.drag_by_axis",
        .mechanism =
            "drag depends on the body axis along which the air comes, a = -|v| R A R' v, A = diag(a_x, a_y, "
            "-a_x - a_y)",
        // In a plane a_x = -a_z.
        .parameters =
            {{"a_x", "1/m", 0, -10, 10, 0.02},
             {.name = "a_y", .unit = "1/m", .low = -10, .high = 10, .typical = 0.02, .in_space_only = true}},
        .per_object = true,
        .anisotropy =
            dynamics::Anisotropy{"flight.quadratic_drag", "k", {{"a_x", {1, 0, -1}}, {"a_y", {0, 1, -1}}}},
        .needs = {.attitude = true},
        .felt_in_fall = true},
       [](const auto& p, auto& air) {
         air.axis_drag_x = p["a_x"];
         air.axis_drag_y = p["a_y"];
       }},
      {{.id = "flight.cubic_drag",
        .mechanism = "drag depends on orientation as a cube's may, a = -kappa (sum n^4 - 3/5) |v| v",
        // Drag by axis says what the section of a cube in a plane does.
        .parameters = {{.name = "kappa",
                        .unit = "1/m",
                        .low = -10,
                        .high = 10,
                        .typical = 0.05,
                        .in_space_only = true}},
        .per_object = true,
        .needs = {.attitude = true}},
       [](const auto& p, auto& air) { air.cubic_drag = p["kappa"]; }},
      {{.id = "flight.spin_damping",
        .mechanism = "the spin dies as exp(-c t)",
        .parameters = {{"c", "1/s", 0, 0, 50, 0.02}},
        .per_object = true,
        .needs = {.attitude = true}},
       [](const auto& p, auto& air) { air.spin_damping = p["c"]; }},
  };
  return table;
}

}  // namespace unhand::flight
