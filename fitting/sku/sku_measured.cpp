#include "fitting/sku/sku_measured.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "experiment/outcome_slopes.hpp"
#include "experiment/unit_check.hpp"
#include "fitting/card.hpp"

namespace unhand::fitting {

using experiment::kDegrees;

namespace {

/// The variance of the landing that the SKU's tolerances bring.
Eigen::Vector2d of_sku(const ThrowInputs& inputs, const experiment::PreparedThrow& prepared) {
  const auto all = experiment::outcome_slopes(prepared, inputs.model, inputs.names, inputs.values);
  Eigen::Vector2d out = Eigen::Vector2d::Zero();
  if (!all) return out;
  const Eigen::MatrixXd J = *all * inputs.mixing();
  for (std::size_t k = 0; k < inputs.inputs.size(); ++k) {
    const auto& input = inputs.inputs[k];
    if (input.source != InputSource::sku && input.source != InputSource::assumed) continue;
    const auto column = static_cast<Eigen::Index>(k);
    out[0] += std::pow(J(experiment::kLandingX, column) * input.sigma, 2);
    out[1] += std::pow(J(experiment::kLandingTheta, column) * input.sigma, 2);
  }
  return out;
}

/// Declared noise of a landing's column [m or rad].
double sensor_sigma(const CampaignThrow& thrown, experiment::Channel channel) {
  for (const auto& o : thrown.observed.all)
    if (o.channel == channel) return o.sigma;
  return 0;
}

}  // namespace

std::optional<MeasuredVerdict> measured_verdict(const datasets::Sku& sku, const datasets::ModelCard& card,
                                                const std::string& card_file, const SkuRequest& request,
                                                bool held_out) {
  datasets::ThrowLog log = *request.log;
  experiment::require_units(log, request.log_file);
  std::erase_if(log.throws, [&](const datasets::Throw& one) {
    return (one.object != sku.name && log.objects.at(one.object).sku != sku.name) || !one.landing;
  });
  MeasuredVerdict out;
  out.held_out = held_out;
  if (out.held_out)
    std::erase_if(log.throws, [](const datasets::Throw& one) { return one.split == datasets::Split::train; });
  if (log.throws.empty()) return {};
  for (const auto& one : log.throws) log.objects[one.object] = datasets::to_object(sku);

  auto campaign = options_of(card, card_file);
  campaign.threads = request.threads;
  campaign.check_units = false;  // from here on the object is the SKU's: a wrong one is no wrong unit
  const CampaignProblem problem(log, request.log_file, campaign);
  const auto predicted = predict_throws(problem, fit_of(card, problem, card_file), {true, request.threads});
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    const auto& error = predicted[i].comparison.error;
    if (!predicted[i].comparison.prediction.landed()) {
      ++out.never_lands;
      continue;
    }
    if (!error[2] || !error[3] || !predicted[i].sigma) continue;
    const CampaignThrow& thrown = problem.throws()[i];
    auto inputs = throw_inputs(sku, card, card_file, thrown.prepared, request.assumed);
    const auto variance = of_sku(inputs, thrown.prepared);
    const auto total = [&](double own, double object, experiment::Channel channel) {
      return std::sqrt(own * own + object + std::pow(sensor_sigma(thrown, channel), 2));
    };
    out.throws.push_back(
        {thrown.prepared.id, thrown.prepared.condition, *error[2], *error[3] / kDegrees,
         total(predicted[i].sigma->landing_x, variance[0], experiment::Channel::landing_x),
         total(predicted[i].sigma->landing_theta, variance[1], experiment::Channel::landing_theta)});
  }
  if (out.count() == 0) return {};
  const auto n = static_cast<double>(out.throws.size());
  double squares = 0;
  int within = 0;
  for (const auto& one : out.throws) {
    out.mae_x += std::abs(one.error_x) / n;
    out.mae_theta += std::abs(one.error_theta) / n;
    out.bias_x += one.error_x / n;
    out.bias_theta += one.error_theta / n;
    squares += std::pow(one.error_x / one.sigma_x, 2) + std::pow(one.error_theta / one.sigma_theta, 2);
    within +=
        std::abs(one.error_x) <= request.tolerance.x && std::abs(one.error_theta) <= request.tolerance.theta;
  }
  out.rms_z = n > 0 ? std::sqrt(squares / (2 * n)) : HUGE_VAL;
  out.within = static_cast<double>(within) / out.count();
  out.p_value = binomial_tail(within, out.count(), request.confidence);
  out.confirmed = out.within >= request.confidence && out.rms_z <= kMostSurprise;
  return out;
}

}  // namespace unhand::fitting
