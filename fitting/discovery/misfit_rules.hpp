// What is a misfit: how much of a channel in a phase calls for an explanation. Internal to fitting.
#pragma once

#include <vector>

#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// Channels and phases of a full log, which share the family-wise level: wrench and mocap before, during
/// and after the release, the sensor's own force, the landing.
inline constexpr int kSeries = 3 * 3 + 3 * 3 + 1 + 3;
/// The level at which the other half of the throws confirms a misfit.
inline constexpr double kConfirmedAt = 0.05;

/// Whether a channel leaves anything to explain in a phase: more than `matters` beyond the noise, and more
/// than chance leaves (χ², at the family-wise level shared among all channels and phases of a log). The
/// wrench while the pads slip or may: more than `wrench_misfit`. In the firm grasp no friction law takes
/// part, only Newton and Euler, and in flight the sensor alone: there it is a channel like any other.
bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options);

/// Whether any channel does on the train throws.
bool leaves_misfit(const Stage& stage, const DiscoverOptions& options);

/// Whether the other half of the throws shows a misfit of the same channel and phase as well: chance does not
/// strike twice.
bool is_confirmed(const std::vector<ChannelMisfit>& other_half, const ChannelMisfit& misfit);

/// χ² per sample of a channel in a phase from where on something is missing there. Twice as much of a wrench
/// while the pads open, most of whose variance is trust; and in the firm grasp where something is missing
/// `elsewhere`, for which the fit bends each throw's own grasp.
double unexplained_from(experiment::Channel, Phase, bool elsewhere, const DiscoverOptions& options);

/// Whether so much is left in a channel in a phase, looked at alone, that something is missing there.
bool is_left(const ChannelMisfit& m, const DiscoverOptions& options);

/// A channel in a phase of these; null where it is not among them.
const ChannelMisfit* find_misfit(const std::vector<ChannelMisfit>& misfit, experiment::Channel, Phase);

/// The misfit of a channel in a phase, 1 where there is none.
double misfit_in(const std::vector<ChannelMisfit>& misfit, experiment::Channel, Phase);

}  // namespace unhand::fitting
