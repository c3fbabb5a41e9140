#include "datasets/sample_noise.hpp"

#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::datasets {

void SampleNoise::add(const std::array<double, 4>& times, const std::array<double, 4>& values) {
  const auto weight = dynamics::third_difference_weights(times);
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += weight[i] * values[i], weights += weight[i] * weight[i];
  squares_.push_back(sum * sum / weights);
}

double SampleNoise::sigma() const { return dynamics::trimmed_rms(squares_); }

}  // namespace unhand::datasets
