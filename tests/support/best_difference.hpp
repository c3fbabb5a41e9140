// Derivatives against central differences.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

namespace unhand::support {

/// The smallest error of a central difference of f at x against `derivative`, over steps of 1e-1 to 1e-7: as
/// a function of the step it falls with its square until rounding takes over, so a true derivative shows at
/// the bottom.
inline double best_difference(const std::function<double(double)>& f, double x, double derivative) {
  double best = INFINITY;
  for (double step = 1e-1; step > 0.5e-7; step *= 0.1)
    best = std::min(best, std::abs((f(x + step) - f(x - step)) / (2 * step) - derivative));
  return best;
}

}  // namespace unhand::support
