// The definitions of LimitSurface: included by the source that instantiates one for a shape, and by nothing
// else:
//   template class unhand::contact::ContactModelFrom<unhand::contact::LimitSurface<MyShape>>;
//   template class unhand::contact::LimitSurface<MyShape>;
#pragma once

#include "contact/contact_model_from.hpp"
#include "contact/limit_surface.hpp"
#include "contact/slip_acceleration.hpp"
#include "contact/slip_stop.hpp"

namespace unhand::contact {

using dynamics::value_of;
using std::sqrt;

namespace limit_surface_detail {

/// Time after the onset of slip [s] at which the flow takes over from its leading term; the slip is then of
/// the order of 1e-7 m/s and the term left out 1e-5 of it or less.
inline constexpr double kOnset = 5e-6;

/// Where the demand is beyond the surface at once (a jump, or a grip that cannot hold) the slip grows
/// linearly and is followed to this speed [m/s] instead: slaving is weak where friction is, and a free
/// direction turns by 1e-4 in 1e-7 s.
inline constexpr double kOnsetSpeed = 1e-6;

/// Normalised wrench w to f [N, N, N m]: f = f_max (w_x, w_z, L w_τ).
template <class S>
Wrench<S> physical(const Vec3<S>& w, const S& f_max, const S& length) {
  return {f_max * w[0], f_max * w[1], f_max * length * w[2]};
}

template <class S>
bool slips(const Relative<S>& y) {
  return value_of(y.slip.x) != 0 || value_of(y.slip.z) != 0 || value_of(y.spin) != 0;
}

/// u = (v_r, L ω_r)
template <class S>
Vec3<S> normalised_slip(const Relative<S>& y, const S& length) {
  return {y.slip.x, y.slip.z, length * y.spin};
}

}  // namespace limit_surface_detail
using namespace limit_surface_detail;

template <class Shape>
LimitSurface<Shape>::LimitSurface(std::string_view name, const Patch<Dual>& patch, Shape shape,
                                  const FrictionVariation<Dual>& variation)
    : name_(name), shape_(std::move(shape)), limits_{{values(patch), values(variation)}, {patch, variation}} {
  validate(limits_.value.patch());
  validate(variation);
  pads_ = {pad_compliance(limits_.value), pad_compliance(limits_.dual)};
  if constexpr (kDisc)
    if (limits_.dual.speed().any()) local_.emplace(shape_.exponent(), shape_.torque_factor());
}

template <class Shape>
dynamics::Guard LimitSurface<Shape>::guard(int mode, int) const {
  using dynamics::Crossing;
  return mode != kSlip ? dynamics::Guard{"limit surface", Crossing::rising, false}
                       : dynamics::Guard{"slip stops", Crossing::falling, true};
}

template <class Shape>
template <class S>
Wrench<S> LimitSurface<Shape>::wrench_(int mode, const Scene<S>& scene, const Relative<S>& y) const {
  if (mode != kSlip) return is_elastic(mode) ? pads_.of<S>()->wrench(scene, y) : sticking_wrench(scene, y);
  const S length = limits_.of<S>().length(scene.normal_force);
  if (y.slip.x == S(0) && y.slip.z == S(0) && y.spin == S(0)) {
    // At the very onset of slip there is no direction yet: the demand, brought back to the surface.
    const Wrench<S> demand = sticking_wrench(scene, y);
    const S limit = limits_.of<S>().held(scene.normal_force);
    const S size = gauge(shape_, scene, Vec3<S>{demand.fx, demand.fz, demand.tau / length});
    if (!(value_of(size) > value_of(limit))) return demand;
    const S k = limit / size;
    return {k * demand.fx, k * demand.fz, k * demand.tau};
  }
  const Vec3<S> u = normalised_slip(y, length);
  Vec3<S> w = resist(shape_, scene, u);
  if (!local_) return physical(w, limits_.of<S>().slipping(scene.normal_force, y.slip, y.spin), length);
  const Vec3<S> more = local_->wrench(limits_.of<S>().speed(), u);
  for (int i = 0; i < 3; ++i) w[i] += more[i];
  return physical(w, limits_.of<S>().coulomb(scene.normal_force), length);
}

template <class Shape>
template <class S>
void LimitSurface<Shape>::rate_(int mode, const Scene<S>& scene, const Relative<S>& y,
                                State<S, 6>& dy) const {
  dy = relative_rate(scene, y, wrench_(mode, scene, y));
}

/// u̇/u of the slip [1/s], judged by its energy ½ uᵀ W⁻¹ u, so (f − f_p)·u / (uᵀ W⁻¹ u). Friction's power f·u
/// is stationary in the slip's direction, so an error in the direction counts by its square here; in |u| it
/// counts by f_max W, which lets a tiny patch under a light object look as if it stopped. Where the direction
/// stays, and so at a stop, both say the same.
template <class Shape>
template <class S>
S LimitSurface<Shape>::growth(const Scene<S>& scene, const Relative<S>& y, const State<S, 6>& rate) const {
  const S length = limits_.of<S>().length(scene.normal_force);
  const Vec3<S> u = normalised_slip(y, length), du{rate[3], rate[4], length * rate[5]};
  const Vec3<S> momentum = times(normalised_inertia(scene, lever(scene, y), length), u);
  return dot3(momentum, du) / dot3(momentum, u);
}

/// A demanded wrench against the surface at `scene`.
template <class Shape>
template <class S>
S LimitSurface<Shape>::margin_of(const Wrench<S>& demand, const Scene<S>& scene) const {
  const S length = limits_.of<S>().length(scene.normal_force),
          f_max = limits_.of<S>().held(scene.normal_force);
  const S size = gauge(shape_, scene, Vec3<S>{demand.fx, demand.fz, demand.tau / length});
  return margin(S(size * size), S(f_max * f_max));
}

template <class Shape>
template <class S>
void LimitSurface<Shape>::guards_(const Phase& phase, const SceneSource& source, const S& t,
                                  const Relative<S>& y, S* g) const {
  if (phase.mode != kSlip) {
    const Scene<S> scene = source.scene(phase.window, t);
    g[0] = margin_of(wrench_(phase.mode, scene, y), scene);
  } else {
    // Where L changes with f_N, L' ω_r is left out of u': of the order of kStopTime beside L ω_r' at a stop.
    const Scene<S> scene = source.scene(phase.window, t);
    State<S, 6> rate;
    rate_(kSlip, scene, y, rate);
    const Vec3<S> u = normalised_slip(y, limits_.of<S>().length(scene.normal_force));
    const S speed = sqrt(dot3(u, u));
    g[0] = stop_guard(speed, S(speed * growth(scene, y, rate)));
  }
}

/// Slip from rest at t. While |u| is tiny its direction is slaved: it relaxes within |u|/(W f_max),
/// microseconds or less, to the n(t) of the quasi-static acceleration a(t) = W (f* − f_p)(t) = |a| n, so u(δ)
/// = n(δ) ∫ |a| dt (Simpson's rule; a = 0 at the start where f_p has just reached the surface). What is left
/// out is of relative size |u|/(W f_max T), T the time scale of the hand and the gripper.
template <class Shape>
template <class S>
Entry<S, 6> LimitSurface<Shape>::onset(const Window& window, const SceneSource& source, const S& t,
                                       const Relative<S>& rest, bool at_the_surface) const {
  Relative<S> y = rest;
  y.slip = {S(0), S(0)};
  y.spin = S(0);
  const State<S, 6> at_rest = y.state();
  const auto acceleration = [&](double after) {
    return slip_acceleration(shape_, limits_.of<S>(), source.scene(window, S(t + after)), y);
  };
  const auto size = [](const Vec3<S>& a) {
    const S square = dot3(a, a);
    return value_of(square) == 0 ? S(0) : S(sqrt(square));
  };
  const S a0 = at_the_surface ? S(0) : size(acceleration(0));
  double delta = std::min(kOnset, 0.25 * (window.end - value_of(t)));
  if (value_of(a0) * delta > kOnsetSpeed) delta = kOnsetSpeed / value_of(a0);
  if (!(delta > 0)) return {stick(), t, y.state(), S(0)};
  const S a1 = size(acceleration(0.5 * delta));
  const Vec3<S> end = acceleration(delta);
  const S a2 = size(end), speed = delta / 6 * (a0 + 4.0 * a1 + a2);
  if (value_of(a2) == 0) return {stick(), t, y.state(), S(0)};  // a demand that only touches the surface
  const S k = speed / a2;
  y.slip = {k * end[0], k * end[1]};
  y.spin = k * end[2] / limits_.of<S>().length(source.scene(window, S(t + delta)).normal_force);
  return {kSlip, S(t + delta), y.state(), S(delta), at_rest};
}

/// Along a straight line to zero slip, then decide anew.
template <class Shape>
template <class S>
Entry<S, 6> LimitSurface<Shape>::come_to_rest(const Window& window, const SceneSource& source, const S& t,
                                              const Relative<S>& at) const {
  const Scene<S> scene = source.scene(window, t);
  State<S, 6> dy;
  rate_(kSlip, scene, at, dy);
  const S left = -1.0 / growth(scene, at, dy);
  Relative<S> y = at;
  y.arm = y.arm + (0.5 * left) * Vec2<S>{dy[0], dy[1]};
  y.angle += 0.5 * left * y.spin;
  y.slip = {S(0), S(0)};
  y.spin = S(0);
  return membership_(stick(), window, source, S(t + left), y);
}

/// Slip on at the velocity of the moment, unless friction stops it at once.
template <class Shape>
template <class S>
Entry<S, 6> LimitSurface<Shape>::slip_or_rest(const Window& window, const SceneSource& source, const S& t,
                                              const Relative<S>& y) const {
  if (!slips(y)) return membership_(stick(), window, source, t, y);
  double stops;
  guards_({kSlip, window}, source, value_of(t), values(y), &stops);
  if (stops > 0) return {kSlip, t, y.state(), S(0)};
  return come_to_rest(window, source, t, y);
}

template <class Shape>
template <class S>
Entry<S, 6> LimitSurface<Shape>::on_guard_(const Phase& from, int /*guard*/, const SceneSource& source,
                                           const S& t, const Relative<S>& at) const {
  if (is_elastic(from.mode)) return slip_or_rest(from.window, source, t, at);
  return from.mode == kSlip ? come_to_rest(from.window, source, t, at)
                            : onset(from.window, source, t, at, true);
}

template <class Shape>
template <class S>
Entry<S, 6> LimitSurface<Shape>::membership_(int mode, const Window& window, const SceneSource& source,
                                             const S& t, const Relative<S>& y) const {
  // What a stop at once takes has passed since t.
  const auto moving = [&] {
    Entry<S, 6> next = slip_or_rest(window, source, t, y);
    next.lead = next.t - t;
    next.at_event = y.state();
    return next;
  };
  const bool start = mode < 0 && !slips(y);
  if (is_elastic(mode) || (start && is_elastic(kHeld))) {
    const Scene<S> scene = source.scene(window, t);
    if (value_of(margin_of(wrench_(kHeld, scene, y), scene)) < 0) return {kHeld, t, y.state(), S(0)};
    return moving();
  }
  if (slips(y)) return moving();
  if (mode == kSlip) return {kSlip, t, y.state(), S(0)};
  const Scene<double> scene = values(source.scene(window, t));
  if (margin_of(sticking_wrench(scene, values(y)), scene) < 0) return {stick(), t, y.state(), S(0)};
  return onset(window, source, t, y, false);
}

}  // namespace unhand::contact
