// Derivatives against central differences.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace unhand::support {

/// The smallest errors of central differences of the components of f at x against `derivative`, over steps of
/// 1e-1 to 1e-7: as a function of the step an error falls with its square until rounding takes over, so a
/// true derivative shows at the bottom.
template <std::size_t N>
std::array<double, N> best_differences(const std::function<std::array<double, N>(double)>& f, double x,
                                       const std::array<double, N>& derivative) {
  std::array<double, N> best;
  best.fill(INFINITY);
  for (double step = 1e-1; step > 0.5e-7; step *= 0.1) {
    const std::array<double, N> up = f(x + step), down = f(x - step);
    for (std::size_t i = 0; i < N; ++i)
      best[i] = std::min(best[i], std::abs((up[i] - down[i]) / (2 * step) - derivative[i]));
  }
  return best;
}

/// The same of one number.
inline double best_difference(const std::function<double(double)>& f, double x, double derivative) {
  return best_differences<1>([&](double at) { return std::array{f(at)}; }, x, {derivative})[0];
}

}  // namespace unhand::support
