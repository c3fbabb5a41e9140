#include "planners/tube/held_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "planners/tube/card_pads.hpp"
#include "planners/tube/planar_hand.hpp"
#include "planners/tube/require.hpp"
#include "planners/tube/throw_once.hpp"

namespace unhand::planners {

using contact::Scene;

namespace {

constexpr double kMostForce = 1e4;  // N

/// An instant that lasts.
class StandingScene final : public contact::SceneSource {
 public:
  explicit StandingScene(const Scene<double>& scene) : scene_(scene) {}
  Scene<double> scene(const dynamics::Window&, double) const override { return scene_; }
  Scene<Dual> scene(const dynamics::Window&, const Dual&) const override {
    const auto& s = scene_;
    return {{Dual(s.body.mass), Dual(s.body.inertia)},
            {Dual(s.gravity.x), Dual(s.gravity.z)},
            {Dual(s.hand.x), Dual(s.hand.z), Dual(s.hand.theta)},
            {Dual(s.hand_twist.vx), Dual(s.hand_twist.vz), Dual(s.hand_twist.omega)},
            {Dual(s.hand_acceleration.ax), Dual(s.hand_acceleration.az), Dual(s.hand_acceleration.alpha)},
            Dual(s.normal_force),
            nullptr};
  }

 private:
  const Scene<double>& scene_;
};

/// Pads that give hold what rigid ones do: they have given by then as much as the wrench asks for.
std::unique_ptr<contact::ContactModel> law_of(const ReleaseCard& card, const Draw& draw) {
  auto pads = pads_of(card, draw[kMu], draw[kLength]);
  pads.variation.compliance = 0;
  return contact::make_contact_model(card.model, pads);
}

bool sticks(const contact::ContactModel& law, Scene<double> scene, const Draw& draw) {
  scene.body = {draw[kMass], draw[kInertia]};
  const contact::Relative<double> held{{draw[kComOffset], 0}, draw[kGraspAngle], {}, 0};
  return law.membership(-1, {0, 1}, StandingScene(scene), 0.0, held).mode == 0;
}

}  // namespace

HeldMotion::HeldMotion(const ReleaseThrow& problem, const JointTrajectory& motion, double step)
    : problem_(problem) {
  validate(problem);
  require(step > 0 && std::isfinite(step), "held motion", "step", step, "(0, inf) s");
  const Transform<double> at_start = forward_kinematics(problem.chain, problem.start.q);
  const ThrowPlane plane(at_start.p, problem.target);
  // Across the plane, so that from forward to up is a positive turn; it is the hand's from here on.
  const Eigen::Vector3d across =
      at_start.R.transpose() * Eigen::Vector3d(plane.along.y(), -plane.along.x(), 0);
  const int steps = std::max(1, static_cast<int>(std::ceil(-motion.begin / step)));
  for (int k = 0; k <= steps; ++k) {
    const auto s = motion.at(motion.begin * (1 - static_cast<double>(k) / steps));
    const auto tip = tip_motion<double>(problem.chain, s.q, s.qd, s.qdd);
    const Eigen::Vector3d turn = tip.frame.R * across, x = tip.frame.R.col(2), z = turn.cross(x);
    const double g = problem.medium.gravity;
    scenes_.push_back({{problem.object.mass, problem.object.inertia},
                       {-g * x.z(), -g * z.z()},
                       {},
                       {tip.velocity.dot(x), tip.velocity.dot(z), tip.omega.dot(turn)},
                       {tip.acceleration.dot(x), tip.acceleration.dot(z), tip.alpha.dot(turn)},
                       problem.card.grip_force + problem.card.friction.adhesion,
                       nullptr});
  }
}

bool HeldMotion::holds(const Draw& draw) const {
  const auto law = law_of(problem_.card, draw);
  return std::all_of(scenes_.rbegin(), scenes_.rend(),
                     [&](const Scene<double>& scene) { return sticks(*law, scene, draw); });
}

int HeldMotion::drops(int count, std::uint64_t seed) const {
  Draws draws(problem_, seed);
  int out = 0;
  for (int i = 0; i < count; ++i) out += !holds(draws.next());
  return out;
}

std::optional<double> HeldMotion::needed_force() const {
  const Draw nominal = nominal_draw(problem_);
  const auto law = law_of(problem_.card, nominal);
  double needed = 0;
  for (Scene<double> scene : scenes_) {
    const auto enough = [&](double force) {
      scene.normal_force = force + problem_.card.friction.adhesion;
      return sticks(*law, scene, nominal);
    };
    if (needed > 0 && enough(needed)) continue;
    double low = needed, high = std::max(1e-3, 2 * needed);
    while (!enough(high)) {
      if (high > kMostForce) return {};
      low = high, high *= 2;
    }
    while (high - low > 1e-3 * high) {
      const double middle = 0.5 * (low + high);
      (enough(middle) ? high : low) = middle;
    }
    needed = high;
  }
  return needed;
}

std::string why_not_held(const ReleaseThrow& problem, const JointTrajectory& motion) {
  const HeldMotion held(problem, motion);
  if (held.holds(nominal_draw(problem))) return "";
  std::string out = fmt::format("a grip of {:.4g} N per pad lets the object slip before the gripper opens",
                                problem.card.grip_force);
  if (const auto needed = held.needed_force())
    out += fmt::format(": this motion needs at least {:.3g} N per pad", *needed);
  return out;
}

}  // namespace unhand::planners
