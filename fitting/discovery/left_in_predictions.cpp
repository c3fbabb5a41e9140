#include <fmt/core.h>

#include <cmath>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/misfit_rules.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Of what was tracked in flight, which says more than the landing does.
bool is_of_flight(const OutcomeLack& lack) {
  return lack.outcome == Outcome::position || lack.outcome == Outcome::orientation;
}

/// Outcomes that held-out throws are predicted so badly in, where the train throws confirm that it goes with
/// the condition: the fit has followed these as far as it could, so that less is left of them. Held-out
/// throws are off by what the fit is uncertain of, too: four times the scatter is beyond that.
std::vector<OutcomeLack> lacking_held_out(const Discovery& so_far, const DiscoverOptions& options) {
  constexpr double kFarOff = 4;
  std::vector<OutcomeLack> out;
  for (const OutcomeLack& lack : so_far.after.test.lacks)
    if (is_lacking(lack, options.family_wise_level / kOutcomes) && lack.fit.ratio() >= kFarOff &&
        lack_in(so_far.after.train, lack.outcome).fit.p_value < kConfirmedAt)
      out.push_back(lack);
  return out;
}

}  // namespace

std::optional<Unexplained> left_in_predictions(const Stage& stage, const Discovery& so_far,
                                               const DiscoverOptions& options) {
  std::optional<OutcomeLack> most;
  std::vector<OutcomeLack> all = lacking(so_far.after.train, so_far.after.test, options);
  const bool held_out = all.empty();
  if (held_out) all = lacking_held_out(so_far, options);
  for (const OutcomeLack& lack : all) {
    const double base = lack_in(held_out ? so_far.before.test : so_far.before.train, lack.outcome).fit.shared;
    if (!so_far.effects.empty() && lack.fit.shared < tolerated_rest(stage) * base) continue;
    const bool more =
        !most || (is_of_flight(lack) == is_of_flight(*most) ? lack.fit.ratio() > most->fit.ratio()
                                                            : is_of_flight(lack));
    if (more) most = lack;
  }
  if (!most) return std::nullopt;
  constexpr Channel kShown[] = {Channel::mocap_x, Channel::mocap_theta, Channel::landing_x,
                                Channel::landing_theta};
  const Channel channel = kShown[static_cast<int>(most->outcome)];
  const bool angle = most->outcome == Outcome::orientation || most->outcome == Outcome::landing_theta;
  const double unit = angle ? experiment::kDegrees : 1e3;
  return Unexplained{
      is_of_flight(*most) ? Phase::release : Phase::landing,
      channel,
      most->fit.ratio(),
      fmt::format(
          "{}, predicted before the throw{}: {:.3g} times the mean square that repetitions scatter by "
          "({:.3g} instead of {:.3g} {} rms): the errors go with the condition",
          to_string(most->outcome), held_out ? ", on held-out throws" : "", most->fit.ratio(),
          unit * std::sqrt(most->fit.repetitions + most->fit.shared), unit * std::sqrt(most->fit.repetitions),
          angle ? "deg" : "mm"),
      {}};
}

}  // namespace unhand::fitting
