// What the parts of `unhand validate-sku` hand to each other.
#pragma once

#include <string>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "datasets/sku.hpp"
#include "fitting/sku/sku_validation.hpp"

namespace unhand::apps {

/// What was asked, for the report.
struct SkuQuestion {
  std::string sku_file, card_file, log_file;
  datasets::Sku sku;
  datasets::ModelCard card;
  fitting::SkuRequest request;
};

/// The answer in words and tables, for the terminal or as Markdown.
std::string sku_text(const SkuQuestion& question, const fitting::SkuValidation& answer, bool markdown);
Json sku_json(const SkuQuestion& question, const fitting::SkuValidation& answer);

/// The landings about the predicted one: Monte Carlo, the ellipses that the derivatives say, the tolerance,
/// and measured errors if there are any. Needs samples.
Figure sku_landing_figure(const SkuQuestion& question, const fitting::SkuValidation& answer);
/// The ranked budget of landing x and theta. Needs a budget.
Figure sku_budget_figure(const SkuQuestion& question, const fitting::SkuValidation& answer);

}  // namespace unhand::apps
