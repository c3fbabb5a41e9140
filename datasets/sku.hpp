// An SKU file: what a shop knows about one object, in TOML, with the unit in every key's name.
//
//   name = "cracker box"
//   mass_kg = 0.411
//   mass_sigma_kg = 0.005
//   dims_m = [0.060, 0.158, 0.210]     # along the object's x, out of the throwing plane, along its z
//   shape = "box"                      # or inertia_kg_m2 = 0.0016
//   com_offset_m = 0.08
//   surface = "printed cardboard"
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// Values in SI units. `inertia` is about the CoM, about the axis out of the throwing plane (the object's y)
/// [kg m²]: the one declared, else the one of `shape` with uniform density:
///   box       m (x² + z²)/12
///   rod       m x²/12                 slender, along x
///   cylinder  m (3 r² + x²)/12        axis along x, r = z/2
///   disc      m r²/2                  axis along y, r = x/2
///   sphere    2 m r²/5                r = x/2
struct Sku {
  std::string name;                              ///< free text
  double mass = 0;                               // [kg]
  std::optional<double> mass_sigma;              // [kg]
  std::optional<std::array<double, 3>> dims;     // [m]
  double com_offset = 0;                         // [m] pad centre to CoM, along the object's x
  std::optional<double> com_offset_sigma;        // [m]
  std::optional<std::string> shape;              ///< box, rod, cylinder, disc or sphere
  std::optional<double> inertia, inertia_sigma;  // [kg m²]
  std::optional<double> drag_k;                  // [1/m]
  std::string surface;                           ///< what the pads touch, in the words of a card's log
  std::optional<std::string> source, notes;      ///< where the numbers are from; anything else
};

/// The inertia of a uniform shape of that name (one of those above) [kg m²]. Throws std::invalid_argument.
double shape_inertia(const std::string& shape, double mass, const std::array<double, 3>& dims);

/// Reads an SKU file. name, mass_kg and surface are required. Throws TomlError with line, column, key, value
/// and range.
Sku read_sku(const std::filesystem::path& file);

/// The object of a throw log that this SKU declares. In a spatial log (dimension 3) the inertia is known
/// where it is that of a uniform box, cylinder, disc or sphere: then it is the three about the object's x, y
/// and z.
Object to_object(const Sku& sku, int dimension = 2);

}  // namespace unhand::datasets
