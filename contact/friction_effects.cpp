#include "contact/friction_effects.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>

#include "contact/contact_model.hpp"

namespace unhand::contact {

using dynamics::convert;
using dynamics::value_of;

FrictionVariation<double> values(const FrictionVariation<Dual>& v) {
  FrictionVariation<double> out;
  const auto from = effect_values(v);
  const auto to = effect_values(out);
  for (std::size_t i = 0; i < to.size(); ++i) *to[i] = from[i]->a;
  out.reference_force = v.reference_force;
  return out;
}

void validate(const FrictionVariation<Dual>& v) {
  const auto values = effect_values(v);
  auto value = values.begin();
  for (const auto& [effect, apply, apply_dual] : friction_effects()) {
    bool there = false;
    for (const dynamics::EffectParameter& p : effect.parameters) {
      dynamics::require_in_range(effect, p, (*value)->a);
      there = there || !dynamics::is_zero(Dual(**value - p.neutral));
      ++value;
    }
    if (there && effect.needs.reference_force && !(v.reference_force > 0))
      throw std::invalid_argument(
          fmt::format("{}: f_0 = {} is not in (0, inf) N", effect.id, v.reference_force));
  }
}

std::span<const dynamics::EffectOn<FrictionVariation>> friction_effects() {
  static const dynamics::EffectOn<FrictionVariation> table[] = {
      {{.id = "contact.stribeck",
        .mechanism = "friction falls with slip speed from a static to a kinetic coefficient",
        // Below 1 the law has solutions, but friction that rises with speed is the viscous effect's.
        .parameters = {{.name = "mu_s/mu_k",
                        .unit = "-",
                        .neutral = 1,
                        .low = 1,
                        .high = 5,
                        .typical = 0.1,
                        .least = 0.2},
                       {"v_s", "m/s", 0.02, 1e-3, 1, 0.01, {0.003, 0.01, 0.03, 0.1}}}},
       [](const auto& p, auto& friction) {
         friction.static_ratio = p["mu_s/mu_k"];
         friction.stribeck_speed = p["v_s"];
       }},
      {{.id = "contact.viscous",
        .mechanism = "friction grows with slip speed, mu (1 + v/v_0)",
        .parameters = {{"1/v_0", "s/m", 0, -1, 50, 1}}},
       [](const auto& p, auto& friction) { friction.viscous = p["1/v_0"]; }},
      {{.id = "contact.soft_patch_radius",
        .mechanism = "the patch shrinks with the normal force, a = a_0 (f_N/f_0)^gamma",
        // Below 0 the law has solutions, but no patch widens as it is let go.
        .parameters = {{.name = "gamma", .unit = "-", .high = 2, .typical = 0.1, .least = -1}},
        .needs = {.reference_force = true}},
       [](const auto& p, auto& friction) { friction.softness = p["gamma"]; }},
      {{.id = "contact.pressure_profile",
        .mechanism = "pressure (1 - (r/a)^2)^s instead of a uniform one",
        .parameters = {{"s", "-", 0, -0.4, 3, 0.2}},
        .needs = {.pressure = true}},
       [](const auto& p, auto& friction) { friction.pressure_exponent = p["s"]; }},
      {{.id = "contact.pad_compliance",
        .mechanism = "the pads give tangentially before they slip",
        // Stiffer pads ring, or creep, too fast for a step budget and for double's resolution: at a tenth of
        // this one throw in a hundred has no answer. They are rigid: detach twists differ by 6e-5 rad/s.
        .parameters =
            {{.name = "compliance", .unit = "m/N", .high = 1e-3, .typical = 5e-6, .smallest = 1e-10},
             {"loss_time", "s", 0.005, 0, 0.1, 0.005, {0.002, 0.005, 0.02}}},
        .one_sided = true,
        .needs = {.giving_pads = true}},
       [](const auto& p, auto& friction) {
         friction.compliance = p["compliance"];
         friction.loss_time = p["loss_time"];
       }},
      {{.id = "contact.adhesion",
        .mechanism = "the pads stick to the object beyond their normal force",
        .parameters = {{"f_adh", "N", 0, 0, 50, 0.2},
                       {.name = "parting_time",
                        .unit = "s",
                        .neutral = 0.005,
                        .low = 1e-4,
                        .high = 0.1,
                        .typical = 0.005,
                        .grid = {0.001, 0.003, 0.01},
                        .least = 0}},
        .one_sided = true},
       [](const auto& p, auto& friction) {
         friction.adhesion = p["f_adh"];
         friction.parting_time = p["parting_time"];
       }},
  };
  return table;
}

AdhesiveForce::AdhesiveForce(const NormalForce& base, const Dual& adhesion, const Dual& parting_time)
    : base_(base), adhesion_(adhesion), parting_time_(parting_time) {
  dynamics::require_in_range(friction_effects(), "contact.adhesion.f_adh", adhesion.a);
  dynamics::require_in_range(friction_effects(), "contact.adhesion.parting_time", parting_time.a);
  if (parting_time.a == 0)
    throw std::invalid_argument("contact.adhesion.parting_time = 0 s is no time to part");
  force_release(base, parting_);
}

template <class S>
S AdhesiveForce::at_(const Window& window, const S& t) const {
  const double snap = std::min(1e-9, 0.25 * (window.end - window.begin));
  const double inside = std::clamp(value_of(t), window.begin + snap, window.end - snap);
  if (inside < parting_.a) {
    const S pressed = base_.at(window, t);
    // Past the window's end the branch may go on below zero; within it that is for who reads it to refuse.
    if (value_of(pressed) < 0) return value_of(t) > window.end ? convert<S>(adhesion_) : pressed;
    return pressed + convert<S>(adhesion_);
  }
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
  if (!std::isfinite(bias.a))
    throw std::invalid_argument(fmt::format("biased force: bias = {} N is not finite", bias.a));
  if (!std::isfinite(opening_start) && std::isfinite(release_.a))
    throw std::invalid_argument(
        fmt::format("biased force: opening_start = {} s is not finite", opening_start));
}

template <class S>
S BiasedForce::at_(const Window& window, const S& t) const {
  const double release = release_.a;
  const double snap = std::min(1e-9, 0.25 * (window.end - window.begin));
  if (std::clamp(value_of(t), window.begin + snap, window.end - snap) >= release) return S(0);
  S weight(1.0);
  if (value_of(t) > opening_start_ && std::isfinite(release))
    weight = (convert<S>(release_) - t) / (convert<S>(release_) - opening_start_);
  const S pressed = base_.at(window, t), force = pressed - convert<S>(bias_) * weight;
  if (value_of(pressed) < 0) return pressed;  // no force: for who reads it to refuse
  return value_of(force) < 0 ? S(0) : force;
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
