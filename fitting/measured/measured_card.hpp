// Cards that the loop writes on free flights and falls, held against a log.
#pragma once

#include <string>

#include "datasets/model_card.hpp"
#include "fitting/measured/measured_discovery.hpp"

namespace unhand::fitting {

/// Errors of a log's groups with what a card knows, each group's own unknowns fitted: of its base model alone
/// ("projectile" or "free_fall"), and with the card's effects at the card's values.
struct CardComparison {
  std::string kind;                   ///< of the groups, in words
  int train{}, test{};                ///< groups
  NamedErrors base_train, base_test;  ///< of the base model, as discover_flights and discover_falls name them
  NamedErrors card_train, card_test;  ///< with the card's effects
  std::vector<std::pair<std::string, std::string>> skipped;  ///< groups, with the reason
  /// Of the held-out groups, or of the train groups where none is held out.
  std::vector<ResidualProfile> base_profile;
  std::vector<ResidualProfile> card_profile;  ///< likewise, with the card's effects
};

/// Whether a card is of free flights or falls.
bool is_of_free_motion(const datasets::ModelCard& card);

/// Throws datasets::CardError, naming `file`, for an effect that such groups do not have, a parameter that is
/// missing (of an object that the card has not seen, say), in another unit or out of range; and
/// std::invalid_argument as FlightProblem and FallProblem do for the log.
CardComparison compare_with_card(const datasets::ModelCard& card, const std::string& file,
                                 const datasets::ThrowLog& log, int threads);

}  // namespace unhand::fitting
