// Closing the loop: where a model's residual leaves the noise, which effect leaves such a footprint, and
// whether held-out throws agree.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "contact/registry.hpp"
#include "fitting/discovery/footprint_traces.hpp"
#include "fitting/discovery/lack_of_fit.hpp"
#include "fitting/discovery/missing_force.hpp"
#include "fitting/discovery/residuals.hpp"
#include "fitting/distributions.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// What the loop may try, and what convinces it.
struct DiscoverOptions {
  CampaignOptions campaign;  ///< model to begin with, and channels
  FitOptions fit;            ///< how every fit runs
  /// An effect matters if, on held-out throws, it takes at least this much off the χ² per sample of some
  /// channel of the motion in some phase (1 is the noise), and a tenth of the misfit there.
  double matters{0.5};
  /// For the wrench channels while the object is held: this much, and a quarter of the misfit there. Once the
  /// pads open it must also have been so many times the noise, or vanish altogether: near the end of a
  /// release a patch slips in parts, and no law of the catalogue follows its torque better. In the firm grasp
  /// only the body's inertia speaks, in flight only the sensor, and they are channels like others.
  double wrench_matters{1}, wrench_misfit{3};  ///< as above [χ² per sample]; times the noise
  /// Or if the held-out throws are predicted that much better before they are made: rms before over after.
  double prediction_matters{1.15};
  double law_matters{0.005};  ///< another contact law: share of the held-out χ² as a whole
  /// Chance of any false alarm of a test [-] (Bonferroni): shared among the effects of a step, every shape
  /// and size at which a footprint was taken being one; and of misfits among the channels and phases of a
  /// log. Contact laws, which have no size to test, are outside it.
  double family_wise_level{0.02};
  double equivalent{0.98};  ///< footprints that correlate by this much are one answer
  /// Leading candidates that are fitted in full, in every step. Beyond them all laws, where none but a law
  /// convinced, and the give of the pads, where an effect with evidence matters to no channel.
  int refits{4};
  int most_effects{3};      ///< accepted in all
  double unexplained{1.5};  ///< χ² per sample of a channel in a phase from which on something is missing
  /// Effects, and laws as contact.law:MODEL, that are not in the catalogue today.
  std::vector<std::string> forget;
  /// Contact laws that are tried: of contact::pad_law_names().
  std::vector<std::string> laws{contact::pad_law_names()};
};

/// Throws std::invalid_argument, naming option, value and accepted range; for a name in `forget` that is no
/// effect and no law (contact.law:MODEL), with the nearest one.
void validate(const DiscoverOptions& options);

/// What the loop says of a log.
enum class Verdict {
  effect_found,       ///< an effect, or another law, explains what was missing
  no_missing_effect,  ///< nothing is missing beyond noise
  unexplained,        ///< something is missing, and no effect of the catalogue is it
  not_answered,       ///< the log does not determine a fit
};
/// The verdict's name, as it is written above.
const char* to_string(Verdict);

/// What predictions are judged by, throw by throw.
enum class Outcome {
  position,       ///< of the tracked frame, mean over the flight
  orientation,    ///< the same of its angle
  landing_x,      ///< of the landing
  landing_theta,  ///< of the landing
};
/// The outcome's name in words.
const char* to_string(Outcome);
/// "m" or "rad".
const char* unit_of(Outcome);

/// Outcomes are few: numbered from 0.
inline constexpr int kOutcomes = 4;

/// Whether an outcome's errors go with the condition.
struct OutcomeLack {
  Outcome outcome{};    ///< whose errors these are
  LackOfFit fit;        ///< mean squares in m² or rad²
  double resolution{};  ///< 1 σ of one reading of the outcome's sensor [m or rad]; of a position, both axes'
};

/// Errors of the outcome, predicted before the throw (own unknowns from the grasp alone) minus measured; none
/// of what was not measured, or not predicted.
struct OutcomeErrors {
  int n{};                                  ///< throws
  std::optional<double> landing_x_mae;      ///< [m]
  std::optional<double> landing_theta_mae;  ///< [deg]
  std::optional<double> detach_vx_mae;      ///< [m/s]
  std::optional<double> detach_omega_mae;   ///< [deg/s]
  std::optional<double> trajectory_rms;     ///< of the position in flight [m]
  std::optional<double>
      chi2_per_dof;  ///< with the throws' own unknowns fitted, where observations outnumber them
  std::vector<OutcomeLack> lacks;  ///< of every outcome that was measured
};

/// A parameter of an accepted effect.
struct Parameter {
  std::string name, unit;   ///< without the effect's id, with "[object]" where every object has its own
  double value{}, sigma{};  ///< in `unit`; 1 σ
  double degrees_of_freedom{kCertain};  ///< of sigma, which comes from the scatter between throws
  /// value ± t sigma, Student's t.
  std::array<double, 2> interval95() const { return student_interval(value, sigma, degrees_of_freedom); }
};

/// An experiment that would tell an accepted effect from another name of its footprint.
struct SeparatingExperiment {
  std::string from;          ///< the other name
  std::string what;          ///< to do, in words
  double before{}, after{};  ///< correlation of the footprints: in this log; with the experiment's throws
  bool separates{};          ///< they would then be two answers (DiscoverOptions::equivalent)
};

/// An effect that the data made believable.
struct AcceptedEffect {
  std::string id;                                          ///< of the effect, or "contact.law:MODEL"
  std::vector<std::pair<std::string, double>> equivalent;  ///< ids, with the correlation of the footprints
  std::vector<SeparatingExperiment> separating;            ///< the most telling first, for each other name
  std::vector<Parameter> parameters;                       ///< as fitted
  double delta_bic{};             ///< of the model with it against without: negative speaks for it
  std::optional<double> p_value;  ///< of its absence; none for a law, which replaces another
  /// Held-out error with it over without [-]; none where one of them is not known.
  std::optional<double> test_error_ratio;
  std::string why;  ///< where the held-out misfit fell, in words
  Phase phase{};    ///< where it fell most

  /// Another name that the data cannot tell from this one; of several correlations the largest counts.
  void add_other_name(const std::string& other, double correlation);
};

/// An error of the same predictions, rms, by two models; zeros where nothing can be compared.
struct RmsOfBoth {
  double before{};  ///< by the first
  double after{};   ///< by the other
  /// Whether it falls by a factor.
  bool falls_by(double factor) const { return before > factor * after; }
  /// Whether it rises by one.
  bool rises_by(double factor) const { return after > factor * before; }
};

/// What one model's predictions are better by than another's: rms errors of the pose tracked in flight, of
/// the landing where nothing is tracked.
struct PredictionGain {
  RmsOfBoth position;  ///< of x and z together, or landing x [m]
  RmsOfBoth angle;     ///< of theta [rad]
  /// Whether either falls by a factor, and the other does not rise by it.
  bool is_better_by(double factor) const {
    return (position.falls_by(factor) && !angle.rises_by(factor)) ||
           (angle.falls_by(factor) && !position.rises_by(factor));
  }
  /// "1.21 to 1.19 mm, 1.14 to 0.69 deg rms"
  std::string in_words() const;
};

/// An effect for which the evidence is, and which is no part of the answer.
struct SmallEffect {
  std::string id;          ///< of the effect
  double delta_bic{};      ///< with it against without
  double p_value{};        ///< of its absence
  double held_out_fall{};  ///< largest, of χ² per sample in a channel and phase
  PredictionGain rms;      ///< of held-out predictions, without it and with it
  bool any_pads{};         ///< it is a give of the pads that no pads are without
  bool likelier{};         ///< the held-out throws' likelihood rises enough with it
};

/// What became of a candidate: in the last refit, or since.
enum class Fate {
  not_refitted,     ///< others led in every step, or it leaves no footprint
  no_fit,           ///< the refit has no answer, or one at the end of its range
  not_significant,  ///< the refit does not tell it from none
  too_small,        ///< evident, and held-out throws show too little of it
  outdone,          ///< it would have done; another did better, or makes it dispensable
  another_name,     ///< of an accepted effect: the data cannot tell which of them it is
  withdrawn,        ///< accepted at first
  fitted_along,     ///< as a nuisance, too small to matter
  accepted,         ///< part of the answer
};
/// "not refitted", "no fit", ...: as it is written above, in words.
const char* to_string(Fate);

/// One candidate: gain, p-value, correlation and visibility of the step in which its gain was largest, the
/// rest of its last refit.
struct Ranked {
  std::string id;                  ///< of the effect, or "contact.law:MODEL"
  double gain{};                   ///< of χ², to first order
  double p_value{1};               ///< of the gain, in units of what is left unexplained
  double correlation_with_best{};  ///< of the footprints
  bool visible{true};              ///< something of its footprint is left beside the fitted unknowns
  int step{1};                     ///< of the search, that the gain is of: 1 is beside the base model
  std::optional<int>
      refit_step{};    ///< of the search, in which it was last fitted in full; may be a later one
  double delta_bic{};  ///< of that refit; negative: for the effect
  /// Largest fall of the held-out χ² per sample in a channel and phase; of refits with evidence on the train
  /// throws.
  std::optional<double> held_out_gain{};
  Fate fate{};  ///< in the last refit, or since
};

/// What an answer has become to its candidates: accepted, another name, ...
void tell_fates(std::span<const AcceptedEffect> effects, std::span<const std::string> withdrawn,
                std::span<const std::string> along, std::vector<Ranked>& ranking);

/// The effects that were found, then what else would take most away: a few that a figure can show.
std::vector<std::string> leading_names(std::span<const AcceptedEffect> effects,
                                       std::span<const Ranked> ranking);

/// How a prediction may use what is estimated to be missing.
enum class Correction {
  withheld,    ///< none: it does not lower the held-out error, or by no share that counts (kCorrects)
  curve,       ///< the curve over time
  candidate,   ///< the physical terms
  not_judged,  ///< none: no held-out motion was tracked, so that nobody knows where it would act
};

/// What is missing, without a form assumed: an acceleration in flight over the time since the detach [m/s²,
/// m/s², rad/s²], or a pad's wrench in the hand's frame over the share of the opening that has passed [N, N,
/// N m].
struct MissingEstimate {
  Phase phase{};                                    ///< in flight, or during the release
  std::vector<std::pair<std::string, int>> groups;  ///< objects, and the group of their curve
  std::vector<MissingCurve> curves;                 ///< one per group
  MissingCandidate candidate;                       ///< physical terms that follow the curves
  /// What lowers the held-out error, if anything: else it is withheld.
  Correction correction{};  ///< what is used
  /// rms without the correction, of the flight where it was seen, else of the landing; none where it is not
  /// judged.
  std::optional<double> error_before;
  std::optional<double> error_after;  ///< with it
  std::string error_unit;             ///< "m", or "sigma" of the landing
};

/// Structure that no effect of the catalogue accounts for.
struct Unexplained {
  Phase phase{};                  ///< where it is largest
  experiment::Channel channel{};  ///< of which sensor
  /// On the train throws (on the held-out ones, if only they are off): χ² per sample; of predictions, their
  /// errors' mean square over what repetitions scatter by. 1 is the noise.
  double chi2_per_dof{};
  std::string description;                 ///< in words
  std::optional<MissingEstimate> missing;  ///< absent where no force can be read from it
};

/// Terms that describe tracked flights better than accepted effects of the air do.
struct AskedForm {
  std::vector<std::string> outdone;  ///< effects none of whose own forms is among the terms
  std::string words;                 ///< the terms with their sizes, of each object
  bool unlisted{};                   ///< a term is no accepted effect's own form
};

/// An effect that was accepted at first, and withdrawn (withdrawal.hpp).
struct Imitation {
  std::string id;      ///< of the effect
  std::string why;     ///< it was withdrawn, in words
  double delta_bic{};  ///< with it against without, when it was
};

/// Where the residual first leaves the noise.
struct FirstMisfit {
  bool any{false};                ///< false: it stays in the noise
  Phase phase{};                  ///< of the throw
  experiment::Channel channel{};  ///< of which sensor
  double chi2_per_sample{};       ///< 1 is the noise
};

/// The loop's answer.
struct Discovery {
  Verdict verdict{};                    ///< found, nothing missing, unexplained, or no answer
  std::vector<std::string> held_out;    ///< throws that with_held_out chose; empty where the log says which
  std::string message;                  ///< why there is no answer (not_answered); else empty
  std::vector<AcceptedEffect> effects;  ///< in order of acceptance
  std::vector<Imitation> imitations;    ///< accepted at first, and withdrawn
  std::optional<AskedForm> asked;       ///< what the flights asked for when effects were questioned
  std::vector<std::string> along;       ///< effects that are fitted along as nuisances, too small to matter
  std::optional<SmallEffect> small;     ///< the most evident of what was too small to matter
  std::optional<Unexplained> unexplained;                            ///< what is left, if anything
  FirstMisfit first;                                                 ///< of the base model
  OutcomeErrors before_train, before_test, after_train, after_test;  ///< base model; the answer
  std::vector<Ranked> ranking;                                       ///< best first
  std::vector<std::string> silent;  ///< candidates of which no channel shows anything under the base model
  FitResult base, final;            ///< of the train throws: by the base model and by the answer
  std::vector<ChannelMisfit> base_test, final_test;          ///< misfit on held-out throws
  std::string model;                                         ///< of the answer (contact.law changes it)
  std::vector<ResidualBin> residual_before, residual_after;  ///< of the train throws
  std::vector<FootprintTrace> footprints;  ///< beside the base model: the answer's, and others that lead
  std::vector<ChannelStructure> structure_before, structure_after;  ///< of the train throws
  std::shared_ptr<const CampaignProblem> problem;                   ///< of the answer
  double seconds{};                                                 ///< of the whole loop

  /// Whether the answer is the base model as it was.
  bool adds_nothing() const { return effects.empty() && along.empty(); }
};

/// Runs the loop. A log without a test split is split as with_held_out does.
/// Throws as validate and CampaignProblem do.
Discovery discover(const datasets::ThrowLog& log, const std::string& file, const DiscoverOptions& options);

}  // namespace unhand::fitting
