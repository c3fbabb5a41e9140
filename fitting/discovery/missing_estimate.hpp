// What no effect of the catalogue explains, and an estimate of it that assumes no form.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "experiment/observations.hpp"
#include "fitting/discovery/missing_force.hpp"
#include "fitting/discovery/residuals.hpp"

namespace unhand::fitting {

/// How a prediction may use what is estimated to be missing.
enum class Correction {
  withheld,    ///< none: it does not lower the held-out error, or by no share that counts (kCorrects)
  curve,       ///< the curve over time
  candidate,   ///< the physical terms
  not_judged,  ///< none: no held-out motion was tracked, so that nobody knows where it would act
};

/// What is missing, without a form assumed: an acceleration in flight over the time since the detach [m/s²,
/// m/s², rad/s²], or a pad's wrench in the hand's frame over the share of the opening that has passed [N, N,
/// N m].
struct MissingEstimate {
  Phase phase{};                      ///< in flight, or during the release
  std::map<int, std::string> groups;  ///< the object of each group
  std::vector<MissingCurve> curves;   ///< one per group
  MissingCandidate candidate;         ///< physical terms that follow the curves
  /// What lowers the held-out error, if anything: else it is withheld.
  Correction correction{};  ///< what is used
  /// rms without the correction, of the flight where it was seen, else of the landing; none where it is not
  /// judged.
  std::optional<double> error_before;
  std::optional<double> error_after;  ///< with it
  std::string error_unit;             ///< "m", or "sigma" of the landing
};

/// Structure that no effect of the catalogue accounts for.
struct Unexplained {
  Phase phase{};                  ///< where it is largest
  experiment::Channel channel{};  ///< of which sensor
  /// On the train throws (on the held-out ones, if only they are off): χ² per sample; of predictions, their
  /// errors' mean square over what repetitions scatter by. 1 is the noise.
  double chi2_per_dof{};
  std::string description;                 ///< in words
  std::optional<MissingEstimate> missing;  ///< absent where no force can be read from it
};

}  // namespace unhand::fitting
