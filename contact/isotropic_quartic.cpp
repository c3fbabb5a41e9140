#include "contact/isotropic_quartic.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "contact/convex_quartic.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

constexpr double kTiny = 1e-13;  // what a vanishing curvature of H counts as

// The root of r³ − e κ r² + κ r − e in [0, 1], which rises there, from a guess: Halley's method inside a
// bracket.
inline double root(double e, double kappa, double r) {
  constexpr double kCubed = 1e-5;  // what a step leaves is about its cube: rounding
  double low = 0, high = 1;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double value = ((r - e * kappa) * r + kappa) * r - e, slope = (3 * r - 2 * e * kappa) * r + kappa,
                 bend = 3 * r - e * kappa;
    (value > 0 ? high : low) = r;
    double next = r - value * slope / (slope * slope - value * bend);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool last = std::abs(next - r) <= kCubed * next;
    r = next;
    if (last) break;
  }
  return r;
}

}  // namespace

IsotropicQuartic::IsotropicQuartic(const Dual& kappa) : kappa_(kappa) {
  if (!(kappa.a >= 0 && kappa.a <= 3))
    throw std::invalid_argument(fmt::format("isotropic quartic: kappa = {} is not in [0, 3]", kappa.a));
  double before = 0, slope_before = 0;
  for (int k = 0; k <= kPieces; ++k) {
    constexpr double kWidth = 1.0 / kPieces;
    const double e = kWidth * k, r = k == 0 ? 0.0 : root(e, kappa.a, std::max(before, 0.5 * e));
    const double rise = (3 * r - 2 * e * kappa.a) * r + kappa.a;
    const double slope = rise > kWidth ? kWidth * (1 + kappa.a * r * r) / rise : 1.0;  // any: it is a guess
    if (k > 0) {
      const double step = r - before;
      ratio_[k - 1] = {before, slope_before, 3 * step - 2 * slope_before - slope,
                       slope_before + slope - 2 * step};
    }
    before = r;
    slope_before = slope;
  }
}

double IsotropicQuartic::ratio(double e) const {
  const double place = kPieces * e;
  const int piece = place < kPieces ? static_cast<int>(place) : kPieces - 1;
  const auto& [c0, c1, c2, c3] = ratio_[piece];
  const double t = place - piece;
  return root(e, kappa_.a, std::clamp(c0 + t * (c1 + t * (c2 + t * c3)), 0.0, 1.0));
}

IsotropicQuartic IsotropicQuartic::closest_to_disc() {
  static const IsotropicQuartic quartic(ConvexQuartic::kappa_closest_to_disc());
  return quartic;
}

// With σ(u) = −resist(u)·u, whose Hessian is λ (q, −p)(q, −p)ᵀ in (p, q) and k = a/p across the slide: the
// larger of (a, b) is g = 1/h = H(1, r)^(−1/4) and λ = (1 + κ r²)³ g⁵/D over the cube of the larger of (p,
// q), D the determinant of ∇²H. By the implicit function theorem ∂r/∂κ = −r (1 − r⁴)/D.
Vec3<double> IsotropicQuartic::resist(const Vec3<double>& u, Slopes* slopes) const {
  const double kappa = kappa_.a;
  const double p = std::sqrt(u[0] * u[0] + u[1] * u[1]), q = std::abs(u[2]);
  const bool slides = q <= p;
  const double per_most = 1 / (slides ? p : q), r = ratio((slides ? q : p) * per_most), x = r * r;
  const double g = 1 / std::sqrt(std::sqrt(1 + x * (2 * kappa + x))), sum = 1 + kappa * x;
  // e = r (κ + r²)/(1 + κ r²), so where p is the lesser, a/p = (a/b) b/(e q) stays finite as it vanishes.
  const double share = slides ? 1.0 : sum / std::max(kappa + x, kTiny), k = share * g * per_most;
  if (slopes) {
    const double per_D = 1 / std::max(kappa + x * (3 - kappa * kappa + kappa * x), kTiny);
    const double square = per_most * per_most, g5 = g * g * g * g * g, scale = g5 * per_D * square * per_most;
    const double lambda = sum * sum * sum * scale;
    // (λ q² − k)/p²; where q is the larger, both are near each other and their difference is divided by x.
    const double below = kappa * kappa - 2, bend = below + x * (3 * kappa * below - x * (3 + kappa * x));
    const double cross = slides ? (lambda * q * q - k) * square : share * share * share * scale * bend;
    slopes->by_slip = isotropic_hessian(u, -k, -cross, -lambda);
    // Of the larger of (a, b), and of the smaller over r.
    const double turn = -(1 - x * x) * per_D, by_kappa = -g5 * x * (0.5 + (kappa + x) * turn),
                 lesser = by_kappa + g * turn;
    const double along = (slides ? by_kappa : lesser * share) * per_most;
    const double sign = std::copysign(1.0, u[2]);
    slopes->by_kappa = {-along * u[0], -along * u[1], -sign * (slides ? r * lesser : by_kappa)};
  }
  return {-k * u[0], -k * u[1], std::copysign(slides ? r * g : g, -u[2])};
}

template <class S>
Vec3<S> IsotropicQuartic::resist(const Vec3<S>& u) const {
  Vec3<double> v{value_of(u[0]), value_of(u[1]), value_of(u[2])};
  const double scale = scale_of(v);
  if (scale == 0.0) return {S(0.0), S(0.0), S(0.0)};
  if (scale != 1.0)
    for (double& entry : v) entry /= scale;
  if constexpr (std::is_same_v<S, double>) {
    return resist(v, nullptr);
  } else {
    Slopes slopes;
    const Vec3<double> w = resist(v, &slopes);
    if (scale != 1.0)
      for (auto& row : slopes.by_slip)
        for (double& entry : row) entry /= scale;
    Vec3<S> out = chain3(u, w, slopes.by_slip);
    for (std::size_t i = 0; i < 3; ++i) out[i].v += slopes.by_kappa[i] * kappa_.v;
    return out;
  }
}

template <class S>
S IsotropicQuartic::gauge(const Vec3<S>& w) const {
  using std::sqrt;
  const double scale = scale_of(w);
  if (scale == 0.0) return S(0.0);
  const Vec3<S> v{w[0] / scale, w[1] / scale, w[2] / scale};
  const S A = v[0] * v[0] + v[1] * v[1], B = v[2] * v[2], kappa = dynamics::convert<S>(kappa_);
  return scale * sqrt(sqrt(S(A * A + 2.0 * kappa * (A * B) + B * B)));
}

// −∇H/|∇H|
Vec3<double> IsotropicQuartic::slip_direction(const Vec3<double>& w) const {
  const double scale = scale_of(w);
  if (scale == 0.0) return {0.0, 0.0, 0.0};
  const Vec3<double> v{w[0] / scale, w[1] / scale, w[2] / scale};
  const double A = v[0] * v[0] + v[1] * v[1], B = v[2] * v[2], kappa = kappa_.a;
  const double flat = A + kappa * B, high = kappa * A + B;
  const Vec3<double> n{v[0] * flat, v[1] * flat, v[2] * high};
  const double k = -1.0 / std::sqrt(dot3(n, n));
  return {k * n[0], k * n[1], k * n[2]};
}

template Vec3<double> IsotropicQuartic::resist(const Vec3<double>&) const;
template Vec3<Dual> IsotropicQuartic::resist(const Vec3<Dual>&) const;
template double IsotropicQuartic::gauge(const Vec3<double>&) const;
template Dual IsotropicQuartic::gauge(const Vec3<Dual>&) const;

}  // namespace unhand::contact
