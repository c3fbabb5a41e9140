#include "fitting/discovery/selection.hpp"

#include <algorithm>
#include <array>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/asked_form.hpp"
#include "fitting/discovery/discrepancy.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/where_acts.hpp"
#include "fitting/discovery/withdrawal.hpp"

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

void name_imitation(Imitation one, Discovery& out) {
  if (std::none_of(out.imitations.begin(), out.imitations.end(),
                   [&](const Imitation& known) { return known.id == one.id; }))
    out.imitations.push_back(std::move(one));
}

/// What was accepted in the company of something that has been withdrawn, another law included, must have its
/// evidence alone.
void drop_without_evidence(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (std::size_t i = out.effects.size(); i-- > 0;) {
    const std::string id = out.effects[i].id;
    const Stage& less = without(stage, {id}, options);
    if (!less.solved() || is_evident(less, stage)) continue;
    name_imitation(
        {id, "there is no evidence for it without what has been withdrawn", stage.bic() - less.bic()}, out);
    out.effects.erase(out.effects.begin() + static_cast<std::ptrdiff_t>(i));
    stage = Stage(less);
  }
}

}  // namespace

void backward(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (bool removed = true; removed && !stage.ids.empty();) {
    removed = false;
    for (std::size_t i = 0; i < stage.ids.size() && !removed; ++i) {
      const Stage& less = without(stage, {stage.ids[i]}, options);
      if (!less.solved()) continue;
      const bool needed =
          is_evident(less, stage) &&
          (is_law(stage.ids[i]) || improvement(less, stage, out.before.held_out, options).matters >= 1 ||
           (left_by_answer(stage, out, options).empty() && predicts_better(less, stage, options)));
      if (needed) continue;
      if (is_evident(less, stage) && !out.small)
        out.small = small_effect(less, stage, stage.ids[i], out.before.held_out, options);
      std::erase_if(out.effects, [&](const AcceptedEffect& e) { return e.id == stage.ids[i]; });
      stage = Stage(less);
      removed = true;
    }
  }
}

FitResult withdraw(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return stage.fit;
  FitResult counted = stage.fit;
  count_discrepancy(stage.problem, counted, options.fit.threads);
  const BothErrors errors = errors_of(stage, options.fit.threads);
  std::vector<std::string> gone, why;
  const AskedForm asked = form_asked_for(stage, out, options);
  if (!asked.words.empty())
    out.asked = asked;
  else if (!asked.outdone.empty())
    out.asked.reset();  // it was asked for beside what flights do not need
  const auto is_among = [](const std::vector<std::string>& ids, const AcceptedEffect& effect) {
    return std::find(ids.begin(), ids.end(), effect.id) != ids.end();
  };
  std::array<bool, 2> misled{};  // in the hand, in the air
  for (const AcceptedEffect& effect : out.effects) {
    const bool in_company = (misled[0] && acts(effect, false)) || (misled[1] && acts(effect, true));
    const bool last = effect.id == out.effects.back().id;
    const bool backed = is_among(asked.backed, effect);
    std::string here;
    if (in_company) here = "it was accepted in the company of one that is withdrawn";
    if (here.empty()) here = why_imitation(effect, stage, errors, counted, backed, out, options);
    const bool stands = backed && !acts(effect, false);  // whatever is beside it
    if (here.empty() && last && !stands && spoils(effect, stage, out, options))
      here = "with it a channel is noisier than under the base model";
    if (here.empty() && is_among(asked.outdone, effect))
      here =
          asked.words.empty() ? "flights lack less without it" : "another form describes the flights better";
    if (here.empty()) continue;
    for (const bool air : {false, true}) misled[air ? 1 : 0] |= acts(effect, air);
    gone.push_back(effect.id), why.push_back(here);
  }
  if (gone.empty()) return counted;
  const Stage& less = without(stage, gone, options);
  if (!less.solved()) return counted;
  std::erase_if(out.effects, [&](const AcceptedEffect& effect) { return is_among(gone, effect); });
  for (std::size_t k = 0; k < gone.size(); ++k) {
    const Stage& alone = without(stage, {gone[k]}, options);
    name_imitation({gone[k], why[k], alone.solved() ? stage.bic() - alone.bic() : 0}, out);
  }
  stage = Stage(less);
  drop_without_evidence(stage, options, out);
  return withdraw(stage, options, out);
}

void judge(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return;
  const OutcomeErrors with = errors_of(stage, Share::test, options.fit.threads);
  for (AcceptedEffect& accepted : out.effects) {
    const Stage& less = without(stage, {accepted.id}, options);
    if (!less.solved()) continue;  // what it was accepted for stands
    accepted.delta_bic = stage.bic() - less.bic();
    accepted.test_error_ratio = error_ratio(errors_of(less, Share::test, options.fit.threads), with);
    if (is_law(accepted.id)) continue;
    const Improvement gain = improvement(less, stage, out.before.held_out, options);
    accepted.why =
        gain.matters >= 1
            ? gain.where
            : predicted_in_words(small_effect(less, stage, accepted.id, out.before.held_out, options));
  }
}

void describe(Stage& stage, FitResult counted, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return;
  const Footprints& f = footprints_of(stage, options);
  stage.fit = std::move(counted);
  for (AcceptedEffect& accepted : out.effects) {
    if (is_law(accepted.id)) {
      for (const auto& u : stage.fit.campaign)
        if (u.unknown.of_law)
          accepted.parameters.push_back(
              {u.unknown.name, u.unknown.unit, u.value, u.sigma, u.interval_freedom()});
      continue;
    }
    const dynamics::Effect effect = find_effect(accepted.id);
    accepted.p_value = wald_p_value(stage.fit, effect);  // with the covariance of the sigmas beside it
    accepted.parameters = parameters_of(stage.fit, effect);
    find_other_names(f, contribution_of(stage.fit, effect), options.equivalent, out.silent, accepted);
  }
}

}  // namespace unhand::fitting
