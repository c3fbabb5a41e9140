// Importer: the measured planar pushes of Zhou, Paolini, Bagnell and Mason (ICRA 2016).
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "datasets/slip_log.hpp"

namespace unhand::datasets {

/// The block that is pushed, in its tracked frame. The logs do not say it; this one is published with them:
/// a right-angled triangle, origin at the right angle, axes along the legs.
struct PushedBlock {
  double mass = 1.518;  ///< [kg]
  std::vector<std::array<double, 2>> outline{
      {0, 0}, {0.15, 0}, {0, 0.15}};         ///< convex, counter-clockwise [m]
  std::array<double, 2> centre{0.05, 0.05};  ///< that torques and the motion are about [m]
  double characteristic_length = 0.05;       ///< L [m]
  /// For the log.
  std::string description =
      "a triangular block; measured: robinzhoucmu MLab_EXP (Zhou, Paolini, Bagnell, Mason, ICRA 2016)";
  std::string licence = "Apache-2.0";  ///< of the log; may be empty
};

/// A homogeneous prism of that outline: its centroid, and for L the distance from there of its area's points,
/// root mean square. `description` is to be set. Throws std::invalid_argument where the outline has fewer
/// than three corners or more than 1,000, is not convex or not counter-clockwise, has sides shorter than
/// 0.1 mm or is not finite, and where the mass [kg] is not > 0.
PushedBlock homogeneous_block(std::vector<std::array<double, 2>> outline, double mass);

/// A block lies on three feet, or on its whole face, and a finger pushes its edge 16 mm at 2.5 mm/s. A log
/// holds, per push, the block's pose before and after, the finger's pose at 33 Hz and the force on the finger
/// at 100 Hz. [Zhou2016]
///
/// **Frames and units.** Poses are in mm, turned into m; every rotation is a yaw about world z, up. The force
/// sensor turns with the finger: with θ the finger's yaw, the force on the block in the world is
/// f = −R(θ) M (f_s − b), M = (1/√2) [[1, 1], [1, −1]], for the sensor's axes stand at 45° and its z points
/// down. The minus sign turns the load of the finger into the load on the block. That load is also the wrench
/// which the block applies to the surface: at 2.5 mm/s inertia is nothing beside friction (quasi-static).
/// The torque is r × f about the block's centre, r from the centre to the finger.
///
/// **Offset b.** The median of the first 0.2 s, when the finger is still on its way. Where that is further
/// than 0.3 N from the median of the log's pushes the finger was touching already, and the median of the
/// log's pushes is taken.
///
/// **Clocks.** Both series bear stamps of one computer; the finger's pose is interpolated linearly at the
/// times of the grid and stays at its ends beyond them (0.03 s at most in these logs).
///
/// **Motion.** The block's pose is known before and after only. In between it moves along the screw that
/// leads from one to the other, so its twist has one direction, and where it is along the screw follows from
/// the finger, which stays on the edge: s(t) in [0, 1], never falling. The edge is the one that the finger is
/// at when the push ends; what it lacks to the edge then (calibration, up to 4 mm) is taken as constant. The
/// finger sits on the block at its own position: its radius does not show in the logs.
///
/// **Samples.** Intervals of 0.1 s: mean force, twist = screw · Δs/0.1 s. An interval stays if the block
/// moves faster than 0.2 mm/s (|v| + L|ω|) under more than 0.3 N. A push stays if its screw, √(|v|² + L²ω²),
/// is longer than 1 mm, the finger ends at an edge, the mean force presses on that edge (a contact cannot
/// pull), and an interval is left. Every fifth push is held out: numbers 4, 9, ..., from 0.
struct PlanarPushOptions {
  PushedBlock block;  ///< what is pushed
};

/// A push that was not kept, and why.
struct DroppedPush {
  std::string surface;  ///< as the log will name it
  int push = 0;         // from 0
  std::string reason;   ///< in words
};

/// What was read of planar pushes, kept and dropped.
struct PlanarPushReport {
  int pushes = 0, kept = 0, train = 0, test = 0;  ///< read, kept, by split
  std::size_t samples = 0, dropped_samples = 0;   // intervals of kept pushes
  int borrowed_offsets = 0;                       // kept pushes that begin in contact
  std::vector<DroppedPush> dropped;               ///< in the order read
};

/// One surface per log, named by the folder that the log is in (with the file's stem where a folder holds
/// several), and one slip per kept push, "push-00" on. Times start with the push's first force sample. A
/// folder among the inputs stands for every .txt file below it. Throws ImportError naming file, line and
/// column; std::invalid_argument for options out of range.
SlipLog import_planar_pushes(std::span<const std::filesystem::path> inputs,
                             const PlanarPushOptions& options = {}, PlanarPushReport* report = nullptr);

}  // namespace unhand::datasets
