// Between model cards and the parameters of a model of releases.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/model_card.hpp"
#include "experiment/compare.hpp"
#include "fitting/card.hpp"

namespace unhand::apps {

/// A parameter by its name on cards.
struct NamedValue {
  std::string name, unit;
  double value{};
};

/// What `model` reads of the parameters: mu [-], length [m], pads [-] and what the law takes of its own, or
/// delay [s] and delay_sigma [s].
std::vector<NamedValue> named_values(const std::string& model, const experiment::ModelParameters& parameters);
/// Those of a fitted model where it is one.
std::vector<NamedValue> named_values(const experiment::ModelComparison& model);

/// A card; says on stderr what its fit warned of. Throws datasets::CardError where it cannot be read.
datasets::ModelCard read_card(const std::filesystem::path& file);

/// A card whose model and parameters are ones of experiment::predict or, if it comes from a fit, of
/// fitting::predict_throws.
struct UsableCard {
  datasets::ModelCard card;
  std::string file;
  bool fitted{};
  experiment::ModelParameters parameters;  ///< of cards that do not come from a fit
};

/// Throws datasets::CardError where the card cannot be read, its model is not one of releases, this library
/// lacks one of its effects, or a parameter is missing, unknown, in another unit or out of range.
UsableCard read_usable_card(const std::filesystem::path& file);

/// The cards by model. Adds their models to `models`, unless those were `named`: then a card for another one
/// is WrongUsage, as are two cards for one model.
std::map<std::string, UsableCard> read_usable_cards(const std::vector<std::string>& files,
                                                    std::vector<std::string>& models, bool named);

/// The friction that the log suggests for the model and that can be relied on. Throws Unanswered where it
/// suggests none, with what helps a command that knows --card but not --fit.
experiment::FrictionEstimate estimated(const datasets::ThrowLog& log,
                                       const std::vector<experiment::PreparedThrow>& throws,
                                       const std::string& model);

/// The card of an estimate. `throws` are those of the log, for the valid range.
datasets::ModelCard card_of(const experiment::ModelComparison& model, const std::filesystem::path& log_file,
                            const datasets::ThrowLog& log,
                            const std::vector<experiment::PreparedThrow>& throws);

/// The card of a fit: fitting::card_of with where it comes from.
datasets::ModelCard card_of(const fitting::CampaignProblem& problem, const fitting::FitResult& fit,
                            const experiment::ModelComparison& errors, const std::filesystem::path& log_file,
                            const datasets::ThrowLog& log);

/// A fitted card's predictions of all throws of a log.
struct CardPredictions {
  fitting::CampaignProblem problem;
  std::vector<fitting::PredictedThrow> throws;
  experiment::ModelComparison comparison;
};
CardPredictions predict_with(const UsableCard& card, const datasets::ThrowLog& log, const std::string& file,
                             const fitting::EvaluateOptions& options,
                             const dynamics::IntegratorOptions& integrator);

}  // namespace unhand::apps
