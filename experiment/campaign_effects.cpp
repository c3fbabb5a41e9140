#include "experiment/campaign_effects.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/effect.hpp"
#include "experiment/random_stream.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "experiment/throw_setup.hpp"

namespace unhand::experiment {

using dynamics::Effect;
using dynamics::EffectParameter;

namespace {

const std::vector<Effect>& catalogue() {
  static const std::vector<Effect> effects = known_effects();
  return effects;
}

struct CataloguedParameter {
  const Effect* effect{};
  const EffectParameter* parameter{};
};

/// By "id.parameter" or "id", which means its first parameter.
CataloguedParameter find(std::string_view name) {
  for (const Effect& effect : catalogue()) {
    if (name == effect.id) return {&effect, &effect.parameters.front()};
    for (const EffectParameter& p : effect.parameters)
      if (name == effect.full_name(p)) return {&effect, &p};
  }
  return {};
}

[[noreturn]] void throw_unknown(std::string_view name) {
  std::vector<std::string> ids, names;
  std::string own;
  for (const Effect& effect : catalogue()) {
    ids.push_back(effect.id);
    names.push_back(effect.id);
    for (const EffectParameter& p : effect.parameters) names.push_back(effect.full_name(p));
    if (name.substr(0, effect.id.size() + 1) != effect.id + ".") continue;
    std::vector<std::string> parameters;
    for (const EffectParameter& p : effect.parameters) parameters.push_back(p.name);
    own = fmt::format("; {} has {}", effect.id, fmt::join(parameters, ", "));
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw std::invalid_argument(
      datasets::unknown_name(fmt::format("effect \"{}\" is unknown{}", name, own), name,
                             datasets::meant_name(name, views).empty() ? ids : names));
}

/// "k[jar]" is {"k", "jar"}; without brackets the second is empty.
std::pair<std::string, std::string> split_object(std::string_view name) {
  const std::size_t bracket = name.find('[');
  if (bracket == std::string_view::npos) return {std::string(name), {}};
  if (name.back() != ']' || bracket + 2 >= name.size())
    throw std::invalid_argument(fmt::format("effect \"{}\": an object is named in brackets, ID[jar]", name));
  return {std::string(name.substr(0, bracket)),
          std::string(name.substr(bracket + 1, name.size() - bracket - 2))};
}

/// The full name; checks everything but whether the object exists.
std::string checked(std::string_view name, double value) {
  const auto [bare, object] = split_object(name);
  const CataloguedParameter found = find(bare);
  if (!found.effect) throw_unknown(bare);
  if (!object.empty() && !found.effect->per_object)
    throw std::invalid_argument(
        fmt::format("effect {}: all objects share it, so it takes no [{}]", found.effect->id, object));
  const EffectParameter& p = *found.parameter;
  if (!(value >= p.low && value <= p.high))
    throw std::invalid_argument(fmt::format("effect {}: {} = {} is not in [{}, {}]{}", found.effect->id,
                                            p.name, value, p.low, p.high, dynamics::after_number(p.unit)));
  const std::string full = found.effect->full_name(p);
  return object.empty() ? full : fmt::format("{}[{}]", full, object);
}

/// True where the campaign's law and sensors could show it.
bool is_visible(const Effect& effect, const CampaignDesign& design) {
  const SensorSuite& s = design.sensors;
  const dynamics::EffectNeeds& needs = effect.needs;
  const auto is_dragged = [](const ThrownObject& o) { return o.drag_k > 0; };
  if (!effect.acts_through.empty() &&  // drag is all that objects declare of what effects act through
      std::none_of(design.objects.begin(), design.objects.end(), is_dragged))
    return false;
  return !(needs.wrench && !(s.ft && s.wrench)) && !(needs.normal_force && !s.ft) &&
         !(needs.mocap && !s.mocap) && !(needs.giving_pads && !contact::can_give(design.contact_model)) &&
         !(needs.pressure && !contact::feels_pressure(design.contact_model));
}

/// What a random campaign can just detect, in typical steps.
constexpr double kLeastSteps = 0.5;

double random_size(const Effect& effect, const EffectParameter& p, RandomStream& random) {
  constexpr double kLargeOverLeast = 20;
  const double size = p.typical * kLeastSteps * std::pow(kLargeOverLeast, random.uniform());
  const bool negative = random.uniform() < 0.5 && !effect.one_sided && p.neutral - size >= p.low;
  return std::min(p.high, p.neutral + (negative ? -size : size));
}

}  // namespace

std::string without_object(std::string_view name) { return std::string(name.substr(0, name.find('['))); }

const EffectParameter* find_parameter(std::string_view name) { return find(name).parameter; }

const Effect* effect_of(std::string_view name) { return find(name).effect; }

std::pair<std::string, double> parse_effect(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0)
    throw std::invalid_argument(fmt::format("effect \"{}\": expected ID=value or ID.parameter=value", text));
  const std::string_view name = text.substr(0, equals), number = text.substr(equals + 1);
  double value = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
  if (error != std::errc() || end != number.data() + number.size()) {
    const EffectParameter* parameter = find_parameter(split_object(name).first);
    checked(name, parameter ? parameter->neutral : 0);
    throw std::invalid_argument(fmt::format("effect {}: \"{}\" is not a number", name, number));
  }
  return {checked(name, value), value};
}

void validate_effects(const EffectSettings& settings, const std::vector<std::string>& objects) {
  for (const auto& [name, value] : settings) {
    if (const std::string full = checked(name, value); full != name)
      throw std::invalid_argument(fmt::format("effect \"{}\": name the parameter, {}", name, full));
    const std::string object = split_object(name).second;
    if (!object.empty() && std::find(objects.begin(), objects.end(), object) == objects.end())
      throw std::invalid_argument(fmt::format("effect {}: the campaign has no object \"{}\", only {}", name,
                                              object, fmt::join(objects, ", ")));
  }
}

OwnEffects::OwnEffects(const EffectSettings& settings, const std::string& object) {
  for (const auto& [name, value] : settings) {
    const auto [bare, whose] = split_object(name);
    if (!whose.empty() && whose != object) continue;
    const auto known = std::find(names_.begin(), names_.end(), bare);
    if (known == names_.end()) {
      names_.push_back(bare);
      values_.push_back(value);
    } else if (!whose.empty()) {
      values_[static_cast<std::size_t>(known - names_.begin())] = value;
    }
  }
}

EffectSettings random_effect(const CampaignDesign& design, std::uint64_t seed) {
  RandomStream random(seed, 0, Purpose::effect);
  std::vector<const Effect*> visible;
  for (const Effect& effect : catalogue())
    if (is_visible(effect, design)) visible.push_back(&effect);
  const Effect& effect = *visible[static_cast<std::size_t>(random.index(static_cast<int>(visible.size())))];
  EffectSettings out;
  for (const EffectParameter& p : effect.parameters) {
    const auto draw = [&] {
      return p.is_shape() ? p.grid[static_cast<std::size_t>(random.index(static_cast<int>(p.grid.size())))]
                          : random_size(effect, p, random);
    };
    if (effect.per_object)
      for (const ThrownObject& object : design.objects)
        out[fmt::format("{}[{}]", effect.full_name(p), object.name)] = draw();
    else
      out[effect.full_name(p)] = draw();
  }
  return out;
}

}  // namespace unhand::experiment
