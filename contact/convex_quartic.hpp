// A limit surface that is a level set of a convex homogeneous quartic.
#pragma once

#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// {w : H(w) <= 1}, H(w) = Σ c_k w_x^i w_z^j w_τ^(4−i−j), slip along −∇H. [Zhou2016] In the hand's frame, since a general
/// quartic has directions of its own. Monomials in the order of the exponents (i, j) = (4,0) (3,1) (3,0) (2,2) (2,1) (2,0)
/// (1,3) (1,2) (1,1) (1,0) (0,4) (0,3) (0,2) (0,1) (0,0).
class ConvexQuartic {
 public:
  static constexpr bool isotropic = false;
  static constexpr int kCoefficients = 15;

  /// Throws std::invalid_argument, with the place, unless H is positive and convex: the least eigenvalue of its Hessian
  /// over the unit sphere (4,000 points, refined around the least) must not be negative beyond rounding.
  explicit ConvexQuartic(const std::array<double, kCoefficients>& coefficients);

  /// H = (w_x² + w_z²)² + 2κ (w_x² + w_z²) w_τ² + w_τ⁴. Convex exactly for 0 <= κ <= 3: of the Hessian in the plane of
  /// slide and spin, the determinant on the diagonal w_xz = w_τ is 144 (1 − κ²/9)·w⁴ times a positive factor, and on the
  /// axes 48 κ w⁴. κ = 1 is the ellipsoid. Throws std::invalid_argument outside.
  static ConvexQuartic isotropic_blend(double kappa);

  /// The blend that is nearest to the uniform disc: least squares of H − 1 over the disc's surface.
  static ConvexQuartic closest_to_disc();
  static double kappa_closest_to_disc();

  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  template <class S>
  S gauge(const Vec3<S>& w) const;
  Vec3<double> slip_direction(const Vec3<double>& w) const;

  const std::array<double, kCoefficients>& coefficients() const { return coefficients_; }

 private:
  ConvexQuartic() = default;
  template <class S>
  S value(const Vec3<S>& w) const;
  void derivatives(const Vec3<double>& w, Vec3<double>& gradient, std::array<Vec3<double>, 3>& hessian) const;

  std::array<double, kCoefficients> coefficients_{};
};

}  // namespace unhand::contact
