// The simulated hardware: one robot, whose own numbers nobody is told, throwing bars.
#pragma once

#include <cstdint>

#include "planners/flip/arm_throw.hpp"
#include "planners/flip/flip_throw.hpp"

namespace unhand::planners::flip {

/// How a throw ended.
enum class FlipOutcome {
  landed,       ///< at height 0
  not_let_go,   ///< the bar was not free in time, or the release was not solved
  never_lands,  ///< it does not come down to height 0
};
/// The outcome's name, as it is written above.
const char* to_string(FlipOutcome);

/// What a throw shows, with the sensors' noise; [LiuDaCostaBillard2025]'s (u, q^h, v^h, q^o, v^o, q^land).
struct FlipTrial {
  FlipCommand command;           ///< as given
  FlipOutcome outcome{};         ///< only `landed` has a landing
  std::array<double, 6> hand{};  ///< pose and twist of the hand at detach
  DetachVector detach{};         ///< m, m, rad, m/s, m/s, rad/s
  FlipPose landing;              ///< m, rad
  ArmUse use;                    ///< of the joints' limits, as the robot reports it
};

/// How the plant is simulated.
struct PlantOptions {
  ArmOptions arm{1, 1.0};  ///< integration steps and noise
  int reaction_passes{1};  ///< the hand's motion is found again under the wrench of the bar; 0 to 64
};

/// One robot: the declared one with masses, friction, motors, gripper, pads and bar off by [robots], drawn by
/// the seed.
///
/// The arm first brakes with the bar held rigidly, which gives a wrench at the pads; with `reaction_passes` >
/// 0 it brakes again under that wrench, with the bar's inertia gone (a fixed point of hand and bar moving
/// each other; the bar weighs a tenth of what the wrist turns, so one pass is enough, see the tests).
class FlipPlant {
 public:
  /// Keeps a reference to `robot`.
  FlipPlant(const FlipRobot& robot, std::uint64_t seed);
  /// A robot that would be gone.
  FlipPlant(const FlipRobot&& robot, std::uint64_t seed) = delete;

  /// Throws the bar once. Equal seeds give equal throws. Throws std::invalid_argument for a command or
  /// options out of range.
  FlipTrial throw_bar(const FlipCommand& u, const Bar& declared, std::uint64_t trial_seed,
                      const PlantOptions& options = {}) const;

 private:
  const FlipRobot& robot_;
  ArmBody body_;
  Gripper gripper_;
  Pads pads_;
  double com_error_{};
};

/// A seed made of others (splitmix64 of each in turn).
std::uint64_t seed_of(std::initializer_list<std::uint64_t> parts);

}  // namespace unhand::planners::flip
