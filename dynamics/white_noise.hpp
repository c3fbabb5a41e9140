// How much noise is on a smooth series.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::dynamics {

/// Root mean square of squares up to 25 of their median, five of the typical size: what is left of it by the
/// few that spikes and jumps make. 0 of nothing.
inline double trimmed_rms(std::span<const double> squares) {
  if (squares.empty()) return 0.0;
  const double most = 25.0 * median(squares);
  double sum = 0.0, n = 0.0;
  for (const double x : squares)
    if (x <= most) sum += x, n += 1.0;
  return std::sqrt(sum / n);
}

/// The same, but of all where the median is zero: as on a coarse grid, where most differences are.
inline double typical_rms(std::span<const double> squares) {
  if (const double trimmed = trimmed_rms(squares); trimmed > 0.0 || squares.empty()) return trimmed;
  double sum = 0.0;
  for (const double x : squares) sum += x;
  return std::sqrt(sum / static_cast<double>(squares.size()));
}

/// Fourth differences of every `stride`-th value from `first` on; of white noise they have the variance 70
/// σ².
inline std::vector<double> fourth_differences(std::span<const double> values, std::size_t first = 0,
                                              std::size_t stride = 1) {
  std::vector<double> out;
  for (std::size_t i = first + 4 * stride; i < values.size(); i += stride) {
    const auto y = [&](std::size_t back) { return values[i - back * stride]; };
    out.push_back(y(0) - 4.0 * y(1) + 6.0 * y(2) - 4.0 * y(3) + y(4));
  }
  return out;
}

/// 1 σ of the white noise on evenly spaced samples of a smooth quantity, by the median of its fourth
/// differences, which forgives the few that straddle a jump. 0 for fewer than five.
inline double white_noise(std::span<const double> values, std::size_t first = 0, std::size_t stride = 1) {
  std::vector<double> size = fourth_differences(values, first, stride);
  for (double& d : size) d = std::abs(d);
  return size.empty() ? 0.0 : median(size) / 0.6745 / std::sqrt(70.0);
}

/// The same by their trimmed_rms: surer (of n samples of normal noise to 1.15/√n), and as little moved by
/// spikes and jumps; of heavy tails it shows the core.
inline double trimmed_white_noise(std::span<const double> values) {
  std::vector<double> squares = fourth_differences(values);
  for (double& d : squares) d *= d / 70.0;
  return trimmed_rms(squares);
}

}  // namespace unhand::dynamics
