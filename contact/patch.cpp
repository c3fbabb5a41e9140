#include "contact/patch.hpp"

#include <fmt/core.h>

#include <stdexcept>

namespace unhand::contact {

void validate(const Patch<double>& p) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("patch: {} = {} is not in {}", name, value, range));
  };
  require(p.mu >= 0 && p.mu <= 10, "mu", p.mu, "[0, 10]");
  require(p.radius > 0 && p.radius <= 1, "radius", p.radius, "(0, 1] m");
  require(p.torque_factor > 0 && p.torque_factor <= 1, "torque_factor", p.torque_factor, "(0, 1]");
  require(p.pads >= 1, "pads", p.pads, "[1, inf)");
}

}  // namespace unhand::contact
