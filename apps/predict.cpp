// unhand predict: where a card's model says each throw goes.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/compare.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "apps/weak_grip.hpp"
#include "dynamics/effect.hpp"
#include "dynamics/median.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/observations.hpp"

namespace unhand::apps {
namespace {

struct PredictOptions {
  std::string log, card, json, csv;
  int threads{0};
};

using experiment::kDegrees;
/// By throw; nothing where a card tells no uncertainty.
using Sigmas = std::vector<std::optional<fitting::OutcomeSigma>>;

/// By how much a measured landing scatters about the prediction: its own 1 σ and that of the sensor, as the
/// throw declares it or the log's landings tell it.
struct MeasuredSigma {
  std::optional<double> x, theta;  ///< [m], [rad]; absent where either is not known
};

std::vector<MeasuredSigma> measured_sigmas(const datasets::ThrowLog& log,
                                           const std::vector<experiment::PreparedThrow>& prepared,
                                           const Sigmas& sigmas) {
  experiment::ObservationOptions landing;
  landing.wrench = landing.normal_force = landing.mocap = false;
  landing.landing_noise = experiment::landing_noise(log);
  std::vector<MeasuredSigma> out(prepared.size());
  for (std::size_t i = 0; i < prepared.size(); ++i) {
    if (!sigmas[i]) continue;
    for (const auto& one : experiment::observe(log, log.throws[i], prepared[i], landing).all) {
      if (one.channel == experiment::Channel::landing_x)
        out[i].x = std::hypot(sigmas[i]->landing_x, one.sigma);
      if (one.channel == experiment::Channel::landing_theta)
        out[i].theta = std::hypot(sigmas[i]->landing_theta, one.sigma);
    }
  }
  return out;
}

std::optional<double> in_degrees(const std::optional<double>& radians) {
  return radians ? std::optional(*radians * kDegrees) : std::nullopt;
}

Json prediction_json(const experiment::ThrowComparison& one, const experiment::PreparedThrow& prepared,
                     const std::optional<fitting::OutcomeSigma>& sigma, const MeasuredSigma& of_measured,
                     const datasets::ModelCard& card, double clock_origin) {
  const auto& p = one.prediction;
  Json out{{"id", one.id},
           {"object", one.object},
           {"condition", one.condition},
           {"split", to_string(one.split)},
           {"outcome", outcome_of(p)},
           {"slips_at_start", p.slips_at_start},
           {"detach", nullptr},
           {"landing", nullptr}};
  if (p.release == release::ReleaseOutcome::detached)
    out["detach"] = {{"time_s", p.detach.time + clock_origin},
                     {"x_m", p.detach.pose.x},
                     {"z_m", p.detach.pose.z},
                     {"theta_deg", p.detach.pose.theta * kDegrees},
                     {"vx_m_s", p.detach.twist.vx},
                     {"vz_m_s", p.detach.twist.vz},
                     {"omega_deg_s", p.detach.twist.omega * kDegrees}};
  if (p.landed())
    out["landing"] = {{"flight_time_s", p.landing.flight_time},
                      {"x_m", p.landing.pose.x},
                      {"theta_deg", p.landing.pose.theta * kDegrees}};
  out["sigma"] = nullptr;
  if (sigma)
    out["sigma"] = {
        {"detach_time_s", sigma->detach_time}, {"detach_vx_m_s", sigma->detach_vx},
        {"detach_vz_m_s", sigma->detach_vz},   {"detach_omega_deg_s", sigma->detach_omega * kDegrees},
        {"landing_x_m", sigma->landing_x},     {"landing_theta_deg", sigma->landing_theta * kDegrees},
        {"flight_time_s", sigma->flight_time}};
  out["sigma_measured"] = nullptr;
  if (of_measured.x || of_measured.theta)
    out["sigma_measured"] = {{"landing_x_m", number(of_measured.x)},
                             {"landing_theta_deg", number(in_degrees(of_measured.theta))}};
  out["outside_valid_range"] = fitting::reasons_of(fitting::outside_range(card, prepared));
  Json& measured = out["measured"] = Json::object();
  const auto& m = prepared.measured;
  if (m.detach_time) measured["detach_time_s"] = *m.detach_time + clock_origin;
  if (m.detach_twist) {
    measured["detach_vx_m_s"] = m.detach_twist->vx;
    measured["detach_vz_m_s"] = m.detach_twist->vz;
    measured["detach_omega_deg_s"] = m.detach_twist->omega * kDegrees;
  }
  if (m.landing_x) measured["landing_x_m"] = *m.landing_x;
  if (m.landing_theta) measured["landing_theta_deg"] = *m.landing_theta * kDegrees;
  Json& error = out["error"] = Json::object();
  for (int q = 0; q < experiment::kQuantityCount; ++q)
    if (one.error[q]) error[experiment::kQuantities[q].key] = *one.error[q];
  return out;
}

Table table_of(const experiment::ModelComparison& model, const Sigmas& sigmas) {
  Table out{{"throw", "condition", "outcome", "detach vx [m/s]", "vz [m/s]", "omega [deg/s]", "landing x [m]",
             "error x", "theta [deg]", "error theta"},
            {},
            3};
  for (std::size_t i = 0; i < model.throws.size(); ++i) {
    const auto& one = model.throws[i];
    const auto& p = one.prediction;
    const bool detached = p.release == release::ReleaseOutcome::detached;
    const auto error = [&](int q, int decimals) {
      return one.error[q] ? with_sign(*one.error[q], decimals) : std::string("-");
    };
    const auto value = [&](bool known, double v, double fitting::OutcomeSigma::*s, double unit,
                           int decimals) {
      return sigmas[i] ? plus_minus(known, v * unit, (*sigmas[i]).*s * unit, decimals)
                       : fixed(known, v * unit, decimals);
    };
    using Sigma = fitting::OutcomeSigma;
    out.rows.push_back(
        {one.id, one.condition, outcome_of(p), value(detached, p.detach.twist.vx, &Sigma::detach_vx, 1, 4),
         value(detached, p.detach.twist.vz, &Sigma::detach_vz, 1, 4),
         value(detached, p.detach.twist.omega, &Sigma::detach_omega, kDegrees, 2),
         value(p.landed(), p.landing.pose.x, &Sigma::landing_x, 1, 4), error(2, 4),
         value(p.landed(), p.landing.pose.theta, &Sigma::landing_theta, kDegrees, 2), error(3, 2)});
  }
  return out;
}

/// The comparison's table with 1 σ beside it.
Table csv_table(const experiment::Comparison& comparison, const datasets::ThrowLog& log, const Sigmas& sigmas,
                const std::vector<MeasuredSigma>& of_measured) {
  Table out = throw_table(comparison, log);
  for (const char* name : {"detach_time_s", "detach_vx_m_s", "detach_vz_m_s", "detach_omega_deg_s",
                           "landing_x_m", "landing_theta_deg"})
    out.header.push_back(std::string("sigma_") + name);
  for (const char* name : {"landing_x_m", "landing_theta_deg"})
    out.header.push_back(std::string("sigma_measured_") + name);
  for (std::size_t i = 0; i < out.rows.size(); ++i) {
    const auto s = sigmas[i].value_or(fitting::OutcomeSigma{});
    for (const double value : {s.detach_time, s.detach_vx, s.detach_vz, s.detach_omega * kDegrees,
                               s.landing_x, s.landing_theta * kDegrees})
      out.rows[i].push_back(all_digits(sigmas[i].has_value(), value));
    for (const auto& value : {of_measured[i].x, in_degrees(of_measured[i].theta)})
      out.rows[i].push_back(all_digits(value.has_value(), value.value_or(0)));
  }
  return out;
}

/// Tells of throws outside the conditions that the card has been tried in: a line per condition.
void warn_outside(const datasets::ModelCard& card, const std::vector<experiment::PreparedThrow>& throws) {
  struct Outside {
    int throws{};
    std::string first, reason;
  };
  if (card.valid_range.empty())
    tell("unhand: the card has no valid_range: nothing tells whether it was tried on such throws\n");
  std::map<std::string, Outside> by_condition;
  for (const auto& one : throws)
    for (const auto& [condition, reason] : fitting::outside_range(card, one)) {
      auto& outside = by_condition.try_emplace(condition, Outside{0, one.id, reason}).first->second;
      ++outside.throws;
    }
  for (const auto& [condition, outside] : by_condition)
    tell("unhand: {} of {} throws are outside of the card's valid range in {}; the first, {}: {}\n",
         outside.throws, throws.size(), condition, outside.first, outside.reason);
}

/// Says where the card's own held-out throws were missed by far more than the predictions' σ: that is of what
/// is not known of parameters and throw, and not of what the model itself has wrong.
void warn_wrong_model(const datasets::ModelCard& card, const Sigmas& sigmas,
                      const std::vector<MeasuredSigma>& of_measured) {
  constexpr double kBeyond = 3;        // of a σ that has the sensor's noise; a mean |error| is 0.8 σ then
  constexpr double kBeyondUnread = 6;  // of one that has not
  auto errors = card.errors.find("test");
  if (errors == card.errors.end()) errors = card.errors.find("cross_validation");
  if (errors == card.errors.end()) return;
  std::vector<std::string> words;
  const auto compare = [&](const experiment::Quantity& quantity, std::vector<double> all, double beyond) {
    const auto error = errors->second.find(quantity.key);
    if (all.empty() || error == errors->second.end()) return;
    const double sigma = dynamics::median(all), mae = error->second.mae;
    if (mae > beyond * sigma) words.push_back(fmt::format("{} {:.2g} ({:.2g})", quantity.title, mae, sigma));
  };
  std::array<std::vector<double>, experiment::kQuantityCount> own, read;
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    if (!sigmas[i]) continue;
    const std::array<double, experiment::kQuantityCount> each{
        sigmas[i]->detach_vx, sigmas[i]->detach_omega * kDegrees, sigmas[i]->landing_x,
        sigmas[i]->landing_theta * kDegrees};
    for (std::size_t q = 0; q < each.size(); ++q) own[q].push_back(each[q]);
    if (of_measured[i].x) read[2].push_back(*of_measured[i].x);
    if (of_measured[i].theta) read[3].push_back(*of_measured[i].theta * kDegrees);
  }
  for (std::size_t q = 0; q < own.size(); ++q)
    if (read[q].empty())
      compare(experiment::kQuantities[q], std::move(own[q]), kBeyondUnread);
    else
      compare(experiment::kQuantities[q], std::move(read[q]), kBeyond);
  if (!words.empty())
    tell(
        "unhand: the card's own held-out throws were missed by far more than the sigmas here (mean "
        "absolute error, in brackets the median sigma): {}. A sigma holds what is not known of parameters "
        "and throw, and not what {} has wrong\n",
        fmt::join(words, ", "), card.model);
}

/// Says how the gripper opens in throws whose normal force was not measured.
void tell_opening(const datasets::ModelCard& card, const std::vector<experiment::PreparedThrow>& throws) {
  const auto n =
      std::count_if(throws.begin(), throws.end(), [](const auto& one) { return !one.normal_force; });
  std::vector<std::string> told;
  for (const char* name : fitting::kOpeningParameters)
    if (const auto p = card.parameters.find(name); p != card.parameters.end())
      told.push_back(
          fmt::format("{} {:.4g}{}", name, p->second.value, dynamics::after_number(p->second.unit)));
  if (n > 0 && !told.empty())
    tell("unhand: {} of {} throws have no normal force: there the pads open as the card says ({})\n", n,
         throws.size(), fmt::join(told, ", "));
}

/// The predictions of one card, plain or fitted.
struct Predictions {
  std::vector<experiment::PreparedThrow> prepared;
  experiment::Comparison comparison;  ///< of one model
  Sigmas sigmas;
};

Predictions predictions_of(const UsableCard& card, const datasets::ThrowLog& log,
                           const PredictOptions& options) {
  Predictions out;
  if (card.fitted) {
    auto predicted =
        predict_with(card, log, options.log, {true, options.threads}, fitting::CampaignOptions{}.integrator);
    for (const auto& one : predicted.problem.throws()) out.prepared.push_back(one.prepared);
    for (const auto& one : predicted.throws) out.sigmas.push_back(one.sigma);
    out.comparison.models.push_back(std::move(predicted.comparison));
    return out;
  }
  out.prepared = experiment::prepare_all(log, options.log, options.threads, false);
  experiment::CompareOptions compare_options;
  compare_options.models = {card.card.model};
  compare_options.threads = options.threads;
  compare_options.parameters.emplace(card.card.model, card.parameters);
  out.comparison = experiment::compare(log, out.prepared, compare_options);
  out.sigmas.resize(out.prepared.size());
  return out;
}

void predict(const PredictOptions& options) {
  require_outputs({{options.json}, {options.csv}}, {options.log, options.card});
  const UsableCard card = read_usable_card(options.card);
  const std::string& model = card.card.model;
  const auto log = read_throws(options.log);
  const auto [prepared, comparison, sigmas] = predictions_of(card, log, options);
  warn_outside(card.card, prepared);
  tell_opening(card.card, prepared);
  const auto& result = comparison.models.front();
  tell_weak_grip(result);
  if (result.failed == static_cast<int>(result.throws.size()))
    throw Unanswered(fmt::format("{} brings no throw to a landing: {}", model,
                                 outcome_in_words(result.throws.front().prediction)));
  std::map<std::string, std::pair<std::string, int>> failures;
  for (const auto& one : result.throws)
    if (!one.prediction.landed()) {
      auto& [words, n] = failures[outcome_of(one.prediction)];
      words = outcome_in_words(one.prediction), ++n;
    }
  for (const auto& [name, failure] : failures)
    tell("unhand: {} of {} throws, {}: {}\n", failure.second, result.throws.size(), name, failure.first);

  const auto of_measured = measured_sigmas(log, prepared, sigmas);
  warn_wrong_model(card.card, sigmas, of_measured);
  Outputs outputs{{options.log, options.card}};
  if (!options.json.empty()) {
    Json json = json_head("predict");
    json["log"] = options.log;
    json["source"] = log.source;
    json["card"] = options.card;
    json["model"] = model;
    json["effects"] = card.card.effects;
    json["parameters"] = Json::object();
    for (const auto& [name, unit, value] : named_values(result)) json["parameters"][name] = value;
    json["failed"] = result.failed;
    json["slips_at_start"] = slips_at_start(result);
    json["throws"] = Json::array();
    for (std::size_t i = 0; i < prepared.size(); ++i)
      json["throws"].push_back(prediction_json(result.throws[i], prepared[i], sigmas[i], of_measured[i],
                                               card.card, log.clock_origin));
    outputs.json(options.json, json);
  }
  if (!options.csv.empty()) outputs.text(options.csv, csv_table(comparison, log, sigmas, of_measured).csv());
  outputs.commit();
  fmt::print(
      "{}: {}\n{} throws with {}{}{} from {} (± 1 sigma of the throw itself, without the noise of sensors; "
      "errors: predicted - measured)\n\n{}",
      options.log, origin_text(log), prepared.size(), model, card.card.effects.empty() ? "" : " with ",
      fmt::join(card.card.effects, ", "), options.card, table_of(result, sigmas).text());
}

}  // namespace

Command predict_command(Parser& root) {
  auto options = std::make_shared<PredictOptions>();
  Parser& parser =
      root.subcommand("predict", "Predict each throw of a log with a card's model and parameters");
  parser.option("LOG", options->log, "A throw log; outcomes need not be in it").required();
  parser.file("--card", options->card, "The model card").required();
  parser.file("--json", options->json, "Write the predictions as JSON");
  parser.file("--csv", options->csv, "Write the predictions as CSV");
  add_threads(parser, options->threads);
  parser.footer(
      "Cards come from `unhand fit LOG --card FILE` (with uncertainties) and from\n"
      "`unhand compare LOG --write-cards DIR`. Existing files are replaced.\n"
      "± is 1 sigma of the throw itself. A measured landing scatters about it by the sensor's noise as "
      "well:\n"
      "sigma_measured of --json and --csv is both.\n"
      "Example:\n  unhand predict campaign.h5 --card cards/sliding_pivot.json --csv predictions.csv");
  return {&parser, [options] { predict(*options); }};
}

}  // namespace unhand::apps
