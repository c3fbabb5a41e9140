// Importer: a phone's accelerometer, as the app phyphox exports it, cut into its free falls.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// What counts as a free fall: the specific force stays below `threshold` for at least `min_duration`, and no
/// impact of 60 m/s², which no hand gives, came in the 0.25 s before (that would be a bounce). Bias and drag
/// of a phone reach some 2.5 m/s² at 6 m/s, a hand that holds it stays above 8 m/s², so the threshold lies
/// between; `guard` is cut from both ends, where the hand lets go and where the ground, or the air before it,
/// begins to push.
struct PhyphoxOptions {
  double threshold = 5.0;     ///< [m/s²]
  double min_duration = 0.4;  ///< [s] a fall from 0.8 m
  double guard = 0.03;        ///< [s]
};

/// A stretch of small specific force that is no free fall, and why.
struct DroppedFall {
  double begin = 0, end = 0;  ///< [s]
  std::string reason;         ///< in words
};

/// The free falls of one recording.
struct PhyphoxRecording {
  /// The falls in order, one throw each: `imu` and `free_flight` (on the clock of the imu), nothing else. A
  /// recording with several is cut half way between them; together they hold every sample of it.
  std::vector<Throw> falls;
  std::vector<DroppedFall> dropped;  ///< what looks like a fall and is none
  std::size_t samples = 0;           ///< in the file
  /// Median of the specific forces of 5 m/s² and more, where something holds the phone: about gravity, unless
  /// the phone is shaken or its scale is off [m/s²]; nothing of fewer than 20.
  std::optional<double> rest;
};

/// Reads time and specific force [m/s²] in the phone's frame, and its angular rate where the file has it
/// ("Gyroscope x (rad/s)"). Columns are separated by commas, semicolons or tabs, with a header in phyphox's
/// English words, where m/s² may stand for m/s^2 and, as in the file that an experiment of the user's own has
/// per sensor, "X (m/s^2)" for "Acceleration x (m/s^2)"; a file without one holds time, x, y, z and perhaps
/// the absolute value. The noise declared is estimated from the third differences of each axis over the
/// falls. "Linear acceleration" (in the header, or of X, Y and Z in the file's name), from which the phone
/// has taken what it believes gravity to be, is refused, and so are samples further apart than 0.1 s or
/// closer than 0.1 ms (times in ms), and a median specific force that is, to 5 %, gravity in g (of all
/// samples) or in ft/s² (PhyphoxRecording::rest). Throws ImportError naming file, line and
/// column; a recording without a fall is not an error.
PhyphoxRecording read_phyphox(const std::filesystem::path& file, const PhyphoxOptions& options = {});

/// Whether phyphox itself names an export so ("Raw Data.csv"), always the same: the folder tells which it is.
bool phyphox_names_it(const std::filesystem::path& file);

/// The recordings that `inputs` name: files as they are, and of a folder every file below it that phyphox
/// named, by path. Throws ImportError for a folder without any.
std::vector<std::filesystem::path> phyphox_files(std::span<const std::filesystem::path> inputs);

}  // namespace unhand::datasets
