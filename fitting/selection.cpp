#include "fitting/selection.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "fitting/discrepancy.hpp"
#include "fitting/residual_structure.hpp"

namespace unhand::fitting {

namespace {

/// Evidence that an effect needs before it is accepted or kept.
constexpr double kDeltaBic = -10;

/// What explains less than this share of what another footprint would is an imitation of it.
constexpr double kImitation = 1.0 / 3.0;

/// Where nothing is left but noise, footprints are small and a refit gains what they say, within this factor.
constexpr double kFirstOrder = 3;

/// What is left of the misfit where an effect acts, from which on it is an imitation of another.
constexpr double kLeft = 0.1;

void rank(std::vector<Ranked>& ranking, const Footprints& f, const std::vector<Score>& all) {
  const auto last = static_cast<Eigen::Index>(f.residual());
  const Score* best = nullptr;
  for (const auto& s : all)
    if (!best || s.gain > best->gain) best = &s;
  for (const auto& s : all) {
    const Candidate& c = f.candidates[s.candidate];
    auto found = std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == c.id; });
    if (found == ranking.end()) found = ranking.insert(ranking.end(), Ranked{c.id, -1});
    if (s.gain <= found->gain) continue;
    found->gain = s.gain;
    found->visible = s.visible;
    // What the best candidate leaves sets the scale of what is not noise.
    const double scale = std::max(1.0, (f.gram(last, last) - best->gain) / std::max(1.0, f.samples));
    found->p_value = chi2_tail(s.gain / scale, static_cast<int>(c.columns.size()));
    found->correlation_with_best = between(f, f.candidates[best->candidate], best->step, c);
  }
  std::sort(ranking.begin(), ranking.end(), [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
}

Ranked& named(std::vector<Ranked>& ranking, const std::string& id) {
  return *std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == id; });
}

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

/// A refit of one candidate against the stage that it would extend.
struct Trial {
  Stage next;
  double delta_bic{};
  Improvement held_out;
};

/// The refit, if it convinces: evidence on the train throws, and then an improvement that matters on the
/// others.
std::optional<Trial> try_out(const Stage& stage, const Footprints& f, const Score& score,
                             const DiscoverOptions& options, Discovery& out) {
  const Candidate& candidate = f.candidates[score.candidate];
  Trial trial{extended(stage, candidate, score, options), 0, {}};
  if (!trial.next.is_fitted()) return std::nullopt;
  trial.delta_bic = trial.next.bic() - stage.bic();
  const bool law = is_law(candidate.id);
  Ranked& ranked = named(out.ranking, candidate.id);
  ranked.refitted = true;
  ranked.delta_bic = trial.delta_bic;
  ranked.held_out_gain.reset();
  const double p = law ? 0 : wald_p_value(trial.next, find_effect(candidate.id));
  const double share = options.false_discovery_rate / static_cast<double>(f.candidates.size());
  if (!(trial.delta_bic <= kDeltaBic) || !(p <= share)) return std::nullopt;
  if (!solve_held_out(trial.next, options)) return std::nullopt;
  trial.held_out = law ? law_improvement(stage.held_out, trial.next.held_out, out.base_test, options)
                       : improvement(stage.held_out, trial.next.held_out, out.base_test, options);
  ranked.held_out_gain = trial.held_out.fall;
  if (!(trial.held_out.matters >= 1)) return std::nullopt;
  return trial;
}

}  // namespace

std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const auto f = footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads);
  auto all = scores(f);
  if (all.empty()) return std::nullopt;
  rank(out.ranking, f, all);
  std::sort(all.begin(), all.end(), [](const Score& a, const Score& b) { return a.gain > b.gain; });
  std::set<std::string> tried;
  std::optional<Trial> best;
  const Score* of_best = nullptr;
  std::vector<std::pair<const Score*, double>> convincing;  // with the criterion of the refit
  const bool noise = !std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(),
                                  [&](const ChannelMisfit& m) { return is_misfit(m, options); });
  const auto in_reach = [&](const Score& score) {
    const double columns = static_cast<double>(f.candidates[score.candidate].columns.size());
    return !noise || kFirstOrder * score.gain >= columns * std::log(f.samples) - kDeltaBic;
  };
  const auto consider = [&](const Score& score) {
    if (!score.visible || !in_reach(score) || !tried.insert(f.candidates[score.candidate].id).second) return;
    auto trial = try_out(stage, f, score, options, out);
    if (!trial) return;
    convincing.push_back({&score, trial->next.bic()});
    if (best && trial->next.bic() >= best->next.bic()) return;
    best = std::move(trial);
    of_best = &score;
  };
  for (const Score& score : all)
    if (static_cast<int>(tried.size()) < options.refits && score.gain >= kImitation * all.front().gain)
      consider(score);
  const auto id_of = [&](const Score& score) { return f.candidates[score.candidate].id; };
  // Laws are alternatives to each other: where one convinces, all are tried. And where nothing convinced,
  // another law may still be the better one.
  if (!best || is_law(id_of(*of_best)))
    for (const Score& score : all)
      if (is_law(id_of(score))) consider(score);
  if (!best) return std::nullopt;
  AcceptedEffect accepted;
  accepted.id = id_of(*of_best);
  accepted.delta_bic = best->delta_bic;
  accepted.why = best->held_out.where;
  accepted.phase = best->held_out.phase;
  if (is_law(accepted.id))
    for (const Score& score : all)
      if (is_law(id_of(score)) && id_of(score) != accepted.id) {
        const double r =
            between(f, f.candidates[of_best->candidate], of_best->step, f.candidates[score.candidate]);
        if (r >= options.equivalent) accepted.equivalent.push_back({id_of(score), r});
      }
  for (const auto& [score, bic] : convincing)
    if (score != of_best && !is_law(id_of(*score)) && bic < best->next.bic() - kDeltaBic)
      accepted.add_other_name(id_of(*score), between(f, f.candidates[of_best->candidate], of_best->step,
                                                     f.candidates[score->candidate]));
  out.effects.push_back(std::move(accepted));
  return std::move(best->next);
}

void backward(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (bool removed = true; removed && stage.ids.size() > 1;) {
    removed = false;
    for (std::size_t i = 0; i + 1 < stage.ids.size() && !removed; ++i) {
      if (is_law(stage.ids[i])) continue;
      Stage without = reduced(stage, i, options);
      if (!without.solved()) continue;
      const bool needed = stage.bic() - without.bic() < kDeltaBic &&
                          improvement(without.held_out, stage.held_out, out.base_test, options).matters >= 1;
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

bool fit_along(Stage& stage, const DiscoverOptions& options) {
  const std::string along = "contact.pad_compliance";
  const auto& model = stage.problem.options().model;
  auto effects = stage.problem.options().effects;
  const bool has_pads = model.starts_with("limit_surface");
  const bool asked = std::any_of(stage.ids.begin(), stage.ids.end(), [](const std::string& id) {
    return id.starts_with("contact.") || id.starts_with("release.");
  });
  const auto known = catalogue(options);
  if (!asked || !has_pads || std::find(effects.begin(), effects.end(), along) != effects.end() ||
      std::find(known.begin(), known.end(), along) == known.end())
    return false;
  effects.push_back(along);
  Stage next{stage.problem.with(model, effects), {}, {}, stage.ids};
  std::vector<double> start = carried(stage.fit, next.problem);
  // Under the grip's friction limit [m]: to start with, and from where on it is an effect like any other.
  constexpr double kGive = 3e-6, kMostGive = 3e-5;
  double mu = 0.5;
  for (const auto& u : stage.fit.campaign)
    if (u.unknown.name == "mu") mu = u.value;
  const double per_compliance = stage.problem.model().pads * mu * stage.problem.model().reference_force;
  for (std::size_t k = 0; k < start.size(); ++k)
    if (next.problem.campaign()[k].name == along + ".compliance") start[k] = kGive / per_compliance;
  solve(next, options, std::move(start));
  if (!next.solved() || next.bic() - stage.bic() > kDeltaBic) return false;
  for (const auto& u : next.fit.campaign)
    if (u.unknown.name == along + ".compliance" && u.value > kMostGive / per_compliance) return false;
  stage = std::move(next);
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
