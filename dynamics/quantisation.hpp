// The grid that readings lie on, where a sensor rounds them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace unhand::dynamics {

/// The step of the grid that readings lie on; 0 where they lie on none or are all the same. It is the least
/// that neighbours, or two distances of neighbours, differ by (readings of a steady motion lie nine or ten
/// steps apart). Values closer than a hundred-thousandth of the largest are one, and nine in ten distances
/// have to be whole numbers of steps: of readings that are not rounded, one in ten is. O(n log n).
inline double quantisation_step(std::vector<double> readings) {
  constexpr double kSame = 1e-5, kOff = 0.05, kOnGrid = 0.9;
  double largest = 0;
  for (const double x : readings) largest = std::max(largest, std::abs(x));
  std::sort(readings.begin(), readings.end());
  std::vector<double> gaps;
  for (std::size_t i = 1; i < readings.size(); ++i)
    if (const double gap = readings[i] - readings[i - 1]; gap > kSame * largest) gaps.push_back(gap);
  if (gaps.empty()) return 0;
  std::sort(gaps.begin(), gaps.end());
  double step = gaps.front();
  for (std::size_t i = 1; i < gaps.size(); ++i)
    if (const double more = gaps[i] - gaps[i - 1]; more > kSame * largest) step = std::min(step, more);
  std::size_t whole = 0;
  for (const double gap : gaps)
    if (std::abs(gap / step - std::round(gap / step)) < kOff) ++whole;
  return static_cast<double>(whole) < kOnGrid * static_cast<double>(gaps.size()) ? 0 : step;
}

/// 1 σ of what rounding to a grid adds: an error that is uniform over a step.
inline double rounding_sigma(double step) { return step / std::sqrt(12.0); }

}  // namespace unhand::dynamics
