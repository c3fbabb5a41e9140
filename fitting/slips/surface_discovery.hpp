// The loop on slips: is the ellipsoid the limit surface that the patches have?
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "fitting/measured/measured_discovery.hpp"
#include "fitting/slips/compare_surfaces.hpp"

namespace unhand::fitting {

/// What slips can show beside another law: wrenches that are off by a constant, in the frame of the object.
inline constexpr const char* kWrenchBias = "sensor.ft_bias";
/// And friction that rises with the speed of sliding.
inline constexpr const char* kViscous = "contact.viscous";
/// Or that falls.
inline constexpr const char* kStribeck = "contact.stribeck";

/// When another limit surface, or a bias, is believed.
struct SurfaceDiscoveryOptions {
  SurfaceComparisonOptions comparison;         ///< folds and null control
  SurfaceModel base{SurfaceModel::ellipsoid};  ///< the law to begin with
  double family_wise_level{0.02};              ///< shared among the laws that are tried; of the bias
  double matters{0.05};  ///< share of the held-out direction error that a law, or the bias, must take away
  /// Neighbouring wrenches of different slips whose residual directions correlate by this much (and by three
  /// standard errors) say that something is left.
  double unexplained{0.15};
  std::vector<std::string> forget;  ///< "contact.law:convex_quartic", ...
  /// Whether `forget` names it.
  bool is_forgotten(const std::string& id) const {
    return std::find(forget.begin(), forget.end(), id) != forget.end();
  }
};

/// One law on one surface against the base.
struct SurfaceEvidence {
  std::string surface;                     ///< its name in the log
  SurfaceModel law{};                      ///< against the base
  int slips{};                             ///< predicted
  double base_deg{}, law_deg{};            ///< mean held-out direction error
  double null_base_deg{}, null_law_deg{};  ///< the same on data simulated from the fitted ellipsoid
  double gain_deg{}, gain_sigma{};         ///< mean over slips, paired, and its standard error
  double left{}, left_sigma{};             ///< correlation of the residual directions of neighbours
};

/// The answer of the loop on measured slips, with each law's evidence on each surface (of the wrenches
/// without the bias, where there is one).
struct SurfaceDiscovery {
  MeasuredDiscovery answer;               ///< as for the other logs
  std::vector<SurfaceEvidence> evidence;  ///< by surface, then law; the base's own row holds what it leaves
};

/// A law is accepted if over all slips of all surfaces (every slip one observation, predicted by the fold
/// that left it out) it lowers the direction error by a one-sided paired t-test, by at least `matters`, and
/// by more than on the null control; the law with the least error wins, and of those within a twentieth of it
/// the one with the fewest coefficients.
///
/// A bias of the wrenches, one of all surfaces, is asked for beside the law that is believed, with each
/// fold's bias from the other folds: it is accepted if its three numbers differ from zero (Hotelling's T² by
/// the scatter between slips) and the direction error falls by the same t-test and share, while the forces
/// come no farther from the surface (the mean |level − 1| of its fit does not rise). The laws are then asked
/// again of the wrenches without it.
SurfaceDiscovery discover_surfaces(const std::vector<SlipSamples>& surfaces,
                                   const SurfaceDiscoveryOptions& options);
/// Throws datasets::LogError for a log that datasets::validate does not take.
SurfaceDiscovery discover_surfaces(const datasets::SlipLog& log, const SurfaceDiscoveryOptions& options);

}  // namespace unhand::fitting
