// Campaigns of perfect sensors, with and without effects.
#pragma once

#include <cstdint>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "experiment/throw_prediction.hpp"

namespace unhand::testing_support {

inline constexpr std::uint64_t kSeed = 7;
inline constexpr double kDrag = 0.05;  // declared, so that wind has something to act on
inline constexpr int kThrow = 8;       // bar-com160, released while the hand brakes

inline experiment::CampaignDesign perfect(const experiment::EffectSettings& effects = {}) {
  experiment::CampaignDesign design = experiment::campaign_design("quick12");
  design.sensors = design.sensors.perfect();
  design.effects = effects;
  return design;
}

/// All parameters of an effect `size` typical steps from neutral.
inline experiment::EffectSettings typical(const dynamics::Effect& effect, double size = 1) {
  experiment::EffectSettings out;
  for (const auto& p : effect.parameters)
    out[effect.full_name(p)] = p.is_shape() ? p.grid.back() : p.neutral + size * p.typical;
  return out;
}

}  // namespace unhand::testing_support
