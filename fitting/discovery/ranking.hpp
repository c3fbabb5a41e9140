// What became of every candidate of the loop.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fitting/discovery/accepted_effect.hpp"
#include "fitting/discovery/outcome_errors.hpp"

namespace unhand::fitting {

/// An effect for which the evidence is, and which is no part of the answer.
struct SmallEffect {
  std::string id;                     ///< of the effect
  std::vector<Parameter> parameters;  ///< as fitted
  double delta_bic{};                 ///< with it against without
  double p_value{};                   ///< of its absence
  double held_out_fall{};             ///< largest, of χ² per sample in a channel and phase
  PredictionGain rms;                 ///< of held-out predictions, without it and with it
  bool any_pads{};                    ///< it is a give of the pads that no pads are without
  bool likelier{};                    ///< the held-out throws' likelihood rises enough with it
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

}  // namespace unhand::fitting
