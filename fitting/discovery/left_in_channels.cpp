#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/traces.hpp"
#include "fitting/discovery/where_acts.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Whether tracked flights lack no acceleration, of whatever form, that chance would not show: what is off in
/// them then is how they begin, and has its cause before the detach.
bool lacks_no_acceleration(const Stage& stage, const DiscoverOptions& options) {
  const PhaseTraces flights = traces_of(stage.problem, stage.fit, Phase::flight, options.fit.threads);
  double fall = 0;
  int values = 0;
  for (const MissingCurve& curve : missing_curves(flights.all, flights.how)) {
    fall += curve.chi2_before - curve.chi2_after;
    values += 3 * static_cast<int>(curve.knots.size());
  }
  return values > 0 && chi2_tail(fall, values) > options.family_wise_level;
}

/// What the answer leaves of a channel in a phase.
std::string in_words(const Discovery& so_far, const Unexplained& left) {
  std::string words = fmt::format("{:.3g} times the variance of the noise", left.chi2_per_dof);
  for (const auto& s : so_far.after.structure)
    if (s.channel == left.channel && s.phase == left.phase) words = s.structure.in_words();
  return fmt::format("{} in {}: {}", to_string(left.channel), to_string(left.phase), words);
}

}  // namespace

std::optional<double> too_small_by(const Discovery& so_far, Channel channel) {
  constexpr int kFewest = 50;                     // samples of a phase
  constexpr double kWhite = 0.15, kAlike = 1.15;  // autocorrelation; √χ² of a phase against all
  constexpr double kLeast = 1.2;                  // less is no matter of a declaration
  const StructureOptions named;
  double sum = 0, n = 0;
  std::vector<double> each;
  for (const auto& s : so_far.after.structure) {
    if (s.channel != channel || s.structure.n < kFewest) continue;
    if (std::abs(s.structure.autocorrelation) > kWhite) return {};
    for (const Dependence& d : s.structure.depends)
      if (d.share > named.share && d.p_value < named.level) return {};
    sum += s.structure.n * s.structure.chi2_per_sample, n += s.structure.n;
    each.push_back(std::sqrt(s.structure.chi2_per_sample));
  }
  if (each.size() < 2) return {};
  const double mean = std::sqrt(sum / n);
  for (const double one : each)
    if (one > kAlike * mean || mean > kAlike * one) return {};
  if (mean < kLeast) return {};
  return mean;
}

double tolerated_rest(const Stage& stage) { return acts_on_pads(stage) ? kRest : 0; }

std::vector<ChannelMisfit> left_by_answer(const Stage& stage, const Discovery& so_far,
                                          const DiscoverOptions& options) {
  const bool elsewhere = std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const auto& m) {
    return is_misfit(m, options) &&
           m.chi2_per_sample() >= unexplained_from(m.channel, m.phase, true, options) &&
           is_confirmed(stage.held_out.misfit, m);
  });
  std::vector<ChannelMisfit> out;
  for (const ChannelMisfit& m : stage.fit.misfit) {
    const double base = misfit_in(so_far.before.fit.misfit, m.channel, m.phase);
    const double limit = std::max(unexplained_from(m.channel, m.phase, elsewhere, options),
                                  1 + tolerated_rest(stage) * (base - 1));
    if (is_misfit(m, options) && m.chi2_per_sample() >= limit && is_confirmed(stage.held_out.misfit, m))
      out.push_back(m);
  }
  return out;
}

std::optional<Unexplained> left_in_channels(const Stage& stage, const Discovery& so_far,
                                            const DiscoverOptions& options) {
  std::optional<Unexplained> out;
  const std::vector<ChannelMisfit> left = left_by_answer(stage, so_far, options);
  const ChannelMisfit* worst = nullptr;
  for (const ChannelMisfit& m : left) {
    if (!worst || m.chi2_per_sample() > worst->chi2_per_sample()) worst = &m;
    if (out && (m.phase != out->phase || m.chi2_per_sample() <= out->chi2_per_dof)) continue;
    out = Unexplained{m.phase, m.channel, m.chi2_per_sample(), {}, {}};
  }
  if (!out) return out;
  out->description = in_words(so_far, *out);
  constexpr double kFarMore = 3;
  if (worst->phase != out->phase && worst->chi2_per_sample() > kFarMore * out->chi2_per_dof)
    out->description += fmt::format("; most is left in {} in {}, {:.3g} times", to_string(worst->channel),
                                    to_string(worst->phase), worst->chi2_per_sample());
  if (const auto factor = too_small_by(so_far, out->channel))
    out->description +=
        fmt::format("; white and alike in all phases: a sigma too small by {:.2g} would do", *factor);
  else if (out->phase == Phase::flight && is_tracked(out->channel) && lacks_no_acceleration(stage, options)) {
    out->phase = Phase::release;
    out->description = "in release, seen in " + out->description;
    out->description += ", from how flights begin: they lack no acceleration";
  }
  return out;
}

std::optional<Unexplained> asked_for_in_flight(const Stage& stage, const Discovery& so_far) {
  if (!so_far.asked || !so_far.asked->unlisted) return {};
  const ChannelMisfit* worst = nullptr;
  for (const ChannelMisfit& m : stage.fit.misfit)
    if (m.phase == Phase::flight && is_tracked(m.channel) &&
        (!worst || m.chi2_per_sample() > worst->chi2_per_sample()))
      worst = &m;
  if (!worst) return {};
  Unexplained out{worst->phase, worst->channel, worst->chi2_per_sample(), {}, {}};
  out.description =
      fmt::format("{}; flights ask for an acceleration of {}", in_words(so_far, out), so_far.asked->words);
  return out;
}

}  // namespace unhand::fitting
