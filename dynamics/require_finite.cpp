#include "dynamics/require_finite.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>

namespace unhand::dynamics {

void require_finite(const char* of, std::initializer_list<NamedNumber> numbers) {
  for (const auto& [name, value, unit] : numbers)
    if (!std::isfinite(value))
      throw std::invalid_argument(
          fmt::format("{}: {} = {}{}{} is not finite", of, name, value, *unit != 0 ? " " : "", unit));
}

}  // namespace unhand::dynamics
