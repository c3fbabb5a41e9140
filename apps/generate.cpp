// unhand generate: a synthetic campaign.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "apps/command.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "experiment/parallel.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::apps {
namespace {

struct Options {
  std::string campaign, out, json;
  std::uint64_t seed{1};
  std::vector<std::string> effects;
  int threads{0};
};

datasets::ThrowLog simulate(const experiment::CampaignDesign& design, const Options& options) {
  datasets::ThrowLog log = experiment::campaign_header(design, options.seed);
  log.throws.resize(static_cast<std::size_t>(design.throws()));
  Progress progress("generate", log.throws.size());
  experiment::parallel_for(log.throws.size(), options.threads, [&](std::size_t i) {
    log.throws[i] = experiment::generate_throw(design, options.seed, static_cast<int>(i)).record;
    progress.step();
  });
  return log;
}

void generate(const Options& options) {
  const auto names = experiment::campaign_names();
  if (std::find(names.begin(), names.end(), options.campaign) == names.end())
    throw WrongUsage(fmt::format("no campaign is called '{}': choose one of {}", options.campaign,
                                 fmt::join(names, ", ")));
  if (!options.effects.empty())
    throw WrongUsage(
        fmt::format("--effect {}: no effects are registered yet; campaigns hold the base physics only",
                    options.effects.front()));
  require_writable(options.out);
  require_writable(options.json);
  const auto design = experiment::campaign_design(options.campaign);
  const auto log = simulate(design, options);
  const auto test = std::count_if(log.throws.begin(), log.throws.end(),
                                  [](const auto& one) { return one.split == datasets::Split::test; });
  Outputs outputs;
  outputs.log(options.out, log);
  if (!options.json.empty()) {
    Json report = json_head("generate");
    report["campaign"] = options.campaign;
    report["seed"] = options.seed;
    report["log"] = options.out;
    report["throws"] = log.throws.size();
    report["train"] = log.throws.size() - static_cast<std::size_t>(test);
    report["test"] = test;
    report["conditions"] = design.conditions();
    report["contact_model"] = design.contact_model;
    outputs.json(options.json, report);
  }
  outputs.commit();
  fmt::print("{}: {} throws of campaign {} ({} train, {} test; {} conditions), seed {}\n", options.out,
             log.throws.size(), options.campaign, log.throws.size() - static_cast<std::size_t>(test), test,
             design.conditions(), options.seed);
}

}  // namespace

Command generate_command(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* parser = root.add_subcommand("generate", "Make the throw log of a synthetic campaign");
  parser
      ->add_option("CAMPAIGN", options->campaign,
                   fmt::format("Which campaign: {}", fmt::join(experiment::campaign_names(), ", ")))
      ->required();
  parser->add_option("--out", options->out, "The throw log to write (replaced if it exists)")->required();
  parser->add_option("--seed", options->seed, "Seed of everything random; the same seed gives the same log")
      ->capture_default_str();
  parser->add_option("--effect", options->effects, "ID=value: an effect to add (none are registered yet)");
  parser->add_option("--json", options->json, "Write what was made as JSON");
  add_threads(*parser, options->threads);
  parser->footer("Example:\n  unhand generate batch180 --seed 7 --out campaign.h5");
  return {parser, [options] { generate(*options); }};
}

}  // namespace unhand::apps
