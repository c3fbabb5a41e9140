// Effects: one physical or sensing mechanism each that a base model leaves out.
//
// An effect's id says where its code lives: "contact.stribeck" in contact/, "sensor.mass" in experiment/.
// Each folder has a struct of what its effects may change (all neutral by default), and a table of EffectOn:
// the effect and how its parameters enter that struct. docs/adding-an-effect.md is the recipe.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/scalar.hpp"

namespace unhand::dynamics {

/// One parameter of an effect. With all parameters at their neutral values the equations are the base
/// model's.
struct EffectParameter {
  std::string name;      ///< "v_s": unique within its effect
  std::string unit;      ///< "-" where it has none
  double neutral{};      ///< where the effect is absent
  double low{}, high{};  ///< accepted range, ends included
  double typical{};      ///< a step from neutral that matters: scales, starts and one-sided footprints
  /// Values to try for a parameter that has no influence while the effect is absent (a Stribeck speed, say).
  /// Empty: the parameter measures the effect's size.
  std::vector<double> grid{};
  /// The equations hold down to here, though no fit looks and no campaign goes below `low` [unit].
  std::optional<double> least{};
  bool in_space_only{false};             ///< no motion in the plane x-z tells it
  std::optional<std::size_t> on_axis{};  ///< of the body, 0 to 2: it adds to what a sensor reads there alone
  std::string remedy{};  ///< what to measure where a log does not tell it; empty: Effect::remedy
  /// Beside neutral, the least that can be integrated, > neutral [unit]; whatever is greater where absent.
  std::optional<double> smallest{};
  /// True if the parameter only shapes an effect that another parameter switches on.
  bool is_shape() const { return !grid.empty(); }
};

/// The power of the metre in a unit as descriptors write it: 1 of "m/s", −1 of "1/m", 0 of "rad". Lengths
/// that are s times as long make a value s to that power as large. Units that hide a metre, as N does, are
/// taken as they are.
int length_power(std::string_view unit);

/// A unit as it stands after its number: with a space before it; nothing for "-".
std::string after_number(std::string_view unit);

/// An acceleration of the free object in the plane x-z or, from `turning` on, of its rotation: the forms that
/// are tried for something unlisted, and that some effects have. Coefficients have the unit of an
/// acceleration over that of the form. θ, ω: of the object; J turns by +90°.
enum class AccelerationForm {
  none,               ///< it seems to be none
  quadratic,          ///< |v| v
  linear,             ///< v
  cubic,              ///< |v|² v
  lift,               ///< ω J v
  along_x,            ///< 1 along x
  along_z,            ///< 1 along z
  along_body_x,       ///< 1 along the object's x
  along_body_z,       ///< 1 along the object's z
  centripetal_x,      ///< ω² along the object's x
  centripetal_z,      ///< ω² along the object's z
  turning,            ///< 1 in rotation
  turning_linear,     ///< ω in rotation
  turning_quadratic,  ///< |ω| ω in rotation
  turning_sine,       ///< sin θ in rotation
  turning_cosine      ///< cos θ in rotation
};

/// What must be there for an effect to leave a trace in a log of throws or flights.
struct EffectNeeds {
  bool wrench{false};           ///< the wrench behind a pad is measured
  bool normal_force{false};     ///< the pads' normal force is measured
  bool mocap{false};            ///< the object is tracked
  bool attitude{false};         ///< how a free body lies is tracked
  bool giving_pads{false};      ///< the contact law has pads that may give before they slip
  bool pressure{false};         ///< where the pads press shapes the contact law's limits
  bool reference_force{false};  ///< f₀, the campaign's median grip force, is known (every campaign's is)
};

/// Of an effect that is the traceless anisotropy of another one's parameter q ≥ 0: along body axis d that is
///   q_d = q + Σ_j w_jd p_j,
/// p_j the effect's own parameters. Nature has no q_d < 0, so there is no such effect where q is zero.
struct Anisotropy {
  std::string of;                                        ///< the other effect: "flight.quadratic_drag"
  std::string parameter;                                 ///< q: "k"
  std::map<std::string, std::array<double, 3>> weights;  ///< w_j by the name of p_j [-]
};

/// The descriptor of one effect: what it is called, what it models, and which parameters it has.
struct Effect {
  std::string id;                           ///< "contact.stribeck"
  std::string mechanism;                    ///< one line
  std::vector<EffectParameter> parameters;  ///< one or more; the order is that of reports and cards
  bool per_object{false};                   ///< every object has its own values, named "k[jar]"
  /// No two-sided derivative at neutral: its footprint is a difference, at several sizes, over the grid.
  bool one_sided{false};
  /// In flight: the acceleration that this effect seems to be.
  AccelerationForm form{AccelerationForm::none};
  std::optional<Anisotropy> anisotropy{};  ///< none: the effect stands alone
  /// Acts through what this other effect adds to, a wind through "flight.quadratic_drag": where nothing is
  /// declared of that and it is not in the model, this is no answer. Empty: stands alone.
  std::string acts_through{};
  /// Acts in the hand and in flight alike, as a tilted gravity does: wherever it was seen most, the rest of
  /// the throw must bear it out.
  bool acts_everywhere{false};
  EffectNeeds needs{};             ///< without these the log is the base model's
  bool about_declaration{false};   ///< of what the log declares of an object: another object has its own
  bool felt_in_fall{false};        ///< an accelerometer that falls feels it, along the vertical too
  std::string remedy{};            ///< what to measure where a log does not tell it; empty: other throws
  std::string untracked_remedy{};  ///< the same where no motion capture tracks the object; empty: as `remedy`
  /// "id.name"
  std::string full_name(const EffectParameter& parameter) const { return id + "." + parameter.name; }
};

/// Throws std::invalid_argument, naming parameter, value and range, for a value [unit] outside of what the
/// equations hold for: [low, high], or from `least` on; and between neutral and `smallest`.
void require_in_range(const Effect& effect, const EffectParameter& parameter, double value);

/// Named numbers; what is not named has the value the reader expects.
template <class S>
class Values {
 public:
  Values() = default;
  /// Both of one length, kept by the caller as long as this is used.
  Values(std::span<const std::string> names, std::span<const S> values) : names_(names), values_(values) {}
  /// The value under the full name ("contact.stribeck.v_s"), or `otherwise`.
  S get(std::string_view name, double otherwise) const {
    for (std::size_t i = 0; i < names_.size(); ++i)
      if (names_[i] == name) return values_[i];
    return S(otherwise);
  }
  /// Whether any name begins with `prefix` and a dot: whether an effect is switched on.
  bool has_prefix(std::string_view prefix) const {
    for (const auto& name : names_)
      if (name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
          name[prefix.size()] == '.')
        return true;
    return false;
  }

 private:
  std::span<const std::string> names_;
  std::span<const S> values_;
};

/// The parameters of one effect, neutral where `all` does not name them.
template <class S>
class EffectValues {
 public:
  /// Both are kept by reference.
  EffectValues(const Effect& effect, const Values<S>& all) : effect_(effect), all_(all) {}
  /// The value of the effect's parameter `name`, without the id. Throws std::logic_error if it has none such.
  S operator[](std::string_view name) const {
    for (const EffectParameter& p : effect_.parameters)
      if (p.name == name) return all_.get(effect_.full_name(p), p.neutral);
    throw_unknown(name);
  }

 private:
  [[noreturn]] void throw_unknown(std::string_view name) const {
    throw std::logic_error("effect " + effect_.id + " has no parameter " + std::string(name));
  }
  const Effect& effect_;
  const Values<S>& all_;
};

/// An effect and how it enters what it changes.
template <template <class> class Setup>
struct EffectOn {
  /// How the parameters enter a setup, SI units.
  template <class S>
  using Apply = void (*)(const EffectValues<S>&, Setup<S>&);
  /// `enter` serves either scalar: [](const auto& p, auto& setup) { setup.drag = p["k"]; }
  template <class Enter>
  EffectOn(Effect what, Enter enter) : effect(std::move(what)), apply(enter), apply_dual(enter) {}

  Effect effect;           ///< the descriptor
  Apply<double> apply;     ///< writes the parameters into the setup
  Apply<Dual> apply_dual;  ///< the same with derivatives
};

/// Writes the parameters of all effects of `table` that `values` names into `setup`.
template <template <class> class Setup, class S>
void apply_effects(std::span<const EffectOn<Setup>> table, const Values<S>& values, Setup<S>& setup) {
  for (const EffectOn<Setup>& entry : table) {
    if (!values.has_prefix(entry.effect.id)) continue;
    const EffectValues<S> own(entry.effect, values);
    if constexpr (std::is_same_v<S, double>)
      entry.apply(own, setup);
    else
      entry.apply_dual(own, setup);
  }
}

/// As above, for the parameter of one of the table's effects ("id.name"). Throws std::logic_error if there is
/// none such.
template <template <class> class Setup>
void require_in_range(std::span<const EffectOn<Setup>> table, std::string_view full_name, double value) {
  for (const EffectOn<Setup>& entry : table)
    for (const EffectParameter& p : entry.effect.parameters)
      if (entry.effect.full_name(p) == full_name) return require_in_range(entry.effect, p, value);
  throw std::logic_error("no effect has the parameter " + std::string(full_name));
}

}  // namespace unhand::dynamics
