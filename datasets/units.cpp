#include "datasets/units.hpp"

#include <numbers>

namespace unhand::datasets {
namespace {

constexpr double pi = std::numbers::pi;
using enum Quantity;

constexpr Unit units[] = {
    {"1", number},
    {"m", length},
    {"cm", length, 1, 100},
    {"mm", length, 1, 1000},
    {"um", length, 1, 1e6},
    {"km", length, 1000},
    {"s", time},
    {"ms", time, 1, 1000},
    {"us", time, 1, 1e6},
    {"ns", time, 1, 1e9},
    {"rad", angle},
    {"mrad", angle, 1, 1000},
    {"deg", angle, pi, 180},
    {"m/s", speed},
    {"cm/s", speed, 1, 100},
    {"mm/s", speed, 1, 1000},
    {"rad/s", angular_rate},
    {"mrad/s", angular_rate, 1, 1000},
    {"deg/s", angular_rate, pi, 180},
    {"m/s^2", acceleration},
    {"cm/s^2", acceleration, 1, 100},
    {"mm/s^2", acceleration, 1, 1000},
    {"rad/s^2", angular_acceleration},
    {"deg/s^2", angular_acceleration, pi, 180},
    {"N", force},
    {"mN", force, 1, 1000},
    {"kN", force, 1000},
    {"N m", torque},
    {"mN m", torque, 1, 1000},
    {"N mm", torque, 1, 1000},
    {"N cm", torque, 1, 100},
    {"kg", mass},
    {"g", mass, 1, 1000},
};

std::string normal_form(std::string_view symbol) {
  while (!symbol.empty() && symbol.front() == ' ') symbol.remove_prefix(1);
  while (!symbol.empty() && symbol.back() == ' ') symbol.remove_suffix(1);
  std::string out;
  for (std::size_t i = 0; i < symbol.size(); ++i) {
    const std::string_view rest = symbol.substr(i);
    if (rest.starts_with("·")) {
      out += ' ';
      i += std::string_view("·").size() - 1;
    } else if (rest.starts_with("²")) {
      out += "^2";
      i += std::string_view("²").size() - 1;
    } else {
      out += symbol[i] == '*' ? ' ' : symbol[i];
    }
  }
  return out;
}

}  // namespace

const Unit* find_unit(std::string_view symbol) {
  const std::string wanted = normal_form(symbol);
  for (const Unit& unit : units) {
    if (unit.symbol == wanted) return &unit;
  }
  return nullptr;
}

std::string_view quantity_name(Quantity quantity) {
  switch (quantity) {
    case number:
      return "pure number";
    case length:
      return "length";
    case time:
      return "time";
    case angle:
      return "angle";
    case speed:
      return "speed";
    case angular_rate:
      return "angular rate";
    case acceleration:
      return "acceleration";
    case angular_acceleration:
      return "angular acceleration";
    case force:
      return "force";
    case torque:
      return "torque";
    case mass:
      return "mass";
  }
  return "quantity";
}

std::string units_of(Quantity quantity) {
  std::string out;
  for (const Unit& unit : units) {
    if (unit.quantity != quantity) continue;
    if (!out.empty()) out += ", ";
    out += unit.symbol;
  }
  return out;
}

}  // namespace unhand::datasets
