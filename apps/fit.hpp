// What the parts of `unhand fit` hand to each other.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/output.hpp"
#include "apps/table.hpp"
#include "fitting/card.hpp"
#include "fitting/discovery/twin.hpp"
#include "fitting/evaluate.hpp"
#include "fitting/gradient_cost.hpp"

namespace unhand::apps {

struct FitRequest {
  std::string log, model;
  std::vector<std::string> effects;
  std::string json, card, report;  ///< destinations; empty: none
  int threads{0}, kfold{0};        ///< kfold 0: only where the log has no test split
  int floor{0};                    ///< twins to fit for the errors' floor
  double rtol{1e-6};
};

/// A fit and everything that is said of it.
struct FitAnswer {
  const fitting::CampaignProblem& problem;
  const fitting::FitResult& fit;
  std::vector<fitting::PredictedThrow> throws;
  experiment::ModelComparison errors;
  std::optional<fitting::CrossValidation> cross_validation;
  std::optional<fitting::ErrorFloor> floor;
  fitting::GradientCost gradients;
  int threads{1};                          ///< used
  std::string origin;                      ///< of the log, as it declares it
  std::vector<std::string> understated{};  ///< columns whose declared noise is too small, in words

  /// Of the fit's time, over all threads.
  double jacobian_share() const {
    return fit.seconds > 0 ? fit.jacobian_seconds / (fit.seconds * threads) : 0;
  }
};

/// Why a fit is no answer, in words.
std::string why_unfitted(const fitting::FitResult& fit);

/// Why the answer is not to be trusted as it is, a line each: said on stderr, in the report and in the JSON.
std::vector<std::string> fit_warnings(const FitAnswer& answer, const FitRequest& request);
/// What was dropped or assumed, a line each.
std::vector<std::string> fit_notes(const FitAnswer& answer, const FitRequest& request);

/// The answer in words and tables; `markdown` for the report, otherwise aligned with spaces.
std::string fit_text(const FitAnswer& answer, const FitRequest& request, bool markdown);
Json fit_json(const FitAnswer& answer, const FitRequest& request);

/// Every throw of the log: its part in the fit, its own unknowns, prediction with 1 σ, errors.
Table fit_throw_table(const FitAnswer& answer);

/// Slip logs: one surface of the model each.
void fit_slips(const FitRequest& request);

}  // namespace unhand::apps
