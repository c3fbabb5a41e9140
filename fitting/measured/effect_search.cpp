#include "fitting/measured/effect_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <set>
#include <utility>

#include "fitting/measured/effect_answer.hpp"
#include "fitting/measured/effect_conditions.hpp"
#include "fitting/measured/effect_description.hpp"
#include "fitting/measured/effect_step.hpp"
#include "fitting/measured/effect_trial.hpp"

namespace unhand::fitting {

using datasets::Split;
using Eigen::VectorXd;

namespace {

/// Bayes' criteria that are no further apart cannot tell two effects from each other.
constexpr double kAlike = 10;
/// The share of the most evident one's evidence from which on held-out groups choose.
constexpr double kComparable = 0.5;
/// An answer takes the place of another one that leaves this many times less.
constexpr double kBetter = 0.9;
/// χ² per sample of held-out groups above which an answer is doubted: alternatives that a step could not tell
/// from what it accepted are followed from kMisfit on, all others that held-out groups confirmed from kFarOff
/// on, twice the noise in size.
constexpr double kMisfit = 1.2, kFarOff = 4;
/// Answers that are tried beside the first one: of six effects, some for each, time and again.
constexpr int kMostTried = 100;

/// The search of search_effects(). Greedy: of what is evident beside an answer, the best is accepted, until
/// nothing is. An early step may not know which of two effects it is, or take one for two others. So where an
/// answer leaves a misfit, its neighbours are searched on from: what could have been accepted in a step of
/// its instead (limited discrepancy search), and itself without one of its effects. One that explains the
/// groups better takes its place. Two effects of like size are each other's noise, and few held-out groups
/// confirm neither: what is evident and not confirmed is followed by one step, too, and stays if each of the
/// two is confirmed beside the other.
class Search {
 public:
  Search(const GroupedProblem& problem, const std::vector<dynamics::Effect>& catalogue,
         const EffectSearchOptions& options)
      : problem_(problem), catalogue_(catalogue), options_(options) {}

  EffectAnswer run(EffectAnswer base) {
    EffectAnswer best = climbed(std::move(base));
    while (auto better = better_neighbour(best)) best = std::move(*better);
    return best;
  }

 private:
  /// What a step did not accept.
  struct Alternative {
    EffectAnswer from;  ///< before that step
    EffectTrial trial;
    double asks;  ///< for a misfit of more than that
    bool alone;   ///< it may be all that is found
    /// Ids of effects that act through it, of which one has to be found beside it; the held-out groups need
    /// not have shown it alone.
    std::vector<std::string> opens;
  };

  std::optional<EffectAnswer> better_neighbour(const EffectAnswer& best) {
    const double misfit = left(best.test);
    while (!alternatives_.empty()) {
      const Alternative alternative = std::move(alternatives_.front());
      alternatives_.pop_front();
      if (!(misfit > alternative.asks)) continue;
      if (auto answer = better_than(best, [&] { return followed(alternative); })) return answer;
    }
    for (std::size_t i = best.effects.size(); i-- > 0;) {
      const std::string& id = best.effects[i].id;
      if (best.needs(problem_, id) || !(misfit > kFarOff || shape_is_open(best.train, id))) continue;
      auto less = without(problem_, best, id, options_.fit);
      if (!less) continue;
      if (auto answer = better_than(best, [&] { return std::optional(instead_of(id, std::move(*less))); }))
        return answer;
    }
    return {};
  }

  /// What `search` finds, if it is better. Else its steps leave no alternatives.
  template <typename Searching>
  std::optional<EffectAnswer> better_than(const EffectAnswer& best, const Searching& search) {
    if (++tried_ > kMostTried) return {};
    const std::size_t known = alternatives_.size();
    auto answer = search();
    if (answer && is_better(*answer, best)) return answer;
    alternatives_.erase(alternatives_.begin() + static_cast<std::ptrdiff_t>(known), alternatives_.end());
    return {};
  }

  /// Both train and held-out groups have less than nine tenths of the misfit, nine tenths again for every
  /// further parameter, or less of it with fewer. A shape that was told when its effect was accepted may be
  /// open once others stand beside it: the effect is another one then, and an answer without it may be worse
  /// by a tenth.
  static bool is_better(const EffectAnswer& is, const EffectAnswer& was) {
    const bool opens = has_open_shape(is), opened = has_open_shape(was);
    const auto more =
        static_cast<double>(is.train.shared.size()) - static_cast<double>(was.train.shared.size());
    const double times = opened && !opens              ? 1 / kBetter
                         : more < 0 && opens == opened ? 1
                                                       : std::pow(kBetter, 1 + std::max(0.0, more));
    return left(is.test) < times * left(was.test) && left(is.train) < times * left(was.train);
  }
  static bool has_open_shape(const EffectAnswer& answer) {
    return std::any_of(answer.effects.begin(), answer.effects.end(),
                       [&](const auto& e) { return shape_is_open(answer.train, e.id); });
  }

  /// Where an answer without one of its effects leads to when something else comes first.
  EffectAnswer instead_of(const std::string& id, EffectAnswer less) {
    less.barred = {id};
    EffectAnswer answer = climbed(std::move(less));
    answer.barred.clear();
    return climbed(std::move(answer));
  }

  /// Where an alternative leads to; nothing if its effect does not hold up.
  std::optional<EffectAnswer> followed(const Alternative& alternative) {
    EffectAnswer answer = alternative.from;
    answer.accept(alternative.trial);
    const std::size_t known = alternatives_.size();
    if (!alternative.opens.empty()) {
      if (!opened(alternative, answer)) return {};
    } else if (!alternative.alone) {
      if (!paired(alternative.trial.id, answer)) return {};
      // They would stand beside what is not confirmed beside them.
      alternatives_.erase(alternatives_.begin() + static_cast<std::ptrdiff_t>(known), alternatives_.end());
    }
    return climbed(std::move(answer));
  }

  /// Accepts one more, if held-out groups confirm the effect `id`, too, beside it.
  bool paired(const std::string& id, EffectAnswer& answer) {
    if (!step(answer)) return false;
    const auto less = without(problem_, answer, id, options_.fit);
    if (!less) return false;
    const HeldOutFall beside = held_out_fall(problem_, less->train, less->test, answer.train, answer.test);
    if (!is_confirmed(beside) || !(wald_of(answer.train, id).p_value(answer.train) < kept_at_)) return false;
    tell(answer.effects[answer.effects.size() - 2], "beside", answer.effects.back().id, beside);
    return true;
  }
  static void tell(AcceptedEffect& effect, const char* how, const std::string& other,
                   const HeldOutFall& held) {
    effect.test_error_ratio = std::sqrt(held.is / held.was);
    effect.why = fmt::format("{} {} chi2 per sample falls from {:.4g} to {:.4g} (p {:.1g})", how, other,
                             held.was, held.is, held.p);
  }

  /// Accepts one that acts through the alternative's effect, if held-out groups confirm the two together.
  bool opened(const Alternative& alternative, EffectAnswer& answer) {
    const std::string& id = alternative.trial.id;
    if (!step(answer, alternative.opens)) return false;
    const HeldOutFall both =
        held_out_fall(problem_, alternative.from.train, alternative.from.test, answer.train, answer.test);
    if (!is_confirmed(both) || !(wald_of(answer.train, id).p_value(answer.train) < kept_at_)) return false;
    tell(answer.effects[answer.effects.size() - 2], "with", answer.effects.back().id, both);
    return true;
  }

  /// Step by step, as far as it goes, or to what was searched on from before; then without what has become
  /// dispensable.
  EffectAnswer climbed(EffectAnswer answer) {
    while (static_cast<int>(answer.effects.size()) < options_.most_effects && step(answer) &&
           is_new(answer)) {
    }
    return pruned(std::move(answer));
  }
  bool is_new(const EffectAnswer& answer) {
    const auto ids = answer.ids_without({});
    return seen_.emplace(ids.begin(), ids.end()).second;
  }

  /// Accepts the best of what is evident, of the effects `only` if there are any; keeps the others as
  /// alternatives. False if nothing convinces.
  bool step(EffectAnswer& answer, const std::vector<std::string>& only = {}) {
    auto effects = answer.candidates(problem_, catalogue_);
    if (!only.empty())
      std::erase_if(effects,
                    [&](const auto& e) { return std::find(only.begin(), only.end(), e.id) == only.end(); });
    const EvidentEffects evident = evident_effects(problem_, effects, options_, answer);
    kept_at_ = std::max(kept_at_, evident.level);
    const EffectTrial* best = best_of(evident.trials);
    for (const EffectTrial& trial : evident.trials)
      answer.ranked(trial.id).fate = is_confirmed(trial.held) ? Fate::outdone : Fate::too_small;
    for (const EffectTrial& trial : evident.trials)
      if (&trial != best) keep(answer, trial, best, evident.silent);
    if (!best) return false;
    answer.accept(*best);
    return true;
  }

  bool matters(const HeldOutFall& held) const { return held.share > options_.matters; }
  bool is_confirmed(const HeldOutFall& held) const { return matters(held) && held.p < 0.05; }

  /// The most evident one that held-out groups confirm, unless another one that they confirm, with at least
  /// half its evidence, explains them better by a tenth and the train groups no worse. Null if there is none.
  const EffectTrial* best_of(const std::vector<EffectTrial>& trials) const {
    const EffectTrial* best = nullptr;
    double most = 0;  // evidence
    for (const EffectTrial& trial : trials) {
      if (!is_confirmed(trial.held)) continue;
      if (!best)
        best = &trial, most = trial.delta_bic;
      else if (trial.delta_bic < kComparable * most && trial.held.is < kBetter * best->held.is &&
               left(trial.fit) <= left(best->fit))
        best = &trial;
    }
    return best;
  }

  /// As an alternative: what is as evident as the best one, or confirmed, or evident where nothing is
  /// confirmed, or makes room for what no channel shows yet.
  void keep(const EffectAnswer& from, const EffectTrial& trial, const EffectTrial* best,
            const std::vector<dynamics::Effect>& silent) {
    if (best && matters(trial.held) && trial.delta_bic < best->delta_bic + kAlike)
      alternatives_.push_back({from, trial, kMisfit, true, {}});
    else if (is_confirmed(trial.held))
      alternatives_.push_back({from, trial, kFarOff, true, {}});
    else if (!best && matters(trial.held) && trial.delta_bic < -kAlike)
      alternatives_.push_back({from, trial, kMisfit, false, {}});
    if (!(left(trial.test) > kMisfit)) return;
    if (auto opens = shown_beside(problem_, trial, silent, options_); !opens.empty())
      alternatives_.push_back({from, trial, kMisfit, false, std::move(opens)});
  }

  EffectAnswer pruned(EffectAnswer answer) const {
    for (std::size_t i = 0; i < answer.effects.size() && answer.effects.size() > 1;) {
      const std::string& id = answer.effects[i].id;
      std::optional<EffectAnswer> less;
      if (!answer.needs(problem_, id) && !(wald_of(answer.train, id).p_value(answer.train) < kept_at_))
        less = without(problem_, answer, id, options_.fit);
      if (less)
        answer = std::move(*less), i = 0;
      else
        ++i;
    }
    return answer;
  }

  const GroupedProblem& problem_;
  const std::vector<dynamics::Effect>& catalogue_;
  const EffectSearchOptions& options_;
  std::deque<Alternative> alternatives_;  ///< not followed yet, in the order in which they were met
  std::set<std::set<std::string>> seen_;  ///< the ids of answers that steps led to
  double kept_at_{};  ///< the loosest level of any step: what was accepted at it is kept at it
  int tried_{};       ///< answers beside the first one
};

std::string why_not(const GroupedProblem& problem, Split split) {
  const char* name = split == Split::test ? "test" : "train";
  for (const auto& group : problem.groups())
    if (group.split == split) return fmt::format("no throw of split '{}' could be fitted", name);
  return fmt::format(
      "no throw has the split '{}', of {}: effects are found on train, and judged on test. Where a log "
      "declares none, every fifth is held out, condition by condition: record five or more, or declare the "
      "split in the log",
      name, problem.groups().size());
}

}  // namespace

EffectSearch search_effects(const GroupedProblem& problem, const EffectSearchOptions& options) {
  EffectSearch out;
  out.base = fit_groups(problem, Split::train, {}, VectorXd(), options.fit);
  out.base_test = fit_own(problem, Split::test, out.base, options.fit);
  if (!out.base.solved || !out.base_test.solved) {
    out.message = why_not(problem, out.base.solved ? Split::test : Split::train);
    return out;
  }
  out.solved = true;
  auto catalogue = problem.effects();
  std::erase_if(catalogue, [&](const auto& effect) {
    return std::find(options.forget.begin(), options.forget.end(), effect.id) != options.forget.end();
  });
  EffectAnswer answer;
  answer.train = out.base;
  answer.test = out.base_test;
  answer = Search(problem, catalogue, options).run(std::move(answer));
  out.effects = described(problem, answer, catalogue, options);
  out.stability = stability_of(problem, answer, options);
  out.conditions = conditions_of(problem, answer, out.effects, catalogue, options);
  out.ranking = std::move(answer.ranking);
  std::sort(out.ranking.begin(), out.ranking.end(),
            [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  out.final = std::move(answer.train);
  out.final_test = std::move(answer.test);
  return out;
}

}  // namespace unhand::fitting
