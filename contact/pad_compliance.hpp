// Pads that give tangentially as a whole, for laws that know no points; see giving_points.hpp.
#pragma once

#include <optional>
#include <stdexcept>

#include "contact/contact_model.hpp"
#include "contact/friction_limits.hpp"

namespace unhand::contact {

/// A disc of linear springs and dampers between the pads and the object, the wrench about the patch:
///
///   f = R(θ_H) f₀ − k (δ + T v_r),   τ = τ₀ − k ρ² (δθ + T ω_r),   k = 1/compliance [N/m],  ρ² = a²/2 [m²]
///
/// (f₀, τ₀) is the wrench of the Hold, δ = R(θ_O) (arm − arm₀) [m] how far the material point that the pads
/// first held has moved against the hand since, δθ = θ_O − θ_H − angle₀ [rad], T the loss time [s] and a the
/// patch's radius [m] under the reference force. k does not change with f_N: rubber keeps its shear stiffness
/// while the friction that it is held by fades. v_r is of the point that is at the hand now: it differs from
/// δ' in the hand by ω_r J δ, of second order in the deflection.
template <class S>
struct PadCompliance {
  S stiffness{};  ///< k [N/m]
  S torsional{};  ///< k ρ² [N m/rad]
  S loss_time{};  ///< T [s]

  /// Throws std::invalid_argument where the scene does not say how the object is held.
  Wrench<S> wrench(const Scene<S>& scene, const Relative<S>& y) const {
    if (!scene.hold) throw std::invalid_argument("contact.pad_compliance: the scene has no hold");
    const Hold<S>& hold = *scene.hold;
    const Vec2<S> moved =
        dynamics::rotate(S(scene.hand.theta + y.angle), Vec2<S>{y.arm.x - hold.arm.x, y.arm.z - hold.arm.z});
    const Vec2<S> first = dynamics::rotate(scene.hand.theta, hold.wrench.force());
    return {first.x - stiffness * (moved.x + loss_time * y.slip.x),
            first.z - stiffness * (moved.z + loss_time * y.slip.z),
            hold.wrench.tau - torsional * (y.angle - hold.angle + loss_time * y.spin)};
  }
};

/// None where the pads are rigid.
template <class S>
using OptionalCompliance = std::optional<PadCompliance<S>>;
/// As the variation of the limits says.
template <class S>
OptionalCompliance<S> pad_compliance(const FrictionLimits<S>& limits) {
  const auto& variation = limits.variation();
  if (!(dynamics::value_of(variation.compliance) > 0)) return std::nullopt;
  const S stiffness = 1.0 / variation.compliance, radius = limits.patch().radius;
  return PadCompliance<S>{stiffness, 0.5 * stiffness * radius * radius, variation.loss_time};
}

}  // namespace unhand::contact
