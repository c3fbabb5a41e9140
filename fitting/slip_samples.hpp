// Wrenches of a sliding surface beside the directions in which it slid.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "datasets/slip_log.hpp"

namespace unhand::fitting {

/// One quasi-static moment of sliding, in the object frame about its centre. L is the surface's
/// characteristic length [m].
struct SlipSample {
  std::array<double, 3> wrench{};     ///< (f_x, f_y, τ/L) [N] that the object applies to the surface
  std::array<double, 3> direction{};  ///< (v_x, v_y, L ω)/|·| [-]
  int slip{};                         ///< index into SlipSamples::slips
};

struct SlipSamples {
  std::string surface;
  double characteristic_length{};  ///< L [m]
  std::vector<std::string> slips;  ///< ids; samples of one slip belong together
  std::vector<SlipSample> samples;
};

/// The samples of one surface, in the log's order. Rows without motion or without force have no direction and
/// are left out; a slip that has no other keeps its id.
SlipSamples slip_samples(const std::string& name, const datasets::Surface& surface);

}  // namespace unhand::fitting
