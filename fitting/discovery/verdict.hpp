// The answers of a loop.
#pragma once

namespace unhand::fitting {

/// What the loop says of a log.
enum class Verdict {
  effect_found,       ///< an effect, or another law, explains what was missing
  no_missing_effect,  ///< nothing is missing beyond noise
  unexplained,        ///< something is missing, and no effect of the catalogue is it
  not_answered,       ///< the log does not determine a fit
};
/// The verdict's name, as it is written above.
const char* to_string(Verdict);

}  // namespace unhand::fitting
