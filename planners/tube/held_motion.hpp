// Whether a grip holds its object while the arm moves, before the gripper opens.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "contact/contact_model.hpp"
#include "planners/arm/jerk_profile.hpp"
#include "planners/tube/release_throw.hpp"

namespace unhand::planners {

/// A motion up to t = 0 with the object in the closed hand. The pads hold where the wrench that makes the
/// object follow the hand lies within their limit, in the plane of the throw as it turns with the hand; what
/// acts across that plane, and so presses on the pads, is left out; and so are oscillations on pads that
/// give.
class HeldMotion {
 public:
  /// Looks every `step` [s] > 0 from the motion's begin on, and at t = 0. The throw is copied; its chain must
  /// outlive this. Throws std::invalid_argument as validate() does.
  HeldMotion(const ReleaseThrow& problem, const JointTrajectory& motion, double step = 2e-3);

  /// Whether the grip of the card holds the object all the way, with the draw's pads, object and grasp.
  bool holds(const Draw& draw) const;
  /// How many of `count` draws, from equal seeds those of draw_landings, it does not hold.
  int drops(int count, std::uint64_t seed) const;
  /// The least force of one pad that holds it with the nominal draw, to 0.1 % [N]; nothing if
  /// 10 kN do not.
  std::optional<double> needed_force() const;

 private:
  ReleaseThrow problem_;
  std::vector<contact::Scene<double>> scenes_;  ///< in the hand's axes, with the card's grip force
};

/// Why the nominal grip does not hold the object over the motion; empty: it does.
std::string why_not_held(const ReleaseThrow& problem, const JointTrajectory& motion);

}  // namespace unhand::planners
