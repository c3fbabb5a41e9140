#include "fitting/discovery/selection.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "contact/registry.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/discrepancy.hpp"

namespace unhand::fitting {

namespace {

/// The footprint's own names for `accepted`: candidates that could have left it as well. What is silent under
/// the base model could not: a wind acts through the drag or the lift that has just been found.
void find_other_names(const Footprints& f, const Eigen::VectorXd& contribution, double enough,
                      const std::vector<std::string>& silent, AcceptedEffect& accepted) {
  for (const Candidate& candidate : f.candidates) {
    if (std::find(silent.begin(), silent.end(), candidate.id) != silent.end()) continue;
    const double r = correlation(f, contribution, candidate);
    if (r < enough) continue;
    accepted.add_other_name(candidate.id, r);
  }
}

/// The give that was fitted along with effects which are gone stays where it is needed without them.
void drop_give(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (out.along.empty()) return;
  const Stage& rigid = without(stage, out.along, options);
  if (!rigid.solved() || needs_give(rigid, stage, out.base_test, options)) return;
  stage = Stage(rigid);
  out.along.clear();
}

/// What was accepted in the company of something that has been withdrawn, another law included, must have its
/// evidence alone.
void drop_without_evidence(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (std::size_t i = out.effects.size(); i-- > 0;) {
    const std::string id = out.effects[i].id;
    const Stage& less = without(stage, {id}, options);
    if (!less.solved() || stage.bic() - less.bic() <= kDeltaBic) continue;
    out.imitations.push_back(id);
    out.effects.erase(out.effects.begin() + static_cast<std::ptrdiff_t>(i));
    stage = Stage(less);
  }
}

}  // namespace

void backward(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (bool removed = true; removed && !stage.ids.empty();) {
    removed = false;
    // The last one has just been judged, unless pads that give were fitted along after it.
    const std::size_t judged = stage.ids.size() - (out.along.empty() ? 1 : 0);
    for (std::size_t i = 0; i < judged && !removed; ++i) {
      if (is_law(stage.ids[i])) continue;
      const Stage& less = without(stage, {stage.ids[i]}, options);
      if (!less.solved()) continue;
      const bool needed = stage.bic() - less.bic() < kDeltaBic &&
                          (improvement(less, stage, out.base_test, options).matters >= 1 ||
                           predicts_better(less, stage, options));
      if (needed) continue;
      std::erase_if(out.effects, [&](const AcceptedEffect& e) { return e.id == stage.ids[i]; });
      stage = Stage(less);
      removed = true;
    }
  }
}

FitResult withdraw(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) {
    drop_give(stage, options, out);
    return stage.fit;
  }
  FitResult counted = stage.fit;
  count_discrepancy(stage.problem, counted, options.fit.threads);
  const BothErrors errors = errors_of(stage, options.fit.threads);
  std::vector<std::string> gone;
  const std::optional<AskedForm> asked = form_asked_for(stage, out, options);
  if (asked) out.asked = asked;
  std::array<bool, 2> misled{};  // in the hand, in the air
  for (const AcceptedEffect& effect : out.effects) {
    const bool in_company = (misled[0] && acts(effect, false)) || (misled[1] && acts(effect, true));
    const bool last = effect.id == out.effects.back().id;
    const bool here =
        in_company || is_imitation(effect, stage, errors, counted, out, options) ||
        (last && spoils(effect, stage, out, options)) ||
        (asked && std::find(asked->outdone.begin(), asked->outdone.end(), effect.id) != asked->outdone.end());
    for (const bool air : {false, true}) misled[air ? 1 : 0] |= here && acts(effect, air);
    if (here) gone.push_back(effect.id);
  }
  if (gone.empty()) return counted;
  const Stage& less = without(stage, gone, options);
  if (!less.solved()) return counted;
  std::erase_if(out.effects, [&](const AcceptedEffect& effect) {
    return std::find(gone.begin(), gone.end(), effect.id) != gone.end();
  });
  out.imitations.insert(out.imitations.end(), gone.begin(), gone.end());
  stage = Stage(less);
  drop_without_evidence(stage, options, out);
  return withdraw(stage, options, out);
}

bool fit_along(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const std::string along = kPads;
  const auto& model = stage.problem.options().model;
  auto effects = stage.problem.options().effects;
  const auto known = catalogue(options);
  if (!contact::can_give(model) || std::find(effects.begin(), effects.end(), along) != effects.end() ||
      std::find(known.begin(), known.end(), along) == known.end())
    return false;
  effects.push_back(along);
  Stage next{stage.problem.with(model, effects), {}, {}, stage.ids};
  std::vector<double> start = carried(stage.fit, next.problem);
  constexpr double kGive = 3e-6;  // to start with [m]
  for (std::size_t k = 0; k < start.size(); ++k)
    if (next.problem.campaign()[k].name == kCompliance) start[k] = kGive / give_per_compliance(stage);
  solve(next, options, std::move(start));
  if (!next.solved() || next.bic() - stage.bic() > kDeltaBic || give_of(next) > kMostGive) return false;
  stage = std::move(next);
  out.along.push_back(along);
  return true;
}

void choose_again_beside_give(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const std::string last = out.effects.empty() ? "" : out.effects.back().id;
  if (!acts_on_pads(last) || is_law(last)) return;
  const Stage& less = without(stage, {last}, options);
  if (!less.solved()) return;
  Discovery again = out;
  again.effects.pop_back();
  auto other = forward(less, options, again);
  if (!other || again.effects.size() != out.effects.size() || again.effects.back().id == last) return;
  polish(*other, options);
  if (other->bic() - stage.bic() > kDeltaBic) return;
  stage = std::move(*other);
  out = std::move(again);
}

void judge(const Stage& stage, const Stage& base, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return;
  const OutcomeErrors with = errors_of(stage, Share::test, options.fit.threads);
  const bool alone = stage.ids.size() == 1 && out.along.empty();
  for (AcceptedEffect& accepted : out.effects) {
    const Stage& less = alone ? base : without(stage, {accepted.id}, options);
    if (!less.solved()) continue;  // what it was accepted for stands
    accepted.delta_bic = stage.bic() - less.bic();
    accepted.test_error_ratio = error_ratio(errors_of(less, Share::test, options.fit.threads), with);
  }
}

void describe(Stage& stage, FitResult counted, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return;
  const auto f = footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads);
  stage.fit = std::move(counted);
  for (AcceptedEffect& accepted : out.effects) {
    if (is_law(accepted.id)) {
      for (const auto& u : stage.fit.campaign)
        if (u.unknown.of_law)
          accepted.parameters.push_back({u.unknown.name, u.unknown.unit, u.value, u.sigma});
      continue;
    }
    const dynamics::Effect effect = find_effect(accepted.id);
    accepted.p_value = wald_p_value(stage.fit, effect);  // with the covariance of the sigmas beside it
    for (const auto& u : stage.fit.campaign)
      for (const auto& p : effect.parameters)
        if (without_object(u.unknown.name) == effect.full_name(p))
          accepted.parameters.push_back(
              {u.unknown.name.substr(accepted.id.size() + 1), u.unknown.unit, u.value, u.sigma});
    find_other_names(f, contribution_of(stage.fit, effect), options.equivalent, out.silent, accepted);
  }
}

}  // namespace unhand::fitting
