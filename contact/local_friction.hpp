// Friction of a disc whose coefficient depends on every point's own slip speed,
//
//   h(v) = μ(v)/μ − 1 = (1 + (μ_s/μ_k − 1) exp(−(v/v_s)²)) (1 + v/v₀) − 1
//   F = ∫ p (v̂·V̂) h(|v|) dA,   T = ∫ p (r × v̂)/a h(|v|) dA,   ∫ p dA = 1
//
// h after [ArmstrongHelouvryDupont1994]; the integrals over the disc are those of [Farkas2003], where h = 1.
#pragma once

#include "contact/limit_surface_shapes.hpp"
#include "contact/speed_dependence.hpp"

namespace unhand::contact {

/// What the dependence adds to the force and the torque of a disc of pressure p ∝ (1 − (r/a)²)^s, c its
/// torque factor: with u = (v_r, L ω_r), V = |v_r| and Ω = |ω_r| a = |u_τ|/c. The viscous part alone is
/// linear: F = V/v₀, T = Ω/((s+2) v₀). The rest is integrated around the centre of rotation, d = V/Ω radii
/// off the middle, where every circle ρ has one speed Ωρ; of each the disc covers |φ| < ψ, cos ψ = (d² + ρ² −
/// 1)/(2dρ):
///
///   F = (2/π) ∫ h ρ sin ψ dρ,   T = (2/π) ∫ h ρ (ρψ − d sin ψ) dρ
///
/// by 32 Gauss points that gather at both ends, where ψ is a square root; error below 1e-8, of derivatives
/// below 1e-6, but 1e-3 of both where friction is cut off at zero (1/v₀ < 0 and fast). A disc that is not
/// pressed evenly is a sum of discs that are, of radii R with the weights −πR² p′(R) dR: six of them, exact
/// for powers of R² up to the fifth, error below 5e-4.
class LocalFriction {
 public:
  /// The exponent s, and c(s). Derivatives enter those of the answer.
  LocalFriction(const dynamics::Dual& exponent, const dynamics::Dual& torque_factor);

  /// The normalised wrench (f_x, f_z, τ/L)/(n μ f_N) [-] that is added to the one under Coulomb's law, u ≠ 0
  /// in m/s. Instantiated for double and Dual.
  template <class S>
  Vec3<S> wrench(const SpeedDependence<S>& speed, const Vec3<S>& u) const;

 private:
  static constexpr int kDiscs = 6;
  std::array<double, kDiscs> radius_{};           ///< R/a [-]
  std::array<dynamics::Dual, kDiscs> weight_{};   ///< share of the load
  int first_{};                                   ///< the last alone where the pressure is even
  dynamics::Dual torque_factor_, square_radius_;  ///< c; ⟨(r/a)²⟩ under the load
};

}  // namespace unhand::contact
