#include "contact/giving_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

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
      limit_dual_(kVaries<S> ? points_.x.size() : 0),
      led_(zero()) {
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
void GivingPoints<S>::mix(double a, const Stretch<S>& p, double b, const Stretch<S>& q, Stretch<S>& to) {
  for (std::size_t i = 0; i < to.x.size(); ++i) {
    to.x[i] = a * p.x[i] + b * q.x[i];
    to.z[i] = a * p.z[i] + b * q.z[i];
  }
  for (std::size_t i = 0; i < to.dx.size(); ++i)
    for (std::size_t k = 0; k < to.dx[i].size(); ++k) {
      to.dx[i][k] = a * p.dx[i][k] + b * q.dx[i][k];
      to.dz[i][k] = a * p.dz[i][k] + b * q.dz[i][k];
    }
}

/// Without a branch, two points at once: which points slip is another set at every guess.
template <class S>
typename GivingPoints<S>::Sum GivingPoints<S>::sum(const Stretch<S>& from, const Vec3<double>& slip,
                                                   double gain, double radius) const {
  double energy = 0, fx = 0, fz = 0, tau = 0, xx = 0, xz = 0, zz = 0, xt = 0, zt = 0, tt = 0;
  const double gx = gain * slip[0], gz = gain * slip[1], turn = gain * slip[2];
  const std::size_t n = points_.x.size();
  const double *const px = points_.x.data(), *const pz = points_.z.data(), *const area = points_.area.data(),
                      *const sx = from.x.data(), *const sz = from.z.data(), *const limit = limit_.data();
#pragma omp simd reduction(+ : energy, fx, fz, tau, xx, xz, zz, xt, zt, tt)
  for (std::size_t i = 0; i < n; ++i) {
    const double x = radius * px[i], z = radius * pz[i], w = area[i];
    const double ux = sx[i] + gx - turn * z, uz = sz[i] + gz + turn * x, most = limit[i];
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

template <class S>
double GivingPoints<S>::Potential::value(const Eigen::Vector3d& q, const Sum& at) const {
  return 0.5 * q.dot(inertia * q) - pull.dot(q) + stiffness / gain * at.energy;
}

template <class S>
Eigen::Vector3d GivingPoints<S>::Potential::gradient(const Eigen::Vector3d& q, const Sum& at) const {
  const Eigen::Vector3d moment(at.moment[0], at.moment[1], at.moment[2]);
  return inertia * q - pull + stiffness * moment;
}

template <class S>
Eigen::Matrix3d GivingPoints<S>::Potential::hessian(const Sum& at) const {
  const auto& b = at.bending;
  Eigen::Matrix3d bending;
  bending << b[0], b[1], b[3], b[1], b[2], b[4], b[3], b[4], b[5];
  return inertia + stiffness * gain * bending;
}

/// Newton's method with a line search.
template <class S>
typename GivingPoints<S>::Minimum GivingPoints<S>::minimise(const Potential& p, const Stretch<S>& from,
                                                            const Eigen::Vector3d& guess) const {
  const auto at = [&](const Eigen::Vector3d& x) { return sum(from, {x[0], x[1], x[2]}, p.gain, p.radius); };
  Minimum here{guess, at(guess), false};
  auto& q = here.slip;
  double value = p.value(q, here.sum);
  for (int iteration = 0; iteration < kNewtonBudget && !here.found; ++iteration) {
    const Eigen::Vector3d gradient = p.gradient(q, here.sum);
    const Eigen::Vector3d way = -p.hessian(here.sum).llt().solve(gradient);
    const double slope = gradient.dot(way);
    if (!std::isfinite(slope)) return here;
    // what a step of Newton's would still take off, beside the terms that the potential is the difference of
    const double terms = q.dot(p.inertia * q) + p.stiffness / p.gain * here.sum.energy;
    if (-slope <= 1e-28 * terms + 1e-300) {
      here.found = true;
      break;
    }
    double reach = 1;
    Eigen::Vector3d next = q + way;
    Sum there = at(next);
    double next_value = p.value(next, there);
    const double rounding = 1e-13 * (std::abs(value) + std::abs(p.pull.dot(q)));
    for (int halving = 0; halving < 40 && next_value > value + 1e-4 * reach * slope + rounding; ++halving) {
      reach *= 0.5;
      next = q + reach * way;
      there = at(next);
      next_value = p.value(next, there);
    }
    here = {next, there, reach == 1 && -slope <= 1e-22 * terms};
    value = next_value;
  }
  return here;
}

template <class S>
void GivingPoints<S>::follow(const Minimum& minimum, const Potential& potential, const Step& p,
                             const Stretch<S>& from, const S& gain, const S& radius,
                             Slip& slip) const requires std::is_same_v<S, Dual> {
  const Eigen::Vector3d& q = minimum.slip;
  const double k = potential.stiffness, g = potential.gain, a = potential.radius;
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
    residual.row(i) = (k * moment[i] + minimum.sum.moment[i] * stiffness_.v - p.free[i].v).transpose();
    for (int j = 0; j < 3; ++j) residual.row(i) += q[j] * p.inertia[i][j].v.transpose();
  }
  const Eigen::Matrix<double, 3, dynamics::kDualSize> shift =
      potential.hessian(minimum.sum).llt().solve(residual);
  for (int i = 0; i < 3; ++i) slip[i].v = -shift.row(i).transpose();
}

/// At the minimum the moment k Σ w Bᵀ e is c − A q: the object's wrench, reversed.
template <class S>
bool GivingPoints<S>::solve(const Step& p, const Stretch<S>& from, const S& gain, const S& radius, Slip& slip,
                            Vec3<S>& wrench) {
  Potential potential{{}, {}, value_of(stiffness_), value_of(gain), value_of(radius)};
  Eigen::Vector3d guess;
  for (int i = 0; i < 3; ++i) {
    potential.pull[i] = value_of(p.free[i]), guess[i] = value_of(slip[i]);
    for (int j = 0; j < 3; ++j) potential.inertia(i, j) = value_of(p.inertia[i][j]);
  }
  const Minimum minimum = minimise(potential, from, guess);
  if (!minimum.slip.allFinite()) return false;
  for (int i = 0; i < 3; ++i) slip[i] = S(minimum.slip[i]);
  if constexpr (kVaries<S>) follow(minimum, potential, p, from, gain, radius, slip);
  for (int i = 0; i < 3; ++i) wrench[i] = dot3(p.inertia[i], slip) - p.free[i];
  return minimum.found;
}

template <class S>
typename GivingPoints<S>::Way GivingPoints<S>::way(std::size_t i, const Slip& q, const S& radius,
                                                   const S& h) const {
  const double time = value_of(h), a = value_of(radius), turn = value_of(q[2]);
  const double px = points_.x[i], pz = points_.z[i];
  const double vx = value_of(q[0]) - a * pz * turn, vz = value_of(q[1]) + a * px * turn;
  Way out{time * vx, time * vz, {}, {}};
  if constexpr (kVaries<S>) {
    const Gradient by_turn = time * (a * q[2].v + turn * radius.v);
    out.dx = time * q[0].v - pz * by_turn + vx * h.v;
    out.dz = time * q[1].v + px * by_turn + vz * h.v;
  }
  return out;
}

/// The springs follow the slip as far as the limit lets them.
template <class S>
void GivingPoints<S>::move(const Stretch<S>& from, const Slip& slip, const S& radius, const S& h,
                           Stretch<S>& to) const {
  for (std::size_t i = 0; i < points_.x.size(); ++i) move(i, from, way(i, slip, radius, h), to);
}
template <class S>
void GivingPoints<S>::move(std::size_t i, const Stretch<S>& from, const Way& way, Stretch<S>& to) const {
  const double ux = from.x[i] + way.x, uz = from.z[i] + way.z;
  const double size = std::sqrt(ux * ux + uz * uz), limit = limit_[i];
  const double kept = size > limit ? limit / size : 1.0;
  to.x[i] = kept * ux, to.z[i] = kept * uz;
  if constexpr (kVaries<S>) {
    Gradient dx = gradient(from.dx[i]) + way.dx, dz = gradient(from.dz[i]) + way.dz;
    if (size > limit) limited(ux / size, uz / size, kept, gradient(limit_dual_[i]), dx, dz);
    gradient(to.dx[i]) = dx, gradient(to.dz[i]) = dz;
  }
}

template <class S>
const Stretch<S>& GivingPoints<S>::led_to_limit(const Stretch<S>& from, const Slip& known, const S& radius,
                                                const S& h) {
  if (!(value_of(loss_time_) > 0)) return from;
  bool any = false;
  const double gx = value_of(h) * value_of(known[0]), gz = value_of(h) * value_of(known[1]),
               turn = value_of(h) * value_of(known[2]) * value_of(radius);
  for (std::size_t i = 0; i < points_.x.size(); ++i) {
    const double x = gx - turn * points_.z[i], z = gz + turn * points_.x[i], sx = from.x[i], sz = from.z[i];
    const double ux = sx + x, uz = sz + z, limit = limit_[i];
    if (!(ux * ux + uz * uz > limit * limit && x * x + z * z < sx * sx + sz * sz)) continue;
    if (!std::exchange(any, true)) led_ = from;
    const Way way = this->way(i, known, radius, h);
    move(i, from, way, led_);
    led_.x[i] -= way.x, led_.z[i] -= way.z;
    if constexpr (kVaries<S>) gradient(led_.dx[i]) -= way.dx, gradient(led_.dz[i]) -= way.dz;
  }
  return any ? led_ : from;
}

/// δ_i λ_i and its derivatives: friction at every point's own speed where it depends on that.
template <class S>
void GivingPoints<S>::set_limits(const S& yield, const S& radius, const Slip& known) {
  S limit = yield;
  for (std::size_t i = 0; i < points_.x.size(); ++i) {
    if (speed_.any()) {
      const S turn = radius * known[2], vx = known[0] - points_.z[i] * turn,
              vz = known[1] + points_.x[i] * turn;
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
  set_limits(yield, radius, p.known);
  const Stretch<S>& base = led_to_limit(from, p.known, radius, p.h);
  const bool solved = solve(scaled, base, gain, radius, slip, wrench);
  move(base, slip, radius, p.h, to);
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
  set_limits(force / stiffness_, radius, p.known);
  const bool solved = solve(p, from, one, radius, moved, carried);
  move(from, moved, radius, one, to);
  return solved;
}

template class GivingPoints<double>;
template class GivingPoints<Dual>;

}  // namespace unhand::contact
