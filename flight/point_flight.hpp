// Flight of the centre of mass in space.
#pragma once

#include <vector>

#include "dynamics/integrator.hpp"
#include "flight/vec3.hpp"

namespace unhand::flight {

/// Where the CoM starts [m] with which velocity [m/s], and what acts on it: constant gravity [m/s²] and
/// quadratic drag a = −k |v| v, k [1/m] >= 0.
template <class S>
struct PointFlight {
  Vec3<S> position{}, velocity{}, gravity{};  ///< m, m/s, m/s²
  S drag_k{0.0};                              ///< k [1/m]
};

/// Positions [m] at `times` [s] after the start, each >= 0 (in any order): p + v t + ½ g t² without drag,
/// otherwise by the integrator. Throws std::invalid_argument when an input is not finite, a time or k is
/// negative, and std::runtime_error when the integrator stops. Instantiated for double and Dual.
template <class S>
std::vector<Vec3<S>> positions(const PointFlight<S>& flight, const std::vector<double>& times,
                               const dynamics::IntegratorOptions& options = {});

}  // namespace unhand::flight
