#include "fitting/discovery/acceptance.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "dynamics/dense_solve.hpp"
#include "fitting/discovery/traces.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using dynamics::pseudo_solve;
using experiment::Channel;

bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options) {
  const bool slips = is_wrench(m.channel) && m.phase != Phase::grasped;
  if (m.chi2_per_sample() <= (slips ? options.wrench_misfit : 1 + options.matters)) return false;
  return chi2_tail(m.chi2, m.n) < options.family_wise_level / kSeries;
}

bool leaves_misfit(const Stage& stage, const DiscoverOptions& options) {
  return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(),
                     [&](const ChannelMisfit& m) { return is_misfit(m, options); });
}

bool is_confirmed(const std::vector<ChannelMisfit>& other_half, const ChannelMisfit& misfit) {
  return std::any_of(other_half.begin(), other_half.end(), [&](const ChannelMisfit& m) {
    return m.channel == misfit.channel && m.phase == misfit.phase && chi2_tail(m.chi2, m.n) < kConfirmedAt;
  });
}

double unexplained_from(Channel channel, Phase phase, bool elsewhere, const DiscoverOptions& options) {
  const bool twice = phase == Phase::grasped ? elsewhere : is_wrench(channel);
  return (twice ? 2 : 1) * options.unexplained;
}

double misfit_in(const std::vector<ChannelMisfit>& misfit, Channel channel, Phase phase) {
  for (const auto& m : misfit)
    if (m.channel == channel && m.phase == phase) return m.chi2_per_sample();
  return 1;
}

namespace {

/// Most of a wrench's variance is trust, not noise: one that is explained falls below 1.
bool is_explained(double was, double is) { return is < 1 + kRest * (was - 1); }

bool is_among(const std::vector<ChannelMisfit>& all, const ChannelMisfit& m) {
  return std::any_of(all.begin(), all.end(), [&](const ChannelMisfit& other) {
    return other.channel == m.channel && other.phase == m.phase;
  });
}

}  // namespace

std::vector<ChannelMisfit> settled_wrenches(const FitResult& before, const FitResult& after,
                                            const DiscoverOptions& options) {
  std::vector<ChannelMisfit> out;
  for (const auto& b : before.misfit)
    if (b.phase == Phase::release && is_wrench(b.channel) && is_misfit(b, options) &&
        is_explained(b.chi2_per_sample(), misfit_in(after.misfit, b.channel, b.phase)))
      out.push_back(b);
  return out;
}

Improvement improvement(const Stage& before, const Stage& after, const std::vector<ChannelMisfit>& base,
                        const DiscoverOptions& options) {
  return improvement(before.held_out, after.held_out, base, options,
                     settled_wrenches(before.fit, after.fit, options));
}

Improvement improvement(const FitResult& before, const FitResult& after,
                        const std::vector<ChannelMisfit>& base, const DiscoverOptions& options,
                        const std::vector<ChannelMisfit>& settled) {
  Improvement out;
  for (const auto& b : before.misfit) {
    if (b.phase == Phase::grasped && !is_wrench(b.channel)) continue;  // no prediction is the better for it
    const double was = b.chi2_per_sample(), is = misfit_in(after.misfit, b.channel, b.phase);
    double needed = std::max({options.matters, kShare * (was - 1), 2 * std::sqrt(2.0 / b.n)});
    if (is_wrench(b.channel)) {
      const double from = b.phase == Phase::grasped ? 1 + options.matters : options.wrench_misfit;
      const bool settles = is_among(settled, b);
      if (was < from && !settles && !is_explained(was, is)) continue;
      needed = std::max(options.wrench_matters, kWrenchShare * (was - 1));
      if (settles) needed = std::min(needed, std::max(kWrenchShare * was, 2 * std::sqrt(2.0 / b.n)));
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

bool held_out_confirms(const Stage& before, const Stage& after) {
  return before.held_out.deviance() - after.held_out.deviance() > 2 * std::log(kTimesAsLikely);
}

bool predicts_better(const Stage& before, const Stage& after, const DiscoverOptions& options) {
  const auto outcomes_before = outcomes_of(before, Share::test, options.fit.threads),
             outcomes_after = outcomes_of(after, Share::test, options.fit.threads);
  const PredictionGain gain = prediction_gain(outcomes_before, outcomes_after);
  if (!(gain.before > options.prediction_matters * gain.after) || !held_out_confirms(before, after))
    return false;
  const OutcomeErrors was = outcome_errors(outcomes_before), is = outcome_errors(outcomes_after);
  const auto holds = [&](std::optional<double> OutcomeErrors::*outcome) {
    if (!(was.*outcome)) return true;
    return is.*outcome && *(is.*outcome) <= options.prediction_matters * *(was.*outcome);
  };
  return holds(&OutcomeErrors::landing_x_mae) && holds(&OutcomeErrors::landing_theta_mae) &&
         holds(&OutcomeErrors::detach_vx_mae) && holds(&OutcomeErrors::detach_omega_mae) &&
         holds(&OutcomeErrors::trajectory_rms);
}

bool is_lacking(const OutcomeLack& lack, double level) {
  return lack.fit.ratio() >= kLacking && lack.fit.p_value < level &&
         lack.fit.shared > lack.resolution * lack.resolution;
}

OutcomeLack lack_in(const OutcomeErrors& all, Outcome outcome) {
  for (const OutcomeLack& lack : all.lacks)
    if (lack.outcome == outcome) return lack;
  return {outcome, {}, 0};
}

std::vector<OutcomeLack> lacking(const OutcomeErrors& train, const OutcomeErrors& held_out,
                                 const DiscoverOptions& options) {
  std::vector<OutcomeLack> out;
  for (const OutcomeLack& lack : train.lacks)
    if (is_lacking(lack, options.family_wise_level / kOutcomes) &&
        is_lacking(lack_in(held_out, lack.outcome), kConfirmedAt))
      out.push_back(lack);
  return out;
}

namespace {

/// The covariance of some unknowns of a fit where `given` others are what they are.
Eigen::MatrixXd conditional(const Eigen::MatrixXd& all, const std::vector<Eigen::Index>& of,
                            const std::vector<Eigen::Index>& given) {
  Eigen::MatrixXd out = all(of, of);
  const Eigen::MatrixXd among = all(given, given), with = all(given, of);
  for (Eigen::Index k = 0; k < out.cols(); ++k)
    out.col(k) -= with.transpose() * pseudo_solve(among, with.col(k));
  return out;
}

/// P-value of Wald's test of an effect's sizes against neutral, with its shape as it was fitted, for every
/// shape of its grid. `ends`: sizes that are neutral at an end of their range cannot go beyond it.
double absence(const FitResult& fit, const dynamics::Effect& effect, bool ends) {
  const auto width = static_cast<Eigen::Index>(fit.campaign.size());
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> all(fit.covariance.data(), width, width);
  std::vector<Eigen::Index> sizes, shapes;
  std::vector<double> away;
  std::vector<int> at_end;
  double tried = 1;
  for (const auto& p : effect.parameters) {
    if (p.is_shape()) tried *= static_cast<double>(p.grid.size());
    for (Eigen::Index k = 0; k < width; ++k) {
      const FittedUnknown& u = fit.campaign[static_cast<std::size_t>(k)];
      if (without_object(u.unknown.name) != effect.full_name(p)) continue;
      if (p.is_shape()) {
        if (all(k, k) > 0) shapes.push_back(k);  // one that was not fitted has none
        continue;
      }
      sizes.push_back(k);
      away.push_back(u.value - p.neutral);
      at_end.push_back(ends && !(p.neutral > p.low && p.neutral < p.high) ? 1 : 0);
    }
  }
  const Eigen::MatrixXd C = conditional(all, sizes, shapes);
  if (!C.allFinite()) return 1;
  double least = std::numeric_limits<double>::infinity(), each = 1;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double known = fit.campaign[static_cast<std::size_t>(sizes[i])].degrees_of_freedom,
                 n = std::max(1.0, known - static_cast<double>(shapes.size()));
    const auto k = static_cast<Eigen::Index>(i);
    least = std::min(least, n);
    if (C(k, k) > 0)
      each = std::min(each, hotelling_bar_tail(away[i] * away[i] / C(k, k), 1 - at_end[i], at_end[i], n));
  }
  if (sizes.size() < 2) return std::min(1.0, tried * each);
  const int bounded = std::accumulate(at_end.begin(), at_end.end(), 0),
            free = static_cast<int>(sizes.size()) - bounded;
  const Eigen::Map<const Eigen::VectorXd> d(away.data(), static_cast<Eigen::Index>(away.size()));
  const double joint = hotelling_bar_tail(d.dot(pseudo_solve(C, d)), free, bounded, least);
  return std::min(1.0, 2 * tried * std::min(joint, static_cast<double>(sizes.size()) * each));
}

}  // namespace

double wald_p_value(const FitResult& fit, const dynamics::Effect& effect) {
  return absence(fit, effect, true);
}

bool is_told_from_none(const FitResult& fit, const dynamics::Effect& effect, double level) {
  return absence(fit, effect, false) <= level;
}

bool in_air(Phase phase) { return phase == Phase::flight || phase == Phase::landing; }

bool acts_on_pads(const std::string& id) { return id.starts_with("contact.") || id.starts_with("release."); }

bool is_of_sensor(const std::string& id) { return id.starts_with("sensor."); }

bool acts_on_pads(const Stage& stage) {
  return std::any_of(stage.ids.begin(), stage.ids.end(),
                     [](const std::string& id) { return acts_on_pads(id); });
}

bool acts(const AcceptedEffect& effect, bool air) {
  return in_air(effect.phase) == air || (!air && acts_on_pads(effect.id)) ||
         (!is_law(effect.id) && find_effect(effect.id).acts_everywhere);
}

namespace {

/// Whether so much is left in a channel that something is missing there.
bool is_left(const ChannelMisfit& m, const DiscoverOptions& options) {
  return is_misfit(m, options) && m.chi2_per_sample() >= unexplained_from(m.channel, m.phase, false, options);
}

/// Whether a channel in a phase is read by a sensor behind the pads while nothing touches them: what it shows
/// is the sensor's own.
bool is_unloaded(Channel channel, Phase phase) {
  return in_air(phase) && (is_wrench(channel) || channel == Channel::normal_force);
}

/// Whether an unloaded sensor has shown that an effect is its own: of what the base left in this channel in
/// the air, no more than kLeft is there now.
bool is_shown_unloaded(Channel channel, const std::vector<ChannelMisfit>& base,
                       const std::vector<ChannelMisfit>& now, const DiscoverOptions& options) {
  return std::any_of(base.begin(), base.end(), [&](const ChannelMisfit& b) {
    return b.channel == channel && is_unloaded(channel, b.phase) && is_left(b, options) &&
           misfit_in(now, channel, b.phase) - 1 <= kLeft * (b.chi2_per_sample() - 1);
  });
}

/// Whether too much is left in the half of the throw where an effect acts, or in a channel that it
/// `explains`, of what the base model's fit left there in the other throws (`other`: train against held-out
/// ones) as well; and not next to nothing of what the base left in that phase's worst channel; for an effect
/// on the pads, which flights and landings show as well, what is left in the hand, in any phase's. Readings
/// of an unloaded sensor are of sensors alone, and where they have shown a sensor's effect, what is left of
/// the same channel under load is something else's.
template <class Explains>
bool leaves_too_much(const AcceptedEffect& effect, const std::vector<ChannelMisfit>& base,
                     const std::vector<ChannelMisfit>& other, const std::vector<ChannelMisfit>& now,
                     const DiscoverOptions& options, const Explains& explains) {
  const bool sensor = is_of_sensor(effect.id);
  const auto answers_for = [&](const ChannelMisfit& m) {
    if (is_unloaded(m.channel, m.phase) ? !sensor
                                        : sensor && is_shown_unloaded(m.channel, base, now, options))
      return false;
    return acts(effect, in_air(m.phase)) || explains(m);
  };
  const auto worst = [&](Phase phase) {
    const bool anywhere = acts_on_pads(effect.id) && !in_air(phase);
    double out = 1;
    for (const ChannelMisfit& m : base)
      if (m.phase == phase || anywhere) out = std::max(out, m.chi2_per_sample());
    return out;
  };
  return std::any_of(now.begin(), now.end(), [&](const ChannelMisfit& m) {
    return is_left(m, options) && is_confirmed(other, m) &&
           m.chi2_per_sample() - 1 > std::max(kLeft * (misfit_in(base, m.channel, m.phase) - 1),
                                              kNextToNothing * (worst(m.phase) - 1)) &&
           answers_for(m);
  });
}

/// Whether predictions lack so much of what the base model's lacked, in both halves of the throws.
bool leaves_lacking(const BothErrors& errors, const Discovery& so_far, const DiscoverOptions& options) {
  const auto share = [](const OutcomeLack& now, const OutcomeLack& base) {
    return now.fit.shared > kLeft * base.fit.shared;
  };
  const auto all = lacking(errors.train, errors.held_out, options);
  return std::any_of(all.begin(), all.end(), [&](const OutcomeLack& lack) {
    return share(lack, lack_in(so_far.before_train, lack.outcome)) &&
           share(lack_in(errors.held_out, lack.outcome), lack_in(so_far.before_test, lack.outcome));
  });
}

/// Whether what predictions lack is another with an effect than without it, by so much of what the base's
/// lacked.
bool bears_on_lacking(const AcceptedEffect& effect, const Stage& stage, const BothErrors& errors,
                      const Discovery& so_far, const DiscoverOptions& options) {
  const Stage& less = without(stage, {effect.id}, options);
  if (!less.solved()) return true;
  const OutcomeErrors before = errors_of(less, Share::train, options.fit.threads);
  return std::any_of(errors.train.lacks.begin(), errors.train.lacks.end(), [&](const OutcomeLack& now) {
    return std::abs(now.fit.shared - lack_in(before, now.outcome).fit.shared) >
           kLeft * lack_in(so_far.before_train, now.outcome).fit.shared;
  });
}

}  // namespace

bool explains_most(const ChannelMisfit& now, const std::vector<ChannelMisfit>& without) {
  return now.chi2_per_sample() - 1 < kExplains * (misfit_in(without, now.channel, now.phase) - 1);
}

bool is_imitation(const AcceptedEffect& effect, const Stage& stage, const BothErrors& errors,
                  const FitResult& counted, const Discovery& so_far, const DiscoverOptions& options) {
  // A sensor that is off is so in the hand and in the air, wherever that was seen most.
  const auto explains = [&](FitResult Stage::*half) {
    return [&, half](const ChannelMisfit& m) {
      if (!is_of_sensor(effect.id)) return false;
      const Stage& less = without(stage, {effect.id}, options);
      return less.solved() && explains_most(m, (less.*half).misfit);
    };
  };
  const bool lacks = acts(effect, false) && leaves_lacking(errors, so_far, options) &&
                     (!is_of_sensor(effect.id) || bears_on_lacking(effect, stage, errors, so_far, options));
  return lacks ||
         (!is_law(effect.id) &&
          !is_told_from_none(counted, find_effect(effect.id), options.family_wise_level)) ||
         leaves_too_much(effect, so_far.base.misfit, so_far.base_test, stage.fit.misfit, options,
                         explains(&Stage::fit)) ||
         leaves_too_much(effect, so_far.base_test, so_far.base.misfit, stage.held_out.misfit, options,
                         explains(&Stage::held_out));
}

namespace {

/// Whether a channel is noisier in `now` than in `before`, beyond chance.
bool is_noisier(const ChannelMisfit& now, const std::vector<ChannelMisfit>& before) {
  const double chance = 3 * std::sqrt(2.0 / now.n);
  return now.chi2_per_sample() > (1 + std::max(kNoisier, chance)) * misfit_in(before, now.channel, now.phase);
}

}  // namespace

bool spoils(const AcceptedEffect& effect, const Stage& stage, const Discovery& so_far,
            const DiscoverOptions& options) {
  const auto spoilt = [&](const ChannelMisfit& m, const std::vector<ChannelMisfit>& before) {
    return is_noisier(m, before) && (is_left(m, options) || acts(effect, in_air(m.phase)));
  };
  const auto& train = stage.fit.misfit;
  const auto& held_out = stage.held_out.misfit;
  return std::any_of(train.begin(), train.end(), [&](const ChannelMisfit& m) {
    return spoilt(m, so_far.base.misfit) &&
           std::any_of(held_out.begin(), held_out.end(), [&](const ChannelMisfit& other) {
             return other.channel == m.channel && other.phase == m.phase && spoilt(other, so_far.base_test);
           });
  });
}

namespace {

/// Whether an accepted effect bends what is seen of flights, wherever it was seen most: a gravity that is
/// tilted acts in the hand as well.
bool bends_flights(const AcceptedEffect& effect) {
  if (effect.id.starts_with("flight.")) return true;
  return in_air(effect.phase) && !is_law(effect.id) && !acts_on_pads(effect.id);
}

/// Whether something is left in the tracked flights of both halves.
bool leaves_flights(const Stage& stage, const DiscoverOptions& options) {
  return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const ChannelMisfit& m) {
    return m.phase == Phase::flight && is_left(m, options) && is_confirmed(stage.held_out.misfit, m);
  });
}

/// One candidate for every object, from its own flights.
std::map<int, MissingCandidate> candidates_of(const PhaseTraces& train) {
  std::map<int, std::vector<ResidualTrace>> of_object;
  for (const ResidualTrace& trace : train.all) of_object[trace.group].push_back(trace);
  std::map<int, MissingCandidate> out;
  for (const auto& [object, traces] : of_object) out[object] = missing_terms(traces, train.how);
  return out;
}

/// What candidates leave, a candidate for each object; one that is not there says nothing.
Rest left_by(const std::map<int, MissingCandidate>& candidates, const PhaseTraces& flights) {
  Rest out;
  for (const ResidualTrace& trace : flights.all) {
    const auto candidate = candidates.find(trace.group);
    const Rest rest = rest_around(
        {trace}, candidate == candidates.end() ? MissingCandidate{} : candidate->second, flights.how);
    out.chi2 += rest.chi2;
    out.degrees_of_freedom += rest.degrees_of_freedom;
  }
  return out;
}

double beyond_noise(const Rest& rest) { return rest.chi2 - static_cast<double>(rest.degrees_of_freedom); }

/// How much likelier the form makes the flights of one half, 2 log of the likelihoods' ratio, in units of the
/// scatter that the effects leave.
double likelier(const Rest& by_effects, const Rest& by_form) {
  const double n = static_cast<double>(std::max(1L, by_effects.degrees_of_freedom));
  return (by_effects.chi2 - by_form.chi2) / std::max(1.0, by_effects.chi2 / n);
}

/// The unknowns of some effects in a fit.
std::size_t unknowns_of(const FitResult& fit, const std::vector<std::string>& ids) {
  return static_cast<std::size_t>(std::count_if(fit.campaign.begin(), fit.campaign.end(), [&](const auto& u) {
    return std::any_of(ids.begin(), ids.end(),
                       [&](const std::string& id) { return u.unknown.name.starts_with(id + "."); });
  }));
}

}  // namespace

std::optional<AskedForm> form_asked_for(const Stage& stage, const Discovery& so_far,
                                        const DiscoverOptions& options) {
  std::vector<std::string> accepted;
  for (const AcceptedEffect& effect : so_far.effects)
    if (bends_flights(effect)) accepted.push_back(effect.id);
  if (accepted.empty()) return {};
  const Stage& less = without(stage, accepted, options);
  if (!less.solved()) return {};
  const int threads = options.fit.threads;
  const auto flights = [&](const Stage& of, const FitResult& half) {
    return traces_of(of.problem, half, Phase::flight, threads);
  };
  const PhaseTraces train = flights(less, less.fit);
  const auto candidates = candidates_of(train);
  const Rest effects = left_by({}, flights(stage, stage.fit)), form = left_by(candidates, train);
  // They may have no part in the flights, or these may lack no acceleration.
  const double lacked = beyond_noise(left_by({}, train));
  if (!(lacked > 0 && std::max(beyond_noise(effects), beyond_noise(form)) < kOutdone * lacked)) return {};
  const Rest effects_held_out = left_by({}, flights(stage, stage.held_out)),
             form_held_out = left_by(candidates, flights(less, less.held_out));
  double terms = 0;
  for (const auto& [object, candidate] : candidates) terms += static_cast<double>(candidate.terms.size());
  const double more = terms - static_cast<double>(unknowns_of(stage.fit, accepted));
  const double bic =
      more * std::log(static_cast<double>(std::max(2L, form.degrees_of_freedom))) - likelier(effects, form);
  if (!(bic <= kDeltaBic) || !(likelier(effects_held_out, form_held_out) > 2 * std::log(kTimesAsLikely)))
    return {};
  // Beside a misfit that a form lowers by little, the effects may be true, and something acts beside them.
  const auto halves = [](const Rest& by_form, const Rest& by_effects) {
    return beyond_noise(by_form) < kOutdone * beyond_noise(by_effects);
  };
  if (leaves_flights(stage, options) && !(halves(form, effects) && halves(form_held_out, effects_held_out)))
    return {};
  AskedForm out{accepted, {}, false};
  for (const auto& [name, object] : train.objects) {
    const auto candidate = candidates.find(object);
    if (candidate == candidates.end() || candidate->second.terms.empty()) continue;
    out.words += (out.words.empty() ? "" : ", ") + candidate->second.in_words();
    if (train.objects.size() > 1) out.words += fmt::format(" for {}", name);
    for (const MissingTerm& term : candidate->second.terms) {
      const auto is_its_own = [&](const std::string& id) {
        return term.form != dynamics::AccelerationForm::none && find_effect(id).form == term.form;
      };
      out.unlisted |= std::none_of(accepted.begin(), accepted.end(), is_its_own);
      std::erase_if(out.outdone, is_its_own);
    }
  }
  return out;
}

}  // namespace unhand::fitting
