#include "dynamics/gravity_effects.hpp"

namespace unhand::dynamics {
namespace {

template <class S>
void tilt(const EffectValues<S>& p, Gravity<S>& gravity) {
  gravity.tilt = p["angle"];
}

}  // namespace

std::span<const EffectOn<Gravity>> gravity_effects() {
  static const EffectOn<Gravity> table[] = {
      {{"flight.gravity_tilt",
        "the base frame is not level",
        {{"angle", "rad", 0, -0.5, 0.5, 0.01}},
        false,
        false,
        "1 along x"},
       &tilt<double>,
       &tilt<Dual>},
  };
  return table;
}

}  // namespace unhand::dynamics
