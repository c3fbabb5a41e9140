// A model in the loop: its fit, what it leaves of held-out throws, and how it compares with another one.
// Internal to fitting.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fitting/discovery/discover_options.hpp"
#include "fitting/discovery/footprints.hpp"
#include "fitting/discovery/outcome_errors.hpp"

namespace unhand::fitting {

/// One model with its fit to the train throws and what it leaves of the others.
struct Stage {
  CampaignProblem problem;
  FitResult fit, held_out;
  std::vector<std::string> ids;         ///< of what was added to the base, "contact.law:..." included
  std::shared_ptr<const Stage> from{};  ///< the one that the loop was at a step before
  /// What without() has fitted: checks ask for the same removals one after the other.
  mutable std::map<std::vector<std::string>, std::shared_ptr<const Stage>> less{};
  mutable std::shared_ptr<const Footprints> asked{};  ///< what footprints_of() has computed

  bool is_fitted() const;  ///< to the train throws
  bool solved() const;     ///< and so are the own unknowns of the others
  /// The deviance of the fit plus log(samples) for every unknown.
  double bic() const;
};

/// Throws as the stage predicts them.
std::vector<PredictedOutcome> outcomes_of(const Stage& stage, Share share, int threads);

/// What the stage predicts wrongly, and χ² per degree of freedom.
OutcomeErrors errors_of(const Stage& stage, Share share, int threads);
/// Of both halves of the throws.
struct BothErrors {
  OutcomeErrors train, held_out;
};
BothErrors errors_of(const Stage& stage, int threads);
/// Trajectory rms after over before; the landing's where the flight was not seen; none where either is not
/// known.
std::optional<double> error_ratio(const OutcomeErrors& before, const OutcomeErrors& after);

/// The throws that the stage uses, of both halves: what is compared with it must use them all
/// (FitOptions::throws).
std::vector<bool> throws_of(const Stage& stage);

/// The footprints of the whole catalogue and of the laws at the stage's fit. Computed once.
const Footprints& footprints_of(const Stage& stage, const DiscoverOptions& options);

/// Fits the train throws from `start`; whether there is an answer. A shape
/// parameter that the log leaves open over its whole range (a speed at which friction changes, while the
/// friction hardly does; the landing's share of a tracker's scale, where nothing was tracked) keeps its
/// start, which the grid of its footprint gave it: the size beside it is then known for that shape.
bool solve_train(Stage& stage, const DiscoverOptions& options, std::vector<double> start);
/// With that, the own unknowns of the test throws; whether there is an answer.
bool solve_held_out(Stage& stage, const DiscoverOptions& options);
/// Both.
void solve(Stage& stage, const DiscoverOptions& options, std::vector<double> start);

/// Fits again from the solution while that helps: the weights of the channels were learned while the effect
/// was still missing, and throws may have an answer there that had none at the start.
void polish(Stage& stage, const DiscoverOptions& options);

/// Lets `start`, of a problem's unknowns, begin with what a candidate's footprint asks for.
void start_candidate(const CampaignProblem& problem, const Candidate& candidate, const Score& score,
                     std::vector<double>& start);

/// The stage with one candidate more, fitted to the train throws from the step that its footprint asks for;
/// where that search may have gone astray, once more from the problem's own start. `leads`: the candidate
/// has the leading footprint, or is the one that a base with rigid pads is bent by most, their give. A law
/// whose pads can give, in the place of one whose cannot, has a give along.
Stage extended(const Stage& stage, const Candidate& candidate, const Score& score, bool leads,
               const DiscoverOptions&);

/// The stage without some of its ids (effects, or the law that took the place of the model to begin with):
/// fitted again from its own solution, or the step before that had this model, whichever is likelier. Every
/// removal is fitted once.
const Stage& without(const Stage& stage, const std::vector<std::string>& gone, const DiscoverOptions&);

/// The ids of all effects but those that were forgotten.
std::vector<std::string> catalogue(const DiscoverOptions& options);

}  // namespace unhand::fitting
