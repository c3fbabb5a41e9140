// Between model cards and the parameters of a model of releases.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/model_card.hpp"
#include "experiment/compare.hpp"

namespace unhand::apps {

/// A parameter by its name on cards.
struct NamedValue {
  std::string name, unit;
  double value{};
};

/// What `model` reads of the parameters: mu [-], length [m] and pads [-], or delay [s] and delay_sigma [s].
std::vector<NamedValue> named_values(const std::string& model, const experiment::ModelParameters& parameters);

/// A card whose model and parameters are ones of experiment::predict.
struct UsableCard {
  datasets::ModelCard card;
  experiment::ModelParameters parameters;
};

/// Throws datasets::CardError where the card cannot be read, its model is not one of releases, or a parameter
/// is missing, unknown, in another unit or out of range.
UsableCard read_usable_card(const std::filesystem::path& file);

/// The card of an estimate. `throws` are those of the log, for the valid range.
datasets::ModelCard card_of(const experiment::ModelComparison& model, const std::filesystem::path& log_file,
                            const datasets::ThrowLog& log,
                            const std::vector<experiment::PreparedThrow>& throws);

/// The conditions of a throw that a card's valid range speaks of, as far as they were measured.
std::vector<NamedValue> conditions_of(const experiment::PreparedThrow& one);

}  // namespace unhand::apps
