// unhand predict: where a card's model says each throw goes.
#include <fmt/format.h>

#include <memory>
#include <set>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/compare.hpp"

namespace unhand::apps {
namespace {

struct Options {
  std::string log, card, json, csv;
  int threads{0};
};

using experiment::kDegrees;

Json json_of(const experiment::ThrowComparison& one, const experiment::PreparedThrow& prepared) {
  const auto& p = one.prediction;
  Json out{{"id", one.id},
           {"object", one.object},
           {"condition", one.condition},
           {"split", one.split == datasets::Split::train ? "train" : "test"},
           {"outcome", outcome_of(p)},
           {"detach", nullptr},
           {"landing", nullptr}};
  if (p.release == release::ReleaseOutcome::detached)
    out["detach"] = {{"time_s", p.detach.time},
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
  Json& measured = out["measured"] = Json::object();
  const auto& m = prepared.measured;
  if (m.detach_time) measured["detach_time_s"] = *m.detach_time;
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

Table table_of(const experiment::ModelComparison& model) {
  Table out{{"throw", "condition", "outcome", "detach vx [m/s]", "vz [m/s]", "omega [deg/s]", "landing x [m]",
             "error", "theta [deg]", "error"},
            {},
            3};
  for (const auto& one : model.throws) {
    const auto& p = one.prediction;
    const bool detached = p.release == release::ReleaseOutcome::detached;
    const auto error = [&](int q, int decimals) {
      return one.error[q] ? fmt::format("{:+.{}f}", *one.error[q], decimals) : std::string("-");
    };
    out.rows.push_back({one.id, one.condition, outcome_of(p), fixed(detached, p.detach.twist.vx, 4),
                        fixed(detached, p.detach.twist.vz, 4),
                        fixed(detached, p.detach.twist.omega * kDegrees, 2),
                        fixed(p.landed(), p.landing.pose.x, 4), error(2, 4),
                        fixed(p.landed(), p.landing.pose.theta * kDegrees, 2), error(3, 2)});
  }
  return out;
}

/// Tells of throws outside the conditions that the card has been tried in.
void warn_outside(const datasets::ModelCard& card, const std::vector<experiment::PreparedThrow>& throws) {
  for (const auto& [name, range] : card.valid_range) {
    int outside = 0;
    for (const auto& one : throws)
      for (const auto& value : conditions_of(one))
        outside += value.name == name && value.unit == range.unit && !range.contains(value.value);
    if (outside > 0)
      fmt::print(stderr, "unhand: {} of {} throws lie outside the card's range of {}, [{:.4g}, {:.4g}] {}\n",
                 outside, throws.size(), name, range.low, range.high, range.unit);
  }
}

void predict(const Options& options) {
  require_writable(options.json);
  require_writable(options.csv);
  const UsableCard card = read_usable_card(options.card);
  const std::string& model = card.card.model;
  if (datasets::read_schema_name(options.log) == "slip-log")
    throw datasets::LogError(options.log, "/@schema", "is a slip-log, which holds no throws to predict");
  const auto log = datasets::read_throw_log(options.log);
  if (log.throws.empty()) throw Unanswered(fmt::format("{}: holds no throws", options.log));
  const auto prepared = experiment::prepare_all(log, options.log, options.threads);
  warn_outside(card.card, prepared);
  experiment::CompareOptions compare_options;
  compare_options.models = {model};
  compare_options.threads = options.threads;
  compare_options.parameters.emplace(model, card.parameters);
  const auto comparison = experiment::compare(log, prepared, compare_options);
  const auto& result = comparison.models.front();
  if (result.failed == static_cast<int>(result.throws.size()))
    throw Unanswered(fmt::format("{} brings no throw to a landing: {}", model,
                                 outcome_of(result.throws.front().prediction)));

  Outputs outputs;
  if (!options.json.empty()) {
    Json json = json_head("predict");
    json["log"] = options.log;
    json["card"] = options.card;
    json["model"] = model;
    json["parameters"] = Json::object();
    for (const auto& [name, unit, value] : named_values(model, card.parameters))
      json["parameters"][name] = value;
    json["failed"] = result.failed;
    json["throws"] = Json::array();
    for (std::size_t i = 0; i < prepared.size(); ++i)
      json["throws"].push_back(json_of(result.throws[i], prepared[i]));
    outputs.json(options.json, json);
  }
  if (!options.csv.empty()) outputs.text(options.csv, throw_table(comparison).csv());
  outputs.commit();
  fmt::print("{}: {} throws with {} from {} (errors: predicted - measured)\n\n{}", options.log,
             prepared.size(), model, options.card, table_of(result).text());
}

}  // namespace

Command predict_command(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* parser =
      root.add_subcommand("predict", "Predict each throw of a log with a card's model and parameters");
  parser->add_option("LOG", options->log, "A throw log; outcomes need not be in it")->required();
  parser->add_option("--card", options->card, "The model card")->required();
  parser->add_option("--json", options->json, "Write the predictions as JSON");
  parser->add_option("--csv", options->csv, "Write the predictions as CSV");
  add_threads(*parser, options->threads);
  parser->footer(
      "Cards come from `unhand compare LOG --write-cards DIR`. Existing files are replaced.\n"
      "Example:\n  unhand predict campaign.h5 --card cards/sliding_pivot.json --csv predictions.csv");
  return {parser, [options] { predict(*options); }};
}

}  // namespace unhand::apps
