// A throw log: one campaign of throws as plain values, and its file.
//
// Everything is in SI base units and radians. World: x forward, z up. Planar (dimension 2): a pose is [x, z,
// theta], a twist [vx, vz, omega], an acceleration [ax, az, alpha], a wrench [fx, fz, tau]; angles run from
// +x towards +z and are unwrapped. Spatial (dimension 3): a pose is [x, y, z, qw, qx, qy, qz], or [x, y, z]
// where orientation was not tracked.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/log_error.hpp"
#include "datasets/series.hpp"

namespace unhand::datasets {

/// A thrown object as its log declares it.
struct Object {
  double mass = 0;                             // [kg]
  std::optional<std::vector<double>> inertia;  // [kg m²] about the CoM: 1 value out of plane, 3 when spatial
  std::optional<double> com_offset;            // [m] pad centre to CoM, along the object's x
  std::optional<std::array<double, 3>> dims;   // [m]
  std::optional<std::string> surface, sku;     ///< what the pads touch; name of the SKU file
  std::optional<double> drag_k;                // [1/m] declared drag, a = −k |v| v: part of the base model
  bool operator==(const Object&) const = default;
};

/// The gripper that all throws of a log have in common.
struct Gripper {
  int n_pads = 2;                              ///< pads that press, 1 … 1000
  std::optional<double> pad_radius;            // [m] nominal
  std::optional<double> opening_command_time;  // [s] robot clock
  bool operator==(const Gripper&) const = default;
};

/// The hand frame (midway between the pads) on the robot clock. Where the acceleration jumps it holds the
/// later value.
struct HandLog {
  Series time, pose, twist, acceleration;  ///< (N) [s]; (N,3) each, SI units
  bool operator==(const HandLog&) const = default;
};

/// The sensor behind one pad: the wrench this pad applies to the object, in the hand frame, about the pad
/// centre.
struct FtLog {
  Series time, wrench, normal_force;  ///< (N) [s]; (N,3) [N, N, N m]; (N) [N], > 0 where it presses
  bool operator==(const FtLog&) const = default;
};

/// The tracked object frame on the motion-capture clock. An empty `valid` means that every sample is good; a
/// pose may be NaN where valid is 0.
struct MocapLog {
  Series time, pose;  ///< (N) [s]; (N,3) planar, (N,7) or (N,3) spatial
  Flags valid;        ///< 1: tracked, 0: lost
  /// Whether sample i was tracked.
  bool is_valid(std::size_t i) const { return valid.empty() || valid[i] != 0; }
  bool operator==(const MocapLog&) const = default;
};

/// Where the tracked frame passes the landing height downwards: [x, theta] planar, [x, y, z] spatial; one
/// row.
struct LandingLog {
  Series time, pose;  ///< (1) [s]; m, and rad where planar
  bool operator==(const LandingLog&) const = default;
};

/// Inside the object, in its frame: specific force [m/s²] (zero in free fall) and angular rate [rad/s] (may
/// be empty).
struct ImuLog {
  Series time, specific_force, angular_rate;  ///< (N) [s]; (N,3) [m/s²]; (N,3) [rad/s]
  bool operator==(const ImuLog&) const = default;
};

/// Whether a throw may be fitted to, or judges.
enum class Split {
  train,  ///< may be fitted to
  test,   ///< held out: only judges
};
/// The split's name, as it is written above.
inline const char* to_string(Split split) { return split == Split::train ? "train" : "test"; }

/// One throw of a log: what was measured, by sensor.
struct Throw {
  std::string id, object, condition;    // `condition` groups repetitions
  int repetition = 0;                   ///< of the condition, >= 0
  Split split = Split::train;           ///< whether it may be fitted to
  std::optional<double> detach_time;    // [s] annotated by hand
  std::optional<double> grasp_angle;    // [rad] object x axis against the hand's, before opening
  std::vector<double> hand_jump_times;  // [s]
  std::optional<std::pair<double, double>> free_flight;  // [s] mocap clock (imu, if no mocap): flies free
  std::optional<HandLog> hand;                           ///< absent where the object flew without a robot
  std::optional<FtLog> ft;                               ///< absent where it was not recorded
  std::optional<MocapLog> mocap;                         ///< absent where it was not recorded
  std::optional<LandingLog> landing;                     ///< absent where it was not recorded
  std::optional<ImuLog> imu;                             ///< absent where it was not recorded
  bool operator==(const Throw&) const = default;
};

/// A campaign of throws, as in docs/log-format.md.
struct ThrowLog {
  int dimension = 2;                      ///< 2: in a plane, 3: in space
  std::string title, source;              ///< free text; whose throws they are, and how made
  std::optional<std::string> licence;     ///< of the data
  double gravity = 9.81;                  // [m/s²] declared
  double landing_height = 0;              // [m]
  std::map<std::string, Object> objects;  ///< by id
  std::optional<Gripper> gripper;         ///< absent where no robot threw
  std::vector<Throw> throws;              // sorted by id when read
  /// What the file's times are more than those in here [s]: nonzero where its clock is far from zero, as one
  /// that counts from 1970, since what happens between two of its doubles (2e-7 s) cannot be simulated.
  double clock_origin = 0;
  bool operator==(const ThrowLog&) const = default;
};

/// What repetitions share, in order of appearance: object and condition, since two objects may be thrown in
/// conditions of one name. Of the throws of a split, or of all.
std::vector<std::pair<std::string, std::string>> conditions_of(const ThrowLog& log,
                                                               std::optional<Split> split = {});

/// Reads and checks a throw log. The file is opened read-only; names that the schema does not know stay in
/// the file and are ignored (so they are not in the value, and write_throw_log does not repeat them), unless
/// they look like a missing name misspelt. Quaternions off unit length by up to 1e-3 are normalised. Times
/// that are all beyond 1e6 s count from the first one's full second (`clock_origin`). Throws LogError.
ThrowLog read_throw_log(const std::filesystem::path& file);

/// Checks and writes: beside the destination first, then renamed, so that a failure leaves nothing behind and
/// an older file as it was. Doubles come back bit for bit. Throws LogError.
void write_throw_log(const std::filesystem::path& file, const ThrowLog& log);

/// The bytes of that file, checked; `file` is for messages. Throws LogError.
std::string to_hdf5(const ThrowLog& log, const std::string& file = "(in memory)");

/// Takes `origin` [s] away from every time of the throw.
void move_clock(Throw& toss, double origin);

/// The rules that reader and writer share (ranges, shapes, order of time, finiteness, references between
/// parts). Throws LogError with `file` as its file.
void validate(const ThrowLog& log, const std::string& file = "(in memory)");

/// The groups, datasets and attributes of a throw log that read_throw_log ignores: their paths, with a '*'
/// for the ids of throws and objects, and in how many places each is. Throws LogError.
std::map<std::string, std::size_t> ignored_names(const std::filesystem::path& file);

/// The root attribute `schema` ("throw-log", "slip-log" or whatever it says), to choose a reader by.
std::string read_schema_name(const std::filesystem::path& file);

/// One line of the layout for documentation: path inside a throw, shape, columns and SI units.
struct LayoutRow {
  std::string path, shape, columns, units;  ///< as in a file
  bool optional = false;                    ///< a log may do without
};
/// The whole layout of a throw, 2 <= dimension <= 3, in the order of docs/log-format.md.
std::vector<LayoutRow> throw_log_layout(int dimension);

}  // namespace unhand::datasets
