// Effects by name and value, as a campaign is given them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/effect.hpp"

namespace unhand::experiment {

struct CampaignDesign;

/// Values of effects' parameters, by "id.parameter" or, for effects that every object has its own of,
/// "id.parameter[object]", which wins over the value for all objects. What is not named is neutral.
using EffectSettings = std::map<std::string, double>;

/// One setting from "ID=value" (the effect's first parameter), "ID.parameter=value" or either with "[object]"
/// before the "=". Throws std::invalid_argument: for an unknown id with the nearest one and the list, for a
/// value out of range with the range.
std::pair<std::string, double> parse_effect(std::string_view text);

/// Throws std::invalid_argument, as parse_effect does, for names that no effect has, objects that are not
/// among `objects`, and values out of range.
void validate_effects(const EffectSettings& settings, const std::vector<std::string>& objects);

/// The settings as a throw of one object reads them: without brackets.
class OwnEffects {
 public:
  /// Of all settings, those that a throw of `object` reads.
  OwnEffects(const EffectSettings& settings, const std::string& object);
  /// Valid as long as this object.
  dynamics::Values<double> values() const { return {names_, values_}; }
  /// "id.parameter", no brackets.
  const std::vector<std::string>& names() const { return names_; }
  /// In the order of `names`.
  const std::vector<double>& numbers() const { return values_; }

 private:
  std::vector<std::string> names_;
  std::vector<double> values_;
};

/// "id.parameter" of "id.parameter[object]"; a name without brackets as it is.
std::string without_object(std::string_view name);

/// The parameter that a name means ("id.parameter", no brackets); null if there is none.
const dynamics::EffectParameter* find_parameter(std::string_view name);

/// The effect that a parameter's name belongs to ("id.parameter", no brackets); null if there is none.
const dynamics::Effect* effect_of(std::string_view name);

/// An effect for benchmarks of detection: one of the catalogue that the design's sensors can see, each of its
/// sizes log-uniform from half the `typical` one (about what a campaign can detect) to twenty times that
/// (large), with either sign where the range allows it (but μ_s > μ_k);
/// parameters of shape from their grid.
EffectSettings random_effect(const CampaignDesign& design, std::uint64_t seed);

}  // namespace unhand::experiment
