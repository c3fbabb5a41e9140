#include <fmt/core.h>

#include <algorithm>

#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/own_drift.hpp"

namespace unhand::fitting {

using experiment::Channel;

std::optional<Unexplained> left_in_own_unknowns(const Stage& stage, const DiscoverOptions& options) {
  const auto drift = own_drift(stage.problem, stage.fit, stage.held_out, options.family_wise_level);
  if (!drift) return std::nullopt;
  const bool friction = drift->name == "mu_deviation";
  const auto& seen = stage.fit.misfit;
  const bool felt = std::any_of(seen.begin(), seen.end(),
                                [](const ChannelMisfit& m) { return m.channel == Channel::wrench_fx; });
  const Channel shown = friction && felt               ? Channel::wrench_fx
                        : drift->name == "grasp_angle" ? Channel::mocap_theta
                                                       : Channel::mocap_x;
  const char* const why =
      friction ? "friction changes over the campaign, as pads do that wear or warm; every throw is "
                 "fitted a friction of its own, so that channels do not show it"
               : "what is tracked moves against the object, or the grasp against the hand";
  return Unexplained{
      friction ? Phase::release : Phase::grasped,
      shown,
      drift->ratio,
      drift->slow
          ? fmt::format(
                "the throws' own {} goes up and down with their order in the log, by {:.2g}{} (1 sigma): "
                "neighbours correlate by {:.2f} about the means of the conditions, and held-out throws agree "
                "with the train throws before and after them: {}",
                drift->name, drift->change, dynamics::after_number(drift->unit), drift->correlation, why)
          : fmt::format(
                "the throws' own {} drifts with their order in the log, by {:+.3g}{} from the first to the "
                "last (correlation {:.3f} about the means of the conditions; held-out throws agree): {}",
                drift->name, drift->change, dynamics::after_number(drift->unit), drift->correlation, why),
      {}};
}

}  // namespace unhand::fitting
