// What the sensors saw of a throw, as one list of numbers with their noise.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/landing_noise.hpp"
#include "experiment/prepared_throw.hpp"

namespace unhand::experiment {

/// A measured quantity. Wrenches are one pad's, in the hand frame; poses are the tracked frame's, in the
/// world.
enum class Channel {
  wrench_fx,      ///< N
  wrench_fz,      ///< N
  wrench_tau,     ///< N m
  normal_force,   ///< of one pad, after the release only: before, it is an input
  mocap_x,        ///< m
  mocap_z,        ///< m
  mocap_theta,    ///< rad
  landing_x,      ///< m
  landing_theta,  ///< rad
  landing_time,   ///< s
};
/// How many channels there are.
inline constexpr int kChannelCount = 10;
/// The channel's name as reports have it: "mocap.theta".
std::string_view to_string(Channel);

/// Whether a channel is of a pad's wrench.
inline bool is_wrench(Channel c) {
  return c == Channel::wrench_fx || c == Channel::wrench_fz || c == Channel::wrench_tau;
}
/// Whether it is of motion capture.
inline bool is_tracked(Channel c) {
  return c == Channel::mocap_x || c == Channel::mocap_z || c == Channel::mocap_theta;
}

/// One measured number with its noise.
struct Observation {
  Channel channel{};        ///< which sensor's, and which component
  double time{};            ///< as stamped [s]: the robot's clock, for mocap its own
  double value{}, sigma{};  ///< in the channel's unit; 1 σ, > 0
};

/// The observations of one throw. The three columns of a wrench or a mocap sample follow each other, with one
/// time.
struct Observations {
  std::vector<Observation> all;  ///< channel by channel, in order of time
  std::vector<Channel> dead;     ///< no two samples differ: left out
};

/// Which channels are taken, and how far they are trusted.
struct ObservationOptions {
  bool wrench{true}, normal_force{true}, mocap{true}, landing{true};  ///< whether these are taken
  /// Wrenches are not used for this long after the log begins and after a jump of the hand's acceleration
  /// [s]: real pads ring there (some micrometres under a held object of 0.2 kg: 30 ms), rigid ones jump.
  double settling{0.03};
  /// Nor for this long before a jump [s]: the sensor's clock may be early, and the sample that a jump passes
  /// over as that clock is fitted would make a step of the misfit.
  double before_jump{0.005};
  /// To what share of the whole wrench a sample of its parts is trusted, beside its noise [-]. The gain of an
  /// F/T sensor and the shape of a friction law are good to a hundredth, and such an error stays for some
  /// twenty samples, which would count as that many witnesses.
  double wrench_trust{0.04};
  /// Of landings without a declared σ; found from the log if absent, for every throw anew.
  std::optional<LandingNoise> landing_noise{};
};

/// All that the throw's log holds of the channels asked for. Left out: wrenches that settle, samples outside
/// the hand's motion, motion capture after the landing, and an F/T channel that is dead. A channel without
/// a declared σ takes it from its own scatter (third differences), a landing from those of the log
/// (experiment::landing_noise): where these are too few, it is left out. So is a landing/time without one.
/// A declared σ is the sensor's: where the readings of a throw lie on a grid, what rounding adds is added to
/// it in quadrature (dynamics::quantisation_step).
Observations observe(const datasets::ThrowLog& log, const datasets::Throw& logged,
                     const PreparedThrow& prepared, const ObservationOptions& options = {});

}  // namespace unhand::experiment
