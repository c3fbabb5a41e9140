// The arm's part of a throw-flip: rigid links under joint impedance control at 1 kHz, accelerating and then
// braking, and the hand that it moves.
#pragma once

#include <random>
#include <span>

#include "dynamics/frames.hpp"
#include "planners/arm/dynamics.hpp"
#include "planners/flip/robot.hpp"
#include "release/hand_motion.hpp"

namespace unhand::planners::flip {

inline constexpr double kControlStep = 1e-3;  ///< [s]

/// What moves: links, friction and motors, as they are or as somebody believes.
struct ArmBody {
  Chain loaded, bare;                  ///< with the bar held rigidly, and without it
  Chain known;                         ///< what the controller compensates with
  Joints friction_scale, torque_gain;  ///< on the published friction; torque applied over commanded [-]
};
/// The arm as it is declared, holding a bar.
ArmBody declared_body(const FlipRobot& robot, const Bar& bar);

/// The reference while accelerating, t from 0 to `duration`: q̇_r = s q̇_s (3 τ² − 2 τ³), τ = t/duration, so
/// that it ends in (q_d, s q̇_s) without acceleration; it starts at rest, at q_d − ½ s q̇_s duration.
struct FlipReference {
  Joints q, qd;  ///< rad; rad/s
};
/// The reference at t [s].
FlipReference reference_at(const FlipMotion& motion, const FlipCommand& u, double t);
/// q_d = q_s + γ/N, over the N joints that throw.
Joints throwing_pose(const FlipMotion& motion, const FlipCommand& u);

/// Throws std::invalid_argument, naming joint and limit, where the reference of a command leaves the joints'
/// limits of position, velocity or acceleration, and where it leaves the vertical plane of x and z: the axes
/// of the joints that throw may be 0.01 rad off y, and the hand as much off the plane.
void check_reference(const FlipRobot& robot, const FlipCommand& u);

/// How finely the arm is integrated.
struct ArmOptions {
  int substeps{1};  ///< integration steps in a control step, 1 to 64
  double noise{0};  ///< factor on the sensors' and torques' noise, >= 0
};

/// Largest shares of limits that were used, and how often commands were cut.
struct ArmUse {
  double position{}, velocity{}, torque{};  ///< of |q − middle| over half the range, and of the limits [-]
  int cut_torque{}, cut_rate{};             ///< control steps in which a joint's command was
};

/// The hand's motion, and what it took.
struct ArmThrow {
  release::PolynomialHand hand;  ///< in the vertical plane y = 0; t = 0 is the brake's start
  ArmUse use;                    ///< over acceleration and brake
};

/// Simulates to the brake's start once; braking can then be simulated with different loads on the hand.
///
/// Integration: a_n = M⁻¹ (τ_n − bias − friction) at the extrapolated midpoint q + h/2 q̇ + h²/8 a_{n−1},
/// q̇ + h/2 a_{n−1}; then q += h q̇ + h²/2 a_n, q̇ += h a_n: second order at one evaluation a step. Torques
/// are held over a control step. Commands are cut to the torque limits and to `torque_rate`.
class ThrowingArm {
 public:
  /// Simulates the acceleration. Equal seeds give equal noise. `robot` and `body` are kept by reference.
  /// Throws std::invalid_argument for options out of range.
  ThrowingArm(const FlipRobot& robot, const ArmBody& body, const FlipCommand& u, std::uint64_t noise_seed,
              const ArmOptions& options = {});

  /// With the bar held to the end.
  ArmThrow brake() const;
  /// With the wrench that the pads put on the bar, about their middle, one for each control step of the
  /// brake [N, N, N m]; its reaction loads the bare hand.
  ArmThrow brake(std::span<const dynamics::Wrench<double>> on_bar) const;

 private:
  struct Tick {
    Joints q, qd;
  };
  struct State {
    Joints q, qd, qdd, torque;
    std::mt19937_64 random;
    std::normal_distribution<double> normal;
    ArmUse use;
  };
  void step(State& state, const Chain& chain, const FlipReference& reference, const Joints& stiffness,
            const Joints& damping, const Joints& external) const;
  ArmThrow finish(const Chain& chain, std::span<const dynamics::Wrench<double>> on_bar) const;

  const FlipRobot& robot_;
  const ArmBody& body_;
  FlipCommand command_;
  ArmOptions options_;
  Joints torque_limit_, target_;
  State at_brake_;
  std::vector<Tick> before_;  ///< the control steps before the brake
};

}  // namespace unhand::planners::flip
