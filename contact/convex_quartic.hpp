// A limit surface that is a level set of a convex homogeneous quartic.
#pragma once

#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// {w : H(w) ≤ 1}, H(w) = Σ c_k w_x^i w_z^j w_τ^(4−i−j) [-], slip along −∇H, gauge = H^(1/4). [Zhou2016] In
/// the hand's frame, since a general quartic has directions of its own. Monomials in the order of the
/// exponents (i, j) = (4,0) (3,1) (3,0) (2,2) (2,1) (2,0) (1,3) (1,2) (1,1) (1,0) (0,4) (0,3) (0,2) (0,1)
/// (0,0).
///
/// Where the Hessian of H is singular (on the axes for the blend κ = 0, at |w_xz| = |w_τ| for κ = 3) resist
/// has no derivative: the wrench turns infinitely fast. There its Dual carries a large finite one.
class ConvexQuartic {
 public:
  static constexpr bool isotropic = false;  ///< has directions of its own: lives in the hand's frame
  static constexpr const char* name = "convex quartic";  ///< as messages call it
  static constexpr int kCoefficients = 15;               ///< monomials of degree four in three variables

  /// Throws std::invalid_argument naming the coefficient, or the place, unless the coefficients are finite, H
  /// is positive and H is convex to rounding: the least of yᵀ∇²H(x)y over unit x, y is not below −1e-10 of
  /// the largest. 600 directions x (every direction within 0.09 rad of one of them, or of its opposite) take
  /// their least eigenvector y; the 24 lowest then descend: since yᵀ∇²H(x)y = xᵀ∇²H(y)x, x and y take turns
  /// in being the least eigenvector for the other.
  explicit ConvexQuartic(const std::array<double, kCoefficients>& coefficients);

  /// H = a⁴ + 2κ a² b² + b⁴, a² = w_x² + w_z², b = w_τ. The Hessian in the (a, b) plane has the determinant
  /// 48 [κ a⁴ + (3 − κ²) a² b² + κ b⁴]; it is never negative exactly if κ ≥ 0 and κ² − 3 ≤ 2κ, and the other
  /// curvature, 4a² + 4κb², agrees: convex for 0 ≤ κ ≤ 3 and for no other κ. κ = 1 is the ellipsoid. Throws
  /// std::invalid_argument outside.
  static ConvexQuartic isotropic_blend(double kappa);

  /// The blend that is nearest to the uniform disc: least squares of H − 1 over the disc's surface, at angles
  /// arctan ε spread evenly between spin and slide. κ = 1.6219; its radius is within 0.70 % of the disc's,
  /// where the ellipsoid's is up to 7.04 % too large.
  static ConvexQuartic closest_to_disc();
  /// The κ of closest_to_disc [-].
  static double kappa_closest_to_disc();

  /// The wrench that opposes the slip u: as limit_surface_shapes.hpp says.
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  /// H(w)^(1/4)
  template <class S>
  S gauge(const Vec3<S>& w) const;
  /// −∇H/|∇H| at w: the unit slip that a wrench there opposes.
  Vec3<double> slip_direction(const Vec3<double>& w) const;

  /// c_k in the order of the monomials above [-].
  const std::array<double, kCoefficients>& coefficients() const { return coefficients_; }

 private:
  struct Unchecked {};
  ConvexQuartic(const std::array<double, kCoefficients>& coefficients, Unchecked);
  Mat3 hessian(const Vec3<double>& w) const;

  std::array<double, kCoefficients> coefficients_;
  std::array<double, kCoefficients>
      tensor_;  // 12 × the entries of the symmetric tensor of H: ∇²H is linear in it
};

}  // namespace unhand::contact
