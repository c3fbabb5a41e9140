#include "fitting/discovery/stage.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "contact/registry.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/pads_give.hpp"

namespace unhand::fitting {

bool Stage::is_fitted() const { return fit.is_answer(); }

bool Stage::solved() const { return is_fitted() && held_out.is_answer(); }

double Stage::bic() const {
  return fit.deviance() + static_cast<double>(problem.campaign().size()) *
                              std::log(static_cast<double>(std::max(2L, fit.samples)));
}

std::vector<PredictedOutcome> outcomes_of(const Stage& stage, Share share, int threads) {
  return predicted_outcomes(stage.problem, stage.fit, share, threads);
}

OutcomeErrors errors_of(const Stage& stage, Share share, int threads) {
  OutcomeErrors out = outcome_errors(outcomes_of(stage, share, threads));
  out.chi2_per_dof = (share == Share::test ? stage.held_out : stage.fit).chi2_per_dof();
  return out;
}

BothErrors errors_of(const Stage& stage, int threads) {
  return {errors_of(stage, Share::train, threads), errors_of(stage, Share::test, threads)};
}

std::optional<double> error_ratio(const OutcomeErrors& before, const OutcomeErrors& after) {
  const auto ratio = [&](std::optional<double> OutcomeErrors::*error) -> std::optional<double> {
    if (!(before.*error) || !(after.*error) || !(*(before.*error) > 0)) return std::nullopt;
    return *(after.*error) / *(before.*error);
  };
  return before.trajectory_rms ? ratio(&OutcomeErrors::trajectory_rms) : ratio(&OutcomeErrors::landing_x_mae);
}

namespace {

/// Shape parameters that a fit leaves open over their whole grid: indices into the campaign's unknowns.
std::vector<std::size_t> open_shapes(const CampaignProblem& problem, const FitResult& fit) {
  std::vector<std::size_t> out;
  for (const auto& id : problem.options().effects) {
    const dynamics::Effect effect = find_effect(id);
    for (const auto& p : effect.parameters) {
      if (!p.is_shape()) continue;
      const auto [low, high] = std::minmax_element(p.grid.begin(), p.grid.end());
      for (std::size_t k = 0; k < fit.campaign.size(); ++k)
        if (without_object(fit.campaign[k].unknown.name) == effect.full_name(p) &&
            !(fit.campaign[k].data_sigma <= *high - *low))
          out.push_back(k);
    }
  }
  return out;
}

}  // namespace

bool solve_train(Stage& stage, const DiscoverOptions& options, std::vector<double> start) {
  if (start.empty()) start = stage.problem.start();
  FitOptions train = options.fit;
  train.start = start;
  train.weigh = Weigh::variances;  // as bic() compares
  stage.fit = fit(stage.problem, train);
  if (!stage.fit.is_answer()) return false;
  if (const auto open = open_shapes(stage.problem, stage.fit); !open.empty()) {
    train.start = stage.fit.values();
    for (const std::size_t k : open) {
      train.start[k] = start[k];
      train.fixed.push_back(stage.fit.campaign[k].unknown.name);
    }
    stage.fit = fit(stage.problem, train);
  }
  return stage.is_fitted();
}

bool solve_held_out(Stage& stage, const DiscoverOptions& options) {
  FitOptions test = options.fit;
  test.weigh = Weigh::variances;
  test.share = Share::test;
  test.start = stage.fit.values();
  test.all_fixed = true;
  test.own_spread = stage.fit.own_spread;
  test.rounds = 2;
  stage.held_out = fit(stage.problem, test);
  return stage.held_out.is_answer();
}

void solve(Stage& stage, const DiscoverOptions& options, std::vector<double> start) {
  if (solve_train(stage, options, std::move(start))) solve_held_out(stage, options);
}

void polish(Stage& stage, const DiscoverOptions& options) {
  for (int again = 0; again < 2; ++again) {
    Stage next{stage.problem, {}, {}, stage.ids};
    if (!solve_train(next, options, stage.fit.values())) return;
    const long more = next.fit.samples - stage.fit.samples;  // of throws that the start could not simulate
    if (more < 0 || (more == 0 && next.bic() - stage.bic() > kLikelierBic)) return;
    if (!solve_held_out(next, options)) return;
    stage = std::move(next);
  }
}

std::vector<bool> throws_of(const Stage& stage) {
  std::vector<bool> out;
  for (std::size_t i = 0; i < stage.fit.throws.size(); ++i)
    out.push_back(stage.fit.throws[i].used || stage.held_out.throws[i].used);
  return out;
}

const Footprints& footprints_of(const Stage& stage, const DiscoverOptions& options) {
  if (!stage.asked)
    stage.asked = std::make_shared<const Footprints>(
        footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads));
  return *stage.asked;
}

namespace {

/// The problem with an effect more, or with another contact law.
CampaignProblem extended_problem(const CampaignProblem& problem, const std::string& id) {
  const auto& options = problem.options();
  if (is_law(id)) return problem.with(id.substr(kLaw.size()), options.effects);
  auto effects = options.effects;
  effects.push_back(id);
  return problem.with(options.model, effects);
}

/// Whether the search of a candidate may have gone astray. Where no misfit is left: it gains far less than
/// its footprint promised, which would have been evident. Where one is, in the first step: it gains nothing,
/// or it has the leading footprint and still leaves a misfit.
bool is_astray(const Stage& stage, const Stage& next, const Score& score, bool leads,
               const DiscoverOptions& options) {
  if (leaves_misfit(stage, options))
    return stage.ids.empty() &&
           (!next.is_fitted() || !is_evident(stage, next) || (leads && leaves_misfit(next, options)));
  const auto more = static_cast<double>(next.problem.campaign().size() - stage.problem.campaign().size());
  const bool promises = score.gain >= more * std::log(static_cast<double>(stage.fit.samples)) - kDeltaBic;
  return (promises || (leads && stage.ids.empty())) &&
         (!next.is_fitted() || stage.fit.deviance() - next.fit.deviance() < score.gain / kFirstOrder);
}

}  // namespace

void start_candidate(const CampaignProblem& problem, const Candidate& candidate, const Score& score,
                     std::vector<double>& start) {
  for (std::size_t k = 0; k < start.size(); ++k) {
    const Unknown& u = problem.campaign()[k];
    for (std::size_t j = 0; j < candidate.parameters.size(); ++j)
      if (candidate.parameters[j] == u.name) start[k] = std::clamp(u.start + score.step[j], u.low, u.high);
    if (const auto shape = candidate.shape.find(without_object(u.name)); shape != candidate.shape.end())
      start[k] = shape->second;
  }
}

Stage extended(const Stage& stage, const Candidate& candidate, const Score& score, bool leads,
               const DiscoverOptions& options) {
  Stage out{extended_problem(stage.problem, candidate.id), {}, {}, stage.ids};
  const std::string model = out.problem.options().model;
  const bool gives = is_law(candidate.id) && !contact::can_give(stage.problem.options().model);
  if (gives) out.problem = out.problem.with(model, with_give(out.problem, model, options));
  out.ids.push_back(candidate.id);
  std::vector<double> start = carried(stage.fit, out.problem), typical = out.problem.start();
  if (gives) start_give(stage, out.problem, start);
  start_candidate(out.problem, candidate, score, start);
  for (std::size_t k = 0; k < start.size(); ++k) {
    const Unknown& u = out.problem.campaign()[k];
    for (std::size_t j = 0; j < candidate.parameters.size(); ++j) {
      if (candidate.parameters[j] != u.name) continue;
      const double by = std::copysign(u.scale, score.step[j]);
      typical[k] = std::clamp(u.start + by, u.low, u.high);
      if (typical[k] == u.start) typical[k] = std::clamp(u.start - by, u.low, u.high);  // one-sided
    }
  }
  // Where the step is so long that a throw has no answer, half of it.
  const std::vector<double> from = carried(stage.fit, out.problem);
  for (int halved = 0; !solve_train(out, options, start) && halved < 4; ++halved) {
    if (out.fit.outcome != FitOutcome::no_start) break;
    for (std::size_t k = 0; k < start.size(); ++k) start[k] = 0.5 * (start[k] + from[k]);
  }
  if (is_law(candidate.id) || !is_astray(stage, out, score, leads, options)) return out;
  // The base had bent what they share to make up for what it lacks. Once more, from what the log itself
  // suggests of that and with an effect of a typical size.
  Stage again{out.problem, {}, {}, out.ids};
  if (solve_train(again, options, std::move(typical)) &&
      (!out.is_fitted() || again.fit.deviance() < out.fit.deviance()))
    return again;
  return out;
}

namespace {

bool is_same_model(const CampaignProblem& a, const CampaignProblem& b) {
  const auto &p = a.options(), &q = b.options();
  return p.model == q.model &&
         std::is_permutation(p.effects.begin(), p.effects.end(), q.effects.begin(), q.effects.end());
}

}  // namespace

const Stage& without(const Stage& stage, const std::vector<std::string>& gone,
                     const DiscoverOptions& options) {
  if (const auto known = stage.less.find(gone); known != stage.less.end()) return *known->second;
  auto effects = stage.problem.options().effects;
  std::string model = stage.problem.options().model;
  std::vector<std::string> ids = stage.ids;
  for (const std::string& id : gone) {
    std::erase(effects, id);
    std::erase(ids, id);
    if (is_law(id)) model = options.campaign.model;
  }
  if (gives_along(stage) && !contact::can_give(model)) std::erase(effects, kPads);
  Stage out{stage.problem.with(model, effects), {}, {}, std::move(ids)};
  solve(out, options, carried(stage.fit, out.problem));
  for (const Stage* before = stage.from.get(); before; before = before->from.get())
    if (is_same_model(before->problem, out.problem) && before->solved() &&
        (!out.solved() || before->fit.deviance() < out.fit.deviance()))
      out = Stage{before->problem, before->fit, before->held_out, out.ids};
  out.from = stage.from;
  return *stage.less.emplace(gone, std::make_shared<const Stage>(std::move(out))).first->second;
}

std::vector<std::string> catalogue(const DiscoverOptions& options) {
  std::vector<std::string> out;
  for (const auto& effect : experiment::known_effects())
    if (std::find(options.forget.begin(), options.forget.end(), effect.id) == options.forget.end())
      out.push_back(effect.id);
  return out;
}

}  // namespace unhand::fitting
