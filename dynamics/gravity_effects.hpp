// Gravity as the base frame sees it.
#pragma once

#include <cmath>

#include "dynamics/effect.hpp"
#include "dynamics/frames.hpp"

namespace unhand::dynamics {

/// Gravity g (sin α, −cos α) in the x-z plane, g [m/s²] declared, α [rad] the angle by which the base frame
/// is not level (positive: gravity has a component along +x). It acts in the grasp, too.
template <class S>
struct Gravity {
  S tilt{};  ///< α [rad]
  /// The gravity vector (x, z) [m/s²] for the declared g > 0 [m/s²].
  Vec2<S> at(double g) const {
    using std::cos;
    using std::sin;
    return {g * sin(tilt), -g * cos(tilt)};
  }
};

/// flight.gravity_tilt
std::span<const EffectOn<Gravity>> gravity_effects();

}  // namespace unhand::dynamics
