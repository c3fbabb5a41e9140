// The median of a list of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <ranges>
#include <vector>

namespace unhand::dynamics {

/// The middle of the sorted numbers: of an even count the upper of the middle two, so that it is one of them.
/// NaN if there are none. O(n).
template <std::ranges::input_range Numbers>
double median(const Numbers& numbers) {
  std::vector<double> x(std::ranges::begin(numbers), std::ranges::end(numbers));
  if (x.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

}  // namespace unhand::dynamics
