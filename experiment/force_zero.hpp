// Whether a normal force reads zero once the pads have let go.
#pragma once

#include <optional>
#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::experiment {

/// A normal force that does not end at zero. Medians over the throws whose pads are known to let go.
struct UntaredForce {
  double level{};  ///< what the sensor reads once the pads have parted [N]
  double sigma{};  ///< 1 σ of a throw's level, from the scatter of its samples [N]
  double grip{};   ///< what it reads while they hold [N]
  int throws{};    ///< that show it
  /// "still reads 1.00 N (1.8 % of the grip's 56.1 N) after the pads have parted, in the median of 24 throws
  /// …"
  std::string in_words() const;
};

/// The zero of the normal force of planar throws that land or are declared to fly (else pads may still
/// press). Told is a level beyond five standard errors of the median (of a throw's own noise, or of how
/// levels scatter from throw to throw) and half a per cent of the grip: friction that is fitted to slips
/// follows the level with some ten times that share, since pads slip while the force is small.
std::optional<UntaredForce> untared_force(const datasets::ThrowLog& log);

}  // namespace unhand::experiment
