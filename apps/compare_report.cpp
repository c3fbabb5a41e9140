// The answer of `unhand compare` on releases: tables, JSON and the report.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "apps/cards.hpp"
#include "apps/compare.hpp"
#include "apps/compare_figures.hpp"
#include "apps/throws.hpp"
#include "apps/weak_grip.hpp"
#include "dynamics/effect.hpp"

namespace unhand::apps {
namespace {

using datasets::Split;
using experiment::ModelComparison;

struct Count {
  int throws{}, failed{};
};
Count count(const ModelComparison& model, Split split) {
  Count out;
  for (const auto& one : model.throws) {
    if (one.split != split) continue;
    ++out.throws;
    out.failed += !one.prediction.landed();
  }
  return out;
}

Json split_json(const ModelComparison& model, Split split) {
  const Count counted = count(model, split);
  Json out{{"n", counted.throws}, {"failed", counted.failed}};
  for (int q = 0; q < experiment::kQuantityCount; ++q)
    out[experiment::kQuantities[q].key] = statistics_json(model.statistics(q, split));
  return out;
}

}  // namespace

Json statistics_json(const experiment::ErrorStatistics& s) {
  Json out{{"n", s.n}, {"mae", nullptr}, {"std", nullptr}, {"bias", nullptr}};
  if (s.n > 0) out["mae"] = s.mae, out["bias"] = s.bias;
  if (s.n > 1) out["std"] = s.std;
  return out;
}

ReleaseTables release_tables(const experiment::Comparison& comparison, const datasets::ThrowLog& log,
                             const std::string& file) {
  ReleaseTables out;
  std::array<int, 2> n{};
  for (const auto& one : log.throws) ++n[one.split == Split::test];
  out.heading = fmt::format(
      "{}: {}\n{} throws ({} train, {} test), {}; mean absolute error ± its standard deviation\n", file,
      origin_text(log), log.throws.size(), n[0], n[1], plural(comparison.conditions.size(), "condition"));
  out.errors.left = out.bias.left = 2;
  out.errors.header = out.bias.header = {"model", "throws", "n", "failed"};
  for (const auto& quantity : experiment::kQuantities) {
    out.errors.header.push_back(quantity.title);
    out.bias.header.push_back(quantity.title);
  }
  out.errors.header.push_back("us/throw");
  for (const Split split : {Split::train, Split::test}) {
    for (const auto& model : comparison.models) {
      const Count counted = count(model, split);
      std::vector<std::string> row{model.model, to_string(split), fmt::to_string(counted.throws),
                                   fmt::to_string(counted.failed)};
      auto bias = row;
      for (int q = 0; q < experiment::kQuantityCount; ++q) {
        const auto s = model.statistics(q, split);
        const bool of_all = s.n == 0 || s.n == counted.throws;
        row.push_back(mean_and_spread(s.n, s.mae, s.std, experiment::kQuantities[q].decimals) +
                      (of_all ? "" : fmt::format(" (of {})", s.n)));
        bias.push_back(s.n > 0 ? fmt::format("{:+.{}f}", s.bias, experiment::kQuantities[q].decimals) : "-");
      }
      row.push_back(fmt::format("{:.0f}", model.microseconds_per_throw));
      out.errors.rows.push_back(std::move(row));
      out.bias.rows.push_back(std::move(bias));
    }
  }
  const auto& floor = comparison.repetitions;
  out.floor = floor.conditions > 0
                  ? fmt::format(
                        "scatter of repetitions: landing x {} m, landing theta {} deg (pooled 1 sigma, "
                        "{}): the floor of a model that knows of a throw only its condition\n",
                        fixed(floor.landing_x.has_value(), floor.landing_x.value_or(0), 4),
                        fixed(floor.landing_theta.has_value(), floor.landing_theta.value_or(0), 2),
                        plural(static_cast<std::size_t>(floor.conditions), "condition"))
                  : "scatter of repetitions: no condition was repeated with its landing measured\n";
  out.parameters = {{"model", "parameters", "how", "samples", "scatter"}, {}, 3};
  std::vector<std::string> known;
  for (const auto& model : comparison.models) {
    std::string values;
    for (const auto& [name, unit, value] : named_values(model))
      values += fmt::format("{}{} = {:.5g}{}", values.empty() ? "" : ", ", name, value,
                            dynamics::after_number(unit));
    const bool sampled = model.estimate.samples > 0;
    const auto method = std::find(known.begin(), known.end(), model.estimate.method) - known.begin();
    const std::string number = fmt::format("[{}]", method + 1);
    if (method == std::ssize(known)) {
      known.push_back(model.estimate.method);
      out.methods.push_back(number + " " + model.estimate.method);
    }
    out.parameters.rows.push_back({model.model, values, number,
                                   sampled ? fmt::to_string(model.estimate.samples) : "-",
                                   fixed(sampled, model.estimate.scatter, 3)});
  }
  return out;
}

Json release_json(const experiment::Comparison& comparison, const CompareRequest& request) {
  Json out = json_head("compare");
  out["log"] = request.log;
  out["settings"] = {{"rtol", request.rtol},
                     {"naive_step_s", request.naive.step},
                     {"naive_smoothing_m_s", request.naive.smoothing}};
  out["conditions"] = comparison.conditions.size();
  const auto& floor = comparison.repetitions;
  out["repetition_scatter"] = {{"conditions", floor.conditions},
                               {"landing_x_m", number(floor.landing_x)},
                               {"landing_theta_deg", number(floor.landing_theta)}};
  out["inputs"] = {{"worst_hand_chi2_per_dof", comparison.worst_hand_chi2},
                   {"mean_normal_force_chi2_per_dof", number(comparison.mean_force_chi2)}};
  Json& models = out["models"] = Json::object();
  for (const auto& model : comparison.models) {
    Json& one = models[model.model];
    Json parameters = Json::object(), units = Json::object();
    for (const auto& [name, unit, value] : named_values(model)) {
      parameters[name] = value;
      units[name] = unit;
    }
    one["parameters"] = parameters;
    one["parameter_units"] = units;
    for (const auto& [name, unit, value, sigma] : model.named) one["parameter_sigmas"][name] = sigma;
    one["estimate"] = {{"from_card", model.from_card},
                       {"method", model.estimate.method},
                       {"samples", model.estimate.samples},
                       {"scatter", model.estimate.scatter}};
    one["failed"] = model.failed;
    one["slips_at_start"] = slips_at_start(model);
    for (const Split split : {Split::train, Split::test}) one[to_string(split)] = split_json(model, split);
    one["microseconds_per_throw"] = model.microseconds_per_throw;
  }
  return out;
}

Table throw_table(const experiment::Comparison& comparison, const datasets::ThrowLog& log) {
  Table out{{"throw", "object", "condition", "split", "model", "outcome", "detach_time_s", "detach_vx_m_s",
             "detach_vz_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"},
            {},
            6};
  for (const auto& quantity : experiment::kQuantities)
    out.header.push_back(std::string("error_") + quantity.key);
  for (const auto& model : comparison.models)
    for (const auto& one : model.throws) {
      const auto& p = one.prediction;
      const bool detached = p.release == release::ReleaseOutcome::detached;
      std::vector<std::string> row{one.id,
                                   one.object,
                                   one.condition,
                                   to_string(one.split),
                                   model.model,
                                   outcome_of(p),
                                   all_digits(detached, p.detach.time + log.clock_origin),
                                   all_digits(detached, p.detach.twist.vx),
                                   all_digits(detached, p.detach.twist.vz),
                                   all_digits(detached, p.detach.twist.omega * experiment::kDegrees),
                                   all_digits(p.landed(), p.landing.pose.x),
                                   all_digits(p.landed(), p.landing.pose.theta * experiment::kDegrees)};
      for (const auto& error : one.error) row.push_back(all_digits(error.has_value(), error.value_or(0)));
      out.rows.push_back(std::move(row));
    }
  return out;
}

void write_release_report(const experiment::Comparison& comparison, const datasets::ThrowLog& log,
                          const ReleaseTables& tables, const Json& json,
                          const std::filesystem::path& directory) {
  std::string pictures;
  if (const auto figure = landing_figure(comparison)) {
    draw(*figure, directory, origin_text(log));
    pictures += fmt::format("![Landing errors]({}.png)\n\n", figure->name);
  }
  if (const auto figure = condition_figure(comparison)) {
    draw(*figure, directory, origin_text(log));
    pictures += fmt::format("![Errors of each condition]({}.png)\n\n", figure->name);
  }
  write_text(
      directory / "report.md",
      fmt::format("# Models against a log\n\n{}\n{}\n{}\n{}## Bias (predicted - measured)\n\n{}\n"
                  "## Parameters\n\n{}\n{}\n",
                  markdown_text(tables.heading), tables.errors.markdown(), tables.floor, pictures,
                  tables.bias.markdown(), tables.parameters.markdown(), fmt::join(tables.methods, "\n\n")));
  write_text(directory / "throws.csv", throw_table(comparison, log).csv());
  write_text(directory / "compare.json", json_text(json));
}

}  // namespace unhand::apps
