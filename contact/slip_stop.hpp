// Where a slip comes to rest. The friction's direction is not defined at zero slip, so no guard is placed there: the
// slip's direction converges while its size falls linearly, so the flow is followed to a small radius and the rest is
// a straight line.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace unhand::contact {

/// Slip speed [m/s] at which a stop is extrapolated. At decelerations of 1 to 100 m/s² what is left takes 1e-7 to
/// 1e-9 s, and the error of the straight line is of second order in that.
inline constexpr double kStopSpeed = 1e-7;

/// Longest step [s] for a slip of size `speed` [m/s] that changes at `rate` [m/s²]: a tenth of it must be left.
inline double longest_step_to_stop(double speed, double rate) {
  if (!(rate < 0)) return std::numeric_limits<double>::infinity();
  return std::max(0.9 * speed / -rate, 0.1 * kStopSpeed / -rate);
}

}  // namespace unhand::contact
