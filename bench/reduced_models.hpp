// One release under the distributed patch and under the models that reduce it, each flown to the landing.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "contact/registry.hpp"
#include "crosscheck/distributed_patch.hpp"
#include "flight/fly.hpp"
#include "release/naive_release.hpp"

namespace unhand::bench {

struct Landed {
  double x{}, theta{};  ///< m, rad
};

/// Flies a detached object to the height 0; nothing if it has not parted or never lands.
inline std::optional<Landed> land(release::ReleaseOutcome outcome, const release::DetachState<double>& detach,
                                  const dynamics::Vec2<double>& gravity) {
  if (outcome != release::ReleaseOutcome::detached) return {};
  const auto flown = flight::fly<double>({detach.pose, detach.twist, gravity});
  if (flown.outcome != flight::FlightOutcome::landed) return {};
  return Landed{flown.landing.pose.x, flown.landing.pose.theta};
}

/// A release by its parts, which must outlive the problems made of it.
struct Throw {
  const release::HandMotion& hand;
  const contact::NormalForce& force;
  dynamics::RigidBody<double> body;
  release::Grasp<double> grasp;
  dynamics::Vec2<double> gravity{0, -9.81};

  release::ReleaseProblem<double> problem(const contact::ContactModel& model) const {
    return {hand, force, model, body, gravity, grasp, hand.begin(), {}, 0.0};
  }
};

inline std::optional<Landed> with_model(const Throw& thrown, const std::string& name,
                                        const contact::ContactParameters<double>& parameters) {
  const auto model = contact::make_contact_model(name, parameters);
  const auto result = simulate_release(thrown.problem(*model));
  return land(result.outcome, result.detach, thrown.gravity);
}

/// The ellipsoid as a sign law at fixed steps [s].
inline std::optional<Landed> naively(const Throw& thrown, const contact::Patch<double>& patch, double step) {
  const auto model = contact::make_contact_model("limit_surface", {patch, {}, {}, 0, 0, {}});
  const auto result = simulate_release_naive(thrown.problem(*model), patch, {step, 0});
  return land(result.outcome, result.detach, thrown.gravity);
}

/// Carried rigidly and let go at `time` [s].
inline std::optional<Landed> carried(const Throw& thrown, double time) {
  const auto hand = thrown.hand.at({thrown.hand.begin(), thrown.hand.end()}, time);
  const double theta = hand.pose.theta + thrown.grasp.angle;
  const auto r = dynamics::rotate(theta, dynamics::Vec2<double>{thrown.grasp.com_offset, 0});
  return land(release::ReleaseOutcome::detached,
              {time, {hand.pose.x + r.x, hand.pose.z + r.z, theta}, dynamics::twist_at_com(hand.twist, r)},
              thrown.gravity);
}

inline std::optional<Landed> with_points(const Throw& thrown, const crosscheck::DistributedPatch& patch) {
  const auto unused = contact::make_contact_model(
      "limit_surface", contact::ContactParameters<double>{{patch.mu, patch.radius}, {}, {}, 0, 0, {}});
  const auto result = simulate_distributed_patch(thrown.problem(*unused), patch);
  return land(result.outcome, result.detach, thrown.gravity);
}

/// In units of 1 cm and 5 degrees, the larger of the two: below 1 both are met.
inline double misses_by(const Landed& predicted, const Landed& truth) {
  return std::max(std::abs(predicted.x - truth.x) / 0.01,
                  std::abs(predicted.theta - truth.theta) / (5 * 3.14159265358979 / 180));
}

}  // namespace unhand::bench
