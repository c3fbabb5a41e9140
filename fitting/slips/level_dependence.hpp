// Does the force under which a patch slides depend on anything but its direction? Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/accepted_effect.hpp"
#include "fitting/discovery/ranking.hpp"
#include "fitting/slips/law_score.hpp"

namespace unhand::fitting {

/// What the level of wrenches may depend on beside their direction. A rate-independent limit surface has none
/// of it, and directions of sliding hardly show it: it scales the surface, whose normals stay.
enum class LevelBy {
  viscous,  ///< contact.viscous: 1 + v/v_0, rising; v = |(v_x, v_y, r ω)|, r the surface's torque over force
  stribeck,  ///< contact.stribeck: 1 + (μ_s/μ_k − 1) exp(−(v/v_s)²), falling
  order,     ///< the slip's place in the order of ids (2 before 10): wear, warming, a sensor that drifts
  sense      ///< more one way than the other: no even surface has it
};

/// One of them, as the slips show it.
struct LevelDependence {
  LevelBy by{};                       ///< which
  Paired gain;                        ///< by slip: how much less the held-out level errs [-]
  double before{}, after{};           ///< mean held-out |level − predicted| [-]
  std::vector<Parameter> parameters;  ///< with "[surface]"; of order and sense the relative change from end
                                      ///< to end
};

/// What the levels depend on.
struct LevelAnswer {
  std::vector<LevelDependence> found;  ///< accepted, the one that takes most away first
  std::vector<Ranked> ranking;         ///< of the effects among those that were asked for
  double before{}, after{};  ///< mean |level − predicted| [-] held out, without and with all of them
  double after_train{};      ///< with them, in sample
};

/// Every question is a factor of the level, of each surface its own size: level = a (1 + Σ b f). Beginning
/// with none, the one that lowers the held-out error most is accepted, given those before it, where it does
/// so by a one-sided paired t-test (every slip one observation, predicted by the slips of the other folds;
/// `family_wise_level` is shared among the questions) and by `matters`; one effect of speed at most. Sizes
/// are fitted in turn with the surface, to the wrenches without them, until both rest; their σ say how they
/// change where both are fitted again without a twentieth of the slips, each in turn (a jackknife). Surfaces
/// with fewer than two slips a fold are left out. `fits`: one per entry of `slips`.
LevelAnswer level_dependence(const std::vector<SlipSamples>& slips, const std::vector<SlipSurface>& fits,
                             const SurfaceDiscoveryOptions& options);

/// Mean held-out |level − mean level| [-] of the same surfaces.
double level_error(const std::vector<SlipSamples>& slips, const std::vector<SlipSurface>& fits, int folds);

/// The effect's id; empty for what no effect of the catalogue is.
std::string level_effect(LevelBy by);

}  // namespace unhand::fitting
