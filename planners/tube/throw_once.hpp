// One throw by a contact model, with derivatives by whatever carries them. Internal to planners/tube.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>

#include "planners/tube/planar_hand.hpp"
#include "planners/tube/release_throw.hpp"

namespace unhand::planners {

/// The unknowns of a throw with their σ.
std::array<Uncertain, kUnknowns> unknowns_of(const ReleaseThrow& problem);
/// The most that a draw may be.
double most_of(int unknown);
/// Whether a draw may be negative.
bool has_sign(int unknown);

/// Draws of the unknowns, each from its normal distribution. One that may not be negative, or not above
/// most_of(), is drawn again while it is: the last resort is the value. An unknown without σ takes no draw.
class Draws {
 public:
  Draws(const ReleaseThrow& problem, std::uint64_t seed) : unknowns_(unknowns_of(problem)), random_(seed) {}
  Draw next();

 private:
  std::array<Uncertain, kUnknowns> unknowns_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

/// What became of one throw.
template <class S>
struct Thrown {
  S miss{};               ///< of the centre of mass, forward of the target [m]
  S detach_time{};        ///< [s]
  double angle{};         ///< through which the object turns against the hand until it is free [rad]
  double speed{};         ///< of the centre of mass when it is free [m/s]
  bool slips_at_start{};  ///< the grip did not hold the object at t = 0
};

/// Which quantity carries derivatives is the caller's: hand, draw, or none. Nothing where it does not land.
template <class S>
std::optional<Thrown<S>> throw_once(const ReleaseThrow& problem, const release::HandMotion& hand,
                                    const std::array<S, kUnknowns>& draw);
extern template std::optional<Thrown<double>> throw_once(const ReleaseThrow&, const release::HandMotion&,
                                                         const std::array<double, kUnknowns>&);
extern template std::optional<Thrown<dynamics::Dual>> throw_once(
    const ReleaseThrow&, const release::HandMotion&, const std::array<dynamics::Dual, kUnknowns>&);

/// The hand of a throw; q̇₀ and q̈ may carry derivatives.
PlanarHand hand_of(const ReleaseThrow& problem, const JointVector<dynamics::Dual>& qd,
                   const JointVector<dynamics::Dual>& qdd);
PlanarHand hand_of(const ReleaseThrow& problem);

}  // namespace unhand::planners
