#include "apps/compare_run.hpp"

#include <fmt/format.h>

#include "apps/command.hpp"
#include "apps/fit.hpp"
#include "fitting/fit.hpp"

namespace unhand::apps {
namespace {

constexpr const char* naive_law = "limit_surface";

double value_of(const experiment::ModelComparison& model, const std::string& name) {
  for (const auto& one : model.named)
    if (one.name == name) return one.value;
  throw Unanswered(fmt::format("the fit of {} has no {}", model.model, name));
}

}  // namespace

ReleaseRun::ReleaseRun(const CompareRequest& request, const datasets::ThrowLog& log,
                       const std::vector<experiment::PreparedThrow>& prepared)
    : request_(request), log_(log), prepared_(prepared) {
  options_.threads = request.threads;
  options_.naive = request.naive;
  options_.integrator.tolerances = {request.rtol, 0.01 * request.rtol};
  comparison_ =
      experiment::compare(log, prepared, options_);  // of no models: what the throws say by themselves
}

const ReleaseRun::Fitted& ReleaseRun::fitted(const std::string& model) {
  if (const auto found = fitted_.find(model); found != fitted_.end()) return found->second;
  fitting::CampaignOptions campaign;
  campaign.model = model;
  campaign.integrator = options_.integrator;
  campaign.threads = request_.threads;
  const fitting::CampaignProblem problem(log_, request_.log, campaign);
  fitting::FitOptions fit_options;
  fit_options.threads = request_.threads;
  const auto fit = fitting::fit(problem, fit_options);
  if (fit.outcome == fitting::FitOutcome::no_start || fit.outcome == fitting::FitOutcome::not_solved)
    throw Unanswered(fmt::format("{}: {}: {}", request_.log, model, why_unfitted(fit)));
  const auto throws = fitting::predict_throws(problem, fit, {false, request_.threads});
  Fitted out{fitting::comparison_of(problem, fit, throws), {}};
  out.card = card_of(problem, fit, out.comparison, request_.log, log_);
  out.comparison.estimate.method = fmt::format("fitted to the train throws: {}", to_string(fit.outcome));
  out.comparison.estimate.samples = static_cast<int>(fit.samples);
  out.comparison.estimate.scatter = std::sqrt(fit.chi2_per_dof().value_or(1));
  return fitted_.emplace(model, std::move(out)).first->second;
}

void ReleaseRun::add_plain(const std::string& model, const experiment::ModelParameters* parameters,
                           const std::string& method) {
  auto options = options_;
  options.models = {model};
  if (parameters) options.parameters.emplace(model, *parameters);
  auto one = experiment::compare(log_, prepared_, options);
  auto& result = one.models.front();
  if (!method.empty()) {
    result.from_card = false;
    result.estimate.method = method;
  }
  if (!result.from_card) cards_[model] = card_of(result, request_.log, log_, prepared_);
  comparison_.models.push_back(std::move(result));
}

void ReleaseRun::add(const std::string& model, const UsableCard* card) {
  if (card && card->fitted) {
    auto predicted = predict_with(*card, log_, request_.log, {false, request_.threads}, options_.integrator);
    comparison_.models.push_back(std::move(predicted.comparison));
  } else if (card) {
    add_plain(model, &card->parameters, "");
  } else if (request_.fit && model == release::kNaiveModel) {
    const auto& law = fitted(naive_law).comparison;
    experiment::ModelParameters parameters;
    parameters.mu = value_of(law, "mu");
    parameters.length = value_of(law, "length");
    if (log_.gripper) parameters.pads = log_.gripper->n_pads;
    add_plain(model, &parameters, fmt::format("the values of {}, fitted to the train throws", naive_law));
  } else if (request_.fit) {
    const auto& one = fitted(model);
    comparison_.models.push_back(one.comparison);
    cards_[model] = one.card;
  } else {
    add_plain(model, nullptr, "");
  }
}

}  // namespace unhand::apps
