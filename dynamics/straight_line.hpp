// The straight line through a series.
#pragma once

#include <cstddef>
#include <span>

namespace unhand::dynamics {

/// y ≈ mean + slope (t − mean_time): least squares with equal weights.
struct StraightLine {
  double mean_time{}, mean{};  ///< of the samples
  double slope{};              ///< NaN where all times are one
  double spread{};             ///< Σ (t − mean_time)²
  /// The line's value at t.
  double at(double t) const { return mean + slope * (t - mean_time); }
};

/// Both of one length, and not empty.
inline StraightLine fit_line(std::span<const double> time, std::span<const double> y) {
  const auto n = static_cast<double>(time.size());
  StraightLine line;
  for (std::size_t i = 0; i < time.size(); ++i) line.mean_time += time[i] / n, line.mean += y[i] / n;
  double cross = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double t = time[i] - line.mean_time;
    line.spread += t * t;
    cross += t * (y[i] - line.mean);
  }
  line.slope = cross / line.spread;
  return line;
}

}  // namespace unhand::dynamics
