#include "flight/effects.hpp"

namespace unhand::flight {
namespace {

using dynamics::AccelerationForm;
using dynamics::Dual;
using dynamics::EffectValues;

template <class S>
void drag(const EffectValues<S>& p, Air<S>& air) {
  air.extra_drag = p["k"];
}
template <class S>
void lift(const EffectValues<S>& p, Air<S>& air) {
  air.lift = p["k_m"];
}
template <class S>
void wind(const EffectValues<S>& p, Air<S>& air) {
  air.wind = {p["w_x"], p["w_z"]};
}

}  // namespace

std::span<const dynamics::EffectOn<Air>> air_effects() {
  static const char* const kLonger = "motion capture of longer and faster flights";
  static const dynamics::EffectOn<Air> table[] = {
      {{.id = "flight.quadratic_drag",
        .mechanism = "quadratic drag, a = -k |v| v",
        .parameters = {{"k", "1/m", 0, 0, 10, 0.02}},
        .per_object = true,
        .form = AccelerationForm::quadratic,
        .remedy = kLonger},
       &drag<double>,
       &drag<Dual>},
      {{.id = "flight.magnus_lift",
        .mechanism = "Magnus lift, a = k_m omega J v",
        .parameters = {{"k_m", "-", 0, -5, 5, 0.01}},
        .form = AccelerationForm::lift,
        .remedy = kLonger},
       &lift<double>,
       &lift<Dual>},
      {{.id = "flight.wind",
        .mechanism = "constant air velocity, acting through the declared drag",
        .parameters = {{"w_x", "m/s", 0, -30, 30, 0.3}, {"w_z", "m/s", 0, -30, 30, 0.3}},
        .acts_through = "flight.quadratic_drag",
        .remedy = kLonger},
       &wind<double>,
       &wind<Dual>},
  };
  return table;
}

}  // namespace unhand::flight
