#include "dynamics/effect.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace unhand::dynamics {

void require_in_range(const Effect& effect, const EffectParameter& parameter, double value) {
  const double low = std::min(parameter.low, parameter.least.value_or(parameter.low));
  const double neutral = parameter.neutral, smallest = parameter.smallest.value_or(neutral);
  if (value >= low && value <= parameter.high && !(value > neutral && value < smallest)) return;
  const std::string range =
      parameter.smallest ? fmt::format("{} or in [{}, ", neutral, smallest) : fmt::format("in [{}, ", low);
  throw std::invalid_argument(fmt::format("{} = {} is not {}{}]{}", effect.full_name(parameter), value, range,
                                          parameter.high, after_number(parameter.unit)));
}

std::string after_number(std::string_view unit) {
  return unit.empty() || unit == "-" ? "" : fmt::format(" {}", unit);
}

int length_power(std::string_view unit) {
  int power = 0, sign = 1;
  while (!unit.empty()) {
    const std::size_t end = std::min(unit.find_first_of(" /"), unit.size());
    const std::string_view factor = unit.substr(0, end);
    if (factor == "m") power += sign;
    if (factor.size() == 3 && factor.starts_with("m^")) power += sign * (factor[2] - '0');
    if (end < unit.size() && unit[end] == '/') sign = -1;
    unit.remove_prefix(std::min(end + 1, unit.size()));
  }
  return power;
}

}  // namespace unhand::dynamics
