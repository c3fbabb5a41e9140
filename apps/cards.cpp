#include "apps/cards.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "apps/command.hpp"
#include "apps/output.hpp"
#include "apps/tell.hpp"
#include "contact/gripper_delay.hpp"
#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/effect.hpp"
#include "fitting/measured/measured_card.hpp"

namespace unhand::apps {
namespace {

namespace fs = std::filesystem;
using datasets::CardError;
using datasets::ModelCard;

/// The parameters of a card, asked for by name.
class Reader {
 public:
  Reader(std::string file, const ModelCard& card) : file_(std::move(file)), card_(card) {}

  [[noreturn]] void fail(const std::string& path, const std::string& why) const {
    throw CardError(file_, path, why);
  }

  double take(const std::string& name, const std::string& unit, double low, double high) {
    const auto found = card_.parameters.find(name);
    if (found == card_.parameters.end())
      fail("/parameters/" + name, fmt::format("is missing: {} takes it", card_.model));
    asked_.push_back(name);
    const double value = found->second.value;
    const std::string& given = found->second.unit;
    if (given != unit) fail("/parameters/" + name + "/unit", fmt::format("is '{}', not '{}'", given, unit));
    if (!(value >= low && value <= high))
      fail("/parameters/" + name + "/value",
           fmt::format("{} is not in [{}, {}]{}", value, low, high, dynamics::after_number(unit)));
    return value;
  }

  double take_or(const std::string& name, const std::string& unit, double low, double high,
                 double otherwise) {
    return card_.parameters.contains(name) ? take(name, unit, low, high) : otherwise;
  }

  void reject_unknown() const {
    for (const auto& [name, ignored] : card_.parameters)
      if (std::find(asked_.begin(), asked_.end(), name) == asked_.end())
        fail("/parameters/" + name,
             fmt::format("is not what is taken of a card of {} without covariance and spreads: {}",
                         card_.model, fmt::join(asked_, ", ")));
  }

 private:
  std::string file_;
  const ModelCard& card_;
  std::vector<std::string> asked_;
};

datasets::CardLog log_of(const fs::path& file, const datasets::ThrowLog& log) {
  std::set<std::string> surfaces;
  for (const auto& one : log.throws)
    if (const auto& object = log.objects.at(one.object);
        one.split == datasets::Split::train && object.surface && !object.surface->empty())
      surfaces.insert(*object.surface);
  return {utf8_name(file), log.title, fitting::checksum_of(file), {surfaces.begin(), surfaces.end()}};
}

}  // namespace

std::vector<NamedValue> named_values(const std::string& model, const experiment::ModelParameters& p) {
  if (!contact::follows_pads(model)) {
    std::vector<NamedValue> out{{"delay", "s", p.delay.centre}};
    if (p.delay.kind == contact::DelayDistribution::Kind::truncated_normal)
      out.push_back({"delay_sigma", "s", p.delay.spread});
    return out;
  }
  std::vector<NamedValue> out{
      {"mu", "-", p.mu}, {"length", "m", p.length}, {"pads", "-", static_cast<double>(p.pads)}};
  for (const auto& [own, value] : contact::given_law_parameters(model, p.law_values))
    out.push_back({own.name, own.unit, value});
  return out;
}

std::vector<NamedValue> named_values(const experiment::ModelComparison& model) {
  if (model.named.empty()) return named_values(model.model, model.estimate.parameters);
  std::vector<NamedValue> out;
  for (const auto& [name, unit, value, sigma] : model.named) out.push_back({name, unit, value});
  return out;
}

datasets::ModelCard read_card(const fs::path& file) {
  datasets::ModelCard card = datasets::read_model_card(file);
  for (const std::string& warning : card.warnings) tell("unhand: {}: {}\n", file.string(), warning);
  return card;
}

UsableCard read_usable_card(const fs::path& file) {
  UsableCard out{read_card(file), file.string(), false, {}};
  Reader reader(file.string(), out.card);
  if (fitting::is_of_free_motion(out.card))
    reader.fail("/model",
                fmt::format("'{}' knows neither a hand nor how a flight starts, and predicts no throw: "
                            "`unhand compare LOG --card FILE` holds it against a log of its kind",
                            out.card.model));
  if (fitting::is_fitted(out.card)) {
    out.fitted = true;
    fitting::options_of(out.card, out.file);
    return out;
  }
  const auto models = experiment::release_model_names();
  if (std::find(models.begin(), models.end(), out.card.model) == models.end())
    reader.fail("/model", datasets::unknown_name(fmt::format("'{}' is no model of releases", out.card.model),
                                                 out.card.model, models));
  auto& p = out.parameters;
  if (!contact::follows_pads(out.card.model)) {
    const double delay = reader.take("delay", "s", 0, 10),
                 sigma = reader.take_or("delay_sigma", "s", 0, 10, 0);
    p.delay = sigma > 0 ? contact::DelayDistribution::normal(delay, sigma, std::max(0.1, 2 * delay))
                        : contact::DelayDistribution::number(delay);
  } else {
    p.mu = reader.take("mu", "-", 0, contact::kMostMu);
    p.length = reader.take("length", "m", 1e-9, contact::kUniformDisc);
    const double pads = reader.take_or("pads", "-", 1, 1000, 2);
    if (pads != std::floor(pads))
      reader.fail("/parameters/pads/value", fmt::format("{} is not a whole number", pads));
    p.pads = static_cast<int>(pads);
    for (const auto& own : contact::law_parameters(out.card.model))
      if (out.card.parameters.contains(own.name))
        p.law_values[own.name] = reader.take(own.name, own.unit, own.low, own.high);
  }
  reader.reject_unknown();
  return out;
}

std::map<std::string, UsableCard> read_usable_cards(const std::vector<std::string>& files,
                                                    std::vector<std::string>& models, bool named) {
  std::map<std::string, UsableCard> out;
  for (const auto& file : files) {
    const UsableCard card = read_usable_card(file);
    const std::string& model = card.card.model;
    if (!out.emplace(model, card).second) throw WrongUsage(fmt::format("two cards for model '{}'", model));
    if (std::find(models.begin(), models.end(), model) != models.end()) continue;
    if (named) throw WrongUsage(fmt::format("{}: a card for '{}', which is not among --models", file, model));
    models.push_back(model);
  }
  return out;
}

experiment::FrictionEstimate estimated(const datasets::ThrowLog& log,
                                       const std::vector<experiment::PreparedThrow>& throws,
                                       const std::string& model) {
  try {
    auto out = experiment::estimate_friction(log, throws, model);
    experiment::require_patch(out, model);
    return out;
  } catch (const experiment::Undetermined& error) {
    const std::string advice =
        !contact::follows_pads(model) ? error.advice
        : model == release::kNaiveModel
            ? std::string("give a card (--card)")
            : fmt::format("give a card (--card), as `unhand fit LOG --model {} --card FILE` makes it", model);
    throw Unanswered(fmt::format("{}: {}; {}", model, error.reason, advice));
  }
}

ModelCard card_of(const experiment::ModelComparison& model, const fs::path& log_file,
                  const datasets::ThrowLog& log, const std::vector<experiment::PreparedThrow>& throws) {
  ModelCard card;
  card.model = model.model;
  for (const auto& [name, unit, value] : named_values(model.model, model.estimate.parameters))
    card.parameters[name] = {value, {}, unit};
  card.log = log_of(log_file, log);
  card.split = "train";
  card.valid_range = fitting::valid_range_of(throws);
  card.library_version = datasets::library_version();
  return card;
}

ModelCard card_of(const fitting::CampaignProblem& problem, const fitting::FitResult& fit,
                  const experiment::ModelComparison& errors, const fs::path& log_file,
                  const datasets::ThrowLog& log) {
  ModelCard card = fitting::card_of(problem, fit);
  card.log = log_of(log_file, log);
  for (const auto split : {datasets::Split::train, datasets::Split::test})
    if (auto found = fitting::errors_of(errors, split); !found.empty())
      card.errors[to_string(split)] = std::move(found);
  return card;
}

CardPredictions predict_with(const UsableCard& card, const datasets::ThrowLog& log, const std::string& file,
                             const fitting::EvaluateOptions& options,
                             const dynamics::IntegratorOptions& integrator) {
  auto campaign = fitting::options_of(card.card, card.file);
  campaign.threads = options.threads;
  campaign.integrator = integrator;
  CardPredictions out{fitting::CampaignProblem(log, file, campaign), {}, {}};
  const auto fit = fitting::fit_of(card.card, out.problem, card.file);
  out.throws = fitting::predict_throws(out.problem, fit, options);
  out.comparison = fitting::comparison_of(out.problem, fit, out.throws);
  out.comparison.from_card = true;
  out.comparison.estimate.method = "from the card";
  return out;
}

}  // namespace unhand::apps
