// Importer: rigid bodies tracked by OptiTrack's Motive, as it exports them to CSV (format versions 1.2x).
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// From Motive's frame to the log's. Motive is right-handed with Y up, unless its export says otherwise; the
/// world of a log has z up and x forward:
///   p_W = Rz(−heading) C (p_M − origin),   C: (X, Y, Z) -> (X, −Z, Y).
/// The axes of the body change in the same way, so that a body created in Motive in an upright pose has its x
/// along Motive's X, its y along −Z and its z along Y, and q_WO = Rz(−heading) (C q_M C⁻¹). Planar logs keep
/// x and z of the tracked point, and the angle of the body's x axis in the throwing plane, from +x towards
/// +z.
struct MotiveOptions {
  std::string body;    ///< the rigid body's name in Motive; empty: the only one
  int dimension = 3;   ///< 2: the throw is in the world's x–z plane
  double heading = 0;  ///< [rad] of the throw in Motive's floor, from X, counter-clockwise seen from above
  std::array<double, 3> origin{};  ///< [m] the robot's base in Motive's axes
  std::array<double, 3> com{};     ///< [m] from the body's pivot to its CoM, in the body's axes in Motive
  double time_offset = 0;          ///< [s] added to Motive's time, to bring it to the clock of the robot
  /// Declared noise, 1 σ: of a position [m] and of an angle [rad] (σ/2 of a quaternion's components); both or
  /// neither where the file has rotations. 0: none.
  double sigma_position = 0, sigma_angle = 0;  ///< m; rad
  double gravity = 9.81;                       ///< [m/s²] by which a free flight is told
  /// What is known of the free flight: from when to when it is [s, on the robot's clock]; the height [m]
  /// below which, after its highest point, the body has landed.
  std::optional<std::pair<double, double>> free_flight;
  std::optional<double> landing_height;  ///< m
};

/// The straight line over the floor along which a free flight runs.
struct FlightRun {
  double length = 0;   ///< m
  double heading = 0;  ///< rad, as MotiveOptions has it
  double beside = 0;   ///< m, how far the flight is beside the line at most
};

/// One take of a Motive export: times, poses, lost frames.
struct MotiveTake {
  std::string name, version, body;  ///< of the take; of the file format ("1.23"); of the rigid body
  std::vector<std::string> bodies;  ///< all that the file holds
  double frame_rate = 0;            ///< [Hz] as the header says; 0: it does not
  MocapLog mocap;                   ///< lost frames: valid = 0, pose NaN
  std::size_t lost = 0;             ///< frames without a pose
  /// Planar: how far the track leaves the plane through its first sample [m], and the largest angle between
  /// the body's x axis and the plane [rad].
  double out_of_plane = 0, out_of_plane_angle = 0;  ///< m; rad
  /// Of MotiveOptions::free_flight, or else of the longest stretch before the landing, 0.1 s at least, that
  /// gravity bends and nothing else; nothing where there is none.
  std::optional<FlightRun> run;
};

/// Reads the exported rotation and position of one rigid body. Lengths in millimetres, centimetres or metres,
/// as the header says; rotations as quaternions, or as Euler angles in degrees in any of the six orders
/// (about the turned axes). Empty cells are frames in which the tracker lost the body. Without rotations a
/// spatial pose is [x, y, z]. Quaternions keep their sign from frame to frame; a planar angle never steps by
/// more than π, so that it is right across a loss only if the body turns less than that. Throws ImportError
/// naming file, line and column, and std::invalid_argument for options out of range.
MotiveTake read_motive_csv(const std::filesystem::path& file, const MotiveOptions& options = {});

}  // namespace unhand::datasets
