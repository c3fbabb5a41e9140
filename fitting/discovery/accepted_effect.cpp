#include "fitting/discovery/accepted_effect.hpp"

#include <algorithm>

#include "experiment/campaign_effects.hpp"

namespace unhand::fitting {

std::vector<Parameter> parameters_of(const FitResult& fit, const dynamics::Effect& effect) {
  std::vector<Parameter> out;
  for (const auto& u : fit.campaign)
    for (const auto& p : effect.parameters)
      if (experiment::without_object(u.unknown.name) == effect.full_name(p))
        out.push_back({u.unknown.name.substr(effect.id.size() + 1), u.unknown.unit, u.value, u.sigma,
                       u.interval_freedom()});
  return out;
}

void AcceptedEffect::add_other_name(const std::string& other, double correlation) {
  for (auto& [name, known] : equivalent)
    if (name == other) {
      known = std::max(known, correlation);
      return;
    }
  equivalent.push_back({other, correlation});
}

bool is_accepted(const std::string& id, std::span<const AcceptedEffect> effects) {
  return std::any_of(effects.begin(), effects.end(), [&](const AcceptedEffect& e) { return e.id == id; });
}

}  // namespace unhand::fitting
