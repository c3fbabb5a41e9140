// What the declared robot would do: hand motions of the arm as it is declared, and a release card for the
// pads. The physics of model 4.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planners/flip/learner.hpp"
#include "planners/tube/release_throw.hpp"

namespace unhand::planners::flip {

/// Hand motions of the declared arm with one bar, held rigidly, on a mesh of commands. They depend on nothing
/// that is learned, so all learners may share them. Building it takes some 3 ms for each mesh point.
class HandLibrary {
 public:
  /// Simulates `per_side`³ commands, 2 to 64; the robot is kept by reference.
  HandLibrary(const FlipRobot& robot, const Bar& bar, int per_side = 7);
  /// A robot that would be gone.
  HandLibrary(const FlipRobot&& robot, const Bar& bar, int per_side = 7) = delete;

  /// The declared robot.
  const FlipRobot& robot() const { return robot_; }
  /// The bar that its hands hold.
  const Bar& bar() const { return bar_; }
  /// The mesh.
  const std::vector<FlipCommand>& commands() const { return commands_; }
  /// The motion of the hand for command i of the mesh; std::out_of_range for another i.
  const release::PolynomialHand& hand(std::size_t i) const { return hands_.at(i); }
  double spacing() const { return spacing_; }  ///< of the mesh, as a fraction of the range
  /// Between the values at the mesh points around a command (fractions of its range, the nearest of it where
  /// they lie outside), linear in each of its parameters. Empty where one of them is. Throws
  /// std::invalid_argument unless there is one value for each of the mesh, and for a fraction that is none.
  std::optional<DetachVector> between(const std::vector<std::optional<DetachVector>>& values,
                                      const std::array<double, 3>& fractions) const;
  /// Of any command; simulated now.
  release::PolynomialHand simulate(const FlipCommand& u) const;

 private:
  const FlipRobot& robot_;
  Bar bar_;
  int per_side_;
  double spacing_{};
  std::vector<FlipCommand> commands_;
  std::vector<release::PolynomialHand> hands_;
};

/// The declared gripper and pads as a card: what is known before any throw, with the spread between robots as
/// its uncertainty. `law` is the contact model that the card names.
ReleaseCard prior_card(const FlipRobot& robot, const std::string& law = "sliding_pivot");

/// The release of a bar that a card predicts for a hand's motion; `angle` is the bar's against the hand
/// [rad].
std::optional<FlipRelease> predicted_release(const release::HandMotion& hand, const ReleaseCard& card,
                                             const Bar& bar, double angle = 0);

/// Where the robot as it is declared, pads and all, lands the library's bar without noise: one entry for each
/// of the library's commands, empty where the bar is not let go in time or never lands.
std::vector<std::optional<FlipPose>> declared_landings(const HandLibrary& library);

/// How far detach states of the declared robot and a real one may differ for reasons that the card does not
/// have, 1 σ of x, z [m], θ [rad] and their rates [m/s, m/s, rad/s].
inline constexpr DetachVector kDiscrepancy{0.01, 0.01, 0.15, 0.05, 0.05, 0.6};

/// How alike such differences are at two commands u, in fractions of their range, as a correlation:
/// ½ + ½ exp(−|u − u'|²/(2 ℓ²)), ℓ = 0.6.
double likeness(const std::array<double, 3>& a, const std::array<double, 3>& b);

/// The card that explains throws best.
struct ReleaseFit {
  ReleaseCard card;                    ///< σ: posterior, of mu, length, dead time and opening time
  int iterations{};                    ///< of Gauss-Newton
  double cost_before{}, cost_after{};  ///< sum of squares in σ, prior included
  /// Of these four, in their order and units.
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  /// Of their σ, as far as it comes from the residuals; infinite where all of it is the prior's.
  std::array<double, 4> degrees_of_freedom{};
  double discrepancy{};  ///< s: what differs for reasons that the card does not have, in kDiscrepancy [-]
};
/// The card that explains throws of the library's bar best: mu, length, dead time and opening time by
/// Gauss-Newton with step control on the mean detach states, weighted with kDiscrepancy, and the prior.
/// Length's prior: 15 %. (grip_force enters only as mu grip_force and is kept.)
///
/// The covariance is that of this estimate if residuals are correlated from command to command as likeness()
/// says, C = s² K, and not independent as the weights take them:
///   V = A⁻¹ (Jᵀ C J + P) A⁻¹,   A = Jᵀ J + P, P the prior's information,   s² = rᵀr / tr(M K),
/// M = (1 − H)ᵀ(1 − H), H = J A⁻¹ Jᵀ. The degrees of freedom of s² are tr(M K)²/tr(M K M K).
ReleaseFit fit_release(const HandLibrary& library, const ReleaseCard& prior, std::span<const FlipDatum> data);

/// The fit as a model card, for `unhand plan throw --card`, `unhand validate-sku --card` and as the prior of
/// another session. What scatters from throw to throw is the robot's declaration; the valid range is that of
/// the data.
datasets::ModelCard model_card_of(const ReleaseFit& fit, const HandLibrary& library,
                                  std::span<const FlipDatum> data, const std::string& source);

}  // namespace unhand::planners::flip
