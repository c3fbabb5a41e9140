#include "planners/flip/plant.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace unhand::planners::flip {
namespace {

/// Normal draws cut off at three σ, and of factors at a fifth.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double plain(double sigma) { return sigma * std::clamp(normal_(random_), -3.0, 3.0); }
  double factor(double share) { return std::max(0.2, 1 + plain(share)); }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace

const char* to_string(FlipOutcome outcome) {
  switch (outcome) {
    case FlipOutcome::landed:
      return "landed";
    case FlipOutcome::not_let_go:
      return "not_let_go";
    case FlipOutcome::never_lands:
      return "never_lands";
  }
  return "unknown";
}

std::uint64_t seed_of(std::initializer_list<std::uint64_t> parts) {
  std::uint64_t state = 0;
  for (const std::uint64_t part : parts) {
    std::uint64_t z = (state ^ part) + 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    state = z ^ (z >> 31);
  }
  return state;
}

FlipPlant::FlipPlant(const FlipRobot& robot, std::uint64_t seed) : robot_(robot) {
  Draws draws(seed_of({seed, 1}));
  const RobotSpread& spread = robot.robots;
  body_ = declared_body(robot, robot.bar);
  for (Joint& joint : body_.bare.joints) {
    const double f = draws.factor(spread.link_mass);
    joint.link.mass *= f;
    joint.link.about_com *= f;
  }
  for (int i = 0; i < robot.chain.size(); ++i) {
    body_.friction_scale[i] = draws.factor(spread.friction);
    body_.torque_gain[i] = draws.factor(spread.torque_gain);
  }
  gripper_ = {robot.gripper.grip_force * draws.factor(spread.grip_force),
              std::max(0.0, robot.gripper.dead_time + draws.plain(spread.dead_time)),
              std::max(0.01, robot.gripper.opening_time + draws.plain(spread.opening_time)),
              robot.gripper.shape * draws.factor(spread.shape)};
  pads_ = robot.pads;
  pads_.mu *= draws.factor(spread.mu);
  pads_.length *= draws.factor(spread.length);
  com_error_ = draws.plain(spread.com_offset);
}

FlipTrial FlipPlant::throw_bar(const FlipCommand& u, const Bar& declared, std::uint64_t trial_seed,
                               const PlantOptions& options) const {
  if (!robot_.motion.range.holds(u))
    throw std::invalid_argument(fmt::format(
        "flip command ({:.4f}, {:.4f}, {:.4f}) is outside the robot's range", u.pitch, u.speed, u.damping));
  if (options.reaction_passes < 0 || options.reaction_passes > 64)
    throw std::invalid_argument(
        fmt::format("flip plant: reaction_passes = {}; accepted: 0 to 64", options.reaction_passes));
  const ThrowSpread& spread = robot_.throws;
  Draws draws(seed_of({trial_seed, 2}));
  HeldBar held{declared, draws.plain(spread.grasp_angle), gripper_, pads_};
  held.bar.com_offset += com_error_ + draws.plain(spread.grasp_offset);
  held.pads.mu *= draws.factor(spread.mu);
  held.gripper.grip_force *= draws.factor(spread.grip_force);
  held.gripper.dead_time = std::max(0.0, gripper_.dead_time + draws.plain(spread.dead_time));
  held.gripper.opening_time = std::max(0.01, gripper_.opening_time + draws.plain(spread.opening_time));
  ArmBody body = body_;
  body.loaded = carrying(body.bare, held.bar);
  body.known = carrying(robot_.chain, declared);

  FlipTrial out;
  out.command = u;
  const ThrowingArm arm(robot_, body, u, seed_of({trial_seed, 3}), options.arm);
  std::vector<dynamics::Wrench<double>> on_bar;
  ArmThrow moved = arm.brake();
  std::optional<FlipRelease> release;
  for (int pass = 0;; ++pass) {
    const bool last = pass >= options.reaction_passes;
    release = release_bar(moved.hand, held, last ? nullptr : &on_bar);
    if (last || !release) break;
    moved = arm.brake(on_bar);
  }
  out.use = moved.use;
  if (!release) {
    out.outcome = FlipOutcome::not_let_go;
    return out;
  }
  const auto landing = fly_flip(release->detach);
  if (!landing) {
    out.outcome = FlipOutcome::never_lands;
    return out;
  }
  const FlipSensors& s = robot_.sensors;
  const std::array<double, 6> sigma{s.position, s.position, s.turn, s.speed, s.speed, s.omega};
  for (std::size_t i = 0; i < 6; ++i) {
    out.detach[i] = release->detach[i] + draws.plain(sigma[i]);
    out.hand[i] = release->hand[i] + draws.plain(sigma[i]);
  }
  out.landing = {landing->x + draws.plain(s.landing), landing->angle + draws.plain(s.landing_turn)};
  return out;
}

}  // namespace unhand::planners::flip
