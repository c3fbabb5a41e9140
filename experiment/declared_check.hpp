// What a log declares of its objects, its pads and where they land, held against physics and motion capture:
// for unit_check, and for those who read an SKU file.
#pragma once

#include <string>
#include <vector>

#include "experiment/unit_check.hpp"

namespace unhand::experiment {

/// I/m that a body of some mass and extent can have about an axis through its CoM [m²].
struct GyrationRange {
  double least, most;  ///< [m²]
};

/// `diagonal` L: of the box that holds the body [m]. The most, L²/4, has all mass in two opposite corners: a
/// coordinate within a length d has a variance of at most d²/4, and I/m is the sum of two. The least,
/// m/(2 π ρ L), is a cylinder about the axis, as long as L and of the densest metal, ρ = 22 600 kg/m³: a
/// section of area A adds ρ A²/(2 π) per length, and the sum is least where all sections are alike.
GyrationRange gyration_range(double mass, double diagonal);

/// Why no body of the object's mass and dims (a diagonal of 2 m where it has none) has its inertia, in words;
/// empty: some body has.
std::string impossible_inertia(const datasets::Object& object);

/// Inertias outside of that range, with a diagonal of 2 m where no dims are declared (then I/m is at most
/// 1 m²), and a pad radius above 0.2 m or above the diagonal of every object.
std::vector<UnitDoubt> impossible_declarations(const datasets::ThrowLog& log);

/// Objects whose CoM motion capture sees across the declared com_offset (to 20 degrees of a right angle, or
/// of the opposite direction) while they are held, in the median over throws.
std::vector<UnitDoubt> turned_levers(const datasets::ThrowLog& log);

/// A landing height that the tracked flights contradict: the end of each, continued by at most 0.15 s, is
/// elsewhere where it passes the measured landing x and at landing/time, by more than 0.1 m in the median
/// over throws, and a fifth of the height (cameras have scales). Where only one of the two is known, by more
/// than 0.2 m: clocks and cameras may be shifted.
std::vector<UnitDoubt> contradicted_landing_height(const datasets::ThrowLog& log);

}  // namespace unhand::experiment
