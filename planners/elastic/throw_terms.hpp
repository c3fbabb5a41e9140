// The equations of a throw's program, each as a term of few variables with exact derivatives.
#pragma once

#include <memory>
#include <vector>

#include "planners/elastic/clutched_arm.hpp"
#include "planners/elastic/nonlinear_program.hpp"

namespace unhand::planners::elastic {

/// A term, owned by the program that it is added to.
using TermPointer = std::unique_ptr<Term>;

/// Accelerations enter the program divided by this [rad/s²], so that all unknowns are of order one.
inline constexpr double kAcceleration = 50;

/// Where the object is to come down, released from the tip at once: [m] in the arm's plane.
struct Target {
  double x{}, z{};  ///< m
};

/// (x₀, x_m, x₁, ẋ₀, ẋ_m, ẋ₁, h), ẋ given in units of `scale`: x₁ − x₀ − h/6 (ẋ₀ + 4 ẋ_m + ẋ₁) and
/// x_m − ½ (x₀ + x₁) − h/8 (ẋ₀ − ẋ₁) [HargravesParis1987].
TermPointer hermite_simpson(std::vector<int> variables, double scale);
/// (x) -> weight x².
TermPointer weighted_square(std::vector<int> variables, double weight);
/// (x, h, h') -> weight x² h/(h + h'): in a mean over two phases of as many intervals of the lengths h and
/// h'.
TermPointer square_in_share(std::vector<int> variables, double weight);
/// Rows of factors times the variables.
TermPointer linear(std::vector<int> variables, std::vector<double> factors);

// Each of the following ends with the motors' torques: those of a node, or of both nodes beside a middle,
// whose mean counts. Torques are straight lines between nodes, so that they keep their limits there.

/// (q, q̇, q̈, θ, θ̇; τ₁, τ₂) -> what the torques of joints 1 and 2, and the spring for the last link, lack [N
/// m].
TermPointer series_torques(std::vector<int> variables, const ClutchedArm& arm);
/// (q, q̇₁, q̇₂, q̈₁, q̈₂, θ, θ̇; τ₁, τ₂) -> what the torques lack, and the torque of the brake that holds the
/// last link.
TermPointer braked_torques(std::vector<int> variables, const ClutchedArm& arm);
/// (q, q̇, q̈, θ; τ₁, τ₂) -> the same as series_torques with the motor held at θ.
TermPointer passive_torques(std::vector<int> variables, const ClutchedArm& arm);
/// (q, q̇₁, q̇₂, q̈₁, q̈₂; τ₁, τ₂) -> what the torques of joints 1 and 2 lack, the last link held.
TermPointer locked_torques(std::vector<int> variables, const ClutchedArm& arm);
/// (q, q̇, q̈; τ₁, τ₂, τ_m) -> what the torques lack, the last motor locked to its link.
TermPointer rigid_torques(std::vector<int> variables, const ClutchedArm& arm);

/// (q, q̇, x, z, vx, vz) -> by how much the last four differ from the tip's state.
TermPointer tip_state(std::vector<int> variables, const ClutchedArm& arm);
TermPointer minus_squared_speed(std::vector<int> variables);  ///< (vx, vz) -> −0.1 |v|²
/// (x, z, vx, vz, flight time) -> by how much the landing misses the target in x and z.
TermPointer miss(std::vector<int> variables, const Target& target, double gravity);

}  // namespace unhand::planners::elastic
