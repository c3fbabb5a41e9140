// unhand compare: models against the measured outcomes of a log.
#include "apps/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>

#include "apps/command.hpp"
#include "apps/compare_run.hpp"
#include "apps/figure.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "apps/weak_grip.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "experiment/free_flight.hpp"
#include "experiment/friction_estimate.hpp"

namespace unhand::apps {
namespace {

std::vector<std::string> known_models() {
  auto names = experiment::release_model_names();
  names.emplace_back(experiment::kProjectile);
  for (const auto& model : surface_model_names()) names.push_back(model);
  return names;
}

void require_models(const std::vector<std::string>& models) {
  const auto known = known_models();
  std::set<std::string> seen;
  for (const auto& model : models) {
    if (std::find(known.begin(), known.end(), model) == known.end())
      throw WrongUsage(
          datasets::unknown_name(fmt::format("--models: there is no model '{}'", model), model, known));
    if (!seen.insert(model).second) throw WrongUsage(fmt::format("model '{}' is named twice", model));
  }
}

/// All release models but the naive one, which is there to be asked for.
std::vector<std::string> usual_models() {
  auto names = experiment::release_model_names();
  std::erase(names, release::kNaiveModel);
  return names;
}

/// Tells of predictions that failed; if none of any model succeeded, there is no answer.
void report_failures(const experiment::Comparison& comparison) {
  bool any = false;
  for (const auto& model : comparison.models) {
    any = any || model.failed < static_cast<int>(model.throws.size());
    std::map<std::string, int> reasons;
    for (const auto& one : model.throws)
      if (!one.prediction.landed()) ++reasons[outcome_in_words(one.prediction)];
    for (const auto& [reason, n] : reasons)
      tell("unhand: {}: {} of {} throws: {}\n", model.model, n, model.throws.size(), reason);
  }
  if (!any) throw Unanswered("no model brought any throw to a landing");
}

/// A model that has no place in the comparison.
struct NotCompared {
  std::string model, reason;
  std::string advice;  ///< empty: none
};

/// A line per reason with the models that it stops, then what helps, once.
void tell_not_compared(const std::vector<NotCompared>& all) {
  std::vector<std::pair<std::string, std::vector<std::string>>> by_reason;
  std::set<std::string> advice;
  for (const auto& one : all) {
    if (!one.advice.empty()) advice.insert(one.advice);
    const auto same = std::find_if(by_reason.begin(), by_reason.end(),
                                   [&](const auto& told) { return told.first == one.reason; });
    if (same == by_reason.end())
      by_reason.push_back({one.reason, {one.model}});
    else
      same->second.push_back(one.model);
  }
  for (const auto& [reason, models] : by_reason)
    tell("unhand: {}: not compared: {}\n", fmt::join(models, ", "), reason);
  for (const auto& helps : advice) tell("unhand: {}\n", helps);
}

/// Whether what it follows is a measured normal force: neither a fit nor a card says how the pads open.
bool follows_measured_force(const std::string& model, const CompareRequest& request,
                            const std::map<std::string, UsableCard>& cards) {
  return contact::follows_pads(model) && !request.fit && !cards.contains(model);
}

void compare_releases(const CompareRequest& request, datasets::ThrowLog log) {
  const bool named = !request.models.empty();
  auto models = named ? request.models : usual_models();
  const auto cards = read_usable_cards(request.cards, models, named);
  // All models have the same throws.
  if (std::any_of(models.begin(), models.end(),
                  [&](const auto& model) { return follows_measured_force(model, request, cards); }))
    leave_out_forceless(log);
  const auto prepared = experiment::prepare_all(log, request.log, request.threads, false);
  ReleaseRun run(request, log, prepared);
  std::vector<NotCompared> unanswered;
  {
    Progress progress(request.fit ? "fit" : "simulate", models.size());
    for (const auto& model : models) {
      const auto card = cards.find(model);
      try {
        run.add(model, card == cards.end() ? nullptr : &card->second);
      } catch (const experiment::Undetermined& error) {
        unanswered.push_back({model, error.reason, error.advice});
      } catch (const std::invalid_argument& error) {
        unanswered.push_back({model, error.what(), {}});
      } catch (const Unanswered& error) {
        unanswered.push_back({model, error.what(), {}});
      }
      progress.step();
    }
  }
  const experiment::Comparison& comparison = run.comparison();
  tell_not_compared(unanswered);
  if (comparison.models.empty()) throw Unanswered("no model is left to compare");
  report_failures(comparison);
  for (const auto& model : comparison.models) tell_weak_grip(model);

  const ReleaseTables tables = release_tables(comparison, log, request.log);
  Json json = release_json(comparison, request);
  json["source"] = log.source;
  for (const auto& [model, reason, advice] : unanswered)
    json["not_compared"][model] = reason + (advice.empty() ? "" : "; " + advice);
  Outputs outputs{request.inputs()};
  if (!request.json.empty()) outputs.json(request.json, json);
  if (!request.report.empty())
    write_release_report(comparison, log, tables, json, outputs.directory(request.report));
  if (!request.write_cards.empty()) {
    const auto directory = outputs.directory(request.write_cards);
    for (const auto& [model, card] : run.cards())
      datasets::write_model_card(directory / (model + ".json"), card);
  }
  outputs.commit();
  fmt::print("{}\n{}\n{}\nbias (predicted - measured)\n{}\nparameters\n{}{}\n", tables.heading,
             tables.errors.text(), tables.floor, tables.bias.text(), tables.parameters.text(),
             fmt::join(tables.methods, "\n"));
}

/// Refuses what only releases are integrated with, and what only the naive limit surface takes.
void refuse_unused(const CompareRequest& request, const Parser& parser, bool releases) {
  if (!releases)
    refuse_options(parser, {"--rtol", "--naive-step", "--naive-smoothing"},
                   "only throws from a hand are integrated so");
  const auto& models = request.models;
  if (std::find(models.begin(), models.end(), release::kNaiveModel) == models.end())
    refuse_options(parser, {"--naive-step", "--naive-smoothing"},
                   fmt::format("of {}, which --models does not name", release::kNaiveModel));
}

void compare(const CompareRequest& request, const Parser& parser) {
  require_models(request.models);
  require_outputs(
      {{request.json}, {request.report, Wanted::directory}, {request.write_cards, Wanted::directory}},
      request.inputs());
  if (!request.report.empty()) require_gnuplot();
  if (datasets::read_schema_name(request.log) == "slip-log") {
    for (const auto& model : request.models) require_of_slips(model, request.log);
    if (!request.fit)
      throw WrongUsage(
          fmt::format("{} is a slip-log, whose surfaces are compared by fitting: add --fit", request.log));
    refuse_unused(request, parser, false);
    compare_slips(request);
    return;
  }
  auto log = read_throws(request.log);
  const bool flights = is_of_flights(log);
  if (flights) require_flights(log, request.log);
  for (const auto& model : request.models) {
    require_of_throws(model, request.log);
    const auto releases = experiment::release_model_names();
    const bool of_release = std::find(releases.begin(), releases.end(), model) != releases.end();
    if (of_release && flights)
      throw datasets::LogError(request.log, "/throws",
                               fmt::format("free flights, which {} does not predict: it needs "
                                           "a hand in the plane (use projectile)",
                                           model));
    if (!of_release && !flights)
      throw datasets::LogError(request.log, "/throws",
                               fmt::format("throws from a hand, which {} does not predict: it "
                                           "is for free flights",
                                           model));
  }
  refuse_unused(request, parser, !flights);
  if (flights && request.fit)
    throw Unanswered("free flights hold nothing to fit here: leave out --fit, or use `unhand discover`");
  if (!flights) return compare_releases(request, std::move(log));
  request.cards.empty() ? compare_flights(request, log) : compare_with_card(request, log);
}

}  // namespace

void answer_with(const CompareRequest& request, const std::string& heading, const Table& table,
                 const Json& json,
                 const std::function<void(const std::filesystem::path& directory)>& report) {
  Outputs outputs{request.inputs()};
  if (!request.json.empty()) outputs.json(request.json, json);
  if (!request.report.empty()) {
    const auto directory = outputs.directory(request.report);
    report(directory);
    write_text(directory / "compare.json", json_text(json));
  }
  outputs.commit();
  fmt::print("{}\n{}", heading, table.text());
}

std::string outcome_of(const experiment::Prediction& prediction) {
  if (prediction.landed()) return "landed";
  return prediction.release == release::ReleaseOutcome::detached ? to_string(prediction.flight)
                                                                 : to_string(prediction.release);
}

std::string outcome_in_words(const experiment::Prediction& prediction) {
  return prediction.release == release::ReleaseOutcome::detached ? in_words(prediction.flight)
                                                                 : in_words(prediction.release);
}

Command compare_command(Parser& root) {
  auto request = std::make_shared<CompareRequest>();
  Parser& parser = root.subcommand("compare", "Models against the measured outcomes of a log");
  parser.option("LOG", request->log, "A throw log or a slip log").required();
  parser
      .option("--models", request->models,
              fmt::format(
                  "Which models, separated by commas: {}. Without it, all release models but {}; for free "
                  "flights, projectile; for slip logs (with --fit), all surfaces",
                  fmt::join(known_models(), ", "), release::kNaiveModel))
      .with_commas();
  parser.flag(
      "--fit", request->fit,
      "Fit the models to the log's train throws (see `unhand fit`), or to its slips, which slip logs need");
  parser.option(
      "--card", request->cards,
      "A model card: its parameters are used for its model; may be repeated (free flights and falls: "
      "one, of `unhand discover --card`)");
  parser.file("--json", request->json, "Write the comparison as JSON");
  parser.file("--report", request->report,
              "A directory for figures, tables (Markdown), per-throw errors (CSV) and the JSON");
  parser.file("--write-cards", request->write_cards,
              "A directory for the estimated or fitted parameters as model cards");
  parser.option("--naive-step", request->naive.step, "Step of limit_surface_naive [s]")
      .range(1e-7, 0.1)
      .with_default();
  parser
      .option("--naive-smoothing", request->naive.smoothing, "Viscous smoothing of limit_surface_naive [m/s]")
      .range(0.0, 10.0)
      .with_default();
  parser.option("--rtol", request->rtol, "Relative tolerance of the integrator")
      .range(1e-13, 1e-2)
      .with_default();
  add_threads(parser, request->threads);
  parser.footer(
      "Parameters that no card gives are estimated from the train throws. Existing files are replaced.\n"
      "Examples:\n  unhand compare campaign.h5 --models sliding_pivot,limit_surface --report out\n"
      "  unhand compare campaign.h5 --models sliding_pivot,limit_surface,gripper_delay --fit --json "
      "out.json\n"
      "  unhand compare cubes.h5 --models projectile --json flights.json\n"
      "  unhand compare cubes.h5 --card discovered.json\n"
      "  unhand compare pushes.h5 --models ellipsoid,convex_quartic --fit --report out");
  return {&parser, [request, &parser] { compare(*request, parser); }};
}

}  // namespace unhand::apps
