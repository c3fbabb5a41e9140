// What an acceleration that is known at samples does to a position.
#pragma once

#include <vector>

namespace unhand::dynamics {

/// x(t) of x'' = a(t) at the samples, from rest at zero; a [m/s²] is linear between the `time`s [s], which
/// are as many and increase.
inline std::vector<double> twice_integrated(const std::vector<double>& time, const std::vector<double>& a) {
  std::vector<double> x(time.size(), 0.0);
  double v = 0;
  for (std::size_t k = 1; k < time.size(); ++k) {
    const double h = time[k] - time[k - 1];
    x[k] = x[k - 1] + h * v + h * h * (2 * a[k - 1] + a[k]) / 6;
    v += 0.5 * h * (a[k - 1] + a[k]);
  }
  return x;
}

}  // namespace unhand::dynamics
