#include "flight/spatial_flight.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/require_finite.hpp"
#include "flight/aerodynamics.hpp"

namespace unhand::flight {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Phase;
using dynamics::State;
using dynamics::value_of;

namespace {

template <class S, class P>
Vec3<S> convert3(const Vec3<P>& a) {
  return {convert<S>(a[0]), convert<S>(a[1]), convert<S>(a[2])};
}

/// Whether drag depends on where in the body the air comes from.
template <class S>
bool has_shape(const SpatialAir<S>& a) {
  return !(is_zero(a.axis_drag_x) && is_zero(a.axis_drag_y) && is_zero(a.cubic_drag));
}

template <class S>
bool is_still(const SpatialAir<S>& a) {
  return is_zero(a.drag_k) && is_zero(a.linear_drag) && is_zero(a.lift) && !has_shape(a);
}

/// −k |u| u − c u of a body that is alike from all sides, in any axes.
template <class S>
Vec3<S> round_drag(const S& k, const S& c, const Vec3<S>& u) {
  return difference(quadratic_drag(k, u), scaled(c, u));
}

/// κ (Σ n_i⁴ − 3/5) |u| u and |u| A u in body axes.
template <class S>
Vec3<S> shape_drag(const S& x, const S& y, const S& cubic, const Vec3<S>& u) {
  using std::sqrt;
  const S square = dot(u, u);
  if (value_of(square) == 0) return {S(0), S(0), S(0)};
  const S speed = sqrt(square);
  S fourth(0.0);
  for (const S& c : u) fourth += c * c * c * c;
  const S isotropic = cubic * (fourth / (square * square) - 0.6);
  return {speed * (x + isotropic) * u[0], speed * (y + isotropic) * u[1], speed * (isotropic - x - y) * u[2]};
}

/// State: position and velocity of the CoM; the rotation is known.
template <class P>
class SpatialPath final : public dynamics::SmoothSystem<SpatialPath<P>, 6> {
 public:
  /// The rotation is known up to `last` [s]; a trial step may look past it.
  SpatialPath(const SpatialAir<P>& air, const Rotation<P>& rotation, double last)
      : air_(air), rotation_(rotation), last_(last) {
    turns_ = !is_zero(air.lift) || has_shape(air);
  }

  template <class S>
  void flow_(const Phase&, const S& t, const State<S, 6>& y, State<S, 6>& dy) const {
    const Vec3<S> u = difference(Vec3<S>{y[3], y[4], y[5]}, convert3<S>(air_.wind));
    Vec3<S> a =
        sum(convert3<S>(air_.gravity), round_drag(convert<S>(air_.drag_k), convert<S>(air_.linear_drag), u));
    if (turns_) {
      const RotationState<P> now = rotation_.at(value_of(t) < last_ ? convert<P>(t) : P(last_));
      const Quaternion<S> q{convert<S>(now.attitude.w), convert<S>(now.attitude.x),
                            convert<S>(now.attitude.y), convert<S>(now.attitude.z)};
      const Vec3<S> omega = rotate(q, convert3<S>(now.omega));
      a = sum(a, scaled(convert<S>(air_.lift), cross(omega, u)));
      a = difference(a, rotate(q, shape_drag(convert<S>(air_.axis_drag_x), convert<S>(air_.axis_drag_y),
                                             convert<S>(air_.cubic_drag), rotate(conjugate(q), u))));
    }
    for (int i = 0; i < 3; ++i) {
      dy[i] = y[3 + i];
      dy[3 + i] = a[static_cast<std::size_t>(i)];
    }
  }

 private:
  const SpatialAir<P>& air_;
  const Rotation<P>& rotation_;
  double last_{};
  bool turns_{};
};

template <class S>
void validate(const SpatialStart<S>& start, const SpatialAir<S>& air, const std::vector<S>& times) {
  for (std::size_t i = 0; i < 3; ++i)
    dynamics::require_finite("spatial flight", {{"position", value_of(start.position[i]), "m"},
                                                {"velocity", value_of(start.velocity[i]), "m/s"},
                                                {"gravity", value_of(air.gravity[i]), "m/s²"},
                                                {"wind", value_of(air.wind[i]), "m/s"}});
  dynamics::require_finite("spatial flight", {{"drag_k", value_of(air.drag_k), "1/m"},
                                              {"linear_drag", value_of(air.linear_drag), "1/s"},
                                              {"lift", value_of(air.lift), ""},
                                              {"axis_drag_x", value_of(air.axis_drag_x), "1/m"},
                                              {"axis_drag_y", value_of(air.axis_drag_y), "1/m"},
                                              {"cubic_drag", value_of(air.cubic_drag), "1/m"}});
  if (!(value_of(air.drag_k) >= 0))
    throw std::invalid_argument(
        fmt::format("spatial flight: drag_k = {} is not in [0, inf) 1/m", value_of(air.drag_k)));
  if (!(value_of(air.linear_drag) >= 0))
    throw std::invalid_argument(
        fmt::format("spatial flight: linear_drag = {} is not in [0, inf) 1/s", value_of(air.linear_drag)));
  for (const S& t : times)
    if (!(value_of(t) >= 0 && std::isfinite(value_of(t))))
      throw std::invalid_argument(fmt::format("spatial flight: time {} s is not in [0, inf)", value_of(t)));
}

}  // namespace

template <class S>
Vec3<S> body_drag(const SpatialAir<S>& air, const Vec3<S>& u) {
  const Vec3<S> round = round_drag(air.drag_k, air.linear_drag, u);
  if (!has_shape(air)) return round;
  return difference(round, shape_drag(air.axis_drag_x, air.axis_drag_y, air.cubic_drag, u));
}
template Vec3<double> body_drag(const SpatialAir<double>&, const Vec3<double>&);
template Vec3<Dual> body_drag(const SpatialAir<Dual>&, const Vec3<Dual>&);

template <class S>
SpatialFlight<S> fly_in_space(const SpatialStart<S>& start, const SpatialAir<S>& air,
                              const std::vector<S>& times, const dynamics::IntegratorOptions& options) {
  validate(start, air, times);
  double last = 0;
  for (const S& t : times) last = std::max(last, value_of(t));
  const Rotation<S> rotation(start.inertia, start.rotation, air.spin_damping, last, options);
  SpatialFlight<S> out{rotation.outcome(), {}};
  if (out.outcome != dynamics::Outcome::horizon) return out;
  const Vec3<S>&p = start.position, &v = start.velocity;
  out.states.reserve(times.size());
  if (is_still(air) || !(last > 0)) {
    for (const S& t : times)
      out.states.push_back({sum(p, scaled(t, sum(v, scaled(S(0.5 * t), air.gravity)))), rotation.at(t)});
    return out;
  }
  const auto flow = dynamics::integrate_flow<S, 6>(SpatialPath<S>(air, rotation, last),
                                                   {p[0], p[1], p[2], v[0], v[1], v[2]}, last, options);
  out.outcome = flow.outcome;
  if (out.outcome != dynamics::Outcome::horizon) return out;
  for (const S& t : times) {
    if (!(value_of(t) > 0)) {
      out.states.push_back({sum(p, scaled(t, v)), rotation.at(t)});
      continue;
    }
    const State<S, 6> at = flow.trajectory.at(t);
    out.states.push_back({{at[0], at[1], at[2]}, rotation.at(t)});
  }
  return out;
}

template SpatialFlight<double> fly_in_space(const SpatialStart<double>&, const SpatialAir<double>&,
                                            const std::vector<double>&, const dynamics::IntegratorOptions&);
template SpatialFlight<Dual> fly_in_space(const SpatialStart<Dual>&, const SpatialAir<Dual>&,
                                          const std::vector<Dual>&, const dynamics::IntegratorOptions&);

}  // namespace unhand::flight
