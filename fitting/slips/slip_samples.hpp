// Wrenches of a sliding surface beside the directions in which it slid.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "datasets/slip_log.hpp"

namespace unhand::fitting {

/// One quasi-static stretch of sliding, in the object frame about its centre. L is the surface's
/// characteristic length [m].
struct SlipSample {
  std::array<double, 3> wrench{};     ///< (f_x, f_y, τ/L) [N] that the object applies to the surface
  std::array<double, 3> direction{};  ///< (v_x, v_y, L ω)/|·| [-]
  int slip{};                         ///< index into SlipSamples::slips
  double speed{};                     ///< mean |(v_x, v_y, L ω)| [m/s]; 0 where it is not known
};

/// The samples of one surface.
struct SlipSamples {
  std::string surface;              ///< its name in the log
  double characteristic_length{};   ///< L [m]
  std::vector<std::string> slips;   ///< ids; samples of one slip belong together
  std::vector<SlipSample> samples;  ///< in order of slips
};

/// The samples of one surface, in the log's order. A slip is cut where the twist has turned by more than
/// `turn` [rad] since the last cut; a sample is the path of one stretch (each row's twist lasts half of each
/// interval beside it) and its wrench, averaged over that path. Rows without motion or force are left out,
/// and so are those slower than a twentieth of the speed that nine tenths of the slip's rows do not exceed:
/// the patch rests there, its wrench may be any within the surface, and its twist is noise. A slip that has
/// no others keeps its id and has no samples.
SlipSamples slip_samples(const std::string& name, const datasets::Surface& surface, double turn = 0.1);

}  // namespace unhand::fitting
