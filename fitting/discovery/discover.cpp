#include "fitting/discovery/discover.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "fitting/clock.hpp"
#include "fitting/discovery/discrepancy.hpp"
#include "fitting/discovery/held_out_split.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/pads_give.hpp"
#include "fitting/discovery/selection.hpp"
#include "fitting/discovery/separating.hpp"
#include "fitting/discovery/unexplained.hpp"
#include "fitting/discovery/wild_throws.hpp"

namespace unhand::fitting {

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
           "that was thrown under two conditions";
  solve(stage, options, {});
  if (stage.solved()) polish(stage, options);
  if (stage.solved()) return {};
  return stage.is_fitted()
             ? fmt::format("there are no held-out throws to judge the fit by: {}", stage.held_out.message)
             : fmt::format("the base model could not be fitted: {}", stage.fit.message);
}

SeenModel seen(const Stage& stage, int threads) {
  SeenModel out;
  out.fit = stage.fit;
  out.held_out = stage.held_out.misfit;
  out.train = errors_of(stage, Share::train, threads);
  out.test = errors_of(stage, Share::test, threads);
  const auto residuals = residuals_of(stage.problem, stage.fit, threads);
  out.residual = residual_over_time(stage.problem, stage.fit, residuals);
  out.structure = structures(stage.problem, stage.fit, residuals);
  return out;
}

/// Which further throws would tell an accepted effect from those that explain the log as well.
void plan_experiments(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (AcceptedEffect& effect : out.effects)
    for (const auto& [other, correlation] : effect.equivalent) {
      const auto experiments = separating_experiments(stage, effect, other, options);
      effect.separating.insert(effect.separating.end(), experiments.begin(), experiments.end());
    }
}

/// The loop from a base model that was fitted, or was not: `message` says why.
Discovery searched(Stage stage, std::string message, DiscoverOptions options) {
  Discovery out;
  out.message = std::move(message);
  out.before.fit = stage.fit;
  out.model = options.campaign.model;
  if (!out.message.empty()) {
    out.verdict = Verdict::not_answered;
    return out;
  }
  options.fit.throws = throws_of(stage);
  out.before = seen(stage, options.fit.threads);
  out.first = first_misfit(stage.fit, options);

  const Stage base = stage;
  FitResult counted = search_and_question(stage, options, out);
  if (gives_along(stage)) out.along = {kPads};
  judge(stage, options, out);
  describe(stage, std::move(counted), options, out);
  plan_experiments(stage, options, out);

  out.footprints =
      footprint_traces(base.problem, base.fit, leading_names(out.effects, out.ranking), options.fit);
  out.model = stage.problem.options().model;
  out.after = out.adds_nothing() ? out.before : seen(stage, options.fit.threads);
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
  return out;
}

/// Without the throws that err as no other does. One that the answer explains as it does the others is none,
/// and takes part in another search.
Discovery searched_without_wild(Stage all, const datasets::ThrowLog& log, const std::string& file,
                                const DiscoverOptions& options) {
  constexpr int kMostSearches = 3;
  auto wild = wild_throws(all, options);
  for (int search = 1; !wild.empty(); ++search) {
    const auto rest = without_throws(log, wild);
    Stage stage{CampaignProblem(rest, file, options.campaign), {}, {}, {}};
    if (std::string message = fit_base(stage, rest, options); !message.empty()) break;
    Discovery out = searched(std::move(stage), {}, options);
    auto still = still_wild(*out.problem, out.after.fit, all.problem, wild, options);
    if (still == wild || search == kMostSearches) {
      for (const WildGroup& one : wild) out.skipped.push_back({log.throws[one.group].id, told(one, all)});
      return out;
    }
    wild = std::move(still);
  }
  return searched(std::move(all), {}, options);
}

}  // namespace

Discovery discover(const datasets::ThrowLog& logged, const std::string& file, const DiscoverOptions& given) {
  const auto begin = Clock::now();
  validate(given);
  datasets::validate(logged, file);
  const DiscoverOptions options = without_forgotten(given);
  const datasets::ThrowLog log = with_held_out(logged);
  Stage stage{CampaignProblem(log, file, options.campaign), {}, {}, {}};
  std::string message = fit_base(stage, log, options);
  Discovery out = message.empty() ? searched_without_wild(std::move(stage), log, file, options)
                                  : searched(std::move(stage), std::move(message), options);
  if (out.problem) out.notes = out.problem->notes();
  if (!has_both_splits(logged))
    for (const auto& one : log.throws)
      if (one.split == datasets::Split::test) out.held_out.push_back(one.id);
  out.seconds = seconds_since(begin);
  return out;
}

}  // namespace unhand::fitting
