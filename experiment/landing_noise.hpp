// The noise of landings that declare none.
#pragma once

#include <optional>
#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// 1 σ of a landing, from the landings of a log themselves. A landing is one row, which has no scatter of its
/// own.
struct LandingNoise {
  std::optional<double> x, theta;  ///< [m], [rad]; absent where too few landings tell
  std::string how;                 ///< in words, for reports: from what, or what is missing
};

/// Of planar logs, x and angle each from the first of these with three degrees of freedom, the angle of
/// landings that tell it:
///
/// - the difference between a landing and where motion capture passes the landing height (a parabola through
///   its last 0.1 s), pooled within the repetitions of a condition: what throws differ by, and what clocks
///   and frames shift, is in both or in all;
/// - the same about the mean of all throws;
/// - the landings within the repetitions of a condition: as large as throws differ.
///
/// The first two are the sensor's, the last is more. Of the train throws alone, where there are any: a fit
/// must not know what its judges say.
LandingNoise landing_noise(const datasets::ThrowLog& log);

/// Whether a landing tells the angle: one whose sigma is declared as half a turn or more was not measured.
bool tells_angle(const datasets::LandingLog& landing);
/// Whether x (column 0) or θ (1) declares its noise: a σ of 0 is none, as it is of the other sensors.
bool declares_noise(const datasets::LandingLog& landing, std::size_t column);

/// How many landings of the log declare no noise.
int landings_without_sigma(const datasets::ThrowLog& log);

/// A sentence on what is taken for the σ of `landings` landings.
std::string in_words(const LandingNoise& noise, int landings);

}  // namespace unhand::experiment
