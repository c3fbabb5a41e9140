// Every measured channel of a throw, predicted from the parameters of a model and its effects.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "experiment/observations.hpp"
#include "experiment/prepared_throw.hpp"
#include "experiment/throw_setup.hpp"

namespace unhand::experiment {

/// The named values that a prediction reads, beside those of the effects ("contact.viscous.1/v_0"):
///   mu             friction coefficient [-]
///   length         L = c a = τ_max/f_max [m]
///   the law's own (contact::law_parameters), as kappa of limit_surface_quartic
///   grip_force, dead_time, opening_time, shape   contact::OpeningProfile where no normal force was measured
///   delay          gripper_delay: from the opening command to the release [s]
///   grasp_angle    of this throw, beyond the prepared one [rad]
///   grasp_offset   of this throw: the pads hold a point that much nearer to the tip [m]
///   grasp_across   of this throw: and beside the object's x axis, the CoM ahead along its z axis [m]
///   mu_deviation   of this throw: its μ is mu (1 + mu_deviation) [-]
///   force_deviation  of this throw: of its measured normal force, in σ of the smoothing (DoubtfulForce) [-]
///   dead_time_deviation  of this throw, beyond `dead_time` [s]
///   delay_deviation  of this throw, beyond `delay` [s]
struct ThrowModel {
  std::string contact_model;   ///< a name that contact::make_contact_model knows
  int pads{2};                 ///< n >= 1: the friction limits are those of all
  double reference_force{20};  ///< f₀ of FrictionVariation: the campaign's median grip force [N]
  dynamics::IntegratorOptions integrator{};  ///< of release and flight
};

/// One throw through a model and its effects, channel by channel.
template <class S>
struct ThrowPrediction {
  release::ReleaseOutcome release{};                                ///< how the release ended
  flight::FlightOutcome flight{flight::FlightOutcome::not_solved};  ///< how the flight ended
  release::DetachState<S> detach;                                   ///< the CoM where the pads part
  flight::Landing<S> landing;                                       ///< of the tracked point
  std::vector<S> channels;  ///< one per observation, in its order and units
  std::vector<int> modes;   ///< the modes entered, in order
  bool slips_at_start{};    ///< the grip cannot hold the object even before it opens
  /// Whether release and flight have an answer.
  bool landed() const {
    return release == release::ReleaseOutcome::detached && flight == flight::FlightOutcome::landed;
  }
};

/// Simulates the throw and reads every observed channel from it. Where the release or the flight has no
/// answer (see the outcomes), `channels` is empty. Throws std::invalid_argument for parameters out of range.
/// Instantiated for double and Dual.
template <class S>
ThrowPrediction<S> predict_channels(const PreparedThrow& prepared, const Observations& observed,
                                    const ThrowModel& model, const dynamics::Values<S>& values);

/// Whether the grip holds the object fast until the gripper is told to open.
bool grip_holds(const PreparedThrow& prepared, const ThrowModel& model,
                const dynamics::Values<double>& values);

/// What looks at a release.
using UseOfRelease =
    std::function<void(const release::ReleaseProblem<double>&, const release::ReleaseResult<double>&)>;
/// Simulates the release alone, recorded, and hands it to `use`; neither of the two is there afterwards.
void visit_release(const PreparedThrow& prepared, const ThrowModel& model,
                   const dynamics::Values<double>& values, const UseOfRelease& use);

}  // namespace unhand::experiment
