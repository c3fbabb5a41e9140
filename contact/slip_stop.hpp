// Where a slip comes to rest. The friction's direction is not defined at zero slip, so no guard is placed
// there: the slip's direction converges while its size falls linearly, so the flow is followed to a small
// radius and the rest is a straight line.
#pragma once

#include <cmath>

#include "dynamics/scalar.hpp"

namespace unhand::contact {

/// Time before a stop [s] at which the rest is taken as a straight line; its error is of second order in
/// this.
inline constexpr double kStopTime = 1e-8;

/// Falls through zero when a slip of size `speed` [m/s] that changes at `rate` [m/s²] is kStopTime away from
/// rest, whatever its size: positive while the slip grows, however small it still is. In [−1, 1].
template <class S>
S stop_guard(const S& speed, const S& rate) {
  const double size = dynamics::value_of(speed) + kStopTime * std::abs(dynamics::value_of(rate));
  return (speed + kStopTime * rate) / (size + 1e-300);
}

}  // namespace unhand::contact
