// The contact patch between the pads and the object, and the friction limits that it sets.
#pragma once

#include "dynamics/scalar.hpp"

namespace unhand::contact {

/// Torque factor c of a uniformly pressed disc [-].
inline constexpr double kUniformDisc = 2.0 / 3.0;
/// The largest friction coefficient that anything here accepts [-].
inline constexpr double kMostMu = 10;
/// The smallest radius that anything here accepts [m], far below an atom's: the spin of smaller ones is too
/// fast for any step.
inline constexpr double kSmallestRadius = 1e-12;
/// L = c a of a finger's pad of about 1 cm radius [m]: where a length is to be assumed, and where force and
/// torque of a wrench are judged together.
inline constexpr double kFingerLength = 0.007;

/// Friction limits of n pads, each pressed by f_N [N]:
///   f_max = n μ f_N [N],   τ_max = c a n μ f_N [N m].
/// c is the torque factor of the pressure: 2/3 uniform, 3π/16 Hertz, 1 thin ring. [LiuBillard2025] II-A.
template <class S>
struct Patch {
  S mu{};                         ///< friction coefficient, [0, kMostMu]
  S radius{};                     ///< a, [kSmallestRadius, 1] m
  S torque_factor{kUniformDisc};  ///< c, (0, 1]
  int pads{2};                    ///< n >= 1

  /// The uniform disc with L = τ_max/f_max = `length` [m]. Rigid pads show a and c only as L = c a, so fits
  /// and cards know no more of a patch; where pads give (contact.pad_compliance) a itself enters, as 3/2 L.
  static Patch of_length(const S& mu, const S& length, int pads) {
    return {mu, length / kUniformDisc, S(kUniformDisc), pads};
  }

  /// n μ f_N [N] for f_N of one pad [N]
  S f_max(const S& normal_force) const { return static_cast<double>(pads) * mu * normal_force; }
  /// c a n μ f_N [N m] for f_N of one pad [N]
  S tau_max(const S& normal_force) const { return length() * f_max(normal_force); }
  /// L = τ_max/f_max = c a [m]
  S length() const { return torque_factor * radius; }
};

/// The patch without derivatives.
inline Patch<double> values(const Patch<double>& p) { return p; }
inline Patch<double> values(const Patch<dynamics::Dual>& p) {
  return {p.mu.a, p.radius.a, p.torque_factor.a, p.pads};
}

/// The same patch as constants of a differentiation.
inline Patch<dynamics::Dual> constant(const Patch<double>& p) {
  return {dynamics::Dual(p.mu), dynamics::Dual(p.radius), dynamics::Dual(p.torque_factor), p.pads};
}

/// Throws std::invalid_argument, naming parameter, value and accepted range.
void validate(const Patch<double>&);

/// Torque factor of a circular patch: c = ∫ p r² dr / (a ∫ p r dr) [-], pressure p(r) [Pa] up to the radius a
/// [m].
///
/// Pressure ∝ (1 − (r/a)²)^s: c = (s+1) B(3/2, s+1), B Euler's beta function. s = 0 uniform 2/3, s = 1/2
/// Hertz 3π/16, s = −1/2 a flat rigid punch π/4. Throws std::invalid_argument unless −1 < s <= 1000.
double torque_factor(double pressure_exponent);

/// Pressure ∝ (1 − (r/a)ⁿ)^(1/n): c = B(3/n, 1 + 1/n)/B(2/n, 1 + 1/n), from t = (r/a)ⁿ. n = 1 a cone 1/2, n =
/// 2 Hertz 3π/16, n → ∞ uniform 2/3. Throws std::invalid_argument unless 0.1 <= n <= 10⁶.
double torque_factor_power(double n);

}  // namespace unhand::contact
