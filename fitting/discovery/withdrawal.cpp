#include "fitting/discovery/withdrawal.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/where_acts.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Whether a channel in a phase is read by a sensor behind the pads while nothing touches them: what it shows
/// is the sensor's own.
bool is_unloaded(Channel channel, Phase phase) {
  return in_air(phase) && (is_wrench(channel) || channel == Channel::normal_force);
}

/// Whether the base left as much in the other throws of what is left here, or nearly: else these show
/// something that those do not, which no effect that was fitted to those can have imitated.
bool is_left_by_base(const std::vector<ChannelMisfit>& other, const ChannelMisfit& m) {
  return is_confirmed(other, m) &&
         misfit_in(other, m.channel, m.phase) - 1 >= kAsMuch * (m.chi2_per_sample() - 1);
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

/// The first channel in which too much is left, or none: in the half of the throw where an effect acts, or in
/// a channel that it `explains`, where the base model's fit left as much in the other throws (`other`: train
/// against held-out ones); and not next to nothing of what the base left in that phase's worst
/// channel; for an effect on the pads, which flights and landings show as well, what is left in the hand, in
/// any phase's; for an effect that acts everywhere, in the other half only a channel that it `worsens`. One
/// throw alone, of which a sample may lie where the wrench jumps, is not much.
/// Readings of an unloaded sensor are of sensors alone, and where they have shown a sensor's effect, what is
/// left of the same channel under load is something else's.
template <class Explains, class Worsens>
const ChannelMisfit* too_much_left(const AcceptedEffect& effect, const std::vector<ChannelMisfit>& base,
                                   const std::vector<ChannelMisfit>& other,
                                   const std::vector<ChannelMisfit>& now, bool backed,
                                   const DiscoverOptions& options, const Explains& explains,
                                   const Worsens& worsens) {
  const bool sensor = is_of_sensor(effect.id);
  const auto answers_for = [&](const ChannelMisfit& m) {
    if (backed && in_air(m.phase)) return false;
    if (is_unloaded(m.channel, m.phase) ? !sensor
                                        : sensor && is_shown_unloaded(m.channel, base, now, options))
      return false;
    // What acts everywhere answers in the other half of the throw for what it makes worse there.
    if (acts_everywhere(effect.id) && in_air(effect.phase) != in_air(m.phase)) return worsens(m);
    return acts(effect, in_air(m.phase)) || explains(m);
  };
  const auto worst = [&](Phase phase) {
    const bool anywhere = acts_on_pads(effect.id) && !in_air(phase);
    double out = 1;
    for (const ChannelMisfit& m : base)
      if (m.phase == phase || anywhere) out = std::max(out, m.chi2_per_sample());
    return out;
  };
  const auto is_much = [&](const ChannelMisfit& m) {
    return is_left(m, options) &&
           m.chi2_per_sample() - 1 > std::max(kLeft * (misfit_in(base, m.channel, m.phase) - 1),
                                              kNextToNothing * (worst(m.phase) - 1));
  };
  const auto found = std::find_if(now.begin(), now.end(), [&](const ChannelMisfit& m) {
    return is_much(m) && is_much(m.without_worst()) && is_left_by_base(other, m) && answers_for(m);
  });
  return found == now.end() ? nullptr : &*found;
}

/// Whether predictions lack so much of what the base model's lacked, in both halves of the throws.
bool leaves_lacking(const BothErrors& errors, const Discovery& so_far, const DiscoverOptions& options) {
  const auto share = [](const OutcomeLack& now, const OutcomeLack& base) {
    return now.fit.shared > kLeft * base.fit.shared;
  };
  const auto all = lacking(errors.train, errors.held_out, options);
  return std::any_of(all.begin(), all.end(), [&](const OutcomeLack& lack) {
    return share(lack, lack_in(so_far.before.train, lack.outcome)) &&
           share(lack_in(errors.held_out, lack.outcome), lack_in(so_far.before.test, lack.outcome));
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
           kLeft * lack_in(so_far.before.train, now.outcome).fit.shared;
  });
}

}  // namespace

bool explains_most(const ChannelMisfit& now, const std::vector<ChannelMisfit>& without) {
  return now.chi2_per_sample() - 1 < kExplains * (misfit_in(without, now.channel, now.phase) - 1);
}

std::string why_imitation(const AcceptedEffect& effect, const Stage& stage, const BothErrors& errors,
                          const FitResult& counted, bool backed, const Discovery& so_far,
                          const DiscoverOptions& options) {
  const bool by_flights = acts_everywhere(effect.id) && in_air(effect.phase);
  if (acts(effect, false) && !by_flights && leaves_lacking(errors, so_far, options) &&
      (!is_of_sensor(effect.id) || bears_on_lacking(effect, stage, errors, so_far, options)))
    return "it leaves what predictions lack";
  if (!is_law(effect.id) && !is_told_from_none(counted, find_effect(effect.id), options.family_wise_level))
    return "conditions and sensors do not agree on its size";
  // A sensor that is off is so in the hand and in the air, wherever that was seen most.
  const auto explains = [&](FitResult Stage::*half) {
    return [&, half](const ChannelMisfit& m) {
      if (!is_of_sensor(effect.id)) return false;
      const Stage& less = without(stage, {effect.id}, options);
      return less.solved() && explains_most(m, (less.*half).misfit);
    };
  };
  const auto worsens = [&](FitResult Stage::*half) {
    return [&, half](const ChannelMisfit& m) {
      const Stage& less = without(stage, {effect.id}, options);
      return !less.solved() || m.chi2_per_sample() - misfit_in((less.*half).misfit, m.channel, m.phase) >
                                   kLeft * (m.chi2_per_sample() - 1);
    };
  };
  const auto too_much = [&](FitResult Stage::*half, const std::vector<ChannelMisfit>& base,
                            const std::vector<ChannelMisfit>& other, const char* throws) -> std::string {
    const ChannelMisfit* left = too_much_left(effect, base, other, (stage.*half).misfit, backed, options,
                                              explains(half), worsens(half));
    if (!left) return {};
    return fmt::format("it leaves {} in {} at {:.3g} times the noise on the {} throws",
                       to_string(left->channel), to_string(left->phase), left->chi2_per_sample(), throws);
  };
  const auto& base = so_far.before.fit.misfit;
  const std::string train = too_much(&Stage::fit, base, so_far.before.held_out, "train");
  return train.empty() ? too_much(&Stage::held_out, so_far.before.held_out, base, "held-out") : train;
}

namespace {

/// Whether a channel is noisier in `now` than in `before`, beyond chance. Of a landing there is one reading,
/// which a throw's own unknowns may take up, the more so the wider they scatter for want of the effect: below
/// its noise it says how much they do, and no more.
bool is_noisier(const ChannelMisfit& now, const std::vector<ChannelMisfit>& before) {
  const double chance = 3 * std::sqrt(2.0 / now.n), least = now.phase == Phase::landing ? 1 : 0;
  return now.chi2_per_sample() >
         (1 + std::max(kNoisier, chance)) * std::max(least, misfit_in(before, now.channel, now.phase));
}

}  // namespace

bool spoils(const AcceptedEffect& effect, const Stage& stage, const Discovery& so_far,
            const DiscoverOptions& options) {
  const auto spoilt = [&](const ChannelMisfit& m, const std::vector<ChannelMisfit>& before) {
    return is_noisier(m, before) && (is_left(m, options) || acts(effect, in_air(m.phase)));
  };
  return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const ChannelMisfit& m) {
    const ChannelMisfit* other = find_misfit(stage.held_out.misfit, m.channel, m.phase);
    return spoilt(m, so_far.before.fit.misfit) && other && spoilt(*other, so_far.before.held_out);
  });
}

}  // namespace unhand::fitting
