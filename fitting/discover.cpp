#include "fitting/discover.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <set>

#include "experiment/parallel.hpp"
#include "fitting/footprints.hpp"
#include "fitting/outcome_errors.hpp"

namespace unhand::fitting {

using experiment::Channel;

const char* to_string(Verdict verdict) {
  constexpr const char* kNames[] = {"effect_found", "no_missing_effect", "unexplained", "not_answered"};
  return kNames[static_cast<int>(verdict)];
}

namespace {

/// P(χ²_k > x), by the recursion Q_{k+2} = Q_k + (x/2)^(k/2) e^(−x/2)/Γ(k/2 + 1).
double chi2_tail(double x, int k) {
  if (!(x > 0)) return 1;
  double q = k % 2 == 1 ? std::erfc(std::sqrt(x / 2)) : std::exp(-x / 2);
  for (int j = k % 2 == 1 ? 1 : 2; j < k; j += 2)
    q += std::exp(0.5 * j * std::log(x / 2) - x / 2 - std::lgamma(0.5 * j + 1));
  return std::min(1.0, q);
}

bool is_wrench(Channel c) {
  return c == Channel::wrench_fx || c == Channel::wrench_fz || c == Channel::wrench_tau;
}

/// A model with its fit, and what it leaves of the held-out throws.
struct Stage {
  CampaignProblem problem;
  FitResult fit, held_out;
  std::vector<std::string> ids;  ///< of what was added to the base, "contact.law:..." included

  bool solved() const {
    const auto ok = [](const FitResult& f) {
      return f.outcome == FitOutcome::converged || f.outcome == FitOutcome::iterations_spent;
    };
    return ok(fit) && ok(held_out);
  }
  /// −2 log of the likelihood in which every channel of every phase has the variance that it shows, at least
  /// the declared one, plus log(samples) for every unknown.
  double bic() const {
    double out = 0;
    for (const auto& m : fit.misfit) {
      const double variance = std::max(1.0, m.chi2_per_sample());
      out += m.n * std::log(variance) + m.chi2 / variance;
    }
    return out + static_cast<double>(problem.campaign().size()) *
                     std::log(static_cast<double>(std::max(2L, fit.samples)));
  }
};

void solve(Stage& stage, const DiscoverOptions& options, std::vector<double> start) {
  FitOptions train = options.fit;
  train.start = std::move(start);
  stage.fit = fit(stage.problem, train);
  if (stage.fit.outcome == FitOutcome::no_start || stage.fit.outcome == FitOutcome::not_solved) return;
  FitOptions test = options.fit;
  test.share = Share::test;
  test.start = stage.fit.values();
  test.all_fixed = true;
  test.own_spread = stage.fit.own_spread;
  test.rounds = 2;
  stage.held_out = fit(stage.problem, test);
}

/// Fits again from the solution: the weights of the channels were learned while the effect was still missing.
void polish(Stage& stage, const DiscoverOptions& options) {
  for (int again = 0; again < 2; ++again) {
    Stage next{stage.problem, {}, {}, stage.ids};
    solve(next, options, stage.fit.values());
    if (!next.solved() || next.bic() > stage.bic() - 1) return;
    stage = std::move(next);
  }
}

/// By how much a channel's misfit must exceed the noise before there is anything to explain.
bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options) {
  if (is_wrench(m.channel)) return m.chi2_per_sample() > options.wrench_misfit;
  return m.chi2_per_sample() > 1 + std::max(options.matters, 3 * std::sqrt(2.0 / m.n));
}

/// The channel and phase whose held-out misfit fell most, in units of what matters there (>= 1: it matters).
struct Improvement {
  double matters{};
  double fall{};
  std::string where;
};
Improvement improvement(const FitResult& before, const FitResult& after, const DiscoverOptions& options) {
  Improvement out;
  for (const auto& b : before.misfit)
    for (const auto& a : after.misfit) {
      if (a.channel != b.channel || a.phase != b.phase) continue;
      if (b.phase == Phase::grasped && !is_wrench(b.channel)) continue;  // no prediction is the better for it
      const double was = b.chi2_per_sample(), fall = was - a.chi2_per_sample();
      double needed = std::max({options.matters, 0.1 * (was - 1), 2 * std::sqrt(2.0 / b.n)});
      if (is_wrench(b.channel)) {
        if (was < options.wrench_misfit) continue;
        needed = std::max(options.wrench_matters, 0.25 * (was - 1));
      }
      if (fall / needed <= out.matters) continue;
      out.matters = fall / needed;
      out.fall = fall;
      out.where = fmt::format("{} in {}: {:.3g} to {:.3g} per sample", to_string(b.channel),
                              to_string(b.phase), was, a.chi2_per_sample());
    }
  return out;
}

FirstMisfit first_misfit(const FitResult& fit, const DiscoverOptions& options) {
  FirstMisfit out;
  for (const auto& m : fit.misfit) {
    if (!is_misfit(m, options)) continue;
    if (out.any && m.phase != out.phase) break;  // misfits are in the order of the phases
    if (out.any && m.chi2_per_sample() <= out.chi2_per_sample) continue;
    out = {true, m.phase, m.channel, m.chi2_per_sample()};
  }
  return out;
}

/// Wald's test of an effect's size parameters against neutral.
double wald_p_value(const Stage& stage, const dynamics::Effect& effect) {
  std::vector<std::size_t> index;
  std::vector<double> away;
  for (std::size_t k = 0; k < stage.fit.campaign.size(); ++k) {
    const auto& u = stage.fit.campaign[k];
    for (const auto& p : effect.parameters)
      if (!p.is_shape() && u.unknown.name.substr(0, u.unknown.name.find('[')) == effect.full_name(p)) {
        index.push_back(k);
        away.push_back(u.value - p.neutral);
      }
  }
  const auto n = static_cast<Eigen::Index>(index.size());
  if (n == 0) return 1;
  Eigen::MatrixXd C(n, n);
  Eigen::VectorXd d(n);
  const std::size_t width = stage.fit.campaign.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    d[i] = away[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < n; ++j)
      C(i, j) =
          stage.fit
              .covariance[index[static_cast<std::size_t>(i)] * width + index[static_cast<std::size_t>(j)]];
  }
  return chi2_tail(d.dot(pseudo_solve(C, d)), static_cast<int>(n));
}

std::vector<std::string> catalogue(const DiscoverOptions& options) {
  std::vector<std::string> out;
  for (const auto& effect : experiment::known_effects())
    if (std::find(options.forget.begin(), options.forget.end(), effect.id) == options.forget.end())
      out.push_back(effect.id);
  return out;
}

bool is_law(const std::string& id) { return id.rfind("contact.law:", 0) == 0; }

/// The stage with one candidate more, started from the step that its footprint asks for.
Stage extended(const Stage& stage, const Candidate& candidate, const Score& score,
               const DiscoverOptions& options) {
  auto effects = stage.problem.options().effects;
  std::string law = stage.problem.options().model;
  if (is_law(candidate.id))
    law = candidate.id.substr(std::string("contact.law:").size());
  else
    effects.push_back(candidate.id);
  Stage out{stage.problem.with(law, effects), {}, {}, stage.ids};
  out.ids.push_back(candidate.id);
  std::vector<double> start = out.problem.start();
  for (std::size_t k = 0; k < start.size(); ++k) {
    const Unknown& u = out.problem.campaign()[k];
    for (const auto& fitted : stage.fit.campaign)
      if (fitted.unknown.name == u.name) start[k] = fitted.value;
    for (std::size_t j = 0; j < candidate.parameters.size(); ++j)
      if (candidate.parameters[j] == u.name) start[k] = std::clamp(u.start + score.step[j], u.low, u.high);
    for (const auto& [name, value] : candidate.shape)
      if (u.name.substr(0, u.name.find('[')) == name) start[k] = value;
  }
  solve(out, options, std::move(start));
  return out;
}

/// A split where the log has none: every other condition of an object is held out.
datasets::ThrowLog with_split(datasets::ThrowLog log) {
  bool train = false, test = false;
  for (const auto& t : log.throws) (t.split == datasets::Split::train ? train : test) = true;
  if (train && test) return log;
  std::map<std::string, std::vector<std::string>> conditions;
  for (const auto& t : log.throws) {
    auto& of = conditions[t.object];
    if (std::find(of.begin(), of.end(), t.condition) == of.end()) of.push_back(t.condition);
  }
  for (auto& t : log.throws) {
    const auto& of = conditions[t.object];
    const auto at = std::find(of.begin(), of.end(), t.condition) - of.begin();
    t.split = at % 2 == 0 ? datasets::Split::train : datasets::Split::test;
  }
  return log;
}

void rank(std::vector<Ranked>& ranking, const Footprints& f, const std::vector<Score>& all) {
  const double left =
      f.gram(static_cast<Eigen::Index>(f.residual()), static_cast<Eigen::Index>(f.residual()));
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
    const double scale = std::max(1.0, best ? (left - best->gain) / std::max(1.0, f.samples) : 1.0);
    found->p_value = chi2_tail(s.gain / scale, static_cast<int>(c.columns.size()));
    found->correlation_with_best = best ? between(f, f.candidates[best->candidate], best->step, c) : 0;
  }
  std::sort(ranking.begin(), ranking.end(), [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
}

/// One step forward: the candidate that explains most, if it convinces. Empty otherwise.
std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out,
                             std::vector<std::pair<std::string, double>>& rivals) {
  const auto f = footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads);
  auto all = scores(f);
  rank(out.ranking, f, all);
  std::sort(all.begin(), all.end(), [](const Score& a, const Score& b) { return a.gain > b.gain; });
  std::set<std::string> tried;
  std::optional<Stage> best;
  Improvement best_improvement;
  // What explains less than a third of what another footprint would is an imitation of it.
  const double least = all.empty() ? 0 : all.front().gain / 3;
  rivals.clear();
  for (const Score& score : all) {
    const Candidate& candidate = f.candidates[score.candidate];
    if (static_cast<int>(tried.size()) >= options.refits) break;
    if (tried.contains(candidate.id) || !score.visible || score.gain < least) continue;
    tried.insert(candidate.id);
    Stage next = extended(stage, candidate, score, options);
    if (!next.solved()) continue;
    const double delta = next.bic() - stage.bic();
    const Improvement held_out = improvement(stage.held_out, next.held_out, options);
    for (auto& r : out.ranking)
      if (r.id == candidate.id) {
        r.refitted = true;
        r.delta_bic = delta;
        r.held_out_gain = held_out.fall;
      }
    rivals.push_back({candidate.id, delta});
    const double p = is_law(candidate.id) ? 0 : wald_p_value(next, find_effect(candidate.id));
    const auto catalogue_size = static_cast<double>(f.candidates.size());
    if (delta > -10 || held_out.matters < 1 || p > options.false_discovery_rate / catalogue_size) continue;
    if (best && next.bic() >= best->bic()) continue;
    best = std::move(next);
    best_improvement = held_out;
  }
  if (best) {
    AcceptedEffect effect;
    effect.id = best->ids.back();
    effect.delta_bic = best->bic() - stage.bic();
    effect.why = best_improvement.where;
    out.effects.push_back(std::move(effect));
  }
  return best;
}

/// Effects that a later one has made superfluous are taken back.
void backward(Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (bool removed = true; removed && stage.ids.size() > 1;) {
    removed = false;
    for (std::size_t i = 0; i + 1 < stage.ids.size(); ++i) {
      if (is_law(stage.ids[i])) continue;
      auto effects = stage.problem.options().effects;
      effects.erase(std::find(effects.begin(), effects.end(), stage.ids[i]));
      Stage without{stage.problem.with(stage.problem.options().model, effects), {}, {}, stage.ids};
      without.ids.erase(without.ids.begin() + static_cast<std::ptrdiff_t>(i));
      std::vector<double> start = without.problem.start();
      for (std::size_t k = 0; k < start.size(); ++k)
        for (const auto& u : stage.fit.campaign)
          if (u.unknown.name == without.problem.campaign()[k].name) start[k] = u.value;
      solve(without, options, std::move(start));
      if (!without.solved()) continue;
      const bool needed = stage.bic() - without.bic() < -10 &&
                          improvement(without.held_out, stage.held_out, options).matters >= 1;
      if (needed) continue;
      std::erase_if(out.effects, [&](const AcceptedEffect& e) { return e.id == stage.ids[i]; });
      stage = std::move(without);
      removed = true;
      break;
    }
  }
}

/// Bins of 5 ms from 100 ms before the release to 50 ms after, then of 20 ms.
std::vector<ResidualBin> residual_over_time(const Stage& stage, int threads) {
  const auto& throws = stage.problem.throws();
  std::vector<Eigen::VectorXd> residuals(throws.size());
  experiment::parallel_for(throws.size(), threads, [&](std::size_t i) {
    if (!stage.fit.throws[i].used) return;
    const auto l = stage.problem.linearise(throws[i], stage.fit.values(), stage.fit.throws[i].own, false);
    if (l.solved) residuals[i] = l.residual;
  });
  std::map<std::pair<int, int>, ResidualBin> bins;
  for (std::size_t i = 0; i < throws.size(); ++i) {
    const double release = throws[i].release_or(throws[i].opening);
    for (Eigen::Index j = 0; j < residuals[i].size(); ++j) {
      const auto& o = throws[i].observed.all[static_cast<std::size_t>(j)];
      if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta ||
          o.channel == Channel::landing_time)
        continue;
      const double since = o.time - release;
      const int bin = since < 0.05 ? static_cast<int>(std::floor(since / 0.005))
                                   : 10 + static_cast<int>((since - 0.05) / 0.02);
      auto& b = bins[{static_cast<int>(o.channel), bin}];
      b.channel = o.channel;
      b.time = bin < 10 ? 0.005 * (bin + 0.5) : 0.05 + 0.02 * (bin - 10 + 0.5);
      const double r = residuals[i][j];
      b.n += 1, b.mean += r, b.rms += r * r;
    }
  }
  std::vector<ResidualBin> out;
  for (auto& [key, b] : bins) {
    b.mean /= b.n;
    b.rms = std::sqrt(b.rms / b.n);
    out.push_back(b);
  }
  return out;
}

/// Values, significance and other names of what was accepted.
void describe(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  const auto f = footprints(stage.problem, stage.fit, catalogue(options), options.laws, options.fit.threads);
  for (AcceptedEffect& accepted : out.effects) {
    if (is_law(accepted.id)) {
      for (const auto& u : stage.fit.campaign)
        if (u.unknown.name == "mu" || u.unknown.name == "length")
          accepted.parameters.push_back({u.unknown.name, u.unknown.unit, u.value, u.sigma});
      continue;
    }
    const dynamics::Effect effect = find_effect(accepted.id);
    accepted.p_value = wald_p_value(stage, effect);
    Eigen::VectorXd contribution = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(f.fitted));
    for (std::size_t k = 0; k < stage.fit.campaign.size(); ++k) {
      const auto& u = stage.fit.campaign[k];
      for (const auto& p : effect.parameters) {
        const std::string full = effect.full_name(p);
        if (u.unknown.name.substr(0, u.unknown.name.find('[')) != full) continue;
        accepted.parameters.push_back(
            {u.unknown.name.substr(accepted.id.size() + 1), u.unknown.unit, u.value, u.sigma});
        if (!p.is_shape()) contribution[static_cast<Eigen::Index>(k)] = u.value - p.neutral;
      }
    }
    for (const Candidate& candidate : f.candidates) {
      const double r = correlation(f, contribution, candidate);
      if (r < options.equivalent) continue;
      auto known = std::find_if(accepted.equivalent.begin(), accepted.equivalent.end(),
                                [&](const auto& e) { return e.first == candidate.id; });
      if (known == accepted.equivalent.end())
        accepted.equivalent.push_back({candidate.id, r});
      else
        known->second = std::max(known->second, r);
    }
  }
}

void look_for_the_unexplained(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  for (const auto& m : stage.fit.misfit) {
    const double limit = is_wrench(m.channel) ? 2 * options.unexplained : options.unexplained;
    if (!is_misfit(m, options) || m.chi2_per_sample() < limit) continue;
    // The first phase in which something is left; there, the channel in which most is.
    if (out.unexplained &&
        (m.phase != out.unexplained->phase || m.chi2_per_sample() <= out.unexplained->chi2_per_dof))
      continue;
    out.unexplained = Unexplained{m.phase, m.channel, m.chi2_per_sample(), {}};
  }
  if (out.unexplained)
    out.unexplained->description = fmt::format(
        "{} in {}: {:.3g} times the variance of the noise is left, and no effect of the catalogue "
        "explains it on held-out throws",
        to_string(out.unexplained->channel), to_string(out.unexplained->phase),
        out.unexplained->chi2_per_dof);
  if (out.unexplained && out.effects.empty() && !out.ranking.empty() && out.ranking.front().gain > 1)
    out.unexplained->description +=
        fmt::format("; the nearest footprint is that of {}", out.ranking.front().id);
}

}  // namespace

Discovery discover(const datasets::ThrowLog& logged, const std::string& file,
                   const DiscoverOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const datasets::ThrowLog log = with_split(logged);
  Discovery out;
  Stage stage{CampaignProblem(log, file, options.campaign), {}, {}, {}};
  solve(stage, options, {});
  out.base = stage.fit;
  out.model = options.campaign.model;
  if (!stage.solved()) {
    out.verdict = Verdict::not_answered;
    out.message = fmt::format("the base model could not be fitted: {}",
                              stage.fit.message.empty() ? stage.held_out.message : stage.fit.message);
    return out;
  }
  out.base_test = stage.held_out.misfit;
  out.before_train = outcome_errors(stage.problem, stage.fit, Share::train, options.fit.threads);
  out.before_test = outcome_errors(stage.problem, stage.fit, Share::test, options.fit.threads);
  out.before_train.chi2_per_dof = stage.fit.chi2_per_dof();
  out.before_test.chi2_per_dof = stage.held_out.chi2_per_dof();
  out.first = first_misfit(stage.fit, options);
  out.residual_before = residual_over_time(stage, options.fit.threads);

  std::vector<std::pair<std::string, double>> rivals;
  for (int step = 0; step < options.most_effects; ++step) {
    if (step > 0 && !first_misfit(stage.fit, options).any) break;
    auto next = forward(stage, options, out, rivals);
    if (!next) break;
    const auto errors = outcome_errors(next->problem, next->fit, Share::test, options.fit.threads);
    const auto before = outcome_errors(stage.problem, stage.fit, Share::test, options.fit.threads);
    out.effects.back().test_error_ratio =
        before.trajectory_rms > 0 ? errors.trajectory_rms / before.trajectory_rms : 1;
    stage = std::move(*next);
    polish(stage, options);
  }
  backward(stage, options, out);
  if (!out.effects.empty()) describe(stage, options, out);
  look_for_the_unexplained(stage, options, out);

  out.residual_after = residual_over_time(stage, options.fit.threads);
  out.final = stage.fit;
  out.final_test = stage.held_out.misfit;
  out.model = stage.problem.options().model;
  out.active = stage.problem.options().effects;
  out.after_train = outcome_errors(stage.problem, stage.fit, Share::train, options.fit.threads);
  out.after_test = outcome_errors(stage.problem, stage.fit, Share::test, options.fit.threads);
  out.after_train.chi2_per_dof = stage.fit.chi2_per_dof();
  out.after_test.chi2_per_dof = stage.held_out.chi2_per_dof();
  out.verdict = !out.effects.empty() ? Verdict::effect_found
                : out.unexplained    ? Verdict::unexplained
                                     : Verdict::no_missing_effect;
  out.problem = std::make_shared<const CampaignProblem>(std::move(stage.problem));
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return out;
}

}  // namespace unhand::fitting
