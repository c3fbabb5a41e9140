// The units a log may use. Everything is in SI base units (and radians) once it has been read.
#pragma once

#include <string>
#include <string_view>

namespace unhand::datasets {

/// The physical quantity that a unit measures.
enum class Quantity {
  number,                ///< no unit
  length,                ///< m
  time,                  ///< s
  angle,                 ///< rad
  speed,                 ///< m/s
  angular_rate,          ///< rad/s
  acceleration,          ///< m/s²
  angular_acceleration,  ///< rad/s²
  force,                 ///< N
  torque,                ///< N m
  mass                   ///< kg
};

/// value in SI = value * multiply / divide. Two factors, because 21 mm is exactly the double nearest to 0.021
/// when divided by 1000 and not always when multiplied by 0.001.
struct Unit {
  std::string_view symbol;               ///< as it is written
  Quantity quantity = Quantity::number;  ///< what it measures
  double multiply = 1, divide = 1;       ///< > 0

  /// The value in SI units.
  double to_si(double value) const {
    return multiply == 1 && divide == 1 ? value : value * multiply / divide;
  }
};

/// The unit of that symbol, or nullptr. Surrounding spaces are ignored; "N m", "N*m" and "N·m" are one unit.
const Unit* find_unit(std::string_view symbol);

/// In words: "angular rate".
std::string_view quantity_name(Quantity quantity);

/// "m, cm, mm, km": what may be written for this quantity.
std::string units_of(Quantity quantity);

}  // namespace unhand::datasets
