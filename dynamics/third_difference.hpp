// What four samples of a smooth motion say of their noise.
#pragma once

#include <array>
#include <cstddef>

namespace unhand::dynamics {

/// w_i = Π_{j≠i} (t₃ − t₀)/(t_i − t_j) [-] of four different times: Σ w_i x(t_i) is zero for every parabola,
/// however the times are spaced, and for noise of variance σ² it has σ² Σ w_i².
inline std::array<double, 4> third_difference_weights(const std::array<double, 4>& times) {
  std::array<double, 4> out{1, 1, 1, 1};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j)
      if (j != i) out[i] *= (times[3] - times[0]) / (times[i] - times[j]);
  return out;
}

/// σ² that four evenly spaced samples of a smooth motion show: of noise alone, the square of their third
/// difference has the mean (1 + 9 + 9 + 1) σ².
inline double third_difference_variance(double x0, double x1, double x2, double x3) {
  const double difference = x3 - 3 * x2 + 3 * x1 - x0;
  return difference * difference / 20;
}

/// The same of four samples at different times.
inline double third_difference_variance(const std::array<double, 4>& times,
                                        const std::array<double, 4>& values) {
  const auto weight = third_difference_weights(times);
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += weight[i] * values[i], weights += weight[i] * weight[i];
  return sum * sum / weights;
}

}  // namespace unhand::dynamics
