#include "contact/giving_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

/// Points on the rings, from the centre outwards. Detach twists of stiff pads are 3e-5 m/s from the exact
/// disc's in the mean of 200 random throws, 3e-4 m/s at worst.
const std::vector<int> kRings{7, 11, 15, 17};

constexpr int kNewtonBudget = 100;
/// Beside the springs of a hold, so that one that cannot be held has an answer, too [-].
constexpr double kBeside = 1e-10;

/// Pₙ + Pₙ₊₁ of Legendre at x in (−1, 1), and its derivative.
std::array<double, 2> radau(int n, double x) {
  double before = 1, at = x;  // P₀, P₁
  for (int k = 1; k < n; ++k) {
    const double next = ((2 * k + 1) * x * at - k * before) / (k + 1);
    before = at, at = next;
  }
  const double next = ((2 * n + 1) * x * at - n * before) / (n + 1);
  const double slope = n * (before - x * at) / (1 - x * x),
               next_slope = (n + 1) * (at - x * next) / (1 - x * x);
  return {at + next, slope + next_slope};
}

template <class S>
constexpr bool kVaries = std::is_same_v<S, Dual>;

using Gradient = Eigen::Matrix<double, dynamics::kDualSize, 1>;
using Numbers = std::array<double, dynamics::kDualSize>;
Eigen::Map<const Gradient> gradient(const Numbers& x) { return Eigen::Map<const Gradient>(x.data()); }
Eigen::Map<Gradient> gradient(Numbers& x) { return Eigen::Map<Gradient>(x.data()); }

/// The derivative of u, given as (dx, dz), becomes that of limit u/|u|; n = u/|u|, kept = limit/|u|.
void limited(double nx, double nz, double kept, const Gradient& dlimit, Gradient& dx, Gradient& dz) {
  const Gradient along = dlimit - kept * (nx * dx + nz * dz);
  dx = kept * dx + nx * along, dz = kept * dz + nz * along;
}

}  // namespace

DiscPoints disc_quadrature(const std::vector<int>& counts) {
  const int rings = static_cast<int>(counts.size());
  DiscPoints out;
  for (int j = 0; j < rings; ++j) {
    // the roots but for −1 interlace with these, from the centre outwards
    double x = -std::cos(std::numbers::pi * (2 * j + 2) / (2 * rings + 1));
    for (int k = 0; k < 60; ++k) {
      const auto [value, slope] = radau(rings, x);
      x -= value / slope;
    }
    const double inner = radau(rings, x)[1] / (1 + x), rho = 0.5 * (1 + x);
    const double area = 2 / ((1 - x * x) * inner * inner);
    const int count = counts[static_cast<std::size_t>(j)];
    for (int k = 0; k < count; ++k) {
      // rings are turned by half a step in turn, so that no direction is marked and z is like −z
      const double angle = 2 * std::numbers::pi * (k + 0.5 * (j % 2)) / count;
      out.x.push_back(rho * std::cos(angle));
      out.z.push_back(rho * std::sin(angle));
      out.area.push_back(area / count);
    }
  }
  return out;
}

template <class S>
GivingPoints<S>::GivingPoints(const FrictionLimits<S>& limits)
    : points_(disc_quadrature(kRings)),
      stiffness_(1.0 / limits.variation().compliance),
      loss_time_(limits.variation().loss_time),
      speed_(limits.speed()),
      limit_(points_.x.size()),
      limit_dual_(kVaries<S> ? points_.x.size() : 0) {
  using std::exp;
  const S& exponent = limits.variation().pressure_exponent;
  std::vector<S> load;
  S sum(0), torque(0);
  const std::size_t n = points_.x.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double square = points_.x[i] * points_.x[i] + points_.z[i] * points_.z[i];
    load.push_back(exp(exponent * std::log(1 - square)));
    sum += points_.area[i] * load[i];
    torque += points_.area[i] * std::sqrt(square) * load[i];
  }
  torque_factor_ = torque / sum;
  for (std::size_t i = 0; i < n; ++i) {
    const S share = load[i] / sum;
    load_.push_back(value_of(share));
    if constexpr (kVaries<S>) {
      if (exponent.v.isZero()) continue;
      load_dual_.emplace_back();
      gradient(load_dual_.back()) = share.v;
    }
  }
}

template <class S>
Stretch<S> GivingPoints<S>::zero() const {
  Stretch<S> out;
  const std::size_t n = points_.x.size();
  out.x.assign(n, 0), out.z.assign(n, 0);
  if (kVaries<S>) out.dx.assign(n, {}), out.dz.assign(n, {});
  return out;
}

template <class S>
void GivingPoints<S>::extrapolate(const Stretch<S>& coarse, const Stretch<S>& fine, Stretch<S>& to) {
  for (std::size_t i = 0; i < to.x.size(); ++i) {
    to.x[i] = 2 * fine.x[i] - coarse.x[i];
    to.z[i] = 2 * fine.z[i] - coarse.z[i];
  }
  for (std::size_t i = 0; i < to.dx.size(); ++i)
    for (std::size_t k = 0; k < to.dx[i].size(); ++k) {
      to.dx[i][k] = 2 * fine.dx[i][k] - coarse.dx[i][k];
      to.dz[i][k] = 2 * fine.dz[i][k] - coarse.dz[i][k];
    }
}

/// Without a branch: which points slip is another set at every guess.
template <class S>
typename GivingPoints<S>::Sum GivingPoints<S>::sum(const Stretch<S>& from, const Vec3<double>& slip,
                                                   double gain, double radius) const {
  double energy = 0, fx = 0, fz = 0, tau = 0, xx = 0, xz = 0, zz = 0, xt = 0, zt = 0, tt = 0;
  const double gx = gain * slip[0], gz = gain * slip[1], turn = gain * slip[2];
  const std::size_t n = points_.x.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double x = radius * points_.x[i], z = radius * points_.z[i], w = points_.area[i];
    const double ux = from.x[i] + gx - turn * z, uz = from.z[i] + gz + turn * x, most = limit_[i];
    const double square = ux * ux + uz * uz, size = std::sqrt(square), held = std::min(size, most);
    const double k = w * (size > most ? most / size : 1.0), bent = size > most ? k / square : 0.0;
    energy += w * held * (size - 0.5 * held);
    const double ex = k * ux, ez = k * uz;
    fx += ex, fz += ez, tau += x * ez - z * ex;
    const double axx = k - bent * ux * ux, axz = -bent * ux * uz, azz = k - bent * uz * uz;
    const double ax = x * axz - z * axx, az = x * azz - z * axz;
    xx += axx, xz += axz, zz += azz, xt += ax, zt += az, tt += x * az - z * ax;
  }
  return {energy, {fx, fz, tau}, {xx, xz, zz, xt, zt, tt}};
}

/// Minimises ½ qᵀ A q − c·q + k/g Σ w ψ over q by Newton's method with a line search; for Dual the implicit
/// function theorem, with the answer's moment k Σ w Bᵀ e = c − A q.
template <class S>
bool GivingPoints<S>::solve(const Step& p, const Stretch<S>& from, const S& gain, const S& radius, Slip& slip,
                            Vec3<S>& wrench) {
  const auto& A = p.inertia;
  const auto& c = p.free;
  const double k = value_of(stiffness_), g = value_of(gain), a = value_of(radius);
  Eigen::Matrix3d metric;
  Eigen::Vector3d pull, q;
  for (int i = 0; i < 3; ++i) {
    pull[i] = value_of(c[i]), q[i] = value_of(slip[i]);
    for (int j = 0; j < 3; ++j) metric(i, j) = value_of(A[i][j]);
  }
  const auto at = [&](const Eigen::Vector3d& x) { return sum(from, {x[0], x[1], x[2]}, g, a); };
  const auto potential = [&](const Eigen::Vector3d& x, const Sum& s) {
    return 0.5 * x.dot(metric * x) - pull.dot(x) + k / g * s.energy;
  };
  Sum here = at(q);
  double value = potential(q, here);
  Eigen::Matrix3d hessian;
  bool solved = false;
  for (int iteration = 0; iteration < kNewtonBudget && !solved; ++iteration) {
    const Eigen::Vector3d moment(here.moment[0], here.moment[1], here.moment[2]);
    const Eigen::Vector3d gradient = metric * q - pull + k * moment;
    const auto& b = here.bending;
    hessian << b[0], b[1], b[3], b[1], b[2], b[4], b[3], b[4], b[5];
    hessian = metric + k * g * hessian;
    const Eigen::Vector3d way = -hessian.llt().solve(gradient);
    const double slope = gradient.dot(way);
    if (!std::isfinite(slope)) return false;
    // what a step of Newton's would still take off, beside the terms that the potential is the difference of
    if (-slope <= 1e-28 * (q.dot(metric * q) + k / g * here.energy) + 1e-300) {
      solved = true;
      break;
    }
    double reach = 1;
    Eigen::Vector3d next = q + way;
    Sum there = at(next);
    double next_value = potential(next, there);
    const double rounding = 1e-13 * (std::abs(value) + std::abs(pull.dot(q)));
    for (int halving = 0; halving < 40 && next_value > value + 1e-4 * reach * slope + rounding; ++halving) {
      reach *= 0.5;
      next = q + reach * way;
      there = at(next);
      next_value = potential(next, there);
    }
    solved = reach == 1 && -slope <= 1e-22 * (q.dot(metric * q) + k / g * here.energy);
    q = next, here = there, value = next_value;
  }
  if (!q.allFinite()) return false;
  for (int i = 0; i < 3; ++i) slip[i] = S(q[i]);
  if constexpr (kVaries<S>) {
    // The residual A q − c + k Σ w Bᵀ e at this q, with derivatives.
    std::array<Gradient, 3> moment;
    for (auto& each : moment) each.setZero();
    const Gradient &dg = gain.v, &da = radius.v;
    for (std::size_t i = 0; i < points_.x.size(); ++i) {
      const double px = points_.x[i], pz = points_.z[i], x = a * px, z = a * pz, w = points_.area[i];
      const double bx = q[0] - z * q[2], bz = q[1] + x * q[2];
      double ux = from.x[i] + g * bx, uz = from.z[i] + g * bz;
      Gradient dx = gradient(from.dx[i]) + bx * dg - (g * pz * q[2]) * da;
      Gradient dz = gradient(from.dz[i]) + bz * dg + (g * px * q[2]) * da;
      const double size = std::sqrt(ux * ux + uz * uz), limit = limit_[i];
      if (size > limit) {
        const double kept = limit / size;
        limited(ux / size, uz / size, kept, gradient(limit_dual_[i]), dx, dz);
        ux *= kept, uz *= kept;
      }
      moment[0] += w * dx;
      moment[1] += w * dz;
      moment[2] += w * (x * dz - z * dx + (px * uz - pz * ux) * da);
    }
    Eigen::Matrix<double, 3, dynamics::kDualSize> residual;
    for (int i = 0; i < 3; ++i) {
      residual.row(i) = (k * moment[i] + here.moment[i] * stiffness_.v - c[i].v).transpose();
      for (int j = 0; j < 3; ++j) residual.row(i) += q[j] * A[i][j].v.transpose();
    }
    const auto& b = here.bending;
    hessian << b[0], b[1], b[3], b[1], b[2], b[4], b[3], b[4], b[5];
    hessian = metric + k * g * hessian;
    const Eigen::Matrix<double, 3, dynamics::kDualSize> shift = hessian.llt().solve(residual);
    for (int i = 0; i < 3; ++i) slip[i].v = -shift.row(i).transpose();
  }
  for (int i = 0; i < 3; ++i) wrench[i] = dot3(A[i], slip) - c[i];
  return solved;
}

/// The springs follow the slip as far as the limit lets them.
template <class S>
void GivingPoints<S>::move(const Stretch<S>& from, const Slip& slip, const S& radius, const S& h,
                           Stretch<S>& to) const {
  const double time = value_of(h), a = value_of(radius);
  const Vec3<double> q{value_of(slip[0]), value_of(slip[1]), value_of(slip[2])};
  for (std::size_t i = 0; i < points_.x.size(); ++i) {
    const double px = points_.x[i], pz = points_.z[i], x = a * px, z = a * pz;
    const double vx = q[0] - z * q[2], vz = q[1] + x * q[2];
    const double ux = from.x[i] + time * vx, uz = from.z[i] + time * vz;
    const double size = std::sqrt(ux * ux + uz * uz), limit = limit_[i];
    const double kept = size > limit ? limit / size : 1.0;
    to.x[i] = kept * ux, to.z[i] = kept * uz;
    if constexpr (kVaries<S>) {
      const Gradient turn = time * (a * slip[2].v + q[2] * radius.v);
      Gradient dx = gradient(from.dx[i]) + time * slip[0].v - pz * turn + vx * h.v;
      Gradient dz = gradient(from.dz[i]) + time * slip[1].v + px * turn + vz * h.v;
      if (size > limit) limited(ux / size, uz / size, kept, gradient(limit_dual_[i]), dx, dz);
      gradient(to.dx[i]) = dx, gradient(to.dz[i]) = dz;
    }
  }
}

/// δ_i λ_i and its derivatives: friction at every point's own speed where it depends on that.
template <class S>
void GivingPoints<S>::set_limits(const S& yield, const S& radius, const Slip& before) {
  S limit = yield;
  for (std::size_t i = 0; i < points_.x.size(); ++i) {
    if (speed_.any()) {
      const S turn = radius * before[2], vx = before[0] - points_.z[i] * turn,
              vz = before[1] + points_.x[i] * turn;
      limit = speed_.factor(S(vx * vx + vz * vz)) * yield;
    }
    limit_[i] = load_[i] * value_of(limit);
    if constexpr (kVaries<S>) {
      gradient(limit_dual_[i]) = load_[i] * limit.v;
      if (!load_dual_.empty()) gradient(limit_dual_[i]) += limit.a * gradient(load_dual_[i]);
    }
  }
}

template <class S>
bool GivingPoints<S>::step(const Step& p, const Stretch<S>& from, Stretch<S>& to, Slip& slip,
                           Vec3<S>& wrench) {
  const S gain = p.h + loss_time_, radius = p.length / torque_factor_, yield = p.force / stiffness_;
  Step scaled = p;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) scaled.inertia[i][j] = p.inertia[i][j] / p.h;
    scaled.free[i] = dot3(scaled.inertia[i], p.free);
  }
  set_limits(yield, radius, p.before);
  const bool solved = solve(scaled, from, gain, radius, slip, wrench);
  move(from, slip, radius, p.h, to);
  return solved;
}

template <class S>
bool GivingPoints<S>::hold(const Vec3<S>& wrench, const S& force, const S& length, Stretch<S>& to) {
  const Stretch<S> from = zero();
  const S one(1.0), radius = length / torque_factor_;
  const S side = kBeside * stiffness_, turn = 0.5 * side * radius * radius;
  const Step p{one,
               force,
               length,
               {{{side, S(0), S(0)}, {S(0), side, S(0)}, {S(0), S(0), turn}}},
               {-wrench[0], -wrench[1], -wrench[2]},
               {S(0), S(0), S(0)}};
  Slip moved{S(0), S(0), S(0)};
  Vec3<S> carried;
  set_limits(force / stiffness_, radius, p.before);
  const bool solved = solve(p, from, one, radius, moved, carried);
  move(from, moved, radius, one, to);
  return solved;
}

template class GivingPoints<double>;
template class GivingPoints<Dual>;

}  // namespace unhand::contact
