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
  /// True if the parameter only shapes an effect that another parameter switches on.
  bool is_shape() const { return !grid.empty(); }
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
  /// In flight: the term of fitting/discovery/missing_force.cpp that is the acceleration this effect seems to
  /// be. Empty: none is.
  std::string form{};
  std::optional<Anisotropy> anisotropy{};  ///< none: the effect stands alone
  /// Acts through what this other effect adds to, a wind through "flight.quadratic_drag": where nothing is
  /// declared of that and it is not in the model, this is no answer. Empty: stands alone.
  std::string acts_through{};
  /// Acts in the hand and in flight alike, as a tilted gravity does: wherever it was seen most, the rest of
  /// the throw must bear it out.
  bool acts_everywhere{false};
  /// "id.name"
  std::string full_name(const EffectParameter& parameter) const { return id + "." + parameter.name; }
};

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
  Effect effect;  ///< the descriptor
  void (*apply)(const EffectValues<double>&,
                Setup<double>&);  ///< writes the parameters into the setup, SI units
  void (*apply_dual)(const EffectValues<Dual>&, Setup<Dual>&);  ///< the same with derivatives
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

}  // namespace unhand::dynamics
