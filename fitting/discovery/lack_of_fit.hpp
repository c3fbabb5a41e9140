// Do prediction errors go with the condition, so that a better model exists? Knows nothing of throws.
#pragma once

#include <array>
#include <vector>

namespace unhand::fitting {

/// Errors of predictions that were repeated, split by what repetitions of a condition share: what they do not
/// share is the floor of any model that predicts from the same inputs (the "pure error" of the test for lack
/// of fit, Fisher 1922; any book on regression), the rest a better model would take away.
struct LackOfFit {
  double repetitions{};  ///< mean square of errors about their condition's mean, unbiased
  double shared{};       ///< mean square of all errors beyond that, at least 0
  double p_value{1};     ///< F test of the conditions' means against none
  /// The errors' mean square over what repetitions scatter by: 1 is the floor.
  double ratio() const { return repetitions > 0 ? 1 + shared / repetitions : 1; }
};

/// Of errors with up to two components that count alike (positions x and z; a scalar has 0 as its second);
/// `condition` numbers each. Two components count as one witness in the F test: most of them may be one.
/// Without at least two repetitions more than conditions nothing is said: p_value 1.
LackOfFit lack_of_fit(const std::vector<std::array<double, 2>>& error, const std::vector<int>& condition);

}  // namespace unhand::fitting
