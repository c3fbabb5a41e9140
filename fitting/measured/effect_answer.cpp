#include "fitting/measured/effect_answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unhand::fitting {

using Eigen::Index;

std::vector<std::string> EffectAnswer::ids_without(const std::string& id) const {
  std::vector<std::string> out;
  for (const auto& effect : effects)
    if (effect.id != id) out.push_back(effect.id);
  return out;
}

bool EffectAnswer::needs(const GroupedProblem& problem, const std::string& id) const {
  const auto others = ids_without(id);
  return std::any_of(others.begin(), others.end(),
                     [&](const std::string& other) { return !problem.may_act(other, others); });
}

std::vector<dynamics::Effect> EffectAnswer::candidates(const GroupedProblem& problem,
                                                       const std::vector<dynamics::Effect>& catalogue) const {
  std::vector<dynamics::Effect> out;
  for (const auto& effect : catalogue)
    if (!is_accepted(effect.id, effects) &&
        std::find(barred.begin(), barred.end(), effect.id) == barred.end() &&
        problem.may_act(effect.id, ids_without({})))
      out.push_back(effect);
  return out;
}

Ranked& EffectAnswer::ranked(const std::string& id) {
  const auto found =
      std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == id; });
  if (found != ranking.end()) return *found;
  ranking.push_back({id, -1});
  return ranking.back();
}

void EffectAnswer::accept(const EffectTrial& trial) {
  AcceptedEffect effect;
  effect.id = trial.id;
  effect.delta_bic = trial.delta_bic;
  effect.test_error_ratio = std::sqrt(trial.held.is / trial.held.was);
  effect.why = fmt::format("chi2 per sample falls from {:.4g} to {:.4g} (p {:.1g})", trial.held.was,
                           trial.held.is, trial.held.p);
  effects.push_back(std::move(effect));
  train = trial.fit;
  test = trial.test;
}

std::optional<EffectAnswer> without(const GroupedProblem& problem, const EffectAnswer& answer,
                                    const std::string& id, const GroupedFitOptions& options) {
  EffectAnswer less = answer;
  std::erase_if(less.effects, [&](const auto& e) { return e.id == id; });
  less.train = fit_without(problem, answer.train, id, options);
  if (!less.train.solved) return {};
  less.test = fit_own(problem, datasets::Split::test, less.train, options, &answer.test);
  if (!less.test.solved) return {};
  return less;
}

double left(const GroupedFit& fit) {
  return fit.samples > 0 ? fit.chi2 / static_cast<double>(fit.samples) : 0;
}

bool shape_is_open(const GroupedFit& fit, const std::string& id) {
  for (std::size_t k = 0; k < fit.shared.size(); ++k) {
    const SharedParameter& p = fit.shared[k];
    const double value = fit.values[static_cast<Index>(k)], inside = std::min(value - p.low, p.high - value);
    if (p.effect == id && p.shape && !(inside > std::max(2 * fit.sigma(k), 1e-3 * (p.high - p.low))))
      return true;
  }
  return false;
}

std::vector<Index> indices(const std::vector<std::size_t>& from) { return {from.begin(), from.end()}; }

}  // namespace unhand::fitting
