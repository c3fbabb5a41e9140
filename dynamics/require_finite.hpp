// What every problem asks of its numbers.
#pragma once

#include <initializer_list>

namespace unhand::dynamics {

/// A number with its name and unit ("" for none), as an error shows it.
struct NamedNumber {
  const char* name;  ///< of the parameter
  double value;      ///< in `unit`
  const char* unit;  ///< "" for none
};

/// Throws std::invalid_argument, "OF: NAME = VALUE UNIT is not finite", for the first one that is not.
void require_finite(const char* of, std::initializer_list<NamedNumber> numbers);

}  // namespace unhand::dynamics
