// Throws that err as no other does, in the loop on a campaign. Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/stage.hpp"
#include "fitting/gross_outliers.hpp"

namespace unhand::fitting {

/// The gross outliers among the throws of both splits, by their places in the log, where all effects of the
/// catalogue, all laws and changes of the stage's own unknowns stand beside it. Not all throws of a
/// condition: what repeats is no stray.
std::vector<WildGroup> wild_throws(const Stage& stage, const DiscoverOptions& options);

/// Of `wild`, places among the throws of `all`, those that an answer, a problem without them and its fit,
/// does not explain as it does the others: their misfit exceeds fit.throw_limit times that of every other
/// throw.
std::vector<WildGroup> still_wild(const CampaignProblem& answer, const FitResult& fitted,
                                  const CampaignProblem& all, const std::vector<WildGroup>& wild,
                                  const DiscoverOptions& options);

/// Why it is left out: how far it is off, and in which channel most.
std::string told(const WildGroup& wild, const Stage& stage);

/// The log without those throws.
datasets::ThrowLog without_throws(datasets::ThrowLog log, const std::vector<WildGroup>& wild);

}  // namespace unhand::fitting
