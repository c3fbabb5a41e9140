// Every rule by which the loop believes something, with its threshold: what docs/closing-the-loop.md has
// in two tables. Thresholds that the user may set are in DiscoverOptions; which terms describe what is
// missing is missing_force.hpp's to say. Internal to fitting.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// @name What is a misfit
/// @{

/// Channels and phases of a full log, which share the family-wise level: wrench and mocap before, during
/// and after the release, the sensor's own force, the landing.
inline constexpr int kSeries = 3 * 3 + 3 * 3 + 1 + 3;
/// The level at which the other half of the throws confirms a misfit.
inline constexpr double kConfirmedAt = 0.05;

/// Whether a channel leaves anything to explain in a phase: more than `matters` beyond the noise, and more
/// than chance leaves (χ², at the family-wise level shared among all channels and phases of a log). The
/// wrench while the pads still slip or may: more than `wrench_misfit`. In the firm grasp no friction law
/// takes part, only Newton and Euler: there it is a channel like any other.
bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options);

/// Whether any channel does on the train throws.
bool leaves_misfit(const Stage& stage, const DiscoverOptions& options);

/// Whether the other half of the throws shows a misfit of the same channel and phase as well: chance does not
/// strike twice.
bool is_confirmed(const std::vector<ChannelMisfit>& other_half, const ChannelMisfit& misfit);

/// χ² per sample of a channel in a phase from where on something is missing there. Twice as much of a wrench
/// once the pads open, most of whose variance is trust; and in the firm grasp where something is missing
/// `elsewhere`, for which the fit bends each throw's own grasp.
double unexplained_from(experiment::Channel, Phase, bool elsewhere, const DiscoverOptions& options);

/// The misfit of a channel in a phase, 1 where there is none.
double misfit_in(const std::vector<ChannelMisfit>& misfit, experiment::Channel, Phase);

/// @}
/// @name What a refit must show
/// @{

/// What explains less than this share of what another footprint would is an imitation of it.
inline constexpr double kImitation = 1.0 / 3.0;

/// Where nothing is left but noise, footprints are small and a refit gains what they say, within this factor.
inline constexpr double kFirstOrder = 3;

/// Evidence (difference of Bayes' criterion) that an effect needs before it is accepted or kept.
inline constexpr double kDeltaBic = -10;

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

/// @}
/// @name What is withdrawn
/// @{

/// What is left of the misfit where an effect acts, from which on it is an imitation of another.
inline constexpr double kLeft = 0.1;
/// The same of the misfit in the worst channel of the phase, a tenth of its size: a channel that showed
/// little beside it cannot tell an imitation from a true effect whose law is not quite right. What effects on
/// the pads leave in the hand is held against the worst channel of any phase.
inline constexpr double kNextToNothing = 0.01;

/// Of the misfit without a sensor's effect, the share below which the effect explains a channel in a phase.
inline constexpr double kExplains = 0.5;
/// Whether so little of the misfit `without` an effect is left, `now` that it is there.
bool explains_most(const ChannelMisfit& now, const std::vector<ChannelMisfit>& without);

/// Wald's test of an effect's size parameters against neutral, with the fit's covariance, which is known to
/// its degrees of freedom only: each size by Student's t of its own, and several together by Hotelling's T²
/// of the fewest; the smaller p of the two ways, times two, since few throws know a covariance of several
/// sizes (forces of three components, drags of two objects) less than the variance of each. Sizes that are
/// neutral at an end of their range count as hotelling_bar_tail has it. Where an effect is absent its shape
/// (a loss time, a Stribeck speed) is nothing that data could tell: sizes are tested with the shape as it was
/// fitted, and p counts for every shape of its grid (Bonferroni's bound on the search).
double wald_p_value(const FitResult& fit, const dynamics::Effect& effect);
/// Whether the two-sided confidence region of the sizes, of a level, leaves neutral out.
bool is_told_from_none(const FitResult& fit, const dynamics::Effect& effect, double level);

/// In flight or at the landing, not in the hand.
bool in_air(Phase phase);
/// Whether an effect is one on the contact or the release.
bool acts_on_pads(const std::string& id);
/// Whether an effect is one of sensing, or of what the log declares.
bool is_of_sensor(const std::string& id);
/// Whether an effect on the pads was added.
bool acts_on_pads(const Stage& stage);
/// Whether an effect acts in the air, or in the hand: where the misfit fell most, an effect on the pads in
/// the hand wherever that was, and one that acts everywhere (Effect::acts_everywhere) in both.
bool acts(const AcceptedEffect& effect, bool air);

/// An accepted effect that is the shadow of something else. Either conditions and blocks of sensors do not
/// agree on its size, so that its interval, which counts that (`counted`), has none in it at the level that
/// it was accepted at. Or it leaves too
/// much where it acts: of the throws that it was fitted to, or of those that it has not seen. A sensor's
/// effect, which is there in the hand and in the air, answers for every channel that it explains. Or, acting
/// in the hand, it leaves predictions lacking (`errors` are the stage's) by too much of what the base's
/// lacked; a sensor's effect only where they lack another amount without it, as most sensors take no part in
/// what happens.
bool is_imitation(const AcceptedEffect& effect, const Stage& stage, const BothErrors& errors,
                  const FitResult& counted, const Discovery& so_far, const DiscoverOptions& options);

/// By what share of its χ² an answer may leave a channel noisier than the base model did.
inline constexpr double kNoisier = 0.25;

/// Whether an accepted effect has spoilt a channel in a phase: in both halves of the throws its χ² has grown
/// by more than kNoisier and three σ of chance, and that in the half of the throw where the effect acts, or
/// to a misfit. A true cause makes no channel noisier; one that takes the place of another bends what they do
/// not share, in wrenches well below what they are trusted to. (A true drag, though, frees friction of what
/// it was bent by, and may show how little that describes a torque.)
bool spoils(const AcceptedEffect& effect, const Stage& stage, const Discovery& so_far,
            const DiscoverOptions& options);

/// What accepted effects may leave of the misfit in tracked flights to count as its explanation, and a form
/// of what they leave.
inline constexpr double kOutdone = 0.5;

/// What tracked flights ask for that accepted effects of the air do not give them. The laws of flight and of
/// sensors are exact, so that a form that describes the flights better means that something unlisted acts:
/// beside them, or in their place. Asked where the effects explain most of the acceleration that flights lack
/// without them, and the terms do. They are outdone where a few terms (missing_terms, one candidate an
/// object), fitted to the train throws in their place, win by Bayes' criterion there (kDeltaBic), and make
/// the held-out flights kTimesAsLikely as likely; where the effects leave a misfit, if less than kOutdone of
/// it is left in both halves, too. An effect whose own form is among those terms is not outdone.
std::optional<AskedForm> form_asked_for(const Stage& stage, const Discovery& so_far,
                                        const DiscoverOptions& options);

/// @}

}  // namespace unhand::fitting
