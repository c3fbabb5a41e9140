#include "fitting/discovery/discover.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include "contact/gripper_delay.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "experiment/throw_setup.hpp"
#include "fitting/clock.hpp"
#include "fitting/discovery/discrepancy.hpp"
#include "fitting/discovery/held_out_split.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/outcome_errors.hpp"
#include "fitting/discovery/pads_give.hpp"
#include "fitting/discovery/selection.hpp"
#include "fitting/discovery/separating.hpp"
#include "fitting/discovery/unexplained.hpp"

namespace unhand::fitting {

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::effect_found:
      return "effect_found";
    case Verdict::no_missing_effect:
      return "no_missing_effect";
    case Verdict::unexplained:
      return "unexplained";
    case Verdict::not_answered:
      return "not_answered";
  }
  return "";
}

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::position:
      return "position in flight";
    case Outcome::orientation:
      return "orientation in flight";
    case Outcome::landing_x:
      return "landing x";
    case Outcome::landing_theta:
      return "landing theta";
  }
  return "";
}

const char* unit_of(Outcome outcome) {
  return outcome == Outcome::orientation || outcome == Outcome::landing_theta ? "rad" : "m";
}

void validate(const DiscoverOptions& options) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("{} = {} is not in {}", name, value, range));
  };
  for (const auto& [name, value] : {std::pair{"matters", options.matters},
                                    {"wrench_matters", options.wrench_matters},
                                    {"wrench_misfit", options.wrench_misfit},
                                    {"law_matters", options.law_matters}})
    require(value > 0 && std::isfinite(value), name, value, "(0, inf)");
  for (const auto& [name, value] :
       {std::pair{"prediction_matters", options.prediction_matters}, {"unexplained", options.unexplained}})
    require(value >= 1 && std::isfinite(value), name, value, "[1, inf)");
  require(options.family_wise_level > 0 && options.family_wise_level < 1, "family_wise_level",
          options.family_wise_level, "(0, 1)");
  require(options.equivalent > 0 && options.equivalent <= 1, "equivalent", options.equivalent, "(0, 1]");
  require(options.refits >= 1, "refits", options.refits, "[1, inf)");
  require(options.most_effects >= 0, "most_effects", options.most_effects, "[0, inf)");
  std::vector<std::string> known;
  for (const auto& effect : experiment::known_effects()) known.push_back(effect.id);
  for (const auto& law : contact::pad_law_names()) known.push_back(std::string(kLaw) + law);
  for (const auto& id : options.forget)
    if (std::find(known.begin(), known.end(), id) == known.end())
      throw std::invalid_argument(
          datasets::unknown_name(fmt::format("forget: there is no effect '{}'", id), id, known));
  for (const auto& law : options.laws)
    if (std::find(known.begin(), known.end(), std::string(kLaw) + law) == known.end())
      throw std::invalid_argument(
          fmt::format("laws: {} is no contact law whose pads press on the object", law));
}

std::string PredictionGain::in_words() const {
  return fmt::format("{:.3g} to {:.3g} mm, {:.3g} to {:.3g} deg rms", 1e3 * position.before,
                     1e3 * position.after, angle.before * experiment::kDegrees,
                     angle.after * experiment::kDegrees);
}

const char* to_string(Fate fate) {
  switch (fate) {
    case Fate::not_refitted:
      return "not refitted";
    case Fate::no_fit:
      return "no fit";
    case Fate::not_significant:
      return "not significant";
    case Fate::too_small:
      return "too small";
    case Fate::outdone:
      return "outdone";
    case Fate::another_name:
      return "another name";
    case Fate::withdrawn:
      return "withdrawn";
    case Fate::fitted_along:
      return "fitted along";
    case Fate::accepted:
      return "accepted";
  }
  return "";
}

void tell_fates(std::span<const AcceptedEffect> effects, std::span<const std::string> withdrawn,
                std::span<const std::string> along, std::vector<Ranked>& ranking) {
  const auto among = [](std::span<const std::string> ids, const std::string& id) {
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  };
  for (Ranked& one : ranking) {
    if (among(withdrawn, one.id)) one.fate = Fate::withdrawn;
    if (among(along, one.id)) one.fate = Fate::fitted_along;
    for (const AcceptedEffect& effect : effects)
      for (const auto& [other, correlation] : effect.equivalent)
        if (other == one.id) one.fate = Fate::another_name;
    for (const AcceptedEffect& effect : effects)
      if (effect.id == one.id) one.fate = Fate::accepted;
  }
}

std::vector<std::string> leading_names(std::span<const AcceptedEffect> effects,
                                       std::span<const Ranked> ranking) {
  constexpr std::size_t kShown = 4;
  std::vector<std::string> out;
  const auto add = [&](const std::string& id) {
    if (out.size() < kShown && std::find(out.begin(), out.end(), id) == out.end()) out.push_back(id);
  };
  for (const AcceptedEffect& effect : effects) add(effect.id);
  for (const Ranked& ranked : ranking)
    if (ranked.visible) add(ranked.id);
  return out;
}

void AcceptedEffect::add_other_name(const std::string& other, double correlation) {
  for (auto& [name, known] : equivalent)
    if (name == other) {
      known = std::max(known, correlation);
      return;
    }
  equivalent.push_back({other, correlation});
}

namespace {

FirstMisfit first_misfit(const FitResult& fit, const DiscoverOptions& options) {
  FirstMisfit out;
  for (const auto& m : fit.misfit) {
    if (!is_misfit(m, options)) continue;
    if (out.any && m.phase != out.phase) break;  // misfits are in the order of the phases
    if (out.any && m.chi2_per_sample() <= out.chi2_per_sample) continue;
    out = {true, m.phase, m.channel, m.chi2_per_sample()};
  }
  return out;
}

/// Steps forward, each from the model that the one before has found, beside the pads' give wherever there is
/// evidence for it.
void search(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  auto from = std::make_shared<const Stage>(stage);
  fit_give_along(stage, options);
  stage.from = std::move(from);
  while (static_cast<int>(out.effects.size()) < options.most_effects) {
    auto next = forward(stage, options, out);
    if (!next) break;
    from = std::make_shared<const Stage>(std::move(stage));
    stage = std::move(*next);
    polish(stage, options);
    fit_give_along(stage, options);
    stage.from = std::move(from);
  }
}

/// Searches, and questions what was found, to the fit with its intervals. A give that was in the model
/// throughout and turned out to be idle may have stood in the place of something likelier: then once more
/// without it.
FitResult search_and_question(Stage& stage, DiscoverOptions options, Discovery& out) {
  search(stage, options, out);
  settle_give(stage, options, out);
  backward(stage, options, out);
  FitResult counted = withdraw(stage, options, out);
  if (!drop_idle_give(stage, options, out)) {
    if (!drop_vanished_give(stage, options)) return counted;
    counted = stage.fit;
    count_discrepancy(stage.problem, counted, options.fit.threads);
    return counted;
  }
  options.forget.push_back(kPads);
  stage.asked.reset();
  out.asked.reset(), out.imitations.clear();  // of a search that is made again
  return search_and_question(stage, std::move(options), out);
}

/// The options of a search, without the laws that it is told to forget.
DiscoverOptions without_forgotten(DiscoverOptions options) {
  const auto& forget = options.forget;
  std::erase_if(options.laws, [&](const std::string& law) {
    return std::find(forget.begin(), forget.end(), std::string(kLaw) + law) != forget.end();
  });
  return options;
}

/// Fits the base model to the train throws. What keeps it from being asked anything, or nothing.
std::string fit_base(Stage& stage, const datasets::ThrowLog& log, const DiscoverOptions& options) {
  if (std::none_of(log.throws.begin(), log.throws.end(),
                   [](const datasets::Throw& t) { return t.split == datasets::Split::test; }))
    return "nothing can be held out to judge an effect by: needed are train and test throws, or an object "
           "that "
           "was thrown under two conditions";
  solve(stage, options, {});
  if (stage.solved()) polish(stage, options);
  if (stage.solved()) return {};
  return stage.is_fitted()
             ? fmt::format("there are no held-out throws to judge the fit by: {}", stage.held_out.message)
             : fmt::format("the base model could not be fitted: {}", stage.fit.message);
}

/// What was there before anything was added.
void tell_before(const Stage& base, const DiscoverOptions& options, Discovery& out) {
  const int threads = options.fit.threads;
  out.base_test = base.held_out.misfit;
  out.before_train = errors_of(base, Share::train, threads);
  out.before_test = errors_of(base, Share::test, threads);
  out.first = first_misfit(base.fit, options);
  const auto residuals = residuals_of(base.problem, base.fit, threads);
  out.residual_before = residual_over_time(base.problem, base.fit, residuals);
  out.structure_before = structures(base.problem, base.fit, residuals);
}

/// What is there now.
void tell_after(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const int threads = options.fit.threads;
  out.final = stage.fit;
  out.final_test = stage.held_out.misfit;
  out.model = stage.problem.options().model;
  if (out.adds_nothing()) {
    out.residual_after = out.residual_before, out.structure_after = out.structure_before;
    out.after_train = out.before_train, out.after_test = out.before_test;
    return;
  }
  const auto residuals = residuals_of(stage.problem, stage.fit, threads);
  out.residual_after = residual_over_time(stage.problem, stage.fit, residuals);
  out.structure_after = structures(stage.problem, stage.fit, residuals);
  out.after_train = errors_of(stage, Share::train, threads);
  out.after_test = errors_of(stage, Share::test, threads);
}

/// Which further throws would tell an accepted effect from those that explain the log as well.
void plan_experiments(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (AcceptedEffect& effect : out.effects)
    for (const auto& [other, correlation] : effect.equivalent) {
      const auto experiments = separating_experiments(stage, effect, other, options);
      effect.separating.insert(effect.separating.end(), experiments.begin(), experiments.end());
    }
}

}  // namespace

Discovery discover(const datasets::ThrowLog& logged, const std::string& file, const DiscoverOptions& given) {
  const auto begin = Clock::now();
  validate(given);
  datasets::validate(logged, file);
  DiscoverOptions options = without_forgotten(given);
  const datasets::ThrowLog log = with_held_out(logged);
  Discovery out;
  if (!has_both_splits(logged))
    for (const auto& one : log.throws)
      if (one.split == datasets::Split::test) out.held_out.push_back(one.id);

  Stage stage{CampaignProblem(log, file, options.campaign), {}, {}, {}};
  out.message = fit_base(stage, log, options);
  out.base = stage.fit;
  out.model = options.campaign.model;
  if (!out.message.empty()) {
    out.verdict = Verdict::not_answered;
    out.seconds = seconds_since(begin);
    return out;
  }
  options.fit.throws = throws_of(stage);
  tell_before(stage, options, out);

  const Stage base = stage;
  FitResult counted = search_and_question(stage, options, out);
  if (gives_along(stage)) out.along = {kPads};
  judge(stage, options, out);
  describe(stage, std::move(counted), options, out);
  plan_experiments(stage, options, out);

  out.footprints =
      footprint_traces(base.problem, base.fit, leading_names(out.effects, out.ranking), options.fit);
  tell_after(stage, options, out);
  for (const AcceptedEffect& effect : out.effects)
    if (out.small && out.small->id == effect.id) out.small.reset();
  std::vector<std::string> withdrawn;
  for (const Imitation& one : out.imitations) withdrawn.push_back(one.id);
  tell_fates(out.effects, withdrawn, out.along, out.ranking);
  out.unexplained = unexplained(stage, out, options);
  if (out.unexplained) out.small.reset();  // beside that, nobody knows what it imitates
  out.verdict = !out.effects.empty() ? Verdict::effect_found
                : out.unexplained    ? Verdict::unexplained
                                     : Verdict::no_missing_effect;
  out.problem = std::make_shared<const CampaignProblem>(std::move(stage.problem));
  out.seconds = seconds_since(begin);
  return out;
}

}  // namespace unhand::fitting
