// What a refit must show before the loop believes in the effect that it adds, with the thresholds: the first
// table of docs/closing-the-loop.md. Thresholds that the user may set are in DiscoverOptions; which terms
// describe what is missing is missing_force.hpp's to say. Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/ranking.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// What explains less than this share of what another footprint would is an imitation of it.
inline constexpr double kImitation = 1.0 / 3.0;

/// Where nothing is left but noise, footprints are small and a refit gains what they say, within this factor.
inline constexpr double kFirstOrder = 3;

/// Evidence that an effect needs before it is accepted or kept: by how much Bayes' criterion (Stage::bic())
/// falls with it.
inline constexpr double kDeltaBic = -10;
/// The same of a fit of the same model that starts elsewhere: any that is likelier, beyond rounding.
inline constexpr double kLikelierBic = -1;

/// Whether `with` has that evidence against `without`, of the same throws.
inline bool is_evident(const Stage& without, const Stage& with) {
  return with.bic() - without.bic() <= kDeltaBic;
}

/// What a law leaves of an effect that it describes: a hundredth of its χ² is a tenth of its size.
inline constexpr double kRest = 0.01;

/// A fall of the held-out χ² per sample matters if it takes this much of the misfit away; of a wrench's,
/// which slipping pads trust least, more.
inline constexpr double kShare = 0.1, kWrenchShare = 0.25;

/// The channel and phase whose held-out misfit fell most, in units of what matters there (>= 1: it matters).
/// `base` is the misfit before anything was added: of that, what is below a hundredth is the part of an
/// effect that its law does not get right, and no other effect.
struct Improvement {
  double matters{};
  double fall{};
  std::string where;
  Phase phase{Phase::release};
};
/// A wrench that is `settled` need not have been a misfit on the held-out throws as well, whose conditions
/// may show less of it: there it matters by a quarter of its χ².
Improvement improvement(const FitResult& before, const FitResult& after,
                        const std::vector<ChannelMisfit>& base, const DiscoverOptions& options,
                        const std::vector<ChannelMisfit>& settled = {});
/// That of the held-out throws of two stages, with the wrenches that the train throws settle.
Improvement improvement(const Stage& before, const Stage& after, const std::vector<ChannelMisfit>& base,
                        const DiscoverOptions& options);

/// The wrenches of slipping pads whose misfit vanishes altogether: not a hundredth of it is left.
std::vector<ChannelMisfit> settled_wrenches(const FitResult& before, const FitResult& after,
                                            const DiscoverOptions& options);

/// Of another law, which has next to no parameters to bend: it matters if the held-out χ² as a whole falls by
/// half a per cent, channels apart of which not a hundredth of the base's misfit is left.
Improvement law_improvement(const FitResult& before, const FitResult& after,
                            const std::vector<ChannelMisfit>& base, const DiscoverOptions& options);

/// How many times as large the held-out throws' likelihood must be, where predictions decide.
inline constexpr double kTimesAsLikely = 20;
/// Whether held-out throws speak for an improvement: their likelihood is kTimesAsLikely as large. A
/// threshold, and no bound on how often chance gets there: each model fits the held-out throws' own unknowns
/// and takes the variances of their channels from them, and Markov's inequality does not hold for likelihoods
/// that are maximised.
bool held_out_confirms(const Stage& before, const Stage& after);

/// Whether held-out throws are predicted better before they are made, by as much as the options ask for, and
/// no outcome (detach, landing, trajectory) by as much worse.
bool predicts_better(const Stage& before, const Stage& after, const DiscoverOptions& options);

/// What an effect is worth in the model with it against the one without it.
SmallEffect small_effect(const Stage& without, const Stage& with, const std::string& id,
                         const std::vector<ChannelMisfit>& base, const DiscoverOptions& options);
/// "predicted before the throw: 0.895 to 0.456 mm, ...": what speaks for one that no channel shows.
std::string predicted_in_words(const SmallEffect& effect);

/// How many times what repetitions scatter by the mean square of prediction errors is where a model lacks
/// something: most of the error then goes with the condition, and a better model would take it away.
inline constexpr double kLacking = 2;
/// Whether an outcome's errors say so, a chance of `level` does not, and it is more than one reading of the
/// outcome's sensor is uncertain by.
bool is_lacking(const OutcomeLack& lack, double level);
/// The outcomes that the train throws are predicted so badly in, where the held-out throws confirm it.
std::vector<OutcomeLack> lacking(const OutcomeErrors& train, const OutcomeErrors& held_out,
                                 const DiscoverOptions& options);
/// An outcome's errors in `all`; none where it was not predicted.
OutcomeLack lack_in(const OutcomeErrors& all, Outcome outcome);

/// An estimate of what is missing is used as a correction where it lowers the held-out error to this share.
inline constexpr double kCorrects = 0.98;

}  // namespace unhand::fitting
