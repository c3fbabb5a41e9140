// Throws without a hand: how well a flight model explains a measured free flight.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "flight/free_rotation.hpp"

namespace unhand::experiment {

/// How a fit of a free flight ended.
enum class FreeFlightOutcome {
  fitted,       ///< the start was found, and the residuals say how good it is
  no_tracking,  ///< the throw has no mocap
  not_free,     ///< held (a hand, or datasets::held_by), and no `free_flight` says when it is not
  too_short,    ///< fewer than kFewestFlightSamples valid samples
  not_solved,   ///< the fit did not converge
};
/// The outcome's name, as it is written above.
const char* to_string(FreeFlightOutcome);

/// Two for the first half: the fewest that fix a position and a velocity.
inline constexpr std::size_t kFewestFlightSamples = 4;

/// The start of a flight, fitted to its first samples, and what it says of all of them. Planar flights lie in
/// the plane y = 0 and turn about −y: their θ runs from +x to +z.
struct FreeFlightFit {
  FreeFlightOutcome outcome{};  ///< only `fitted` has an answer
  std::string reason;           ///< why it was not fitted, in words
  std::vector<double> times;    ///< of the valid samples of the flight, without those removed [s]
  std::size_t removed{};        ///< frames in which the tracker was elsewhere (remove_glitches)
  std::size_t fitted{};         ///< the first so many were fitted
  bool oriented{};              ///< the orientation was tracked
  flight::Vec3<double> position{}, velocity{};              ///< at times.front() [m, m/s]
  flight::RotationState<double> rotation;                   ///< at times.front(), if oriented
  double theta{};                                           ///< planar: the same angle, unwrapped [rad]
  std::vector<flight::Vec3<double>> position_residuals;     ///< measured − predicted, every sample [m]
  std::vector<flight::Vec3<double>> orientation_residuals;  ///< from predicted to measured, in the body [rad]
};

/// The model's name, on cards and in what commands write.
inline constexpr const char* kProjectile = "projectile";

/// Fits the start on the first `fraction` of the samples by least squares weighted with the declared sigma,
/// with the model kProjectile: declared gravity straight down, the object's declared drag_k if it has one,
/// torque-free rotation with its declared inertia (without one, a spherical body's), and the tracked frame
/// taken for the centre of mass. Used are the valid samples within `free_flight`, or all valid ones, without
/// glitches (remove_glitches). A quaternion's sigma stands for an angle of twice that much. Throws
/// std::invalid_argument when `fraction` is not in (0, 1].
FreeFlightFit fit_free_flight(const datasets::ThrowLog& log, const datasets::Throw& one, double fraction);

/// One throw through the model. `whole` is what is left when the start is fitted on every sample: it shows
/// what the model lacks. `half` has the start fitted on the first half: its last residual is the error of a
/// prediction.
struct FreeFlightErrors {
  std::string id;               ///< as in the log
  datasets::Split split{};      ///< whether it may be fitted to
  FreeFlightOutcome outcome{};  ///< only `fitted` has errors
  std::string reason;           ///< why it was not fitted, in words
  std::vector<double>
      normalised_time;          ///< 0 at the first sample, 1 at the last: for figures, beside the residuals
  FreeFlightFit whole, half;    ///< fitted on all samples; on the first half
  double trajectory_rms{};      ///< root mean square distance over the flight, of `whole` [m]
  double end_position_error{};  ///< distance at the last sample, of `half` [m]
  std::optional<double> end_orientation_error;  ///< angle at the last sample, of `half` [rad]
};
/// The errors of one throw.
FreeFlightErrors free_flight_errors(const datasets::ThrowLog& log, const datasets::Throw& one);

/// Of a sample of errors; std with n − 1 (0 for n < 2).
struct Spread {
  std::size_t n{};                 ///< errors in the sample
  double median{}, mean{}, std{};  ///< in the unit of the errors
};

/// Errors over the free flights of one split.
struct FreeFlightStatistics {
  std::size_t n{};                                         ///< throws
  double trajectory_rms_m{};                               ///< pooled over their samples
  Spread end_position_error_m, end_orientation_error_deg;  ///< the latter over the throws with orientation
};

/// The model against every free flight of a log.
struct FreeFlightComparison {
  FreeFlightStatistics train, test;    ///< over the fitted throws of each split
  std::size_t skipped{};               ///< throws that were not fitted: their `each` says why
  double microseconds_per_throw{};     ///< both fits, one thread's time, warmed up
  std::vector<FreeFlightErrors> each;  ///< in the order of the log
};

/// Every throw of the log, on `threads` threads (0: one per core). The answer (but for the time it took) does
/// not depend on their number. Throws std::invalid_argument for threads < 0.
FreeFlightComparison compare_free_flights(const datasets::ThrowLog& log, int threads = 1);

}  // namespace unhand::experiment
