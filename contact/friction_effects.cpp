#include "contact/friction_effects.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>

#include "contact/contact_model.hpp"

namespace unhand::contact {

using dynamics::convert;
using dynamics::EffectValues;
using dynamics::value_of;

namespace {

template <class S>
void stribeck(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.static_ratio = p["mu_s/mu_k"];
  friction.stribeck_speed = p["v_s"];
}
template <class S>
void viscous(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.viscous = p["1/v_0"];
}
template <class S>
void soft_patch(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.softness = p["gamma"];
}
template <class S>
void pressure_profile(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.pressure_exponent = p["s"];
}
template <class S>
void compliance(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.compliance = p["compliance"];
  friction.loss_time = p["loss_time"];
}
template <class S>
void adhesion(const EffectValues<S>& p, FrictionVariation<S>& friction) {
  friction.adhesion = p["f_adh"];
  friction.parting_time = p["parting_time"];
}

}  // namespace

FrictionVariation<double> values(const FrictionVariation<Dual>& v) {
  return {v.static_ratio.a,      v.stribeck_speed.a, v.viscous.a,   v.softness.a, v.reference_force,
          v.pressure_exponent.a, v.compliance.a,     v.loss_time.a, v.adhesion.a, v.parting_time.a};
}

void validate(const FrictionVariation<Dual>& v) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("contact.{} = {} is not in {}", name, value, range));
  };
  require(v.static_ratio.a >= 0.2 && v.static_ratio.a <= 5, "stribeck.mu_s/mu_k", v.static_ratio.a,
          "[0.2, 5]");
  require(v.stribeck_speed.a >= 1e-3 && v.stribeck_speed.a <= 1, "stribeck.v_s", v.stribeck_speed.a,
          "[0.001, 1] m/s");
  require(v.viscous.a >= -1 && v.viscous.a <= 50, "viscous.1/v_0", v.viscous.a, "[-1, 50] s/m");
  require(v.softness.a >= -1 && v.softness.a <= 2, "soft_patch_radius.gamma", v.softness.a, "[-1, 2]");
  const bool soft = !dynamics::is_zero(v.softness);
  require(!soft || v.reference_force > 0, "soft_patch_radius: f_0", v.reference_force, "(0, inf) N");
  require(v.pressure_exponent.a >= -0.4 && v.pressure_exponent.a <= 3, "pressure_profile.s",
          v.pressure_exponent.a, "[-0.4, 3]");
  require(v.compliance.a >= 0 && v.compliance.a <= 1e-3, "pad_compliance.compliance", v.compliance.a,
          "[0, 0.001] m/N");
  require(v.loss_time.a >= 0 && v.loss_time.a <= 0.1, "pad_compliance.loss_time", v.loss_time.a,
          "[0, 0.1] s");
  require(v.adhesion.a >= 0 && v.adhesion.a <= 50, "adhesion.f_adh", v.adhesion.a, "[0, 50] N");
  require(v.parting_time.a >= 0 && v.parting_time.a <= 0.1, "adhesion.parting_time", v.parting_time.a,
          "[0, 0.1] s");
}

std::span<const dynamics::EffectOn<FrictionVariation>> friction_effects() {
  static const dynamics::EffectOn<FrictionVariation> table[] = {
      {{"contact.stribeck",
        "friction falls with slip speed from a static to a kinetic coefficient",
        {{"mu_s/mu_k", "-", 1, 0.2, 5, 0.1}, {"v_s", "m/s", 0.02, 1e-3, 1, 0.01, {0.003, 0.01, 0.03, 0.1}}}},
       &stribeck<double>,
       &stribeck<Dual>},
      {{"contact.viscous",
        "friction grows with slip speed, mu (1 + v/v_0)",
        {{"1/v_0", "s/m", 0, -1, 50, 1}}},
       &viscous<double>,
       &viscous<Dual>},
      {{"contact.soft_patch_radius",
        "the patch shrinks with the normal force, a = a_0 (f_N/f_0)^gamma",
        // Below 0 the law has solutions, but no patch widens as it is let go.
        {{"gamma", "-", 0, 0, 2, 0.1}}},
       &soft_patch<double>,
       &soft_patch<Dual>},
      {{"contact.pressure_profile",
        "pressure (1 - (r/a)^2)^s instead of a uniform one",
        {{"s", "-", 0, -0.4, 3, 0.2}}},
       &pressure_profile<double>,
       &pressure_profile<Dual>},
      {{"contact.pad_compliance",
        "the pads give tangentially before they slip",
        {{"compliance", "m/N", 0, 0, 1e-3, 5e-6},
         {"loss_time", "s", 0.005, 0, 0.1, 0.005, {0.002, 0.005, 0.02}}},
        false,
        true},
       &compliance<double>,
       &compliance<Dual>},
      {{"contact.adhesion",
        "the pads stick to the object beyond their normal force",
        {{"f_adh", "N", 0, 0, 50, 0.2}, {"parting_time", "s", 0.005, 1e-4, 0.1, 0.005, {0.001, 0.003, 0.01}}},
        false,
        true},
       &adhesion<double>,
       &adhesion<Dual>},
  };
  return table;
}

AdhesiveForce::AdhesiveForce(const NormalForce& base, const Dual& adhesion, const Dual& parting_time)
    : base_(base), adhesion_(adhesion), parting_time_(parting_time) {
  if (!(adhesion.a >= 0 && adhesion.a <= 1000))
    throw std::invalid_argument(
        fmt::format("contact.adhesion: f_adh = {} is not in [0, 1000] N", adhesion.a));
  if (!(parting_time.a > 0 && parting_time.a <= 1))
    throw std::invalid_argument(
        fmt::format("contact.adhesion: parting_time = {} is not in (0, 1] s", parting_time.a));
  force_release(base, parting_);
}

template <class S>
S AdhesiveForce::at_(const Window& window, const S& t) const {
  const double snap = std::min(1e-9, 0.25 * (window.end - window.begin));
  const double inside = std::clamp(value_of(t), window.begin + snap, window.end - snap);
  if (inside < parting_.a) return base_.at(window, t) + convert<S>(adhesion_);
  const S rest = 1.0 - (t - convert<S>(parting_)) / convert<S>(parting_time_);
  return value_of(rest) > 0 ? S(convert<S>(adhesion_) * rest) : S(0);
}
template <class S>
void AdhesiveForce::kinks_(std::vector<S>& out) const {
  base_.kinks(out);
  if (std::isfinite(parting_.a)) out.push_back(convert<S>(parting_) + convert<S>(parting_time_));
}

BiasedForce::BiasedForce(const NormalForce& base, const Dual& bias, double opening_start)
    : base_(base), bias_(bias), opening_start_(opening_start) {
  force_release(base, release_);
}

template <class S>
S BiasedForce::at_(const Window& window, const S& t) const {
  const double release = release_.a;
  if (value_of(t) >= release) return S(0);
  S weight(1.0);
  if (value_of(t) > opening_start_ && std::isfinite(release))
    weight = (convert<S>(release_) - t) / (convert<S>(release_) - opening_start_);
  const S force = base_.at(window, t) - convert<S>(bias_) * weight;
  return value_of(force) > 0 ? force : S(0);
}
void BiasedForce::kinks(std::vector<double>& out) const { base_.kinks(out); }
void BiasedForce::kinks(std::vector<Dual>& out) const { base_.kinks(out); }

template double AdhesiveForce::at_(const Window&, const double&) const;
template Dual AdhesiveForce::at_(const Window&, const Dual&) const;
template void AdhesiveForce::kinks_(std::vector<double>&) const;
template void AdhesiveForce::kinks_(std::vector<Dual>&) const;
template double BiasedForce::at_(const Window&, const double&) const;
template Dual BiasedForce::at_(const Window&, const Dual&) const;

}  // namespace unhand::contact
