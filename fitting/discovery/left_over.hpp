// Where an answer leaves something over: the questions that unexplained() asks, in this order. Internal to
// fitting.
#pragma once

#include <optional>
#include <vector>

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// The channels and phases, in their order, in which a stage leaves more than noise in both halves of the
/// throws; of what an effect on the pads has taken away of the base's misfit, a hundredth may stay.
std::vector<ChannelMisfit> left_by_answer(const Stage& stage, const Discovery& so_far,
                                          const DiscoverOptions& options);

/// Where flights asked for what no effect has the form of, though no channel need show it any more: in the
/// tracked channel that is off most.
std::optional<Unexplained> asked_for_in_flight(const Stage& stage, const Discovery& so_far);

/// Where a channel leaves more than noise: the first phase, and in it the channel in which most is left.
std::optional<Unexplained> left_in_channels(const Stage& stage, const Discovery& so_far,
                                            const DiscoverOptions& options);

/// Where a channel is far off in one half of the throws and noise in the other: something is wrong with those
/// throws, or it acts so that only they show it.
std::optional<Unexplained> left_in_one_half(const Stage& stage, const Discovery& so_far,
                                            const DiscoverOptions& options);

/// Where every channel is noise once a throw's own unknowns follow it, but predictions made before the throw
/// are off by what repetitions share: something acts before the detach that those unknowns take up.
std::optional<Unexplained> left_in_predictions(const Stage& stage, const Discovery& so_far,
                                               const DiscoverOptions& options);

/// Where every throw's own unknowns take up what changes over the campaign.
std::optional<Unexplained> left_in_own_unknowns(const Stage& stage, const DiscoverOptions& options);

/// √χ² of what a channel leaves where it is white and alike in all phases, as a declared σ that is too small
/// leaves it: the number that it is too small by.
std::optional<double> too_small_by(const Discovery& so_far, experiment::Channel channel);

/// The share of the base's misfit that an answer may leave: no law of pads is quite right; of flight and of
/// sensors they are.
double tolerated_rest(const Stage& stage);

}  // namespace unhand::fitting
