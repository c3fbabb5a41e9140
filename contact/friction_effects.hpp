// How friction and the normal force may depart from a rigid patch under Coulomb's law.
#pragma once

#include <array>
#include <span>

#include "contact/normal_force.hpp"
#include "dynamics/effect.hpp"

namespace unhand::contact {

/// Departures of the friction limits, all neutral by default. Each contact law reads those that it models
/// (ContactParameters::variation); adhesion is of the normal force, which whoever simulates wraps in an
/// AdhesiveForce. u = (v_r, L ω_r) is the slip, |u| its speed [m/s].
template <class S>
struct FrictionVariation {
  S static_ratio{1.0};       ///< μ_s/μ_k: μ(|u|) = μ (1 + (μ_s/μ_k − 1) exp(−(|u|/v_s)²)) [-]
  S stribeck_speed{0.02};    ///< v_s [m/s]
  S viscous{};               ///< 1/v₀: μ(|u|) = μ (1 + |u|/v₀) [s/m]
  S softness{};              ///< γ: a = a₀ (f_N/f₀)^γ, soft finger [XydasKao1999] [-]
  double reference_force{};  ///< f₀ [N]
  S pressure_exponent{};     ///< s: pressure ∝ (1 − (r/a)²)^s at the same L = c a [-]; of the disc alone
  S compliance{};    ///< tangential, of the pads together [m/N], 0 or >= 1e-10; of limit surfaces alone
  S loss_time{};     ///< of the compliance [s]; likewise
  S adhesion{};      ///< f_adh: limits μ (f_N + f_adh) of a pad [N]; AdhesiveForce's, no law reads it
  S parting_time{};  ///< from f_N = 0 until the adhesion has died [s]; likewise
};

/// The members that effects set, in the order of friction_effects() and of their parameters: of a variation
/// (const or not), pointers to its members.
template <class Variation>
auto effect_values(Variation& v) {
  return std::array{&v.static_ratio, &v.stribeck_speed, &v.viscous,  &v.softness,    &v.pressure_exponent,
                    &v.compliance,   &v.loss_time,      &v.adhesion, &v.parting_time};
}

/// With derivatives, for models that store both.
template <class S>
FrictionVariation<Dual> constant(const FrictionVariation<S>& v) {
  FrictionVariation<Dual> out;
  const auto from = effect_values(v);
  const auto to = effect_values(out);
  for (std::size_t i = 0; i < to.size(); ++i) *to[i] = Dual(*from[i]);
  out.reference_force = v.reference_force;
  return out;
}

/// Without derivatives.
FrictionVariation<double> values(const FrictionVariation<Dual>& v);

/// Throws std::invalid_argument, naming parameter, value and range, outside of those of friction_effects()
/// (EffectParameter::least and `smallest` where there are), and unless f₀ > 0 where an effect needs it.
void validate(const FrictionVariation<Dual>& v);

/// contact.stribeck, contact.viscous, contact.soft_patch_radius, contact.pressure_profile,
/// contact.pad_compliance, contact.adhesion
std::span<const dynamics::EffectOn<FrictionVariation>> friction_effects();

/// f_N + f_adh while the pads press, then f_adh fading linearly within the parting time, at whose end the
/// object is free. `base` must outlive it.
class AdhesiveForce final : public NormalForce {
 public:
  /// `adhesion` f_adh [N], `parting_time` [s] > 0. Throws std::invalid_argument outside of the effect's
  /// ranges.
  AdhesiveForce(const NormalForce& base, const Dual& adhesion, const Dual& parting_time);
  AdhesiveForce(const NormalForce&&, const Dual&, const Dual&) = delete;
  double at(const Window& window, double t) const override { return at_(window, t); }
  Dual at(const Window& window, const Dual& t) const override { return at_(window, t); }
  void kinks(std::vector<double>& out) const override { kinks_(out); }
  void kinks(std::vector<Dual>& out) const override { kinks_(out); }
  double release_time() const override { return base_.release_time() + parting_time_.a; }

 private:
  template <class S>
  S at_(const Window& window, const S& t) const;
  template <class S>
  void kinks_(std::vector<S>& out) const;
  const NormalForce& base_;
  Dual adhesion_, parting_time_, parting_;
};

/// f_N(t) − b w(t) >= 0, where w is 1 in the grip and falls linearly to 0 over the opening: the smoothing has
/// already taken the level after the release for the sensor's zero there, so that the release stays where it
/// was seen. b [N] is reported minus true. Where the difference is cut off at zero, near the release, its
/// slope jumps: kinks() does not list that instant, which depends on b, and the integrator's error control
/// finds it. `base` must outlive it.
class BiasedForce final : public NormalForce {
 public:
  /// `bias` b [N]; `opening_start` [s], when the grip begins to open (after the release: all of b acts until
  /// then; not read where `base` has none). Throws std::invalid_argument where either is not finite.
  BiasedForce(const NormalForce& base, const Dual& bias, double opening_start);
  BiasedForce(const NormalForce&&, const Dual&, double) = delete;
  double at(const Window& window, double t) const override { return at_(window, t); }
  Dual at(const Window& window, const Dual& t) const override { return at_(window, t); }
  void kinks(std::vector<double>& out) const override;
  void kinks(std::vector<Dual>& out) const override;
  double release_time() const override { return base_.release_time(); }

 private:
  template <class S>
  S at_(const Window& window, const S& t) const;
  const NormalForce& base_;
  Dual bias_, release_;
  double opening_start_;
};

}  // namespace unhand::contact
