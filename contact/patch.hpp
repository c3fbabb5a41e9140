// The contact patch between the pads and the object, and the friction limits that it sets.
#pragma once

#include "dynamics/scalar.hpp"

namespace unhand::contact {

/// Friction limits of n pads, each pressed by f_N [N]:
///   f_max = n μ f_N [N],   τ_max = c a n μ f_N [N m].
/// c is the torque factor of the pressure: 2/3 uniform, 3π/16 Hertz, 1 thin ring (patch.cpp). [LiuBillard2025] II-A.
template <class S>
struct Patch {
  S mu{};                       ///< friction coefficient, [0, 10]
  S radius{};                   ///< a, (0, 1] m
  S torque_factor{2.0 / 3.0};   ///< c, (0, 1]
  int pads{2};                  ///< n >= 1

  S f_max(const S& normal_force) const { return static_cast<double>(pads) * mu * normal_force; }
  S tau_max(const S& normal_force) const { return length() * f_max(normal_force); }
  /// L = τ_max/f_max = c a [m]
  S length() const { return torque_factor * radius; }
};

inline Patch<double> values(const Patch<double>& p) { return p; }
inline Patch<double> values(const Patch<dynamics::Dual>& p) { return {p.mu.a, p.radius.a, p.torque_factor.a, p.pads}; }

/// The same patch as constants of a differentiation.
inline Patch<dynamics::Dual> constant(const Patch<double>& p) {
  return {dynamics::Dual(p.mu), dynamics::Dual(p.radius), dynamics::Dual(p.torque_factor), p.pads};
}

/// Throws std::invalid_argument, naming parameter, value and accepted range.
void validate(const Patch<double>&);

}  // namespace unhand::contact
