// unhand validate-sku: whether an object can be thrown with a gripper so that it lands as predicted.
#include "apps/validate_sku.hpp"

#include <fmt/format.h>

#include <memory>
#include <numbers>
#include <set>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/progress.hpp"
#include "apps/throws.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::apps {
namespace {

struct ValidateSkuOptions {
  std::string sku, card, log, condition, json, report;
  std::vector<double> tolerance{0.05, 45};  ///< m, deg
  fitting::SkuRequest request;
};

void write_report(const SkuQuestion& question, const fitting::SkuValidation& answer, const Json& json,
                  const std::filesystem::path& directory) {
  std::string pictures, about = "predicted from " + question.card_file;
  if (const auto* log = question.request.log) about += "; measured: " + origin_text(*log);
  const auto add = [&](const Figure& figure, const char* title) {
    draw(figure, directory, about);
    pictures += fmt::format("\n![{}]({}.png)\n", title, figure.name);
  };
  if (!answer.samples.empty()) add(sku_landing_figure(question, answer), "Landings about the predicted one");
  if (!answer.budget.empty()) add(sku_budget_figure(question, answer), "What the spread is made of");
  write_text(directory / "report.md", sku_text(question, answer, true) + pictures);
  write_text(directory / "validate-sku.json", json_text(json));
}

void validate(ValidateSkuOptions options) {
  if (options.tolerance.size() != 2 || !(options.tolerance[0] > 0) || !(options.tolerance[1] > 0))
    throw WrongUsage("--tolerance takes two positive numbers, METRES,DEGREES, for example 0.05,45");
  constexpr double kMostMetres = 100, kMostDegrees = 57000;  // of SkuRequest's tolerance
  if (options.tolerance[0] > kMostMetres || options.tolerance[1] > kMostDegrees)
    throw WrongUsage(fmt::format("--tolerance: {:g} m, {:g} degrees; accepted: up to {:g} m, {:g} degrees",
                                 options.tolerance[0], options.tolerance[1], kMostMetres, kMostDegrees));
  require_outputs({{options.json}, {options.report, Wanted::directory}},
                  {options.sku, options.card, options.log});
  if (!options.report.empty()) require_gnuplot();
  SkuQuestion question{options.sku, options.card, options.log, read_throwable_sku(options.sku), {}, {}};
  question.card = read_usable_card(options.card).card;
  std::optional<datasets::ThrowLog> log;
  question.request = options.request;
  auto& request = question.request;
  request.tolerance = {options.tolerance[0], options.tolerance[1] * std::numbers::pi / 180};
  if (!options.log.empty()) {
    log = read_throws(options.log);
    request.log = &*log;
    request.log_file = options.log;
  }
  if (!options.condition.empty()) {
    if (!log) throw WrongUsage("--condition names one of a log's: give --log, too");
    std::set<std::string> known;
    for (const auto& one : log->throws) known.insert(one.condition);
    if (!known.contains(options.condition))
      throw WrongUsage(
          datasets::unknown_name(fmt::format("--condition: {} has no '{}'", options.log, options.condition),
                                 options.condition, {known.begin(), known.end()}));
    request.condition = options.condition;
  }
  const auto answer = [&] {
    const Progress progress("validate-sku", 0);
    return fitting::validate_sku(question.sku, question.card, options.card, request);
  }();
  const Json json = sku_json(question, answer);
  Outputs outputs{{options.sku, options.card, options.log}};
  if (!options.json.empty()) outputs.json(options.json, json);
  if (!options.report.empty()) write_report(question, answer, json, outputs.directory(options.report));
  outputs.commit();
  fmt::print("{}", sku_text(question, answer, false));
}

}  // namespace

Command validate_sku_command(Parser& root) {
  auto options = std::make_shared<ValidateSkuOptions>();
  auto& assumed = options->request.assumed;
  Parser& parser = root.subcommand(
      "validate-sku", "Can this object be thrown with this gripper, so that it lands as predicted?");
  parser.option("SKU", options->sku, "The object as an SKU file (TOML)").required();
  parser.file("--card", options->card, "The gripper's model card, of `unhand fit`").required();
  parser.file("--log", options->log,
              "Throws whose motion and normal force are taken; those of this object are judged");
  parser.option("--condition", options->condition,
                "Which of the log's conditions; otherwise that with the least spread");
  parser.option("--tolerance", options->tolerance, "METRES,DEGREES about the predicted landing")
      .with_commas()
      .with_default();
  parser.option("--confidence", options->request.confidence, "Share of throws that must land within it")
      .range(0.01, 0.9999)
      .with_default();
  parser
      .option("--other-surface", assumed.other_surface,
              "Relative 1 sigma of mu for a surface that the card's log did not have, 0.2 say")
      .range(0.0, 2.0)
      .with_default();
  parser.option("--samples", options->request.samples, "Draws of the Monte Carlo")
      .range(100, 1'000'000)
      .with_default();
  parser.option("--seed", options->request.seed, "Of the draws").with_default();
  parser.file("--json", options->json, "Write the answer as JSON");
  parser.file("--report", options->report, "A directory for the tables (Markdown), figures and JSON");
  add_threads(parser, options->request.threads);
  parser.footer(
      "Without --log, the motion is the middle flip of the synthetic campaign batch180 and the gripper\n"
      "opens as the card's valid range says. Existing files are replaced.\n"
      "Examples:\n  unhand validate-sku jar.toml --card card.json --report out\n"
      "  unhand validate-sku bar.toml --card card.json --log campaign.h5 --tolerance 0.05,45");
  return {&parser, [options] { validate(*options); }};
}

}  // namespace unhand::apps
