// unhand fit: the parameters of a model from a log, and the card that carries them.
#include "apps/fit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/compare_figures.hpp"
#include "apps/figure.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "apps/weak_grip.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/summary.hpp"

namespace unhand::apps {
namespace {

constexpr int kDefaultFolds = 5;

bool among(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void require_names(const FitRequest& request) {
  auto models = contact::contact_model_names();
  for (auto& name : surface_model_names()) models.push_back(std::move(name));
  if (!among(models, request.model))
    throw WrongUsage(datasets::unknown_name(fmt::format("--model: '{}' cannot be fitted", request.model),
                                            request.model, models));
  for (const auto& id : request.effects) {
    try {
      fitting::find_effect(id);
    } catch (const std::invalid_argument& error) {
      throw WrongUsage(fmt::format("--effects: {}", error.what()));
    }
    if (std::count(request.effects.begin(), request.effects.end(), id) > 1)
      throw WrongUsage(fmt::format("--effects: {} is named twice", id));
  }
  if (request.kfold == 1) throw WrongUsage("--kfold 1: at least 2 folds, or 0 for none");
}

datasets::ModelCard made_card(const FitAnswer& answer, const FitRequest& request,
                              const datasets::ThrowLog& log) {
  datasets::ModelCard card = card_of(answer.problem, answer.fit, answer.errors, request.log, log);
  if (answer.cross_validation) {
    auto& errors = card.errors["cross_validation"];
    for (int q = 0; q < experiment::kQuantityCount; ++q)
      if (const auto s = answer.cross_validation->statistics(q); s.n > 0)
        errors[experiment::kQuantities[q].key] = {s.n, s.mae, s.std, s.bias};
  }
  card.warnings = fit_warnings(answer, request);
  return card;
}

void write_report(const FitAnswer& answer, const FitRequest& request, const Json& json,
                  const std::filesystem::path& directory) {
  std::string pictures;
  experiment::Comparison comparison;
  comparison.models.push_back(answer.errors);
  if (const auto figure = landing_figure(comparison)) {
    draw(*figure, directory, request.log + ": " + answer.origin);
    pictures = fmt::format("\n![Landing errors]({}.png)\n", figure->name);
  }
  write_text(directory / "report.md", fit_text(answer, request, true) + pictures);
  write_text(directory / "throws.csv", fit_throw_table(answer).csv());
  write_text(directory / "fit.json", json_text(json));
}

void fit_throws(const FitRequest& request, const datasets::ThrowLog& log) {
  fitting::CampaignOptions campaign;
  campaign.model = request.model;
  campaign.effects = request.effects;
  campaign.integrator.tolerances = {request.rtol, 1e-3 * request.rtol};
  campaign.threads = request.threads;
  fitting::FitOptions options;
  options.threads = request.threads;
  options.profile = true;
  const bool has_test = std::any_of(log.throws.begin(), log.throws.end(),
                                    [](const auto& one) { return one.split == datasets::Split::test; });
  int folds = request.kfold > 0 ? request.kfold : has_test ? 0 : kDefaultFolds;
  Progress progress("fit", 3 + (folds > 0 ? 1 : 0) + (request.floor > 0 ? 1 : 0));
  const fitting::CampaignProblem problem(log, request.log, campaign);
  const int conditions = static_cast<int>(datasets::conditions_of(log, datasets::Split::train).size());
  if (folds > 0 && conditions < 2) {
    if (request.kfold > 0)
      throw Unanswered(fmt::format("{}: --kfold needs two conditions among the train throws", request.log));
    tell("unhand: no test throws and one condition only: no held-out errors\n");
    folds = 0;
  }
  if (request.kfold > conditions && folds > 0)
    tell("unhand: --kfold {}: {} folds, as many as the train throws have conditions\n", request.kfold,
         conditions);
  progress.step();
  const auto fit = fitting::fit(problem, options);
  if (fit.outcome == fitting::FitOutcome::no_start || fit.outcome == fitting::FitOutcome::not_solved)
    throw Unanswered(fmt::format("{}: {}", request.log, why_unfitted(fit)));
  progress.step();
  const auto cost = fitting::gradient_cost(problem, fit);
  FitAnswer answer{problem, fit, {}, {}, {}, {}, cost, 1, {}};
  const auto summary = datasets::summarise(log);
  for (const auto& noise : summary.noise)
    if (const auto columns = noise.understated(); !columns.empty())
      answer.understated.push_back(noise.dataset + " scatters by more than it declares, " + columns);
  answer.origin = origin_text(log);
  answer.threads = request.threads > 0 ? request.threads
                                       : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  answer.throws = fitting::predict_throws(problem, fit, {true, request.threads});
  answer.errors = fitting::comparison_of(problem, fit, answer.throws);
  progress.step();
  if (folds > 0)
    answer.cross_validation = fitting::cross_validate(log, request.log, campaign, options, folds);
  if (request.floor > 0)
    answer.floor = fitting::error_floor(log, request.log, problem, fit, options, request.floor);
  for (const auto& warning : fit_warnings(answer, request)) tell("unhand: {}\n", warning);
  tell_weak_grip(answer.errors);

  const Json json = fit_json(answer, request);
  Outputs outputs{{request.log}};
  if (!request.json.empty()) outputs.json(request.json, json);
  if (!request.report.empty()) write_report(answer, request, json, outputs.directory(request.report));
  if (!request.card.empty()) outputs.text(request.card, datasets::to_json(made_card(answer, request, log)));
  outputs.commit();
  fmt::print("{}", fit_text(answer, request, false));
}

void fit(const FitRequest& request, const Parser& parser) {
  require_names(request);
  require_outputs({{request.json}, {request.card}, {request.report, Wanted::directory}}, {request.log});
  if (datasets::read_schema_name(request.log) == "slip-log") {
    require_of_slips(request.model, request.log);
    refuse_options(parser, {"--effects", "--floor", "--rtol"},
                   fmt::format("is for throws; {} holds slips", request.log));
    fit_slips(request);
    return;
  }
  if (!request.report.empty()) require_gnuplot();
  require_of_throws(request.model, request.log);
  const auto log = read_throws(request.log);
  if (std::none_of(log.throws.begin(), log.throws.end(),
                   [](const auto& one) { return one.split == datasets::Split::train; }))
    throw Unanswered(
        fmt::format("{}: holds no train throws to fit to: none of its {} throws has the split 'train'",
                    request.log, log.throws.size()));
  fit_throws(request, log);
}

}  // namespace

Command fit_command(Parser& root) {
  auto request = std::make_shared<FitRequest>();
  Parser& parser = root.subcommand("fit", "Fit a model's parameters to a log and write its card");
  parser.option("LOG", request->log, "A throw log or a slip log").required();
  parser
      .option(
          "--model", request->model,
          fmt::format("Which model: {}; for slip logs: {}", fmt::join(contact::contact_model_names(), ", "),
                      fmt::join(surface_model_names(), ", ")))
      .required();
  parser
      .option("--effects", request->effects,
              "Ids of effects whose parameters are fitted, too, separated by commas")
      .with_commas();
  parser.file("--card", request->card, "Write the model card");
  parser.file("--json", request->json, "Write the fit as JSON");
  parser.file(
      "--report", request->report,
      "A directory for the tables (Markdown) and the JSON; of throws also a figure and all throws (CSV)");
  parser
      .option("--kfold", request->kfold,
              "Cross-validate over so many groups of conditions of the train throws; 0: with 5, and only "
              "if the log has no test throws")
      .range(0, 1000)
      .with_default();
  parser
      .option("--floor", request->floor,
              "Simulate so many twins of the campaign with the fitted model and the declared noise, fit and "
              "predict them alike, and set the errors beside theirs")
      .range(0, 1000)
      .with_default();
  parser.option("--rtol", request->rtol, "Relative tolerance of the integrator")
      .range(1e-12, 1e-3)
      .with_default();
  add_threads(parser, request->threads);
  parser.footer(
      "Train throws only are fitted; the others are predicted. Of slips all are fitted, and errors are of "
      "a cross-validation. Existing files are replaced, each at once.\n"
      "Examples:\n  unhand fit campaign.h5 --model limit_surface --card card.json --report out\n"
      "  unhand fit campaign.h5 --model limit_surface_disc --effects flight.quadratic_drag --card card.json\n"
      "  unhand fit pushes.h5 --model convex_quartic --card felt.json");
  return {&parser, [request, &parser] { fit(*request, parser); }};
}

}  // namespace unhand::apps
