// The friction limits at an instant: what a patch can hold and what it resists with while it slips.
#pragma once

#include <cmath>

#include "contact/friction_effects.hpp"
#include "contact/patch.hpp"
#include "contact/speed_dependence.hpp"
#include "dynamics/frames.hpp"

namespace unhand::contact {

/// f_max and L = τ_max/f_max of n pads, each pressed by f_N [N], that slip with u = (v_r, L ω_r):
///
///   L(f_N)     = L₀ (f_N/f₀)^γ                                                                [m]
///   f_max(f_N) = n μ f_N (1 + (μ_s/μ_k − 1) exp(−|u|²/v_s²)) (1 + |u|/v₀),   τ_max = L f_max  [N], [N m]
///
/// with the symbols of FrictionVariation. A held patch has |u| = 0. Neutral values leave the limits of Patch,
/// to the bit. The soft finger's f_N/f₀ is taken as sqrt((f_N/f₀)² + 10⁻¹⁰), so that L stays positive and
/// finite as f_N → 0; f_max (1 + |u|/v₀) is taken as 0 where it would be negative. With adhesion f_N is f_N +
/// f_adh. [XydasKao1999] for γ, [ArmstrongHelouvryDupont1994] for the speeds.
///
/// |u| stands for the speed of the patch in the laws that know no points. On the discs every point has its
/// own: see LocalFriction and GivingPoints.
template <class S>
class FrictionLimits {
 public:
  /// Both are copied; validate them first.
  FrictionLimits(const Patch<S>& patch, const FrictionVariation<S>& variation)
      : patch_(patch),
        variation_(variation),
        soft_(!dynamics::is_zero(variation.softness)),
        speed_(variation) {}

  /// The patch under Coulomb's law.
  const Patch<S>& patch() const { return patch_; }
  /// How the limits depart from it.
  const FrictionVariation<S>& variation() const { return variation_; }

  /// L [m]
  S length(const S& normal_force) const {
    if (!soft_) return patch_.length();
    using std::exp;
    using std::log;
    const S ratio = normal_force / variation_.reference_force;
    return patch_.length() * exp(0.5 * variation_.softness * log(ratio * ratio + 1e-10));
  }
  /// n μ f_N, under Coulomb's law [N]
  S coulomb(const S& normal_force) const { return patch_.f_max(normal_force); }
  /// f_max of a held patch [N]
  S held(const S& normal_force) const {
    return speed_.stribeck ? S(variation_.static_ratio * coulomb(normal_force)) : coulomb(normal_force);
  }
  /// f_max while slipping at v_r [m/s] and ω_r [rad/s]
  S slipping(const S& normal_force, const dynamics::Vec2<S>& slip, const S& spin) const {
    if (!speed_.any()) return coulomb(normal_force);
    const S spin_speed = length(normal_force) * spin;
    return speed_.factor(S(dot(slip, slip) + spin_speed * spin_speed)) * coulomb(normal_force);
  }
  /// How friction depends on the speed of the slip.
  const SpeedDependence<S>& speed() const { return speed_; }

 private:
  Patch<S> patch_;
  FrictionVariation<S> variation_;
  bool soft_;
  SpeedDependence<S> speed_;
};

}  // namespace unhand::contact
