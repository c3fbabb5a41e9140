#include "contact/pressed_disc.hpp"

#include "contact/disc_friction.hpp"
#include "contact/friction_effects.hpp"
#include "contact/pressed_disc_table.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

struct PressedDisc::Series {
  bool uniform;  ///< values by the closed forms
  PressedSeriesAt at;
  double kappa;              ///< 1/c
  double kappa_by_exponent;  ///< d(1/c)/ds

  PressedProfile inner(double m) const {
    if (!uniform) return evaluate(at.value.inner, m);
    const DiscProfile p = disc_profile(m);
    return {p.slide, p.dslide, p.spin};
  }
  PressedProfile outer(double m) const {
    if (!uniform) return evaluate(at.value.outer, m);
    const DiscProfile p = disc_profile(m);
    return {p.slide, p.dslide, p.arm};
  }
};

/// The point of the surface on a ray: the slip (|v|, |L ω|) that meets it.
struct PressedDisc::Ray {
  double slide, spin;  ///< one of them κ or 1
  double gauge;
};

PressedDisc::PressedDisc(const Dual& exponent) : exponent_(exponent) {
  const double s = exponent.a;
  dynamics::require_in_range(friction_effects(), "contact.pressure_profile.s", s);
  auto series = std::make_shared<Series>();
  series->uniform = s == 0;
  series->at = pressed_series(s);
  const double c = series->inner(0)[2];
  series->kappa = 1 / c;
  series->kappa_by_exponent = -evaluate(series->at.by_exponent.inner, 0)[2] / (c * c);
  series_ = std::move(series);
}

Dual PressedDisc::torque_factor() const {
  const double kappa = series_->kappa;
  return dynamics::chain(exponent_, 1 / kappa, -series_->kappa_by_exponent / (kappa * kappa));
}

/// u of ordinary size. The Jacobian is −∇² of the power, as for UniformDisc with κ = 1/c for 3/2; dm/ds = ∓2
/// m κ′/κ at fixed u.
Vec3<double> PressedDisc::resist_(const Vec3<double>& u, Mat3* jacobian, Vec3<double>* by_exponent) const {
  const double kappa = series_->kappa, growth = series_->kappa_by_exponent / kappa;
  const double slide = u[0] * u[0] + u[1] * u[1], spin = kappa * kappa * u[2] * u[2];  // v², (ω a)²
  if (slide <= spin) {
    const double m = slide / spin, rim = kappa * std::abs(u[2]);
    const auto [phi, dphi, torque] = series_->inner(m);
    const double k = phi / rim, slope = phi + 2 * m * dphi;  // dF/dε
    if (jacobian)
      *jacobian = isotropic_hessian(u, -k, -2 * dphi / (rim * spin), -kappa * kappa * slope / (rim * spin));
    if (by_exponent) {
      const PressedProfile ds = evaluate(series_->at.by_exponent.inner, m);
      const double dk = (ds[0] - growth * slope) / rim;
      *by_exponent = {-dk * u[0], -dk * u[1],
                      std::copysign(1.0, -u[2]) * kappa * (ds[2] + growth * (torque + m * slope))};
    }
    return {-k * u[0], -k * u[1], std::copysign(kappa * torque, -u[2])};
  }
  const double m = spin / slide, inverse = 1 / std::sqrt(slide);
  const auto [phi, dphi, arm] = series_->outer(m);
  const double k = phi * inverse, turn = kappa * kappa * inverse;
  if (jacobian) {
    const double lambda = -2 * turn * dphi / slide;
    *jacobian = isotropic_hessian(u, -k, -(lambda * u[2] * u[2] - k) / slide, -lambda);
  }
  if (by_exponent) {
    const PressedProfile ds = evaluate(series_->at.by_exponent.outer, m);
    const double dk = (ds[0] + 2 * m * growth * dphi) * inverse;
    *by_exponent = {-dk * u[0], -dk * u[1], -turn * u[2] * (ds[2] + growth * (arm - 2 * dphi))};
  }
  return {-k * u[0], -k * u[1], -turn * arm * u[2]};
}

Mat3 PressedDisc::resist_jacobian(const Vec3<double>& u) const {
  Mat3 jacobian{};
  const double scale = scale_of(u);
  if (scale == 0) return jacobian;
  resist_({u[0] / scale, u[1] / scale, u[2] / scale}, &jacobian, nullptr);
  for (auto& row : jacobian)
    for (double& entry : row) entry /= scale;
  return jacobian;
}

template <class S>
Vec3<S> PressedDisc::resist(const Vec3<S>& u) const {
  Vec3<double> v{value_of(u[0]), value_of(u[1]), value_of(u[2])};
  const double scale = scale_of(v);
  if (scale == 0) return {S(0), S(0), S(0)};
  for (double& entry : v) entry /= scale;
  if constexpr (std::is_same_v<S, double>) {
    return resist_(v, nullptr, nullptr);
  } else {
    Mat3 jacobian;
    const bool varies = !exponent_.v.isZero();
    Vec3<double> by_exponent{};
    const Vec3<double> w = resist_(v, &jacobian, varies ? &by_exponent : nullptr);
    for (auto& row : jacobian)
      for (double& entry : row) entry /= scale;
    Vec3<S> out = chain3(u, w, jacobian);
    if (varies)
      for (int i = 0; i < 3; ++i) out[i].v += by_exponent[i] * exponent_.v;
    return out;
  }
}

/// Solves F/T̂ = p/q by Newton's method kept inside a bracket, for ε or 1/ε in [0, 1]; the gauge is the
/// maximum of (p |v| + q |L ω|)/power over the slips, hence insensitive to what is left.
PressedDisc::Ray PressedDisc::ray(double p, double q) const {
  const double kappa = series_->kappa;
  const auto rim = series_->inner(1);
  const bool inner = p * kappa * rim[2] <= q * rim[0];
  const auto start = inner ? series_->inner(0) : series_->outer(0);
  double t = inner ? p / (q * start[0]) : q / (p * kappa * start[2]), low = 0, high = 1;
  if (!(t < 1)) t = 0.9;
  for (int iteration = 0; iteration < 60; ++iteration) {
    double h, dh;
    if (inner) {
      const auto [phi, dphi, torque] = series_->inner(t * t);
      h = t * phi * q - kappa * torque * p;
      dh = (phi + 2 * t * t * dphi) * (q + kappa * t * p);
    } else {
      const auto [phi, dphi, arm] = series_->outer(t * t);
      h = kappa * t * arm * p - phi * q;
      dh = -2 * dphi * (kappa * p + t * q);
    }
    (h > 0 ? high : low) = t;
    double next = t - h / dh;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = next - t;
    t = next;
    if (std::abs(step) <= 1e-8) break;
  }
  Ray r{inner ? kappa * t : kappa, inner ? 1 : t, 0};
  const Vec3<double> w = resist_({r.slide, 0, r.spin}, nullptr, nullptr);
  r.gauge = (p * r.slide + q * r.spin) / -(w[0] * r.slide + w[2] * r.spin);
  return r;
}

template <class S>
S PressedDisc::gauge(const Vec3<S>& w) const {
  Vec3<double> x{value_of(w[0]), value_of(w[1]), value_of(w[2])};
  const double scale = std::max({std::abs(x[0]), std::abs(x[1]), std::abs(x[2])});
  if (!(scale > 0) || std::isnan(x[0] + x[1] + x[2])) return S(x[0] + x[1] + x[2]);
  for (double& entry : x) entry /= scale;
  const double p = std::sqrt(x[0] * x[0] + x[1] * x[1]);
  const Ray r = ray(p, std::abs(x[2]));
  if constexpr (std::is_same_v<S, double>) {
    return scale * r.gauge;
  } else {
    Vec3<double> by_exponent{};
    const Vec3<double> at{r.slide, 0, r.spin}, force = resist_(at, nullptr, &by_exponent);
    const double power = -dot3(force, at), turn = std::copysign(r.spin / power, x[2]);
    const double along = p > 0 ? r.slide / (power * p) : 0;
    S out(scale * r.gauge, along * x[0] * w[0].v + along * x[1] * w[1].v + turn * w[2].v);
    if (!exponent_.v.isZero()) out.v += scale * r.gauge * dot3(by_exponent, at) / power * exponent_.v;
    return out;
  }
}

Vec3<double> PressedDisc::slip_direction(const Vec3<double>& w) const {
  const double scale = std::max({std::abs(w[0]), std::abs(w[1]), std::abs(w[2])}), sum = w[0] + w[1] + w[2];
  if (!(scale > 0) || std::isnan(sum)) return {sum, sum, sum};
  const double x = w[0] / scale, z = w[1] / scale, p = std::sqrt(x * x + z * z);
  const Ray r = ray(p, std::abs(w[2]) / scale);
  const double inverse = -1 / std::hypot(r.slide, r.spin), along = p > 0 ? inverse * r.slide / p : 0;
  return {along * x, along * z, std::copysign(inverse * r.spin, -w[2])};
}

template Vec3<double> PressedDisc::resist(const Vec3<double>&) const;
template Vec3<Dual> PressedDisc::resist(const Vec3<Dual>&) const;
template double PressedDisc::gauge(const Vec3<double>&) const;
template Dual PressedDisc::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
