#include "contact/patch.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>

namespace unhand::contact {

namespace {

void require(bool ok, const char* name, double value, const char* range) {
  if (!ok) throw std::invalid_argument(fmt::format("patch: {} = {} is not in {}", name, value, range));
}

}  // namespace

void validate(const Patch<double>& p) {
  require(p.mu >= 0 && p.mu <= kMostMu, "mu", p.mu, fmt::format("[0, {}]", kMostMu).c_str());
  require(p.radius >= kSmallestRadius && p.radius <= 1, "radius", p.radius,
          fmt::format("[{}, 1] m", kSmallestRadius).c_str());
  require(p.torque_factor > 0 && p.torque_factor <= 1, "torque_factor", p.torque_factor, "(0, 1]");
  require(p.pads >= 1, "pads", p.pads, "[1, inf)");
}

double torque_factor(double pressure_exponent) {
  const double s = pressure_exponent;
  require(s > -1 && s <= 1000, "pressure_exponent", s, "(-1, 1000]");
  return (s + 1) * std::beta(1.5, s + 1);
}

double torque_factor_power(double n) {
  require(n >= 0.1 && n <= 1e6, "n", n, "[0.1, 1e6]");
  return std::beta(3 / n, 1 + 1 / n) / std::beta(2 / n, 1 + 1 / n);
}

}  // namespace unhand::contact
