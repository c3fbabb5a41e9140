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
      {{"flight.quadratic_drag", "quadratic drag, a = -k |v| v", {{"k", "1/m", 0, 0, 10, 0.02}}, true},
       &drag<double>,
       &drag<Dual>},
      {{"flight.linear_drag", "drag in proportion to speed, a = -c v", {{"c", "1/s", 0, 0, 10, 0.02}}, true},
       &linear_drag<double>,
       &linear_drag<Dual>},
      {{"flight.magnus_lift", "Magnus lift, a = k_m omega x v", {{"k_m", "-", 0, -5, 5, 0.01}}, true},
       &lift<double>,
       &lift<Dual>},
      {{"flight.wind",
        "constant air velocity, acting through the declared drag",
        {{"w_x", "m/s", 0, -30, 30, 0.3}, {"w_y", "m/s", 0, -30, 30, 0.3}, {"w_z", "m/s", 0, -30, 30, 0.3}}},
       &wind<double>,
       &wind<Dual>},
      {{"flight.gravity",
        "gravity's magnitude is not the declared one, true/declared",
        {{"ratio", "-", 1, 0.1, 10, 2e-3}}},
       &gravity<double>,
       &gravity<Dual>},
      {{"flight.gravity_tilt",
        "the base frame is not level: gravity leans towards +x and +y",
        {{"toward_x", "rad", 0, -0.5, 0.5, 0.01}, {"toward_y", "rad", 0, -0.5, 0.5, 0.01}}},
       &tilt<double>,
       &tilt<Dual>},
      {{"flight.drag_by_axis",
        "drag depends on the body axis along which the air comes, a = -|v| R A R' v, A = diag(a_x, a_y, -a_x "
        "- a_y)",
        {{"a_x", "1/m", 0, -10, 10, 0.02}, {"a_y", "1/m", 0, -10, 10, 0.02}},
        true,
        false,
        {},
        dynamics::Anisotropy{"flight.quadratic_drag", "k", {{"a_x", {1, 0, -1}}, {"a_y", {0, 1, -1}}}}},
       &drag_by_axis<double>,
       &drag_by_axis<Dual>},
      {{"flight.cubic_drag",
        "drag depends on orientation as a cube's may, a = -kappa (sum n^4 - 3/5) |v| v",
        {{"kappa", "1/m", 0, -10, 10, 0.05}},
        true},
       &cubic_drag<double>,
       &cubic_drag<Dual>},
      {{"flight.spin_damping", "the spin dies as exp(-c t)", {{"c", "1/s", 0, 0, 50, 0.02}}, true},
       &spin_damping<double>,
       &spin_damping<Dual>},
  };
  return table;
}

}  // namespace unhand::flight
