// What a synthetic campaign does not log, as JSON.
#pragma once

#include <string>
#include <vector>

#include "apps/output.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::apps {

/// The truths of a campaign, schema "truth": parameters, effects, and one entry per throw, by id in the log's
/// order. SI units and radians; poses are of the true CoM, [x, z, theta].
Json truth_json(const experiment::CampaignDesign& design, std::uint64_t seed, const std::string& log,
                const std::vector<experiment::SyntheticThrow>& throws);

}  // namespace unhand::apps
