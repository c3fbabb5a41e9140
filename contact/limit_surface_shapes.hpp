// Limit surfaces in normalised coordinates: the shapes that a slipping patch's wrench can lie on.
//
// L = τ_max/f_max [m]. Slip u = (v_x, v_z, L ω_r) [m/s], wrench w = (f_x, f_z, τ/L)/f_max [-], x and z being
// the hand's axes (round shapes need not know which): pure slide is
// |w_xz| = 1 and pure spin |w_τ| = 1 for every isotropic shape. Each shape is a convex, centrally symmetric
// set:
// - resist(u): the wrench that opposes the slip u ≠ 0, argmin over the set of w · u (maximal dissipation);
// - gauge(w): positively homogeneous, 1 on the surface, below 1 inside, 0 at w = 0;
// - slip_direction(w): the unit u with resist(u) = w/gauge(w), −∇gauge/|∇gauge|: minus the outward normal.
// With Dual the first two carry exact first derivatives; directions are asked for in double. At u = 0 or w =
// 0 the answer is open: zero is returned, without derivatives. NaN in, NaN out; magnitudes may lie anywhere
// in the range of double.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "contact/patch.hpp"

namespace unhand::contact {

/// Normalised components: along x, along z, of the spin.
template <class S>
using Vec3 = std::array<S, 3>;
/// A matrix by rows.
using Mat3 = std::array<Vec3<double>, 3>;

/// a · b
template <class S>
S dot3(const Vec3<S>& a, const Vec3<S>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// What to divide x by before its squares and fourth powers are taken: 1 unless x is extreme, 0 if x is zero.
template <class S>
double scale_of(const Vec3<S>& x) {
  using dynamics::value_of;
  double most = 0.0;
  for (const S& entry : x) {
    const double size = std::abs(value_of(entry));
    if (!(size <= most)) most = size;  // so that NaN stays
    if (std::isnan(most)) return most;
  }
  return most > 1e-60 && most < 1e60 ? 1.0 : most;
}

/// The unit ball, that is fᵀ D⁻¹ f ≤ 1 with D = diag(f_max², f_max², τ_max²). [HoweCutkosky1996]
struct Ellipsoid {
  static constexpr bool isotropic = true;           ///< round in the plane of sliding: needs no frame
  static constexpr const char* name = "ellipsoid";  ///< as messages call it

  /// w = −u/|u|
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const {
    using std::sqrt;
    const double scale = scale_of(u);
    if (scale == 0.0) return {S(0.0), S(0.0), S(0.0)};
    if (scale != 1.0 && std::isfinite(scale))
      return resist(Vec3<S>{u[0] / scale, u[1] / scale, u[2] / scale});
    const S k = -1.0 / sqrt(dot3(u, u));
    return {k * u[0], k * u[1], k * u[2]};
  }
  /// |w|
  template <class S>
  S gauge(const Vec3<S>& w) const {
    using std::sqrt;
    const double scale = scale_of(w);
    if (scale == 0.0) return S(0.0);
    if (scale != 1.0 && std::isfinite(scale))
      return scale * gauge(Vec3<S>{w[0] / scale, w[1] / scale, w[2] / scale});
    return sqrt(dot3(w, w));
  }
  /// −w/|w|
  Vec3<double> slip_direction(const Vec3<double>& w) const { return resist(w); }
};

/// The exact surface of a uniformly pressed disc of radius R [m], L = 2R/3 [m] [Farkas2003]:
///   w_xz = −F(ε) u_xz/|u_xz|,  w_τ = −sgn(u_τ) T(ε)/(2/3),  ε = v/(|ω|R) = |u_xz|/(1.5 |u_τ|),
/// F and T as in disc_friction.hpp.
///
/// Everything is written so that nothing is divided by a part of u or w that may vanish. Derivatives of
/// resist are closed: ∇resist = −∇²σ, and the power σ(u) = −resist(u)·u depends on (|u_xz|, |u_τ|) and is
/// homogeneous of degree 1, which leaves one curvature λ and the slope over |u_xz|. Error of resist and gauge
/// below 1e-14. Instantiated for double and Dual.
struct UniformDisc {
  static constexpr bool isotropic = true;              ///< round in the plane of sliding: needs no frame
  static constexpr const char* name = "uniform disc";  ///< as messages call it

  /// Of the pressure (1 − (r/a)²)^s [-].
  dynamics::Dual exponent() const { return dynamics::Dual(0.0); }
  /// c [-]
  dynamics::Dual torque_factor() const { return dynamics::Dual(kUniformDisc); }

  /// The wrench that opposes the slip u.
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  /// 1 on the surface, homogeneous of degree 1.
  template <class S>
  S gauge(const Vec3<S>& w) const;
  /// Unit slip that a wrench w on the surface opposes.
  Vec3<double> slip_direction(const Vec3<double>& w) const;
};

/// ∇² at x of a function of (a, b) = (|x_xz|, |x_τ|), homogeneous of degree 1: in (a, b) it is λ (b, −a)(b,
/// −a)ᵀ, across the slide it is k, the slope in a over a. `cross` = (λ b² − k)/a², which stays finite at a =
/// 0.
inline Mat3 isotropic_hessian(const Vec3<double>& x, double k, double cross, double lambda) {
  const double xz = cross * x[0] * x[1], along = -lambda * x[2];
  return {Vec3<double>{k + cross * x[0] * x[0], xz, along * x[0]},
          Vec3<double>{xz, k + cross * x[1] * x[1], along * x[1]},
          Vec3<double>{along * x[0], along * x[1], lambda * (x[0] * x[0] + x[1] * x[1])}};
}

/// f(x) for a Dual x when f and its Jacobian are known at the value of x (the chain rule).
inline Vec3<double> chain3(const Vec3<double>& /*x*/, const Vec3<double>& f, const Mat3& /*jacobian*/) {
  return f;
}
inline Vec3<dynamics::Dual> chain3(const Vec3<dynamics::Dual>& x, const Vec3<double>& f,
                                   const Mat3& jacobian) {
  const auto row = [&](int i) {
    return dynamics::Dual(f[i], jacobian[i][0] * x[0].v + jacobian[i][1] * x[1].v + jacobian[i][2] * x[2].v);
  };
  return {row(0), row(1), row(2)};
}

}  // namespace unhand::contact
