#include "fitting/discovery/stage.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "fitting/dense_solve.hpp"
#include "fitting/discovery/residual_structure.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Channels and phases of a full log: wrench and mocap before, during and after the release, the sensor's own
/// force, the landing.
constexpr int kSeries = 3 * 3 + 3 * 3 + 1 + 3;

bool is_answer(const FitResult& f) {
  return f.outcome == FitOutcome::converged || f.outcome == FitOutcome::iterations_spent;
}

}  // namespace

bool is_wrench(Channel c) {
  return c == Channel::wrench_fx || c == Channel::wrench_fz || c == Channel::wrench_tau;
}

bool Stage::is_fitted() const { return is_answer(fit); }

bool Stage::solved() const { return is_fitted() && is_answer(held_out); }

double deviance(const FitResult& fit) {
  double out = 0;
  for (const auto& m : fit.misfit) {
    const double variance = std::max(1.0, m.chi2_per_sample());
    out += m.n * std::log(variance) + m.chi2 / variance;
  }
  return out;
}

double Stage::bic() const {
  return deviance(fit) + static_cast<double>(problem.campaign().size()) *
                             std::log(static_cast<double>(std::max(2L, fit.samples)));
}

PredictionGain prediction_gain(const Stage& before, const Stage& after, const DiscoverOptions& options) {
  return prediction_gain(before.problem, before.fit, after.problem, after.fit, Share::test,
                         options.fit.threads);
}

OutcomeErrors errors_of(const Stage& stage, Share share, int threads) {
  OutcomeErrors out = outcome_errors(stage.problem, stage.fit, share, threads);
  out.chi2_per_dof = (share == Share::test ? stage.held_out : stage.fit).chi2_per_dof();
  return out;
}

double error_ratio(const OutcomeErrors& before, const OutcomeErrors& after) {
  if (before.trajectory_rms > 0) return after.trajectory_rms / before.trajectory_rms;
  return before.landing_x_mae > 0 ? after.landing_x_mae / before.landing_x_mae : 1;
}

bool held_out_confirms(const Stage& before, const Stage& after) {
  constexpr double kConfirmed = 20;  // times as likely
  return deviance(before.held_out) - deviance(after.held_out) > 2 * std::log(kConfirmed);
}

double give_per_compliance(const Stage& stage) {
  double mu = 0.5;
  for (const auto& u : stage.fit.campaign)
    if (u.unknown.name == "mu") mu = u.value;
  return stage.problem.model().pads * mu * stage.problem.model().reference_force;
}

double give_of(const Stage& stage) {
  for (const auto& u : stage.fit.campaign)
    if (u.unknown.name == std::string(kPads) + ".compliance") return u.value * give_per_compliance(stage);
  return 0;
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
  if (!is_answer(stage.fit)) return false;
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
  return is_answer(stage.held_out);
}

void solve(Stage& stage, const DiscoverOptions& options, std::vector<double> start) {
  if (solve_train(stage, options, std::move(start))) solve_held_out(stage, options);
}

void polish(Stage& stage, const DiscoverOptions& options) {
  for (int again = 0; again < 2; ++again) {
    Stage next{stage.problem, {}, {}, stage.ids};
    if (!solve_train(next, options, stage.fit.values()) || next.bic() > stage.bic() - 1) return;
    if (!solve_held_out(next, options)) return;
    stage = std::move(next);
  }
}

CampaignProblem extended_problem(const CampaignProblem& problem, const std::string& id) {
  const auto& options = problem.options();
  if (is_law(id)) return problem.with(id.substr(kLaw.size()), options.effects);
  auto effects = options.effects;
  effects.push_back(id);
  return problem.with(options.model, effects);
}

Stage extended(const Stage& stage, const Candidate& candidate, const Score& score,
               const DiscoverOptions& options) {
  Stage out{extended_problem(stage.problem, candidate.id), {}, {}, stage.ids};
  out.ids.push_back(candidate.id);
  std::vector<double> start = carried(stage.fit, out.problem), typical = out.problem.start();
  for (std::size_t k = 0; k < start.size(); ++k) {
    const Unknown& u = out.problem.campaign()[k];
    for (std::size_t j = 0; j < candidate.parameters.size(); ++j) {
      if (candidate.parameters[j] != u.name) continue;
      start[k] = std::clamp(u.start + score.step[j], u.low, u.high);
      const double by = std::copysign(u.scale, score.step[j]);
      typical[k] = std::clamp(u.start + by, u.low, u.high);
      if (typical[k] == u.start) typical[k] = std::clamp(u.start - by, u.low, u.high);  // one-sided
    }
    if (const auto shape = candidate.shape.find(without_object(u.name)); shape != candidate.shape.end())
      start[k] = shape->second;
  }
  solve_train(out, options, std::move(start));
  const bool in_vain = !out.is_fitted() || out.bic() - stage.bic() > kDeltaBic;
  const bool misfit = std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(),
                                  [&](const ChannelMisfit& m) { return is_misfit(m, options); });
  if (is_law(candidate.id) || !stage.ids.empty() || !misfit || !in_vain) return out;
  // Something is missing, and a leading candidate gains nothing: its search may have gone astray, since the
  // base had bent what they share to make up for what it lacks. Once more, from what the log itself suggests
  // of that and with an effect of a typical size.
  Stage again{out.problem, {}, {}, out.ids};
  if (solve_train(again, options, std::move(typical)) &&
      (!out.is_fitted() || deviance(again.fit) < deviance(out.fit)))
    return again;
  return out;
}

Stage reduced(const Stage& stage, std::size_t index, const DiscoverOptions& options) {
  auto effects = stage.problem.options().effects;
  std::erase(effects, stage.ids[index]);
  const std::string& model =
      is_law(stage.ids[index]) ? options.campaign.model : stage.problem.options().model;
  Stage out{stage.problem.with(model, effects), {}, {}, stage.ids};
  out.ids.erase(out.ids.begin() + static_cast<std::ptrdiff_t>(index));
  solve(out, options, carried(stage.fit, out.problem));
  return out;
}

bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options) {
  const bool slips = is_wrench(m.channel) && m.phase != Phase::grasped;
  if (m.chi2_per_sample() <= (slips ? options.wrench_misfit : 1 + options.matters)) return false;
  return chi2_tail(m.chi2, m.n) < options.false_discovery_rate / kSeries;
}

bool is_confirmed(const std::vector<ChannelMisfit>& other_half, const ChannelMisfit& misfit) {
  return std::any_of(other_half.begin(), other_half.end(), [&](const ChannelMisfit& m) {
    return m.channel == misfit.channel && m.phase == misfit.phase && chi2_tail(m.chi2, m.n) < 0.05;
  });
}

double unexplained_from(Channel channel, const DiscoverOptions& options) {
  return is_wrench(channel) ? 2 * options.unexplained : options.unexplained;
}

double misfit_in(const std::vector<ChannelMisfit>& misfit, Channel channel, Phase phase) {
  for (const auto& m : misfit)
    if (m.channel == channel && m.phase == phase) return m.chi2_per_sample();
  return 1;
}

Improvement improvement(const FitResult& before, const FitResult& after,
                        const std::vector<ChannelMisfit>& base, const DiscoverOptions& options) {
  Improvement out;
  for (const auto& b : before.misfit) {
    if (b.phase == Phase::grasped && !is_wrench(b.channel)) continue;  // no prediction is the better for it
    const double was = b.chi2_per_sample(), is = misfit_in(after.misfit, b.channel, b.phase);
    double needed = std::max({options.matters, 0.1 * (was - 1), 2 * std::sqrt(2.0 / b.n)});
    if (is_wrench(b.channel)) {
      // Most of a wrench's variance is trust, not noise: one that is explained falls below 1, and what
      // matters is by how much.
      const double from = b.phase == Phase::grasped ? 1 + options.matters : options.wrench_misfit;
      const bool explained = is < 1 + kRest * (was - 1);
      if (was < from && !explained) continue;
      needed = std::max(options.wrench_matters, 0.25 * (was - 1));
    }
    needed = std::max(needed, kRest * (misfit_in(base, b.channel, b.phase) - 1));
    if ((was - is) / needed <= out.matters) continue;
    out.matters = (was - is) / needed;
    out.fall = was - is;
    out.where = fmt::format("{} in {}: {:.3g} to {:.3g} per sample", to_string(b.channel), to_string(b.phase),
                            was, is);
    out.phase = b.phase;
  }
  return out;
}

Improvement law_improvement(const FitResult& before, const FitResult& after,
                            const std::vector<ChannelMisfit>& base, const DiscoverOptions& options) {
  double fall = 0;
  for (const auto& b : before.misfit) {
    const double left = b.chi2_per_sample() - 1, at_base = misfit_in(base, b.channel, b.phase) - 1;
    if (at_base > 0 && left < kRest * at_base) continue;  // explained
    fall += b.n * (b.chi2_per_sample() - misfit_in(after.misfit, b.channel, b.phase));
  }
  const double was = before.chi2, per = static_cast<double>(std::max(1L, before.samples));
  if (!(was > 0)) return {};
  return {fall / (options.law_matters * was), fall / per,
          fmt::format("chi2 of all channels: {:.4g} to {:.4g} per sample", was / per, (was - fall) / per)};
}

double wald_p_value(const FitResult& fit, const dynamics::Effect& effect) {
  std::vector<Eigen::Index> index;
  std::vector<double> away;
  const auto& campaign = fit.campaign;
  for (std::size_t k = 0; k < campaign.size(); ++k)
    for (const auto& p : effect.parameters)
      if (!p.is_shape() && without_object(campaign[k].unknown.name) == effect.full_name(p)) {
        index.push_back(static_cast<Eigen::Index>(k));
        away.push_back(campaign[k].value - p.neutral);
      }
  if (index.empty()) return 1;
  const auto width = static_cast<Eigen::Index>(campaign.size());
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> all(fit.covariance.data(), width, width);
  const Eigen::MatrixXd C = all(index, index);
  const Eigen::Map<const Eigen::VectorXd> d(away.data(), static_cast<Eigen::Index>(away.size()));
  return chi2_tail(d.dot(pseudo_solve(C, d)), static_cast<int>(away.size()));
}

std::vector<std::string> catalogue(const DiscoverOptions& options) {
  std::vector<std::string> out;
  for (const auto& effect : experiment::known_effects())
    if (std::find(options.forget.begin(), options.forget.end(), effect.id) == options.forget.end())
      out.push_back(effect.id);
  return out;
}

}  // namespace unhand::fitting
