// Closing the loop: where a model's residual leaves the noise, which effect leaves such a footprint, and
// whether held-out throws agree.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fitting/discovery/accepted_effect.hpp"
#include "fitting/discovery/discover_options.hpp"
#include "fitting/discovery/footprint_traces.hpp"
#include "fitting/discovery/missing_estimate.hpp"
#include "fitting/discovery/outcome_errors.hpp"
#include "fitting/discovery/ranking.hpp"
#include "fitting/discovery/residuals.hpp"
#include "fitting/discovery/verdict.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// Where the residual first leaves the noise.
struct FirstMisfit {
  bool any{false};                ///< false: it stays in the noise
  Phase phase{};                  ///< of the throw
  experiment::Channel channel{};  ///< of which sensor
  double chi2_per_sample{};       ///< 1 is the noise
};

/// What the loop saw of a model.
struct SeenModel {
  FitResult fit;                            ///< of the train throws
  std::vector<ChannelMisfit> held_out;      ///< misfit on the other ones
  OutcomeErrors train, test;                ///< of predictions
  std::vector<ResidualBin> residual;        ///< of the train throws
  std::vector<ChannelStructure> structure;  ///< of what is left on the train throws
};

/// The loop's answer.
struct Discovery {
  Verdict verdict{};                  ///< found, nothing missing, unexplained, or no answer
  std::vector<std::string> held_out;  ///< throws that with_held_out chose; empty where the log says which
  /// Throws that were set aside, since neither the answer nor all listed effects together explain them as
  /// they do the others: id and how far they are off.
  std::vector<std::pair<std::string, std::string>> skipped;
  std::vector<std::string> notes;       ///< CampaignProblem::notes()
  std::string message;                  ///< why there is no answer (not_answered); else empty
  std::vector<AcceptedEffect> effects;  ///< in order of acceptance
  std::vector<Imitation> imitations;    ///< accepted at first, and withdrawn
  std::optional<AskedForm> asked;       ///< what the flights asked for when effects were questioned
  std::vector<std::string> along;       ///< effects that are fitted along as nuisances, too small to matter
  std::optional<SmallEffect> small;     ///< the most evident of what was too small to matter
  std::optional<Unexplained> unexplained;  ///< what is left, if anything
  FirstMisfit first;                       ///< of the base model
  SeenModel before, after;                 ///< the base model; the answer
  std::vector<Ranked> ranking;             ///< best first
  std::vector<std::string> silent;  ///< candidates of which no channel shows anything under the base model
  std::string model;                ///< of the answer (contact.law changes it)
  std::vector<FootprintTrace> footprints;  ///< beside the base model: the answer's, and others that lead
  std::shared_ptr<const CampaignProblem> problem;  ///< of the answer
  double seconds{};                                ///< of the whole loop

  /// Whether the answer is the base model as it was.
  bool adds_nothing() const { return effects.empty() && along.empty(); }
};

/// Runs the loop. A log without a test split is split as with_held_out does. Throws of both splits that err
/// as no other does (gross_outliers) take no part. Throws as validate and CampaignProblem do.
Discovery discover(const datasets::ThrowLog& log, const std::string& file, const DiscoverOptions& options);

}  // namespace unhand::fitting
