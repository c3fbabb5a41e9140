// The models of `unhand compare` on releases, one after the other.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "apps/cards.hpp"
#include "apps/compare.hpp"

namespace unhand::apps {

/// Collects models over the same throws. Parameters come from a card, from a fit (`--fit`), or from
/// experiment::estimate_friction. Fits use the train throws; limit_surface_naive, which cannot be fitted,
/// takes the fitted ellipsoid's values.
class ReleaseRun {
 public:
  ReleaseRun(const CompareRequest& request, const datasets::ThrowLog& log,
             const std::vector<experiment::PreparedThrow>& prepared);

  /// `card`: of that model; may be null.
  void add(const std::string& model, const UsableCard* card);

  const experiment::Comparison& comparison() const { return comparison_; }
  /// Of the models whose parameters came from this log.
  const std::map<std::string, datasets::ModelCard>& cards() const { return cards_; }

 private:
  struct Fitted {
    experiment::ModelComparison comparison;
    datasets::ModelCard card;
  };
  const Fitted& fitted(const std::string& model);
  void add_plain(const std::string& model, const experiment::ModelParameters* parameters,
                 const std::string& method);

  const CompareRequest& request_;
  const datasets::ThrowLog& log_;
  const std::vector<experiment::PreparedThrow>& prepared_;
  experiment::CompareOptions options_;
  experiment::Comparison comparison_;
  std::map<std::string, Fitted> fitted_;
  std::map<std::string, datasets::ModelCard> cards_;
};

}  // namespace unhand::apps
