// A slip log: direct evidence on friction patches, wrenches beside the twists they go with.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// wrench (N,3) [fx, fy, tau]: what the object applies to the surface [N, N, N m]; twist (N,3) [vx, vy,
/// omega] of the object [m/s, m/s, rad/s]; both in the object frame about its centre.
struct Slip {
  std::string id;              ///< unique within its surface
  Split split = Split::train;  ///< whether it may be fitted to
  Series time, wrench, twist;  ///< (N) [s]; (N,3) and (N,3) as above
  bool operator==(const Slip&) const = default;
};

/// One friction patch and its measured slips.
struct Surface {
  double mass = 0;                     // [kg]
  double characteristic_length = 0;    // [m]
  std::string description;             ///< free text
  std::optional<std::string> licence;  ///< of the data
  std::vector<Slip> slips;             // in order of id when read
  bool operator==(const Surface&) const = default;
};

/// Friction patches and their slips.
struct SlipLog {
  std::map<std::string, Surface> surfaces;  ///< by name
  bool operator==(const SlipLog&) const = default;
};

/// The work that the object does on the surface over all samples, Σ w·v, over the sum of its sizes, in [-1,
/// 1]: near 1 where friction takes it, negative where a sign is reversed; 0 without samples.
double dissipation(const Surface& surface);

/// As for throw logs: the same strictness, the same errors, the same atomic writing.
SlipLog read_slip_log(const std::filesystem::path& file);
/// Checks and writes; throws LogError.
void write_slip_log(const std::filesystem::path& file, const SlipLog& log);
/// The bytes of that file, checked; `file` is for messages. Throws LogError.
std::string to_hdf5(const SlipLog& log, const std::string& file = "(in memory)");
/// The rules that reader and writer share. Throws LogError with `file` as its file.
void validate(const SlipLog& log, const std::string& file = "(in memory)");

}  // namespace unhand::datasets
