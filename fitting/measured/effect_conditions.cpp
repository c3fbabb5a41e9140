#include "fitting/measured/effect_conditions.hpp"

#include <algorithm>
#include <cmath>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/measured/effect_step.hpp"

namespace unhand::fitting {

using Eigen::Index;

namespace {

constexpr double kDiffers = 2;  // standard deviations

/// The parameters of `was` that `is` has, too, elsewhere.
std::vector<SizeShift> shifts_of(const GroupedFit& was, const GroupedFit& is) {
  std::vector<SizeShift> out;
  for (std::size_t k = 0; k < was.shared.size(); ++k) {
    const SharedParameter& p = was.shared[k];
    const auto same = std::find_if(is.shared.begin(), is.shared.end(),
                                   [&](const SharedParameter& other) { return other.name == p.name; });
    if (p.shape || same == is.shared.end()) continue;
    const auto j = static_cast<std::size_t>(same - is.shared.begin());
    const double value = was.values[static_cast<Index>(k)], then = is.values[static_cast<Index>(j)];
    if (std::abs(then - value) > kDiffers * was.sigma(k))
      out.push_back({p.effect, p.short_name, p.unit, value, then, is.sigma(j)});
  }
  return out;
}

}  // namespace

std::vector<SizeCondition> conditions_of(const GroupedProblem& problem, const EffectAnswer& answer,
                                         const std::vector<AcceptedEffect>& effects,
                                         const std::vector<dynamics::Effect>& catalogue,
                                         const EffectSearchOptions& options) {
  std::vector<SizeCondition> out;
  for (const AcceptedEffect& accepted : effects) {
    if (effects.size() < 2 || accepted.equivalent.empty() || answer.needs(problem, accepted.id)) continue;
    auto less = without(problem, answer, accepted.id, options.fit);
    if (!less) continue;
    for (const auto& effect : catalogue) {
      const bool named = std::any_of(accepted.equivalent.begin(), accepted.equivalent.end(),
                                     [&](const auto& other) { return other.first == effect.id; });
      if (!named) continue;
      for (const EffectTrial& trial : evident_effects(problem, {effect}, options, *less).trials)
        if (auto shifts = shifts_of(answer.train, trial.fit); !shifts.empty())
          out.push_back({effect.id, accepted.id, trial.delta_bic, std::move(shifts)});
    }
  }
  EffectAnswer more = answer;
  for (const EffectTrial& trial :
       evident_effects(problem, answer.candidates(problem, catalogue), options, more).trials)
    if (trial.delta_bic <= kDeltaBic)
      if (auto shifts = shifts_of(answer.train, trial.fit); !shifts.empty() || effects.empty())
        out.push_back({trial.id, {}, trial.delta_bic, std::move(shifts)});
  return out;
}

}  // namespace unhand::fitting
