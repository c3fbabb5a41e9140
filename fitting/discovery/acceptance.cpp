#include "fitting/discovery/acceptance.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/pads_give.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/where_acts.hpp"

namespace unhand::fitting {

namespace {

/// Most of a wrench's variance is trust, not noise: one that is explained falls below 1.
bool is_explained(double was, double is) { return is < 1 + kRest * (was - 1); }

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
    if (is_wrench(b.channel) && !in_air(b.phase)) {
      const double from = b.phase == Phase::grasped ? 1 + options.matters : options.wrench_misfit;
      const bool settles = find_misfit(settled, b.channel, b.phase) != nullptr;
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
  if (!prediction_gain(outcomes_before, outcomes_after).is_better_by(options.prediction_matters) ||
      !held_out_confirms(before, after))
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

SmallEffect small_effect(const Stage& without, const Stage& with, const std::string& id,
                         const std::vector<ChannelMisfit>& base, const DiscoverOptions& options) {
  const int threads = options.fit.threads;
  const dynamics::Effect effect = find_effect(id);
  return {
      id,
      parameters_of(with.fit, effect),
      with.bic() - without.bic(),
      wald_p_value(with.fit, effect),
      improvement(without, with, base, options).fall,
      prediction_gain(outcomes_of(without, Share::test, threads), outcomes_of(with, Share::test, threads)),
      id == kPads && give_of(with) <= kMostGive,
      held_out_confirms(without, with)};
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

std::string predicted_in_words(const SmallEffect& effect) {
  return fmt::format("predicted before the throw: {}", effect.rms.in_words());
}

}  // namespace unhand::fitting
