#include "dynamics/gravity_effects.hpp"

namespace unhand::dynamics {

std::span<const EffectOn<Gravity>> gravity_effects() {
  static const EffectOn<Gravity> table[] = {
      {{.id = "flight.gravity_tilt",
        .mechanism = "the base frame is not level",
        .parameters = {{"angle", "rad", 0, -0.5, 0.5, 0.01}},
        .form = AccelerationForm::along_x,
        .acts_everywhere = true,
        .remedy = "motion capture of longer and faster flights"},
       [](const auto& p, auto& gravity) { gravity.tilt = p["angle"]; }},
  };
  return table;
}

}  // namespace unhand::dynamics
