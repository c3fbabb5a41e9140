#include "flight/spatial_effects.hpp"

namespace unhand::flight {
namespace {

using dynamics::Dual;
using dynamics::EffectValues;

template <class S>
void drag(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.drag_k += p["k"];
}
template <class S>
void linear_drag(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.linear_drag = p["c"];
}
template <class S>
void lift(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.lift = p["k_m"];
}
template <class S>
void wind(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.wind = {p["w_x"], p["w_y"], p["w_z"]};
}
template <class S>
void tilt(const EffectValues<S>& p, SpatialAir<S>& air) {
  using std::cos, std::sin;
  const S x = p["toward_x"], y = p["toward_y"], g = norm(air.gravity);
  air.gravity = {g * sin(x) * cos(y), g * sin(y), -g * cos(x) * cos(y)};
}
template <class S>
void gravity(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.gravity = scaled(S(p["ratio"]), air.gravity);
}
template <class S>
void drag_by_axis(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.axis_drag_x = p["a_x"];
  air.axis_drag_y = p["a_y"];
}
template <class S>
void cubic_drag(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.cubic_drag = p["kappa"];
}
template <class S>
void spin_damping(const EffectValues<S>& p, SpatialAir<S>& air) {
  air.spin_damping = p["c"];
}

}  // namespace

std::span<const dynamics::EffectOn<SpatialAir>> spatial_effects() {
  static const dynamics::EffectOn<SpatialAir> table[] = {
      {{.id = "flight.quadratic_drag",
        .mechanism = "quadratic drag, a = -k |v| v",
        .parameters = {{"k", "1/m", 0, 0, 10, 0.02}},
        .per_object = true,
        .felt_in_fall = true},
       &drag<double>,
       &drag<Dual>},
      {{.id = "flight.linear_drag",
        .mechanism = "drag in proportion to speed, a = -c v",
        .parameters = {{"c", "1/s", 0, 0, 10, 0.02}},
        .per_object = true,
        .felt_in_fall = true},
       &linear_drag<double>,
       &linear_drag<Dual>},
      {{.id = "flight.magnus_lift",
        .mechanism = "Magnus lift, a = k_m omega x v",
        .parameters = {{"k_m", "-", 0, -5, 5, 0.01}},
        .per_object = true,
        .needs = {.attitude = true}},
       &lift<double>,
       &lift<Dual>},
      {{.id = "flight.wind",
        .mechanism = "constant air velocity, acting through the declared drag",
        .parameters =
            {{"w_x", "m/s", 0, -30, 30, 0.3},
             {.name = "w_y", .unit = "m/s", .low = -30, .high = 30, .typical = 0.3, .in_space_only = true},
             {"w_z", "m/s", 0, -30, 30, 0.3}}},
       &wind<double>,
       &wind<Dual>},
      {{.id = "flight.gravity",
        .mechanism = "gravity's magnitude is not the declared one, true/declared",
        .parameters = {{"ratio", "-", 1, 0.1, 10, 2e-3}}},
       &gravity<double>,
       &gravity<Dual>},
      {{.id = "flight.gravity_tilt",
        .mechanism = "the base frame is not level: gravity leans towards +x and +y",
        .parameters = {{"toward_x", "rad", 0, -0.5, 0.5, 0.01},
                       {.name = "toward_y",
                        .unit = "rad",
                        .low = -0.5,
                        .high = 0.5,
                        .typical = 0.01,
                        .in_space_only = true}}},
       &tilt<double>,
       &tilt<Dual>},
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
       &drag_by_axis<double>,
       &drag_by_axis<Dual>},
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
       &cubic_drag<double>,
       &cubic_drag<Dual>},
      {{.id = "flight.spin_damping",
        .mechanism = "the spin dies as exp(-c t)",
        .parameters = {{"c", "1/s", 0, 0, 50, 0.02}},
        .per_object = true,
        .needs = {.attitude = true}},
       &spin_damping<double>,
       &spin_damping<Dual>},
  };
  return table;
}

}  // namespace unhand::flight
