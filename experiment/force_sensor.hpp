// What the force sensor shows of itself: whether it reads zero once the pads have let go, rings, clips, or is
// filtered.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "experiment/log_note.hpp"
#include "experiment/prepared_throw.hpp"

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

/// How the pads open in each throw, by its normal force; none where that does not tell when they part, or
/// where nothing says that they let go (no landing, no declared flight: they may still press).
using ForceOpenings = std::vector<std::optional<contact::NormalForceSummary>>;
/// Those of a log, whose forces are smoothed for it.
ForceOpenings force_openings(const datasets::ThrowLog& log);
/// The same of throws whose force has been smoothed.
ForceOpenings force_openings(const std::vector<PreparedThrow>& throws);

/// The zero of the normal force of planar throws. Told is a level beyond five standard errors of the median
/// (of a throw's own noise, or of how levels scatter from throw to throw) and half a per cent of the grip:
/// friction that is fitted to slips follows the level with some ten times that share, since pads slip while
/// the force is small.
std::optional<UntaredForce> untared_force(const ForceOpenings& openings);

/// What of `ft` cannot be the pads' alone, a note each:
/// - a normal force that rises again after its release (NormalForceSummary::later_rise);
/// - a column that stands at its largest or smallest value for eight samples or more, though it has noise
///   elsewhere: a sensor at the end of its range;
/// - a normal force whose samples after the release are alike, by a low-pass filter or by hum: correlation of
///   neighbours above a half, in the median over five throws or more.
std::vector<LogNote> force_notes(const datasets::ThrowLog& log, const ForceOpenings& openings);

}  // namespace unhand::experiment
