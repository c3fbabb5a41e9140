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
  /// How often chance shows conditions as much in agreement with themselves: the randomisation test that
  /// turns each error's sign (Fisher 1935). It asks no more than independent errors as often of one sign as
  /// of the other; conditions differ manyfold in how much they scatter, and the F test takes one that
  /// scatters more than the others for a difference.
  double p_value{1};
  /// The errors' mean square over what repetitions scatter by: 1 is the floor.
  double ratio() const { return repetitions > 0 ? 1 + shared / repetitions : 1; }
};

/// Of errors with up to two components that count alike (positions x and z; a scalar has 0 as its second);
/// `condition` numbers each. Agreement of a condition: its mean's share n |mean|²/Σ|e|² of its squares, the
/// mean over conditions. Without at least two repetitions more than conditions nothing is said: p_value 1.
LackOfFit lack_of_fit(const std::vector<std::array<double, 2>>& error, const std::vector<int>& condition);

}  // namespace unhand::fitting
