#include "datasets/sample_noise.hpp"

#include <cmath>

#include "dynamics/median.hpp"

namespace unhand::datasets {

void SampleNoise::add(const std::array<double, 4>& times, const std::array<double, 4>& values) {
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    double w = 1;
    for (std::size_t j = 0; j < 4; ++j)
      if (j != i) w /= (times[i] - times[j]) / (times[3] - times[0]);
    sum += w * values[i], weights += w * w;
  }
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
