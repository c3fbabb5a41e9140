// How much noise is on a smooth series.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::dynamics {

/// 1 σ of the white noise on evenly spaced samples of a smooth quantity: fourth differences of the noise have
/// the variance 70 σ², and their median forgives the few that straddle a jump. Of every `stride`-th value
/// from `first` on; 0 for fewer than five.
inline double white_noise(std::span<const double> values, std::size_t first = 0, std::size_t stride = 1) {
  std::vector<double> size;
  for (std::size_t i = first + 4 * stride; i < values.size(); i += stride) {
    const auto y = [&](std::size_t back) { return values[i - back * stride]; };
    size.push_back(std::abs(y(0) - 4.0 * y(1) + 6.0 * y(2) - 4.0 * y(3) + y(4)));
  }
  return size.empty() ? 0.0 : median(size) / 0.6745 / std::sqrt(70.0);
}

/// The same, from the mean square of the fourth differences up to five of their typical size: surer (of n
/// samples of normal noise to 1.15/√n), and as little moved by spikes and jumps; of heavy tails it shows the
/// core. 0 for fewer than five values.
inline double trimmed_white_noise(std::span<const double> y) {
  std::vector<double> square;
  for (std::size_t i = 4; i < y.size(); ++i) {
    const double d = y[i] - 4.0 * y[i - 1] + 6.0 * y[i - 2] - 4.0 * y[i - 3] + y[i - 4];
    square.push_back(d * d / 70.0);
  }
  if (square.empty()) return 0.0;
  const double most = 25.0 * median(square);
  double sum = 0.0, n = 0.0;
  for (const double x : square)
    if (x <= most) sum += x, n += 1.0;
  return std::sqrt(sum / n);
}

}  // namespace unhand::dynamics
