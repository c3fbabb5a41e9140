// Importers: a robot's hand, a force/torque sensor and a tracked object from plain CSV files, by a map of
// columns.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// What a file holds, and with that its channels.
enum class TableKind {
  /// "time,x,z,theta,vx,vz,omega,ax,az,alpha": the hand frame in the throwing plane (x forward, z up, theta
  /// from +x towards +z). All of them are needed: a controller knows its acceleration, a differentiated log
  /// does not.
  hand,
  /// "time,fx,fz,tau,normal": what this pad applies to the object, in the hand frame, about the pad's centre,
  /// and the pad's normal force, positive when it presses.
  ft,
  /// "time,x,z,theta": the tracked object in the throwing plane (x forward, z up, theta from +x towards +z),
  /// at its centre of mass.
  mocap,
};
/// Their names, in this order.
std::vector<std::string> channels_of(TableKind kind);

/// Which column of a file is which channel of the log. Keys are the names of channels.
struct ColumnMap {
  /// Channel -> header of its column, or "#3" for the third column (a file whose channels are all given so
  /// needs no header). A '-' in front flips the sign: a sensor that reports what the object does to the pad
  /// has fx=-Fx.
  std::map<std::string, std::string> columns;
  /// Channel -> unit of its column ("mm", "deg", "N mm"). Where it is not given, the header says it: "Fx
  /// (N)", "Fx [N]". There is no default.
  std::map<std::string, std::string> units;
  /// Channel -> declared noise, 1 σ, in the column's unit. All channels of a dataset, or none.
  std::map<std::string, double> sigma;
  /// [s] added to the file's time, to bring it to the clock of the robot.
  double time_offset = 0;
};

/// Reads a CSV file (separated by tabs, semicolons or commas; with a decimal comma where it is not the
/// separator) whose first line is a header. All values finite, time strictly increasing. theta is unwrapped:
/// it never steps by more than π. Throws ImportError naming file, line and column, and std::invalid_argument
/// for a map with names of channels that there are not, or without those that are needed.
HandLog read_hand_csv(const std::filesystem::path& file, const ColumnMap& map);
/// The same for the sensor behind one pad.
FtLog read_ft_csv(const std::filesystem::path& file, const ColumnMap& map);
/// The same for a tracked object. A row in which a cell of x, z or theta is empty, NaN (of either sign), N/A
/// or NA, in capitals or not, is one in which the tracker lost the object: valid = 0, pose NaN. A bare sign
/// is none of these, and no number. theta is unwrapped from valid row to valid row, so that it is right
/// across a loss only if the object turns by less than half a turn meanwhile. Throws ImportError where it is
/// lost in all rows, too.
MocapLog read_mocap_csv(const std::filesystem::path& file, const ColumnMap& map);

/// What is wrong with a map for such a file, or nothing: to say so before any file is read.
std::string fault_of(const ColumnMap& map, TableKind kind);

}  // namespace unhand::datasets
