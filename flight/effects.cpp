#include "flight/effects.hpp"

namespace unhand::flight {
namespace {

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
  static const dynamics::EffectOn<Air> table[] = {
      {{"flight.quadratic_drag",
        "quadratic drag, a = -k |v| v",
        {{"k", "1/m", 0, 0, 10, 0.02}},
        true,
        false,
        "|v| v"},
       &drag<double>,
       &drag<Dual>},
      {{"flight.magnus_lift",
        "Magnus lift, a = k_m omega J v",
        {{"k_m", "-", 0, -5, 5, 0.01}},
        false,
        false,
        "omega J v"},
       &lift<double>,
       &lift<Dual>},
      {{"flight.wind",
        "constant air velocity, acting through the declared drag",
        {{"w_x", "m/s", 0, -30, 30, 0.3}, {"w_z", "m/s", 0, -30, 30, 0.3}},
        false,
        false,
        {},
        {},
        "flight.quadratic_drag"},
       &wind<double>,
       &wind<Dual>},
  };
  return table;
}

}  // namespace unhand::flight
