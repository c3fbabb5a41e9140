// What is withdrawn of what had been accepted, with the thresholds: the second table of
// docs/closing-the-loop.md. Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// What is left of the misfit where an effect acts, from which on it is an imitation of another.
inline constexpr double kLeft = 0.1;
/// The same of the misfit in the worst channel of the phase, a tenth of its size: a channel that showed
/// little beside it cannot tell an imitation from a true effect whose law is not quite right. What effects on
/// the pads leave in the hand is held against the worst channel of any phase.
inline constexpr double kNextToNothing = 0.01;

/// Of what is left in a channel on train or held-out throws, the share that the base model must have left
/// there in the others, too.
inline constexpr double kAsMuch = 0.5;

/// Of the misfit without a sensor's effect, the share below which the effect explains a channel in a phase.
inline constexpr double kExplains = 0.5;
/// Whether so little of the misfit `without` an effect is left, `now` that it is there.
bool explains_most(const ChannelMisfit& now, const std::vector<ChannelMisfit>& without);

/// Why an accepted effect is the shadow of something else, in words; empty where it is not. Either conditions
/// and blocks of sensors do not agree on its size, so that its interval, which counts that (`counted`), has
/// none in it at the level that it was accepted at. Or it leaves too much where it acts: of the throws that
/// it was fitted to, or of those that it has not seen. A sensor's effect, which is there in the hand and in
/// the air, answers for every channel that it explains. Or, acting in the hand, it leaves predictions lacking
/// (`errors` are the stage's) by too much of what the base's lacked; a sensor's effect only where they lack
/// another amount without it, as most sensors take no part in what happens, and not one that acts everywhere
/// and is seen in flight: in the hand that is held against what it makes worse. What is left in flights is
/// not held against an effect that they ask for, in its own form, beside another (`backed`).
std::string why_imitation(const AcceptedEffect& effect, const Stage& stage, const BothErrors& errors,
                          const FitResult& counted, bool backed, const Discovery& so_far,
                          const DiscoverOptions& options);

/// By what share of its χ² an answer may leave a channel noisier than the base model did.
inline constexpr double kNoisier = 0.25;

/// Whether an accepted effect has spoilt a channel in a phase: in both halves of the throws its χ² has grown
/// by more than kNoisier and three σ of chance, and that in the half of the throw where the effect acts, or
/// to a misfit. A true cause makes no channel noisier; one that takes the place of another bends what they do
/// not share, in wrenches well below what they are trusted to. (A true drag, though, frees friction of what
/// it was bent by, and may show how little that describes a torque.)
bool spoils(const AcceptedEffect& effect, const Stage& stage, const Discovery& so_far,
            const DiscoverOptions& options);

}  // namespace unhand::fitting
