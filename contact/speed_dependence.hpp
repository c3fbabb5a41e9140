// How friction depends on the speed of the slip.
#pragma once

#include <cmath>

#include "contact/friction_effects.hpp"

namespace unhand::contact {

/// The friction of a point that slips at v [m/s], beside Coulomb's [ArmstrongHelouvryDupont1994]:
///
///   μ(v)/μ = (1 + (μ_s/μ_k − 1) exp(−v²/v_s²)) (1 + v/v₀), 0 where that would be negative
template <class S>
struct SpeedDependence {
  S static_excess;        ///< μ_s/μ_k − 1 [-]
  S stribeck_speed;       ///< v_s [m/s]
  S viscous;              ///< 1/v₀ [s/m]
  bool stribeck, linear;  ///< whether the two terms vary, be it by their derivatives alone

  /// Of a variation that has been validated.
  explicit SpeedDependence(const FrictionVariation<S>& variation)
      : static_excess(variation.static_ratio - 1.0),
        stribeck_speed(variation.stribeck_speed),
        viscous(variation.viscous),
        stribeck(!dynamics::is_zero(static_excess)),
        linear(!dynamics::is_zero(variation.viscous)) {}
  /// Whether there is any.
  bool any() const { return stribeck || linear; }
  /// μ(v)/μ at v² = `square` [m²/s²]
  S factor(const S& square) const {
    using dynamics::value_of, std::exp, std::sqrt;
    S out(1.0);
    if (stribeck) out += static_excess * exp(-square / (stribeck_speed * stribeck_speed));
    if (linear && value_of(square) > 0) {
      const S growth = 1.0 + viscous * sqrt(square);
      out = value_of(growth) > 0 ? S(out * growth) : S(0);
    }
    return out;
  }
};

}  // namespace unhand::contact
