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

}  // namespace unhand::dynamics
