// Flights as a throw's planner sees them: where does a state in the throwing plane land, and which states
// land in a box?
//
// The throwing plane is vertical, with its origin at the target: r forward along the throw, z up [m].
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "dynamics/scalar.hpp"

namespace unhand::flight {

/// ξ = (r, z, ṙ, ż) [m, m, m/s, m/s].
template <class S>
struct PlaneState {
  S r{}, z{}, r_rate{}, z_rate{};  ///< m, m, m/s, m/s
};

/// What acts on an object in flight.
struct Medium {
  double gravity{9.81};  ///< downward [m/s²], > 0
  double drag_k{};       ///< quadratic drag, a = −k |v| v [1/m], >= 0
};

/// The state on the way down through z = 0; empty if the flight never gets there (with drag: not within 1000
/// s). Projectiles in closed form, drag by the integrator; derivatives pass through the landing. Throws
/// std::invalid_argument for a state that is not finite and a medium out of range. Instantiated for double
/// and Dual.
template <class S>
std::optional<PlaneState<S>> landing_of(const PlaneState<S>& release, const Medium& medium);

/// Φ(ξ) = r_land [m] and ∇Φ [-, -, s, s]: the flying flow map of [LiuBillard2024].
struct FlowMap {
  double landing{};                  ///< r_land [m]
  std::array<double, 4> gradient{};  ///< by r, z, ṙ, ż
};
/// The flow map at a state; empty if the flight never gets down to z = 0. Throws as landing_of does.
std::optional<FlowMap> flow_map(const PlaneState<double>& release, const Medium& medium);

/// Where and how fast a throw may come down: |r| <= half_length at z = 0, and both velocities in their
/// ranges, all of them finite.
struct LandingSet {
  double half_length{};                    ///< [m], > 0
  double r_rate_low{0}, r_rate_high{6};    ///< ṙ [m/s]
  double z_rate_low{-10}, z_rate_high{0};  ///< ż [m/s], high <= 0
};

/// The backward reachable tube of a landing set in implicit form: f(ξ) < 0 inside, 0 on its boundary, > 0
/// outside. f is the largest of |x − c|/h − 1 over the coordinates x of the landing state, c and h the middle
/// and the half width of their ranges; where a flight never gets to z = 0, it is 1 plus what its apex
/// (without drag) lacks over half_length. [-] Throws std::invalid_argument for a state that is not finite,
/// and for a set or a medium out of range.
double tube_level(const PlaneState<double>& release, const LandingSet& set, const Medium& medium);

/// The same tube by samples: states from which flights of up to `longest` [s] end in the set, found by flying
/// backward from landings drawn from it. Every `boundary_every`-th sample comes from the set's boundary. With
/// drag, a flight is followed back to where it had 100 m/s and no further: it began within a finite time
/// before that, at any speed however large.
struct TubeSampling {
  int count{1000};        ///< samples, >= 0
  double longest{1.0};    ///< in (0, 100] s
  int boundary_every{4};  ///< every how many samples one lies on the boundary
  std::uint64_t seed{1};  ///< the same seed gives the same samples
};
/// The samples. Throws std::invalid_argument for a set, a medium or a sampling out of range.
std::vector<PlaneState<double>> sample_tube(const LandingSet& set, const Medium& medium,
                                            const TubeSampling& sampling = {});

}  // namespace unhand::flight
