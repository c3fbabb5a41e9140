#include "fitting/discovery/pads_give.hpp"

#include <algorithm>
#include <limits>

#include "contact/registry.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/where_acts.hpp"

namespace unhand::fitting {

namespace {

constexpr const char* kCompliance = "contact.pad_compliance.compliance";
constexpr const char* kLossTime = "contact.pad_compliance.loss_time";
constexpr double kStart = 3e-6;  // of a give [m]

bool has(const std::vector<std::string>& ids, const std::string& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// The give per unit of the effect [N]: the friction limit of all pads at the campaign's grip force.
double give_per_compliance(const Stage& stage) {
  double mu = 0.5;
  for (const auto& u : stage.fit.campaign)
    if (u.unknown.name == "mu") mu = u.value;
  return stage.problem.model().pads * mu * stage.problem.model().reference_force;
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

namespace {

/// Some of the throws that the stage is fitted to, spread over the log.
std::vector<bool> some_throws(const Stage& stage) {
  constexpr std::size_t kSome = 12;
  const auto& throws = stage.fit.throws;
  const auto used = static_cast<std::size_t>(
      std::count_if(throws.begin(), throws.end(), [](const ThrowFit& t) { return t.used; }));
  const std::size_t every = std::max<std::size_t>(1, used / kSome);
  std::vector<bool> out;
  std::size_t n = 0;
  for (const ThrowFit& one : throws) out.push_back(one.used && n++ % every == 0);
  return out;
}

/// Pads that ring have a minimum at every give whose pitch is off by a beat more; damped ones have one. Of
/// such gives and loss times, those at which some throws are likeliest while their own unknowns alone follow.
std::vector<double> likeliest_give(const Stage& stage, const CampaignProblem& problem,
                                   std::vector<double> start, const DiscoverOptions& options) {
  struct Give {
    double length, loss;  // [m], [s]
  };
  std::vector<Give> gives{{1e-6, 5e-3}, {3e-6, 5e-3}, {9e-6, 5e-3}};
  constexpr double kLeast = 0.7e-6, kMost = 16e-6, kFinely = 1.3, kRings = 1e-3;
  for (double length = kLeast; length < kMost; length *= kFinely) gives.push_back({length, kRings});

  FitOptions held = options.fit;
  held.throws = some_throws(stage);
  held.weigh = Weigh::variances;
  held.all_fixed = true;
  held.rounds = 1, held.iterations = 3;
  std::vector<double> best = start;
  double least = std::numeric_limits<double>::infinity();
  for (const Give& give : gives) {
    for (std::size_t k = 0; k < start.size(); ++k) {
      const std::string& name = problem.campaign()[k].name;
      if (name == kCompliance) start[k] = give.length / give_per_compliance(stage);
      if (name == kLossTime) start[k] = give.loss;
    }
    held.start = start;
    const FitResult fitted = fit(problem, held);
    if (fitted.is_answer() && fitted.deviance() < least) least = fitted.deviance(), best = start;
  }
  return best;
}

}  // namespace

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
  start = likeliest_give(stage, next.problem, start, options);
  if (Stage other{next.problem, {}, {}, stage.ids};
      solve_train(other, options, std::move(start)) &&
      (!next.is_fitted() || other.fit.deviance() < next.fit.deviance()))
    next = std::move(other);
  if (!next.is_fitted() || !solve_held_out(next, options)) return;
  const double give = give_of(next);  // where it is none, the fit has found something else
  if (give > 0 && give <= kMostGive && next.bic() - stage.bic() <= (again ? -1 : kDeltaBic))
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
      const Improvement gain = improvement(rigid, stage, out.base_test, options);
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
  const SmallEffect give = small_effect(rigid, stage, kPads, out.base_test, options);
  const RmsOfBoth& position = give.rms.position;
  const bool spoils = position.rises_by(kSpoils),
             matters = improvement(rigid, stage, out.base_test, options).matters >= 1;
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
