// A small campaign for the loop.
#pragma once

#include <cstdint>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::fitting::support {

/// 24 throws of two bars, six conditions each, two repetitions.
inline datasets::ThrowLog loop_campaign(const experiment::EffectSettings& effects, std::uint64_t seed = 3) {
  experiment::CampaignDesign design = experiment::campaign_design("batch180");
  design.name = "loop";
  design.postures.resize(2);
  design.release_accelerations.resize(3);
  design.repetitions = 2;
  design.effects = effects;
  return experiment::generate_campaign(design, seed);
}

}  // namespace unhand::fitting::support
