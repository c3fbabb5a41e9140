// One measured push log as it is in the file, numbers unchanged. Private to the importer.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

namespace unhand::datasets {

/// time [s], then x, y, z [mm] and the unit quaternion qw, qx, qy, qz.
struct TimedPose {
  double time = 0;
  std::array<double, 7> pose{};
};

/// time [s] and the force [N] in the sensor's own axes.
struct TimedForce {
  double time = 0;
  std::array<double, 2> force{};
};

/// One push as its text file has it.
struct RawPush {
  std::array<double, 7> before{}, after{};  // the object: x, y, z [mm], qw, qx, qy, qz
  std::vector<TimedForce> forces;           // at least two, times strictly rising
  std::vector<TimedPose> robot;             // the same
};

/// Lines of numbers separated by blanks: the number of pushes; for each push two lines of seven (the object's
/// pose before and after), a count n and n lines "t fx fy", a count m and m lines "t x y z qw qx qy qz".
/// Throws ImportError with line and column: a missing or superfluous number, one that is not finite or not a
/// number, a count below its least, a quaternion whose norm is not 1, time that does not rise, a file that
/// ends early or goes on.
std::vector<RawPush> read_push_file(const std::filesystem::path& file);

}  // namespace unhand::datasets
