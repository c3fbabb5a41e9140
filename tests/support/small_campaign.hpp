// Synthetic campaigns that are small enough to be fitted in tests.
#pragma once

#include <string>

#include "experiment/synthetic_campaign.hpp"

namespace unhand::testing_support {

/// Twelve throws of two objects, eight of them for training, with sensors slower than a lab's.
inline experiment::CampaignDesign small_design(const std::string& model) {
  auto design = experiment::campaign_design("quick12");
  design.contact_model = model;
  design.sensors.ft_rate = 500;
  design.sensors.mocap_rate = 120;
  return design;
}

/// One of them, whose pads obey the disc.
inline const datasets::ThrowLog& small_log() {
  static const auto log = experiment::generate_campaign(small_design("limit_surface_disc"), 5);
  return log;
}

/// What a fit of the design's model should find: the campaign's mean of that unknown.
inline double truth_of(const experiment::CampaignDesign& design, const std::string& unknown) {
  if (unknown == "mu") return design.patch.mu;
  if (unknown == "length") return design.patch.length();
  return design.opening.dead_time + design.opening.opening_time;  // "delay"
}

}  // namespace unhand::testing_support
