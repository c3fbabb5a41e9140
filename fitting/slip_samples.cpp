#include "fitting/slip_samples.hpp"

#include <cmath>

namespace unhand::fitting {

SlipSamples slip_samples(const std::string& name, const datasets::Surface& surface) {
  SlipSamples out{name, surface.characteristic_length, {}, {}};
  const double length = surface.characteristic_length;
  for (const datasets::Slip& slip : surface.slips) {
    const int index = static_cast<int>(out.slips.size());
    out.slips.push_back(slip.id);
    for (std::size_t i = 0; i < slip.time.rows; ++i) {
      const auto& f = slip.wrench;
      const auto& v = slip.twist;
      const std::array<double, 3> wrench{f(i, 0), f(i, 1), f(i, 2) / length};
      const std::array<double, 3> twist{v(i, 0), v(i, 1), v(i, 2) * length};
      const double force = std::hypot(wrench[0], wrench[1], wrench[2]);
      const double speed = std::hypot(twist[0], twist[1], twist[2]);
      if (!(force > 0.0 && speed > 0.0)) continue;
      out.samples.push_back({wrench, {twist[0] / speed, twist[1] / speed, twist[2] / speed}, index});
    }
  }
  return out;
}

}  // namespace unhand::fitting
