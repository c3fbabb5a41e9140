// The tracked samples of a free flight.
#pragma once

#include <vector>

#include "datasets/throw_log.hpp"
#include "flight/quaternion.hpp"

namespace unhand::experiment {

/// The valid samples within `free_flight`, or all valid ones (which a throw that datasets::held_by shows as
/// held does not all fly). A planar flight lies in the plane y = 0.
struct FlightSamples {
  std::vector<double> times, elapsed;                // [s]: as logged, and from the first of these
  std::vector<flight::Vec3<double>> position;        // [m]
  std::vector<flight::Quaternion<double>> attitude;  // spatial, where it was tracked
  std::vector<double> theta;                         // planar [rad]
  std::vector<int> axes;                             // of the world, that were measured
  flight::Vec3<double> sigma{1, 1, 1};               // [m], or ones
  double sigma_angle{1};                             // [rad], or one; a quaternion's sigma is half an angle's
  bool declared{};                                   // the log declares sigma
};

/// Of a throw with `mocap`.
FlightSamples read_flight_samples(const datasets::ThrowLog& log, const datasets::Throw& one);

/// What scatters from sample to sample, 1 σ (dynamics::third_difference_variance), without the few
/// differences that glitches make (dynamics::typical_rms). Of position [m] per axis and of a small rotation
/// about any axis [rad]; 0 where the series is too short.
struct FlightScatter {
  flight::Vec3<double> position{};  ///< 1 σ by world axis [m]
  double angle{};                   ///< 1 σ [rad]
  std::size_t n{};                  // third differences
};
/// The scatter of a flight's samples; see FlightScatter.
FlightScatter scatter_of(const FlightSamples& samples);
/// Of several flights together.
FlightScatter pooled(const std::vector<FlightScatter>& flights);

/// Takes out the frames in which a tracker was elsewhere for once (experiment::glitches, of positions; not
/// the last three, which may have met the ground). Returns how many.
std::size_t remove_glitches(FlightSamples& samples);

}  // namespace unhand::experiment
