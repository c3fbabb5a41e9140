#include "fitting/discovery/pads_give.hpp"

#include <algorithm>

#include "contact/registry.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/where_acts.hpp"
#include "fitting/give_start.hpp"

namespace unhand::fitting {

namespace {

constexpr const char* kCompliance = "contact.pad_compliance.compliance";
constexpr double kStart = 3e-6;  // of a give [m]

bool has(const std::vector<std::string>& ids, const std::string& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

double give_per_compliance(const Stage& stage) {
  return give_per_compliance(stage.problem, stage.fit.values());
}

/// The give's footprint at a stage without one.
struct GiveFootprint {
  const Candidate* candidate{};  // none where it is not in the catalogue, or shows nothing
  Score score;
  bool hidden{};  // by an effect that pads take no part in, which explains far more of a misfit
};
GiveFootprint footprint_of_give(const Stage& stage, const DiscoverOptions& options) {
  const Footprints& f = footprints_of(stage, options);
  GiveFootprint out;
  double most = 0;
  bool by_pads = false;
  for (const Score& score : scores(f)) {
    const Candidate& candidate = f.candidates[score.candidate];
    if (score.gain > most) most = score.gain, by_pads = acts_on_pads(candidate.id);
    if (candidate.id == kPads && score.visible && (!out.candidate || score.gain > out.score.gain))
      out.candidate = &candidate, out.score = score;
  }
  out.hidden = !by_pads && out.score.gain < kImitation * most && leaves_misfit(stage, options);
  return out;
}

}  // namespace

double give_of(const Stage& stage) {
  for (const auto& u : stage.fit.campaign)
    if (u.unknown.name == kCompliance) return u.value * give_per_compliance(stage);
  return 0;
}

bool gives_along(const Stage& stage) {
  return has(stage.problem.options().effects, kPads) && !has(stage.ids, kPads);
}

std::vector<std::string> with_give(const CampaignProblem& problem, const std::string& law,
                                   const DiscoverOptions& options) {
  auto out = problem.options().effects;
  if (contact::can_give(law) && !has(out, kPads) && has(catalogue(options), kPads)) out.push_back(kPads);
  return out;
}

void start_give(const Stage& stage, const CampaignProblem& problem, std::vector<double>& start) {
  const std::vector<double> typical = problem.start();
  for (std::size_t k = 0; k < start.size(); ++k) {
    const std::string& name = problem.campaign()[k].name;
    if (name == kCompliance)
      start[k] = kStart / give_per_compliance(stage);
    else if (name.starts_with(std::string(kPads) + "."))
      start[k] = typical[k];
  }
}

void fit_give_along(Stage& stage, const DiscoverOptions& options) {
  const auto& model = stage.problem.options().model;
  const bool again = gives_along(stage);
  const auto effects = with_give(stage.problem, model, options);
  if (!again && effects == stage.problem.options().effects) return;
  Stage next{stage.problem.with(model, effects), {}, {}, stage.ids};
  std::vector<double> start = carried(stage.fit, next.problem);
  start_give(stage, next.problem, start);
  if (!again) {
    const GiveFootprint footprint = footprint_of_give(stage, options);
    if (footprint.hidden && stage.ids.empty()) return;
    if (footprint.candidate) {
      std::vector<double> asked = start;
      start_candidate(next.problem, *footprint.candidate, footprint.score, asked);
      solve_train(next, options, std::move(asked));
    }
  }
  if (auto likelier = likelier_give(next.problem, start, stage.fit.throws, options.fit)) start = *likelier;
  if (Stage other{next.problem, {}, {}, stage.ids};
      solve_train(other, options, std::move(start)) &&
      (!next.is_fitted() || other.fit.deviance() < next.fit.deviance()))
    next = std::move(other);
  if (!next.is_fitted() || !solve_held_out(next, options)) return;
  const double give = give_of(next);  // where it is none, the fit has found something else
  if (give > 0 && give <= kMostGive && next.bic() - stage.bic() <= (again ? kLikelierBic : kDeltaBic))
    stage = std::move(next);
}

void settle_give(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const bool small = give_of(stage) <= kMostGive;
  if (has(stage.ids, kPads) && small) {
    std::erase(stage.ids, kPads);
    std::erase_if(out.effects, [](const AcceptedEffect& e) { return e.id == kPads; });
  } else if (gives_along(stage) && !small) {
    AcceptedEffect give;
    give.id = kPads;
    if (const Stage& rigid = without(stage, {kPads}, options); rigid.solved()) {
      const Improvement gain = improvement(rigid, stage, out.before.held_out, options);
      give.why = gain.where;
      give.phase = gain.phase;
    }
    stage.ids.push_back(kPads);
    out.effects.push_back(std::move(give));
  }
}

bool drop_idle_give(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (!gives_along(stage) || !out.effects.empty()) return false;
  const Stage rigid = without(stage, {kPads}, options);
  if (!rigid.solved()) return false;
  constexpr double kSpoils = 1.05;  // times the held-out predictions' rms
  const SmallEffect give = small_effect(rigid, stage, kPads, out.before.held_out, options);
  const RmsOfBoth& position = give.rms.position;
  const bool spoils = position.rises_by(kSpoils),
             matters = improvement(rigid, stage, out.before.held_out, options).matters >= 1;
  if (!spoils && (matters || (position.falls_by(1) && give.likelier))) return false;
  if (!matters && (!out.small || give.delta_bic < out.small->delta_bic)) out.small = give;
  stage = rigid;
  return true;
}

bool drop_vanished_give(Stage& stage, const DiscoverOptions& options) {
  constexpr double kNone = 1e-9;  // m
  if (!gives_along(stage) || give_of(stage) > kNone) return false;
  const Stage rigid = without(stage, {kPads}, options);
  if (rigid.solved()) stage = rigid;
  return rigid.solved();
}

}  // namespace unhand::fitting
