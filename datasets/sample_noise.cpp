#include "datasets/sample_noise.hpp"

#include <cmath>

#include "dynamics/median.hpp"
#include "dynamics/third_difference.hpp"

namespace unhand::datasets {

void SampleNoise::add(const std::array<double, 4>& times, const std::array<double, 4>& values) {
  const auto weight = dynamics::third_difference_weights(times);
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += weight[i] * values[i], weights += weight[i] * weight[i];
  squares_.push_back(sum * sum / weights);
}

double SampleNoise::sigma() const {
  if (squares_.empty()) return 0;
  const double most = 25 * dynamics::median(squares_);
  double sum = 0, n = 0;
  for (const double square : squares_)
    if (square <= most) sum += square, n += 1;
  return std::sqrt(sum / n);
}

}  // namespace unhand::datasets
