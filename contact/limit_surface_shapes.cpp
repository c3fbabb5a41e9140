#include "contact/limit_surface_shapes.hpp"

#include <algorithm>

#include "contact/disc_friction.hpp"

namespace unhand::contact {

using dynamics::chain;
using dynamics::Dual;
using dynamics::value_of;
using std::sqrt;

namespace {

/// dΨ/dm = −(2Φ′ + Ψ)/(2m), from ε F′ + T′ = 0; the quotient loses its digits towards m = 0, where Ψ′ is constant.
double darm(double m, const DiscProfile& profile) {
  constexpr double kSmall = 1e-5;
  if (m >= kSmall) return -(2 * profile.dslide + profile.arm) / (2 * m);
  static const double at_zero = [] {
    const DiscProfile p = disc_profile(kSmall);
    return -(2 * p.dslide + p.arm) / (2 * kSmall);
  }();
  return at_zero;
}

/// The slip ratio ε whose (F, T) points along (a, b), a, b >= 0 not both zero: h(ε) = a T − b F falls from a·2/3 to −b.
/// Newton's method with bisection in z, ε = z up to 1 and 1/(2 − z) beyond.
double slip_ratio(double a, double b) {
  if (a <= 0) return 0;
  if (b <= 0) return std::numeric_limits<double>::infinity();
  const double guess = a / (2.25 * b);  // the ellipsoid's
  double low = 0, high = 2, z = guess <= 1 ? guess : 2 - 1 / guess;
  for (int k = 0; k < 60; ++k) {
    const double epsilon = z <= 1 ? z : 1 / (2 - z);
    const DiscFriction f = disc_friction(epsilon);
    const double h = a * f.torque - b * f.force;
    (h > 0 ? low : high) = z;
    const double slope = f.dforce * (a * epsilon + b) * (z <= 1 ? 1.0 : epsilon * epsilon);
    double next = slope > 0 ? z + h / slope : 0.5 * (low + high);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - z) <= 1e-15 * z) break;
    z = next;
  }
  return z <= 1 ? z : 1 / (2 - z);
}

/// The unit-free outward normal (n_xz, n_τ) at slip ratio ε, scaled so that n · w* = 1 on the surface.
void scaled_normal(double epsilon, double& n_slide, double& n_spin) {
  const DiscFriction f = disc_friction(epsilon);
  if (epsilon <= 1) {
    const double power = epsilon * f.force + f.torque;
    n_slide = epsilon / power;
    n_spin = (2.0 / 3.0) / power;
  } else {
    const double delta = 1 / epsilon, power = f.force + delta * f.torque;
    n_slide = 1 / power;
    n_spin = (2.0 / 3.0) * delta / power;
  }
}

}  // namespace

template <class S>
Vec3<S> UniformDisc::resist(const Vec3<S>& u) const {
  const S slide = u[0] * u[0] + u[1] * u[1], spin = 2.25 * u[2] * u[2];  // v², (ωR)²
  if (value_of(slide) <= value_of(spin)) {
    const S m = slide / spin;
    const DiscProfile p = disc_profile(std::min(value_of(m), 1.0));
    const S phi = chain(m, p.slide, p.dslide), torque = chain(m, p.spin, -0.5 * (p.slide + 2 * value_of(m) * p.dslide));
    const S rim = value_of(u[2]) > 0 ? S(1.5 * u[2]) : S(-1.5 * u[2]);  // |ω| R
    const S k = -phi / rim;
    return {k * u[0], k * u[1], value_of(u[2]) > 0 ? S(-1.5 * torque) : S(1.5 * torque)};
  }
  const S m = spin / slide, inverse = 1.0 / sqrt(slide);
  const DiscProfile p = disc_profile(std::min(value_of(m), 1.0));
  const S phi = chain(m, p.slide, p.dslide), psi = chain(m, p.arm, darm(value_of(m), p));
  return {-phi * inverse * u[0], -phi * inverse * u[1], -2.25 * psi * inverse * u[2]};
}

template <class S>
S UniformDisc::gauge(const Vec3<S>& w) const {
  const double x = value_of(w[0]), z = value_of(w[1]), tau = value_of(w[2]), slide = std::hypot(x, z);
  if (slide == 0 && tau == 0) return S(0);
  double n_slide, n_spin;
  scaled_normal(slip_ratio(slide, std::abs(tau) * 2 / 3), n_slide, n_spin);
  // The gauge is stationary in ε, so n · w is its value and n its gradient.
  const double nx = slide > 0 ? n_slide * x / slide : 0.0, nz = slide > 0 ? n_slide * z / slide : 0.0;
  return nx * w[0] + nz * w[1] + std::copysign(n_spin, tau) * w[2];
}

Vec3<double> UniformDisc::slip_direction(const Vec3<double>& w) const {
  const double slide = std::hypot(w[0], w[1]);
  double n_slide, n_spin;
  scaled_normal(slip_ratio(slide, std::abs(w[2]) * 2 / 3), n_slide, n_spin);
  const double size = std::hypot(n_slide, n_spin);
  return {slide > 0 ? -n_slide / size * w[0] / slide : 0.0, slide > 0 ? -n_slide / size * w[1] / slide : 0.0,
          -std::copysign(n_spin / size, w[2])};
}

template Vec3<double> UniformDisc::resist(const Vec3<double>&) const;
template Vec3<Dual> UniformDisc::resist(const Vec3<Dual>&) const;
template double UniformDisc::gauge(const Vec3<double>&) const;
template Dual UniformDisc::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
