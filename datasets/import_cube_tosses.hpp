// Importer: the measured cube tosses of Pfrommer, Halm and Posa (CoRL 2020), as one CSV in SI units.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// What the CSV does not say. Mass, side and inertia are as published with the data set (0.37 kg, 0.1048 m,
/// 0.00081 kg m²; a uniform cube of that mass and side would have m s²/6 = 0.00068 kg m²). Gravity is
/// declared, not measured. The landing height is the half diagonal of the cube, √3 s/2 = 0.0908 m: above that
/// plane no orientation can touch the table; what a throw is compared over is `free_flight`, which may end a
/// little above or below it.
///
/// The noise is declared by this importer, since the source names none: the scatter about a parabola per toss
/// and axis before contact is 0.03 mm (pooled over the tosses), that of a quaternion's components 2e-4 about
/// a smooth curve. These are the fast, independent part only: scale and alignment errors of the tracker are
/// not in them. Where the samples of a file scatter by more (third differences over time in the air), that is
/// declared.
struct CubeTossOptions {
  double mass = 0.37, side = 0.1048;                         // [kg], [m]
  std::array<double, 3> inertia{0.00081, 0.00081, 0.00081};  // [kg m²]
  /// Where the tosses and the cube's numbers are from, and the licence of the data.
  /// @{
  std::string source =
      "measured: DAIRLab contact-nets (Pfrommer, Halm, Posa, CoRL 2020); mass, side and inertia as published";
  std::string licence = "BSD-3-Clause";
  /// @}
  double gravity = 9.81;  // [m/s²]
};

/// A toss that was not kept, and why.
struct DroppedToss {
  int toss = 0, samples = 0;  ///< its number; samples before contact
  std::string reason;         ///< in words
};

/// What the importer read, kept and dropped.
struct ImportReport {
  int rows = 0, tosses = 0, kept = 0, train = 0, test = 0;  ///< rows read; tosses read, kept, by split
  std::vector<DroppedToss> dropped;                         ///< in the order of the file
};

/// A spatial log with one object, "cube", and one throw per kept toss: id "toss-0042", condition "toss",
/// repetition = the toss number, the whole series as mocap pose (K,7), and `free_flight` from the first
/// sample to the last one before contact. Tosses with fewer than eight samples before contact do not pin down
/// a flight and are dropped; every fifth toss number (4, 9, ...) is held out. Quaternions are normalised. The
/// velocities in the file are derived from the poses and are not kept. Throws ImportError naming file, line
/// and column.
ThrowLog import_cube_tosses(const std::filesystem::path& csv, const CubeTossOptions& options = {},
                            ImportReport* report = nullptr);

}  // namespace unhand::datasets
