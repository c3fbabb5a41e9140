#include "datasets/sample_noise.hpp"

#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::datasets {

void SampleNoise::add(const std::array<double, 4>& times, const std::array<double, 4>& values) {
  squares_.push_back(dynamics::third_difference_variance(times, values));
}

double SampleNoise::sigma() const { return dynamics::trimmed_rms(squares_); }

}  // namespace unhand::datasets
