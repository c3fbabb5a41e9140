// Does a number that every throw has change with the order of the throws? Knows nothing of throws. Internal
// to fitting.
#pragma once

#include <vector>

namespace unhand::fitting {

/// One throw's number, and its place in the log; throws that repeat one experiment share the condition.
struct Placed {
  int condition{};
  double place{}, value{};
};

/// A straight line over the place in the log, each condition with a mean of its own: what belongs to a
/// condition is no trend, so that throws whose condition is thrown once say nothing.
struct OrderTrend {
  double slope{};        ///< of the value, per place
  double correlation{};  ///< of value and place, both about the means of their conditions
  double p_value{1};     ///< of no slope, by the F test
  double ratio{1};       ///< mean square about the conditions' means over that about the trend
  double explained{};    ///< sum of squares of the values that the trend takes away, beyond what chance does
};

/// By least squares; no trend where the places or the values of conditions do not differ.
OrderTrend order_trend(const std::vector<Placed>& values);

}  // namespace unhand::fitting
