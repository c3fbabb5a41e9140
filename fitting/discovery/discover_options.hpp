// What the loop may try, and the thresholds that a user may set.
#pragma once

#include <string>
#include <vector>

#include "contact/registry.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

/// What the loop may try, and what convinces it.
struct DiscoverOptions {
  CampaignOptions campaign;  ///< model to begin with, and channels
  FitOptions fit;            ///< how every fit runs
  /// An effect matters if, on held-out throws, it takes at least this much off the χ² per sample of some
  /// channel of the motion in some phase (1 is the noise), and a tenth of the misfit there.
  double matters{0.5};
  /// For the wrench channels while the object is held: this much, and a quarter of the misfit there. Once the
  /// pads open it must also have been so many times the noise, or vanish altogether: near the end of a
  /// release a patch slips in parts, and no law of the catalogue follows its torque better. In the firm grasp
  /// only the body's inertia speaks, in flight only the sensor, and they are channels like others.
  double wrench_matters{1}, wrench_misfit{3};  ///< as above [χ² per sample]; times the noise
  /// Or if the held-out throws are predicted that much better before they are made: rms before over after.
  double prediction_matters{1.15};
  double law_matters{0.005};  ///< another contact law: share of the held-out χ² as a whole
  /// Chance of any false alarm of a test [-] (Bonferroni): shared among the effects of a step, every shape
  /// and size at which a footprint was taken being one; and of misfits among the channels and phases of a
  /// log. Contact laws, which have no size to test, are outside it.
  double family_wise_level{0.02};
  double equivalent{0.98};  ///< footprints that correlate by this much are one answer
  /// Leading candidates that are fitted in full, in every step. Beyond them all laws, where none but a law
  /// convinced, and the give of the pads, where an effect with evidence matters to no channel.
  int refits{4};
  int most_effects{3};      ///< accepted in all
  double unexplained{1.5};  ///< χ² per sample of a channel in a phase from which on something is missing
  /// Effects, and laws as contact.law:MODEL, that are not in the catalogue today.
  std::vector<std::string> forget;
  /// Contact laws that are tried: of contact::pad_law_names().
  std::vector<std::string> laws{contact::pad_law_names()};
};

/// Throws std::invalid_argument, naming option, value and accepted range; for a name in `forget` that is no
/// effect and no law (contact.law:MODEL), with the nearest one.
void validate(const DiscoverOptions& options);

}  // namespace unhand::fitting
