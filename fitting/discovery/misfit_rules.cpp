#include "fitting/discovery/misfit_rules.hpp"

#include <algorithm>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

using experiment::Channel;

bool is_misfit(const ChannelMisfit& m, const DiscoverOptions& options) {
  const bool slips = is_wrench(m.channel) && m.phase == Phase::release;
  if (m.chi2_per_sample() <= (slips ? options.wrench_misfit : 1 + options.matters)) return false;
  return chi2_tail(m.chi2, m.n) < options.family_wise_level / kSeries;
}

bool leaves_misfit(const Stage& stage, const DiscoverOptions& options) {
  return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(),
                     [&](const ChannelMisfit& m) { return is_misfit(m, options); });
}

bool is_confirmed(const std::vector<ChannelMisfit>& other_half, const ChannelMisfit& misfit) {
  const ChannelMisfit* there = find_misfit(other_half, misfit.channel, misfit.phase);
  return there && chi2_tail(there->chi2, there->n) < kConfirmedAt;
}

double unexplained_from(Channel channel, Phase phase, bool elsewhere, const DiscoverOptions& options) {
  const bool twice = phase == Phase::grasped ? elsewhere : is_wrench(channel) && phase == Phase::release;
  return (twice ? 2 : 1) * options.unexplained;
}

const ChannelMisfit* find_misfit(const std::vector<ChannelMisfit>& misfit, Channel channel, Phase phase) {
  const auto found = std::find_if(misfit.begin(), misfit.end(), [&](const ChannelMisfit& m) {
    return m.channel == channel && m.phase == phase;
  });
  return found == misfit.end() ? nullptr : &*found;
}

double misfit_in(const std::vector<ChannelMisfit>& misfit, Channel channel, Phase phase) {
  const ChannelMisfit* found = find_misfit(misfit, channel, phase);
  return found ? found->chi2_per_sample() : 1;
}

bool is_left(const ChannelMisfit& m, const DiscoverOptions& options) {
  return is_misfit(m, options) && m.chi2_per_sample() >= unexplained_from(m.channel, m.phase, false, options);
}

}  // namespace unhand::fitting
