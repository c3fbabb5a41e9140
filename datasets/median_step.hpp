// The usual step of a series of times.
#pragma once

#include <cstddef>
#include <vector>

#include "datasets/series.hpp"
#include "dynamics/median.hpp"

namespace unhand::datasets {

/// The median of the steps between samples; 0 of fewer than two.
inline double median_step(const Series& time) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.rows; ++i) steps.push_back(time(i) - time(i - 1));
  return steps.empty() ? 0 : dynamics::median(steps);
}

}  // namespace unhand::datasets
