// The convex quartics that are round in the plane of sliding, in closed form but for one root.
#pragma once

#include <array>

#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// {H ≤ 1}, H = a⁴ + 2κ a² b² + b⁴, a² = w_x² + w_z², b = w_τ: ConvexQuartic::isotropic_blend(κ) at a tenth
/// of its price. [Zhou2016] κ = 1 is the ellipsoid.
///
/// A slip (p, q) = (|u_xz|, |u_τ|) is along ∇H, so r = b/a is the root in [0, 1] of
///   r³ − e κ r² + κ r − e = 0,  e = q/p,  if q ≤ p;
/// else a/b is, with e = p/q: H is symmetric in a and b. Every quartic that is isotropic in (x, z) and even
/// in τ is such a one but for the scales of force and torque. Derivatives are closed, as those of
/// UniformDisc. Where the Hessian of H is singular (on the axes for κ = 0, at a = b for κ = 3) resist has no
/// derivative, and its Dual carries a large finite one.
class IsotropicQuartic {
 public:
  static constexpr bool isotropic = true;                   ///< round in the plane of sliding: needs no frame
  static constexpr const char* name = "isotropic quartic";  ///< as messages call it

  /// Throws std::invalid_argument unless 0 ≤ κ ≤ 3, where H is convex. Derivatives of κ go into those of
  /// resist and gauge in Dual.
  explicit IsotropicQuartic(const dynamics::Dual& kappa);
  explicit IsotropicQuartic(double kappa) : IsotropicQuartic(dynamics::Dual(kappa)) {}
  /// κ = ConvexQuartic::kappa_closest_to_disc().
  static IsotropicQuartic closest_to_disc();

  /// The wrench that opposes the slip u: as limit_surface_shapes.hpp says.
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  /// H(w)^(1/4)
  template <class S>
  S gauge(const Vec3<S>& w) const;
  /// −∇H/|∇H| at w: the unit slip that a wrench there opposes.
  Vec3<double> slip_direction(const Vec3<double>& w) const;

 private:
  /// Its derivatives by u and by κ, unless null.
  struct Slopes {
    Mat3 by_slip;
    Vec3<double> by_kappa;
  };
  Vec3<double> resist(const Vec3<double>& u, Slopes* slopes) const;

  /// r(e), e in [0, 1].
  double ratio(double e) const;

  static constexpr int kPieces = 16;
  dynamics::Dual kappa_;
  std::array<std::array<double, 4>, kPieces> ratio_;  // cubics in e near r(e), where its iteration begins
};

}  // namespace unhand::contact
