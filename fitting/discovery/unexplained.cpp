#include "fitting/discovery/unexplained.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/estimate_missing.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/misfit_rules.hpp"

namespace unhand::fitting {

namespace {

/// The candidate that would take most of the misfit away to first order, with how much of it; nothing where
/// that is little, as it then resembles nothing.
std::string nearest_footprint(const Stage& stage, const Discovery& so_far, const DiscoverOptions& options) {
  constexpr double kLeast = 0.25;
  double misfit = 0;
  for (const ChannelMisfit& m : stage.fit.misfit)
    if (is_misfit(m, options)) misfit += m.chi2 - m.n;
  if (so_far.ranking.empty() || !(so_far.ranking.front().gain > kLeast * misfit) || !(misfit > 0)) return {};
  const Ranked& nearest = so_far.ranking.front();
  return fmt::format("; the nearest footprint is that of {}, with {:.0f} % of the misfit to first order",
                     nearest.id, 100 * std::min(1.0, nearest.gain / misfit));
}

/// An estimate of what is missing, as a clause of a description.
std::string in_words(const MissingEstimate& missing, bool with_terms) {
  std::string out;
  if (with_terms && !missing.candidate.terms.empty())
    out += fmt::format("; of the forms tried, the missing {} is nearest to {}",
                       missing.phase == Phase::flight ? "acceleration in flight" : "wrench of a pad",
                       missing.candidate.in_words(missing.groups));
  switch (missing.correction) {
    case Correction::withheld:
      return out +
             fmt::format("; as a correction it does not lower the held-out error by {:.0f} % and is withheld",
                         100 * (1 - kCorrects));
    case Correction::not_judged:
      return out + "; no held-out motion was tracked to judge it by as a correction";
    case Correction::curve:
    case Correction::candidate:
      break;
  }
  return out + fmt::format("; as a correction it lowers the held-out error from {:.3g} to {:.3g} {}",
                           *missing.error_before, *missing.error_after, missing.error_unit);
}

/// How far off a tracker's clock would be that leaves the same as a constant acceleration along the vertical:
/// flights timed by a clock that is fast by a share r seem to fall at g (1 - 2 r). No effect of throws has
/// its form.
std::string as_clock(const Stage& stage, const MissingEstimate& missing) {
  const auto& terms = missing.candidate.terms;
  if (missing.phase != Phase::flight || missing.candidate.coefficients() != 1 ||
      terms.front().form != dynamics::AccelerationForm::along_z || stage.problem.throws().empty())
    return {};
  const double g = -stage.problem.throws().front().prepared.gravity.z;
  if (!(g > 0)) return {};
  const double rate = terms.front().sizes.front().value / (2 * g);
  return fmt::format("; a clock of the tracker that runs {} by {:.2g} % leaves the same in flight",
                     rate > 0 ? "fast" : "slow", 100 * std::abs(rate));
}

/// The estimate where something is left; what acts on a tracked object in the hand may act in flight, too.
std::optional<MissingEstimate> missing_there(const Stage& stage, const Unexplained& left,
                                             const DiscoverOptions& options) {
  if (left.phase == Phase::grasped && is_tracked(left.channel)) {
    auto in_flight = estimate_missing(stage, Phase::flight, options);
    if (in_flight && !in_flight->candidate.terms.empty()) return in_flight;
  }
  return estimate_missing(stage, left.phase, options);
}

}  // namespace

std::optional<Unexplained> unexplained(const Stage& stage, const Discovery& so_far,
                                       const DiscoverOptions& options) {
  std::optional<Unexplained> out = asked_for_in_flight(stage, so_far);
  if (!out) out = left_in_channels(stage, so_far, options);
  if (!out) {
    if (auto few = left_in_one_half(stage, so_far, options)) return few;
    out = left_in_predictions(stage, so_far, options);
    if (!out) return left_in_own_unknowns(stage, options);
  }
  out->description += so_far.imitations.empty()
                          ? "; no effect of the catalogue explains it on held-out throws"
                          : "; no effect of the catalogue explains all of it on held-out throws";
  for (const Imitation& one : so_far.imitations)
    out->description += fmt::format("; {}, which was accepted at first, is no answer ({})", one.id, one.why);
  if (so_far.effects.empty() && so_far.imitations.empty() && !too_small_by(so_far, out->channel))
    out->description += nearest_footprint(stage, so_far, options);
  out->missing = missing_there(stage, *out, options);
  const bool asked = so_far.asked && so_far.asked->unlisted;  // its terms have been said
  if (out->missing) out->description += in_words(*out->missing, !asked) + as_clock(stage, *out->missing);
  return out;
}

}  // namespace unhand::fitting
