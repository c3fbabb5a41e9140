// What motion capture sees of an object in the hand before the gripper opens. Internal to experiment and
// fitting.
#pragma once

#include "datasets/throw_log.hpp"
#include "dynamics/frames.hpp"
#include "release/hand_motion.hpp"

namespace unhand::experiment {

/// Calls use(angle, place) for every valid sample of a throw between the begin of its hand's motion and
/// `open_command` [s]: θ_O − θ_H [rad], and p_O − p_H along the object's axes [m].
template <class Use>
void each_seen_in_hand(const datasets::Throw& logged, const release::HandMotion& hand, double open_command,
                       const Use& use) {
  if (!logged.mocap) return;
  const datasets::MocapLog& mocap = *logged.mocap;
  const dynamics::Window whole{hand.begin(), hand.end()};
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (!mocap.is_valid(i) || t < hand.begin() || t >= open_command || t > hand.end()) continue;
    const auto pose = hand.at(whole, t).pose;
    const dynamics::Vec2<double> r{mocap.pose(i, 0) - pose.x, mocap.pose(i, 1) - pose.z};
    use(mocap.pose(i, 2) - pose.theta, dynamics::rotate(-mocap.pose(i, 2), r));
  }
}

}  // namespace unhand::experiment
