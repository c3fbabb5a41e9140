// The basis of functions that are straight lines between knots. Internal to fitting.
#pragma once

#include <algorithm>
#include <vector>

namespace unhand::fitting {

/// 1 at knot j, 0 at the others, straight between; level beyond the ends. The knots increase.
inline double hat(const std::vector<double>& knots, std::size_t j, double x) {
  x = std::clamp(x, knots.front(), knots.back());
  if (j > 0 && x < knots[j]) return std::max(0.0, (x - knots[j - 1]) / (knots[j] - knots[j - 1]));
  if (j + 1 < knots.size() && x > knots[j])
    return std::max(0.0, (knots[j + 1] - x) / (knots[j + 1] - knots[j]));
  return 1;
}

}  // namespace unhand::fitting
