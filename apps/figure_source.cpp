#include "apps/figure_source.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/command.hpp"
#include "apps/tell.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::apps {

struct FigureSource::Fitted {
  CardPredictions predicted;
  fitting::FitResult fit;
};

FigureSource::FigureSource(const FigureRequest& request) : request_(request) {
  for (const auto& model : request_.models) {
    try {
      experiment::require_release_model(model);
    } catch (const std::invalid_argument& error) {
      throw WrongUsage(fmt::format("--models: {}", error.what()));
    }
  }
  cards_ = read_usable_cards(request_.cards, request_.models, !request_.models.empty());
  if (request_.models.empty()) request_.models = {"limit_surface_disc", "limit_surface", "sliding_pivot"};
  if (request_.log.empty()) {
    tell("unhand: no --log: drawn from the synthetic campaign quick12, seed 1\n");
    file_ = "quick12 (synthetic)";
    log_ = experiment::generate_campaign(experiment::campaign_design("quick12"), 1);
  } else {
    file_ = request_.log;
    if (datasets::read_schema_name(file_) == "slip-log")
      throw datasets::LogError(
          file_, "/@schema",
          "is a slip-log, and these figures are of releases from a hand: `unhand compare "
          "LOG --fit --report DIR` draws the limit surfaces of slips");
    log_ = read_throws(file_);
    if (is_of_flights(log_))
      throw datasets::LogError(
          file_, "/throws",
          "free flights, and these figures are of releases from a hand in the plane: `unhand "
          "discover LOG --report DIR` draws what a model leaves of flights and falls, `unhand "
          "compare LOG --report DIR` of tracked flights");
  }
  if (!request_.thrown.empty()) chosen_ = place_of(log_, request_.thrown, file_);
  prepared_ = experiment::prepare_all(log_, file_, request_.threads, false);
}

const FigureSource::Fitted& FigureSource::fitted(const std::string& model) {
  auto& out = fitted_[model];
  if (!out) {
    const UsableCard& card = cards_.at(model);
    auto predicted = predict_with(card, log_, file_, {false, request_.threads}, {});
    auto fit = fitting::fit_of(card.card, predicted.problem, card.file);
    out = std::make_shared<const Fitted>(Fitted{std::move(predicted), std::move(fit)});
  }
  return *out;
}

const experiment::ModelParameters& FigureSource::parameters_of(const std::string& model) {
  if (const auto card = cards_.find(model); card != cards_.end()) return card->second.parameters;
  const auto known = estimated_.find(model);
  if (known != estimated_.end()) return known->second;
  return estimated_.emplace(model, estimated(log_, prepared_, model).parameters).first->second;
}

double FigureSource::length() {
  const std::string& model = traces().front().model;
  const auto card = cards_.find(model);
  if (card == cards_.end() || !card->second.fitted) return parameters_of(model).length;
  return card->second.card.parameters.at("length").value;
}

const experiment::Comparison& FigureSource::compared() {
  if (compared_) return *compared_;
  experiment::CompareOptions options;
  options.threads = request_.threads;
  auto out = experiment::compare(log_, prepared_, options);  // of no models
  for (const auto& model : request_.models) {
    const auto card = cards_.find(model);
    if (card != cards_.end() && card->second.fitted) {
      out.models.push_back(fitted(model).predicted.comparison);
      continue;
    }
    options.models = {model};
    options.parameters = {{model, parameters_of(model)}};
    out.models.push_back(experiment::compare(log_, prepared_, options).models.front());
  }
  return compared_.emplace(std::move(out));
}

std::optional<ReleaseTrace> FigureSource::trace(const std::string& model) {
  const auto& prepared = prepared_[chosen_];
  ReleaseTrace out;
  const auto take = [&](const release::ReleaseProblem<double>& problem,
                        const release::ReleaseResult<double>& result, double mu, double length, int pads) {
    if (result.outcome != release::ReleaseOutcome::detached)
      throw Unanswered(fmt::format("{}, throw {}: {}", model, prepared.id, in_words(result.outcome)));
    out = trace_of(problem, result, contact::Patch<double>::of_length(mu, length, pads));
    out.thrown = prepared.id;
    out.open_command = prepared.open_command;
    if (const auto& ft = log_.throws[chosen_].ft)
      for (std::size_t i = 0; i < ft->normal_force.rows; ++i)
        if (std::isfinite(ft->normal_force(i))) out.pressed.emplace_back(ft->time(i), ft->normal_force(i));
  };
  const auto card = cards_.find(model);
  if (!contact::follows_pads(model) || model == release::kNaiveModel) return {};
  if (card != cards_.end() && card->second.fitted) {
    const Fitted& known = fitted(model);
    const auto& problem = known.predicted.problem;
    const auto& parameters = card->second.card.parameters;
    problem.visit_release(prepared, known.fit.values(), known.predicted.throws[chosen_].own,
                          [&](const auto& simulated, const auto& result) {
                            take(simulated, result, parameters.at("mu").value, parameters.at("length").value,
                                 problem.model().pads);
                          });
    return out;
  }
  const auto& parameters = parameters_of(model);
  const auto contact = experiment::contact_model_for(prepared, model, parameters);
  if (!contact) return {};
  const auto problem = experiment::release_problem(prepared, *contact);
  release::ReleaseOptions simulate;
  simulate.integrator.record = true;
  take(problem, release::simulate_release(problem, simulate), parameters.mu, parameters.length,
       parameters.pads);
  return out;
}

const std::vector<ReleaseTrace>& FigureSource::traces() {
  if (!traces_.empty()) return traces_;
  std::vector<ReleaseTrace> all;
  std::vector<std::string> without;
  for (const auto& model : request_.models)
    if (auto one = trace(model))
      all.push_back(*std::move(one));
    else
      without.push_back(model);
  if (all.empty()) throw WrongUsage(fmt::format("--models: {} has no modes to draw", without.front()));
  if (!without.empty())
    tell("unhand: without modes, left out of the figures of one release: {}\n", fmt::join(without, ", "));
  return traces_ = std::move(all);
}

FlightOverlay FigureSource::overlay() {
  const std::string& model = request_.models.front();
  const auto& logged = log_.throws[chosen_];
  if (!logged.mocap) throw Unanswered(fmt::format("throw {} has no motion capture", logged.id));
  const auto& p = compared().models.front().throws[chosen_].prediction;
  if (!p.landed()) throw Unanswered(fmt::format("{} brings throw {} to no landing", model, logged.id));
  FlightOverlay out{model, logged.id, {}, {}, {}};
  std::vector<double> seen;  // on the log's clock
  for (std::size_t i = 0; i < logged.mocap->time.rows; ++i) {
    const double t = logged.mocap->time(i);
    if (!logged.mocap->is_valid(i) || t < p.detach.time || t > p.detach.time + p.landing.flight_time)
      continue;
    seen.push_back(t);
    out.time.push_back(t - p.detach.time);
    out.measured.push_back({logged.mocap->pose(i, 0), logged.mocap->pose(i, 1), logged.mocap->pose(i, 2)});
  }
  if (out.time.empty()) throw Unanswered(fmt::format("throw {} was not tracked in flight", logged.id));
  const auto card = cards_.find(model);
  if (card != cards_.end() && card->second.fitted) {
    using experiment::Channel;
    const Fitted& known = fitted(model);
    experiment::Observations wanted;  // what the tracker would say, with the card's effects
    for (const double t : seen)
      for (const auto channel : {Channel::mocap_x, Channel::mocap_z, Channel::mocap_theta})
        wanted.all.push_back({channel, t, 0, 1});
    const auto said = known.predicted.problem.predict(prepared_[chosen_], wanted, known.fit.values(),
                                                      known.predicted.throws[chosen_].own);
    for (std::size_t i = 0; i + 2 < said.channels.size(); i += 3)
      out.predicted.push_back({said.channels[i], said.channels[i + 1], said.channels[i + 2]});
    return out;
  }
  const auto& prepared = prepared_[chosen_];
  const flight::FlightProblem<double> flight{p.detach.pose, p.detach.twist, prepared.gravity, prepared.drag_k,
                                             prepared.landing_height};
  out.predicted = flight::fly_through(flight, out.time);
  return out;
}

}  // namespace unhand::apps
