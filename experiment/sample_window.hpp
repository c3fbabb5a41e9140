// Which side of an event a logged sample belongs to.
#pragma once

#include <algorithm>
#include <vector>

#include "dynamics/window.hpp"

namespace unhand::experiment {

/// Samples nearer than this before an event [s] count as after it: what decimal times leave of rounding.
inline constexpr double kAtSample = 1e-9;

/// The stretch of [begin, end] between two of `kinks` (in any order) that holds t; at a kink the later one,
/// which is what a log holds. All in seconds.
inline dynamics::Window window_at(double begin, double end, const std::vector<double>& kinks, double t) {
  dynamics::Window out{begin, end};
  for (const double kink : kinks) {
    if (kink <= t + kAtSample)
      out.begin = std::max(out.begin, kink);
    else
      out.end = std::min(out.end, kink);
  }
  return out;
}

}  // namespace unhand::experiment
