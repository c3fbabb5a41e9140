// Do the throws' own unknowns drift over the campaign? What every throw is free to take up hides from
// channels and predictions what wears, warms or works loose. Internal to fitting.
#pragma once

#include <optional>
#include <string>

#include "fitting/campaign_problem.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// An own unknown that follows the order of the throws, condition by condition.
struct OwnDrift {
  std::string name, unit;  ///< of the unknown
  double change{};       ///< from the first throw of the log to the last, in its unit; 1 σ where it is slow
  double correlation{};  ///< with the place in the log, both about the means of their conditions; or of
                         ///< neighbours
  double ratio{1};       ///< mean square about the conditions' means over that about the trend
  bool slow{};           ///< it goes up and down: no straight line, but neighbours in the log are alike
};

/// The drift of a log's throws that is surest, if there is any: over the train throws (`fit`) it accounts for
/// more than half of how an unknown differs between throws of a condition, by more than Unknown::scale over
/// the log, with a p-value (F test of the slope, conditions' means taken off) below `level` shared among the
/// unknowns; and the held-out throws confirm its sign at 5 %. Else one that is slow: neighbouring train
/// throws correlate by more than a half, at that level, and held-out throws with the train throws before and
/// after them, at 5 %. Throws of one condition that follow each other say as much of it as others, but throws
/// whose condition is thrown once say nothing.
std::optional<OwnDrift> own_drift(const CampaignProblem& problem, const FitResult& fit,
                                  const FitResult& held_out, double level);

}  // namespace unhand::fitting
