// Limit surfaces in normalised coordinates: the shapes that a slipping patch's wrench can lie on.
//
// L = τ_max/f_max [m]. Slip u = (v_x, v_z, L ω_r) [m/s], wrench w = (f_x, f_z, τ/L)/f_max [-]: pure slide is |w_xz| = 1
// and pure spin |w_τ| = 1 for every shape. Each shape is a convex, centrally symmetric set and answers
//   resist(u)          the wrench that opposes the slip u ≠ 0: argmin over the set of w · u (maximal dissipation),
//   gauge(w)           positively homogeneous, 1 on the surface, below 1 inside, 0 at w = 0,
//   slip_direction(w)  the unit u with resist(u) = w/gauge(w): minus the outward normal there.
#pragma once

#include <array>
#include <cmath>

#include "dynamics/scalar.hpp"

namespace unhand::contact {

template <class S>
using Vec3 = std::array<S, 3>;

template <class S>
S dot3(const Vec3<S>& a, const Vec3<S>& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// The unit ball, that is fᵀ D⁻¹ f <= 1 with D = diag(f_max², f_max², τ_max²). [HoweCutkosky1996]
struct Ellipsoid {
  static constexpr bool isotropic = true;

  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const {
    using std::sqrt;
    const S k = -1.0 / sqrt(dot3(u, u));
    return {k * u[0], k * u[1], k * u[2]};
  }
  template <class S>
  S gauge(const Vec3<S>& w) const {
    using std::sqrt;
    const S square = dot3(w, w);
    return dynamics::value_of(square) > 0 ? S(sqrt(square)) : S(0);
  }
  Vec3<double> slip_direction(const Vec3<double>& w) const { return resist(w); }
};

/// The exact surface of a uniformly pressed disc, L = 2R/3: with ε = v/(|ω| R) = |u_xz|/(1.5 |u_τ|),
/// w_xz = −F(ε) u_xz/|u_xz| and w_τ = −sgn(u_τ) T(ε)/(2/3), F and T as in disc_friction.hpp. [Farkas2003]
/// Instantiated for double and Dual.
struct UniformDisc {
  static constexpr bool isotropic = true;

  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  template <class S>
  S gauge(const Vec3<S>& w) const;
  Vec3<double> slip_direction(const Vec3<double>& w) const;
};

}  // namespace unhand::contact
