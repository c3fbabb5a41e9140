#include "fitting/selection.hpp"

#include <algorithm>
#include <cmath>

#include "fitting/discrepancy.hpp"

namespace unhand::fitting {

namespace {

/// What is left of the misfit where an effect acts, from which on it is an imitation of another.
constexpr double kLeft = 0.1;

/// The footprint's own names for `accepted`: candidates that could have left it as well. What had no
/// footprint of its own before anything was accepted could not: a wind acts through the drag that has just
/// been found.
void find_other_names(const Footprints& f, const Eigen::VectorXd& contribution, double enough,
                      const std::vector<Ranked>& at_base, AcceptedEffect& accepted) {
  const auto has_footprint = [&](const std::string& id) {
    return std::any_of(at_base.begin(), at_base.end(),
                       [&](const Ranked& r) { return r.id == id && r.gain > 0; });
  };
  for (const Candidate& candidate : f.candidates) {
    if (!has_footprint(candidate.id)) continue;
    const double r = correlation(f, contribution, candidate);
    if (r < enough) continue;
    accepted.add_other_name(candidate.id, r);
  }
}

}  // namespace

bool predicts_better(const Stage& before, const Stage& after, const DiscoverOptions& options) {
  const PredictionGain gain = prediction_gain(before, after, options);
  return gain.before > options.prediction_matters * gain.after && held_out_confirms(before, after);
}

void backward(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (bool removed = true; removed && stage.ids.size() > 1;) {
    removed = false;
    for (std::size_t i = 0; i + 1 < stage.ids.size() && !removed; ++i) {
      if (is_law(stage.ids[i])) continue;
      Stage without = reduced(stage, i, options);
      if (!without.solved()) continue;
      const bool needed =
          stage.bic() - without.bic() < kDeltaBic &&
          (improvement(without.held_out, stage.held_out, out.base_test, options).matters >= 1 ||
           predicts_better(without, stage, options));
      if (needed) continue;
      std::erase_if(out.effects, [&](const AcceptedEffect& e) { return e.id == stage.ids[i]; });
      stage = std::move(without);
      removed = true;
    }
  }
}

void withdraw(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const auto in_air = [](Phase phase) { return phase == Phase::flight || phase == Phase::landing; };
  const auto imitates = [&](const AcceptedEffect& effect) {
    return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const ChannelMisfit& m) {
      const double before = misfit_in(out.base.misfit, m.channel, m.phase);
      return !is_wrench(m.channel) && is_misfit(m, options) && in_air(m.phase) == in_air(effect.phase) &&
             m.chi2_per_sample() >= options.unexplained && m.chi2_per_sample() - 1 > kLeft * (before - 1);
    });
  };
  std::vector<std::string> ids;
  auto effects = stage.problem.options().effects;
  std::string model = out.model;
  for (const AcceptedEffect& effect : out.effects) {
    if (imitates(effect)) {
      out.imitations.push_back(effect.id);
      std::erase(effects, effect.id);
    } else {
      ids.push_back(effect.id);
      if (is_law(effect.id)) model = stage.problem.options().model;
    }
  }
  if (out.imitations.empty()) return;
  if (ids.empty()) effects.clear();  // what was fitted along went with them
  Stage without{stage.problem.with(model, effects), {}, {}, ids};
  solve(without, options, carried(stage.fit, without.problem));
  if (!without.solved()) {
    out.imitations.clear();
    return;
  }
  std::erase_if(out.effects, [&](const AcceptedEffect& effect) {
    return std::find(ids.begin(), ids.end(), effect.id) == ids.end();
  });
  if (effects.empty()) out.along.clear();
  stage = std::move(without);
}

bool acts_on_pads(const Stage& stage) {
  return std::any_of(stage.ids.begin(), stage.ids.end(), [](const std::string& id) {
    return id.starts_with("contact.") || id.starts_with("release.");
  });
}

bool fit_along(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const std::string along = "contact.pad_compliance";
  const auto& model = stage.problem.options().model;
  auto effects = stage.problem.options().effects;
  const bool has_pads = model.starts_with("limit_surface");
  const auto known = catalogue(options);
  if (!has_pads || std::find(effects.begin(), effects.end(), along) != effects.end() ||
      std::find(known.begin(), known.end(), along) == known.end())
    return false;
  effects.push_back(along);
  Stage next{stage.problem.with(model, effects), {}, {}, stage.ids};
  std::vector<double> start = carried(stage.fit, next.problem);
  constexpr double kGive = 3e-6;  // to start with [m]
  for (std::size_t k = 0; k < start.size(); ++k)
    if (next.problem.campaign()[k].name == along + ".compliance")
      start[k] = kGive / give_per_compliance(stage);
  solve(next, options, std::move(start));
  if (!next.solved() || next.bic() - stage.bic() > kDeltaBic || give_of(next) > kMostGive) return false;
  stage = std::move(next);
  out.along.push_back(along);
  return true;
}

void describe(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  if (out.effects.empty()) return;
  const auto f = footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads);
  for (AcceptedEffect& accepted : out.effects)
    if (!is_law(accepted.id)) accepted.p_value = wald_p_value(stage, find_effect(accepted.id));
  count_discrepancy(stage.problem, stage.fit, options.fit.threads);
  for (AcceptedEffect& accepted : out.effects) {
    if (is_law(accepted.id)) {
      for (const auto& u : stage.fit.campaign)
        if (u.unknown.name == "mu" || u.unknown.name == "length")
          accepted.parameters.push_back({u.unknown.name, u.unknown.unit, u.value, u.sigma});
      continue;
    }
    const dynamics::Effect effect = find_effect(accepted.id);
    Eigen::VectorXd contribution = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(f.fitted));
    for (std::size_t k = 0; k < stage.fit.campaign.size(); ++k) {
      const auto& u = stage.fit.campaign[k];
      for (const auto& p : effect.parameters) {
        if (without_object(u.unknown.name) != effect.full_name(p)) continue;
        accepted.parameters.push_back(
            {u.unknown.name.substr(accepted.id.size() + 1), u.unknown.unit, u.value, u.sigma});
        if (!p.is_shape()) contribution[static_cast<Eigen::Index>(k)] = u.value - p.neutral;
      }
    }
    find_other_names(f, contribution, options.equivalent, out.ranking, accepted);
  }
}

}  // namespace unhand::fitting
