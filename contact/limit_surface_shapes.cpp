#include "contact/limit_surface_shapes.hpp"

#include <type_traits>

#include "contact/disc_friction.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

// resist at u of ordinary size; the Jacobian too unless null.
Vec3<double> disc_resist(const Vec3<double>& u, Mat3* jacobian) {
  const double slide = u[0] * u[0] + u[1] * u[1], spin = 2.25 * u[2] * u[2];  // v², (ωR)²
  if (slide <= spin) {
    const double m = slide / spin, rim = 1.5 * std::abs(u[2]);
    const DiscProfile p = disc_profile(m);
    const double k = p.slide / rim;
    if (jacobian) {
      const double lambda = 2.25 * (p.slide + 2.0 * m * p.dslide) / (rim * spin);
      *jacobian = isotropic_hessian(u, -k, -2.0 * p.dslide / (rim * spin), -lambda);
    }
    return {-k * u[0], -k * u[1], std::copysign(1.5 * p.spin, -u[2])};
  }
  const double m = spin / slide, inverse = 1.0 / std::sqrt(slide);
  const DiscProfile p = disc_profile(m);
  const double k = p.slide * inverse;
  if (jacobian) {
    const double lambda = -4.5 * p.dslide * inverse / slide;
    *jacobian = isotropic_hessian(u, -k, -(lambda * u[2] * u[2] - k) / slide, -lambda);
  }
  return {-k * u[0], -k * u[1], -2.25 * p.arm * inverse * u[2]};
}

// The point of the disc's surface on a ray: (F, T̂) ∝ (p, q), T̂ = T/(2/3).
struct RayPoint {
  bool inner;    // ε ≤ 1
  double t;      // ε if inner, else δ = 1/ε
  double gauge;  // p/F = q/T̂
  double slide;  // Φ
  double power;  // t-scaled dissipation: 1.5 ε F + T̂ if inner, else 1.5 F + δ T̂
};

// Solves h(t) = 0, h = F q − T̂ p if inner and T̂ p − F q if not, by Newton's method kept inside a bracket (h
// rises; at most 50 steps, rarely more than 3). The gauge is the maximum over t of (1.5 t p + q)/power, or
// (1.5 p + t q)/power, whose slope is −1.5 h/power²: one more term of its series leaves an error of the third
// order in the last step.
RayPoint disc_ray(double p, double q, double accuracy) {
  RayPoint r{};
  r.inner = p <= 2.0 * q;  // F(1)/T̂(1) = 2
  // Start: t over the ratio as a polynomial in the ratio's square, interpolated at Chebyshev points to 2e-3.
  const double ratio = r.inner ? p / q : q / p, s = ratio * ratio;
  double t = ratio;
  if (r.inner) {
    t *= 0.9939 + s * (-0.50409 + s * (0.31741 + s * (-0.122698 + s * (0.0244012 - s * 0.00190529))));
  } else {
    t *= 2.66666 + s * (-3.949 + s * (8.683 + s * (-22.68 + s * (48.41 - s * 58.16))));
  }
  double low = 0.0, high = 1.0;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const DiscProfile at = disc_profile(t * t);
    double force, torque, h, dh, gain;  // F, T̂; the equation and its slope; numerator of the gauge
    if (r.inner) {
      force = t * at.slide;
      torque = 1.5 * at.spin;
      r.power = 1.5 * t * force + torque;
      h = force * q - torque * p;
      dh = (at.slide + 2.0 * t * t * at.dslide) * (q + 1.5 * t * p);
      gain = 1.5 * t * p + q;
    } else {
      force = at.slide;
      torque = 1.5 * t * at.arm;
      r.power = 1.5 * force + t * torque;
      h = torque * p - force * q;
      dh = -at.dslide * (3.0 * p + 2.0 * t * q);
      gain = 1.5 * p + t * q;
    }
    (h > 0.0 ? high : low) = t;
    double next = t - h / dh;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = next - t;
    r.t = next;
    if (std::abs(step) <= accuracy || iteration == 49) {
      r.gauge = (gain - 0.75 * h * step / r.power) / r.power;
      r.slide = at.slide + at.dslide * (next * next - t * t);
      r.power += (r.inner ? 1.5 * force : torque - 3.0 * at.dslide * step) * step;
      break;
    }
    t = next;
  }
  return r;
}

// ∇gauge at w.
Vec3<double> disc_gradient(const RayPoint& r, const Vec3<double>& w) {
  const double along = r.inner ? 1.0 / (r.gauge * r.slide) : 1.0 / std::hypot(w[0], w[1]);  // ε/p, 1/p
  const double k = 1.5 * along / r.power;
  return {k * w[0], k * w[1], std::copysign((r.inner ? 1.0 : r.t) / r.power, w[2])};
}

constexpr double kForValue = 1e-6, kForGradient = 1e-7;  // last Newton step

// w scaled to a largest entry of 1, as the ray wants it; false if w is zero or not a number.
template <class S>
bool to_unit(const Vec3<S>& w, Vec3<double>& unit, double& scale) {
  unit = {value_of(w[0]), value_of(w[1]), value_of(w[2])};
  scale = std::max({std::abs(unit[0]), std::abs(unit[1]), std::abs(unit[2])});
  const double sum = unit[0] + unit[1] + unit[2];
  if (!(scale > 0.0) || std::isnan(sum)) {
    scale = sum;  // 0 or NaN: max alone does not tell
    return false;
  }
  for (double& entry : unit) entry /= scale;
  return true;
}

}  // namespace

template <class S>
Vec3<S> UniformDisc::resist(const Vec3<S>& u) const {
  Vec3<double> v{value_of(u[0]), value_of(u[1]), value_of(u[2])};
  const double scale = scale_of(v);
  if (scale == 0.0) return {S(0.0), S(0.0), S(0.0)};
  if (scale != 1.0) {
    for (double& entry : v) entry /= scale;
  }
  if constexpr (std::is_same_v<S, double>) {
    return disc_resist(v, nullptr);
  } else {
    Mat3 jacobian;
    const Vec3<double> w = disc_resist(v, &jacobian);
    if (scale != 1.0) {
      for (auto& row : jacobian) {
        for (double& entry : row) entry /= scale;
      }
    }
    return chain3(u, w, jacobian);
  }
}

template <class S>
S UniformDisc::gauge(const Vec3<S>& w) const {
  Vec3<double> unit;
  double scale;
  if (!to_unit(w, unit, scale)) return S(scale);
  const double slide = std::sqrt(unit[0] * unit[0] + unit[1] * unit[1]);
  if constexpr (std::is_same_v<S, double>) {
    return scale * disc_ray(slide, std::abs(unit[2]), kForValue).gauge;
  } else {
    const RayPoint r = disc_ray(slide, std::abs(unit[2]), kForGradient);
    const Vec3<double> gradient = disc_gradient(r, unit);
    return S(scale * r.gauge, gradient[0] * w[0].v + gradient[1] * w[1].v + gradient[2] * w[2].v);
  }
}

Vec3<double> UniformDisc::slip_direction(const Vec3<double>& w) const {
  Vec3<double> unit;
  double scale;
  if (!to_unit(w, unit, scale)) return {scale, scale, scale};
  const double slide = std::sqrt(unit[0] * unit[0] + unit[1] * unit[1]);
  const RayPoint r = disc_ray(slide, std::abs(unit[2]), kForGradient);
  Vec3<double> n = disc_gradient(r, unit);
  const double inverse = 1.0 / std::sqrt(dot3(n, n));
  for (double& entry : n) entry *= -inverse;
  return n;
}

template Vec3<double> UniformDisc::resist(const Vec3<double>&) const;
template Vec3<Dual> UniformDisc::resist(const Vec3<Dual>&) const;
template double UniformDisc::gauge(const Vec3<double>&) const;
template Dual UniformDisc::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
