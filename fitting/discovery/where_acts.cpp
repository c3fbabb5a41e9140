#include "fitting/discovery/where_acts.hpp"

#include <algorithm>

namespace unhand::fitting {

bool in_air(Phase phase) { return phase == Phase::flight || phase == Phase::landing; }

bool acts_on_pads(const std::string& id) { return id.starts_with("contact.") || id.starts_with("release."); }

bool is_of_sensor(const std::string& id) { return id.starts_with("sensor."); }

bool acts_everywhere(const std::string& id) { return !is_law(id) && find_effect(id).acts_everywhere; }

bool acts_on_pads(const Stage& stage) {
  return std::any_of(stage.ids.begin(), stage.ids.end(),
                     [](const std::string& id) { return acts_on_pads(id); });
}

bool acts(const AcceptedEffect& effect, bool air) {
  return in_air(effect.phase) == air || (!air && acts_on_pads(effect.id)) || acts_everywhere(effect.id);
}

}  // namespace unhand::fitting
