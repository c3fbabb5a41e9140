// A throw whose object leaves the hand as a contact model says: where it lands, and how sure that is.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "planners/tube/release_card.hpp"
#include "planners/tube/tube_cvx.hpp"

namespace unhand::planners {

/// What the hand holds, and how.
struct HeldObject {
  double mass{0.246}, inertia{2.4e-3};  ///< [kg], about the centre of mass [kg m²]
  Uncertain com_offset{0.14, 0.004};    ///< pads to centre of mass [m]
  double angle{};  ///< of the object's x axis against the tip's z axis, in the plane [rad]
  double mass_sigma{}, inertia_sigma{};  ///< 1 σ [kg, kg m²]
};

/// The uncertain numbers of one throw.
enum Unknown {
  kMu,           ///< friction coefficient [-]
  kDeadTime,     ///< of the gripper [s]
  kOpeningTime,  ///< of the gripper [s]
  kComOffset,    ///< of the object [m]
  kGraspAngle,   ///< of the object against the hand [rad]
  kLength,       ///< L = τ_max/f_max of the pads [m]
  kShape,        ///< p of the gripper's opening [-]
  kMass,         ///< of the object [kg]
  kInertia,      ///< of the object, about its centre of mass [kg m²]
  kUnknowns      ///< how many there are
};
/// A value of every unknown, in its own unit, by kMu … kInertia.
using Draw = std::array<double, kUnknowns>;
/// The name that a card has for it: "dead_time".
const char* name_of(Unknown);

/// A throw in the vertical plane through the tip and the target: a chain whose tip is the middle of the pads,
/// its state when the gripper is told to open (t = 0), and the joint acceleration from then on.
struct ReleaseThrow {
  const Chain& chain;       ///< kept by reference
  ThrowState start;         ///< when the gripper is told to open
  JointVector<double> qdd;  ///< rad/s²
  Eigen::Vector3d target;   ///< [m]
  double hold{0.13};        ///< q̈ is held until then [s]; the object is free before
  ReleaseCard card{};       ///< pads and gripper
  HeldObject object{};      ///< what is thrown
  flight::Medium medium{};  ///< of the flight
};

/// Throws std::invalid_argument, naming value and accepted range: one finite number per joint, hold > 0,
/// every sigma >= 0, what is thrown and what holds it > 0, a card whose law follows the pads: plans have no
/// delay of a gripper. All functions below that take a throw check it.
void validate(const ReleaseThrow& problem);

/// One landing, and the release before it.
struct ReleaseLanding {
  double miss{};         ///< of the centre of mass, forward of the target [m]
  double detach_time{};  ///< [s]
  double angle{};        ///< through which the object turns against the hand until it is free [rad]
  double speed{};        ///< of the centre of mass when it is free [m/s]
};

/// Where a throw lands; empty if the object is not free by `hold` or never comes down to the target's height.
/// Throws std::invalid_argument where the tip does not move in a vertical plane with the target.
std::optional<ReleaseLanding> release_landing(const ReleaseThrow& problem, const Draw& draw);
/// The unknowns at their nominal values.
Draw nominal_draw(const ReleaseThrow& problem);

/// The same with the object carried rigidly until `delay` and then free: the kinematic model.
std::optional<ReleaseLanding> rigid_landing(const ReleaseThrow& problem, double com_offset, double delay);

/// Landing and its exact derivatives by the unknowns, at their nominal values; spread² = Σ (∂x/∂θ σ)².
struct ReleaseSpread {
  double miss{}, spread{};                   ///< nominal landing, forward of the target; its 1 σ [m]
  std::array<double, kUnknowns> gradient{};  ///< m per unit of the unknown
};
/// Nothing where the nominal throw does not land.
std::optional<ReleaseSpread> release_spread(const ReleaseThrow& problem);

class HeldMotion;

/// Landings of `count` draws from normal distributions (cut off at zero where the number must be positive),
/// each unknown by itself. An unknown without σ takes no draw.
struct Landings {
  std::vector<double> miss;  ///< of those that land [m]
  int lost{};                ///< slipping before the gripper opens, not free in time, or never down
  double mean{}, std{};      ///< of those that land [m]; NaN where fewer than one, or two, do
};
/// Mean and standard deviation of what landed.
void summarise(Landings& landings);
/// Equal seeds give equal draws; count >= 1. Draws that slip at t = 0 are lost and, where `before` tells the
/// motion up to there, those that slip on the way.
Landings draw_landings(const ReleaseThrow& problem, int count, std::uint64_t seed,
                       const HeldMotion* before = nullptr);

}  // namespace unhand::planners
