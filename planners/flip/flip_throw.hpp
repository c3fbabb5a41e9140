// The bar's part of a throw-flip: release by a contact law from a moving hand, flight, and where it lands.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "contact/contact_model.hpp"
#include "contact/normal_force.hpp"
#include "planners/flip/robot.hpp"
#include "release/hand_motion.hpp"

namespace unhand::planners::flip {

/// x, z [m], θ [rad] and their rates [m/s, m/s, rad/s] of the bar's centre of mass when it is free. θ as in
/// release: from +x to +z, of the bar's axis from the pads to the centre of mass.
using DetachVector = std::array<double, 6>;

/// Where the bar lands: x forward of the robot's base [m] at height 0, and its angle from hanging straight
/// down, θ + π/2, not wrapped [rad]; [LiuDaCostaBillard2025] counts it so.
struct FlipPose {
  double x{}, angle{};  ///< m; rad
};
inline constexpr double kFromHanging = 1.5707963267948966;  ///< [rad]

/// The flow map g of the flight to height 0. Empty where it never comes down to it. Throws
/// std::invalid_argument for a state that is not finite.
std::optional<FlipPose> fly_flip(const DetachVector& detach);

/// How one bar is held and let go.
struct HeldBar {
  Bar bar;          ///< what is held
  double angle{};   ///< of the bar against the hand [rad]
  Gripper gripper;  ///< how it opens
  Pads pads;        ///< what holds
};

/// How a bar left the hand.
struct FlipRelease {
  double time{};                 ///< of the detach, after the gripper's command [s]
  DetachVector detach{};         ///< m, m, rad, m/s, m/s, rad/s
  std::array<double, 6> hand{};  ///< pose and twist of the hand then, in the same order
};

/// Throws std::invalid_argument for pads whose law does not follow them (contact::follows_pads) and for a
/// step that is not > 0 [s]. Empty where the bar is not free before the hand's motion ends, or the release is
/// not solved. With `on_bar`, the wrench of the pads about their middle is written there for instants
/// k `step`, k = 0 …, zero once the bar is free.
std::optional<FlipRelease> release_bar(const release::HandMotion& hand, const HeldBar& held,
                                       std::vector<dynamics::Wrench<double>>* on_bar = nullptr,
                                       double step = 1e-3);

}  // namespace unhand::planners::flip
