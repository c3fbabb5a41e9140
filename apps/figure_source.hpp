// What the figures of `unhand figure` are drawn from: a log, and the models with where their parameters are
// from.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/cards.hpp"
#include "apps/release_figures.hpp"
#include "apps/throws.hpp"

namespace unhand::apps {

struct FigureRequest {
  std::string log, thrown;                 ///< no log: a synthetic one; no throw: the first
  std::vector<std::string> models, cards;  ///< no models: those of the cards, or the usual ones
  int threads{0};

  std::vector<std::filesystem::path> inputs() const {
    std::vector<std::filesystem::path> all(cards.begin(), cards.end());
    all.emplace_back(log);
    return all;
  }
};

/// Everything is computed when it is first asked for, and kept. Throws WrongUsage for models and throws that
/// there are not, Unanswered where the log does not determine a model that has no card.
class FigureSource {
 public:
  explicit FigureSource(const FigureRequest& request);

  const std::string& file() const { return file_; }
  /// The file, and what it declares of itself.
  std::string about() const { return file_ + ": " + origin_text(log_); }

  /// All throws with every model.
  const experiment::Comparison& compared();
  /// The one throw through every model that has modes, recorded.
  const std::vector<ReleaseTrace>& traces();
  /// Of the first of the traces: L = c a [m].
  double length();
  /// The flight of the one throw after the release that the first model says.
  FlightOverlay overlay();

 private:
  struct Fitted;  // a card of a fit, with its problem on this log
  const Fitted& fitted(const std::string& model);
  /// Of its card, or estimated from the log.
  const experiment::ModelParameters& parameters_of(const std::string& model);
  /// Nothing of a model without modes.
  std::optional<ReleaseTrace> trace(const std::string& model);

  FigureRequest request_;
  std::string file_;
  datasets::ThrowLog log_;
  std::map<std::string, UsableCard> cards_;
  std::vector<experiment::PreparedThrow> prepared_;
  std::size_t chosen_{};
  std::map<std::string, std::shared_ptr<const Fitted>> fitted_;
  std::map<std::string, experiment::ModelParameters> estimated_;  // of models without a card
  std::optional<experiment::Comparison> compared_;
  std::vector<ReleaseTrace> traces_;
};

}  // namespace unhand::apps
