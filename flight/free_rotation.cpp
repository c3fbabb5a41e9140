#include "flight/free_rotation.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/require_finite.hpp"

namespace unhand::flight {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Phase;
using dynamics::State;
using dynamics::value_of;

namespace {

/// ω̇ in the body, of the ratios (I₂ − I₃)/I₁ and so on in turn, with the damping c.
template <class S>
Vec3<S> spin_rate(const Vec3<S>& ratios, const S& damping, const Vec3<S>& w) {
  return {ratios[0] * w[1] * w[2] - damping * w[0], ratios[1] * w[2] * w[0] - damping * w[1],
          ratios[2] * w[0] * w[1] - damping * w[2]};
}

template <class S>
Vec3<S> inertia_ratios(const Vec3<S>& inertia) {
  return {S((inertia[1] - inertia[2]) / inertia[0]), S((inertia[2] - inertia[0]) / inertia[1]),
          S((inertia[0] - inertia[1]) / inertia[2])};
}

/// State: the attitude against the start's (w, x, y, z) and ω in the body.
template <class P>
class Turning final : public dynamics::SmoothSystem<Turning<P>, 7> {
 public:
  Turning(const Vec3<P>& ratios, const P& damping) : damping_(damping), ratios_(ratios) {}

  template <class S>
  void flow_(const Phase&, const S&, const State<S, 7>& y, State<S, 7>& dy) const {
    const Quaternion<S> rate = Quaternion<S>{y[0], y[1], y[2], y[3]} * Quaternion<S>{S(0), y[4], y[5], y[6]};
    const Vec3<S> spin =
        spin_rate<S>({convert<S>(ratios_[0]), convert<S>(ratios_[1]), convert<S>(ratios_[2])},
                     convert<S>(damping_), {y[4], y[5], y[6]});
    dy = {0.5 * rate.w, 0.5 * rate.x, 0.5 * rate.y, 0.5 * rate.z, spin[0], spin[1], spin[2]};
  }

 private:
  P damping_;
  Vec3<P> ratios_;
};

constexpr double kMostTurn = 1e15;  ///< [rad], or per second, or of moments of inertia their ratio

template <class S>
void validate(const Vec3<S>& inertia, const RotationState<S>& start, const std::vector<double>& times) {
  for (const S& x : inertia)
    if (!(value_of(x) > 0 && std::isfinite(value_of(x))))
      throw std::invalid_argument(fmt::format("free rotation: inertia {} is not in (0, inf)", value_of(x)));
  const auto [least, most] = std::minmax({value_of(inertia[0]), value_of(inertia[1]), value_of(inertia[2])});
  if (!(most / least <= kMostTurn))
    throw std::invalid_argument(fmt::format(
        "free rotation: inertia {} is not in (0, {:g}] times another, which is {}", most, kMostTurn, least));
  dynamics::require_finite("free rotation", {{"attitude w", value_of(start.attitude.w), ""},
                                             {"attitude x", value_of(start.attitude.x), ""},
                                             {"attitude y", value_of(start.attitude.y), ""},
                                             {"attitude z", value_of(start.attitude.z), ""},
                                             {"omega x", value_of(start.omega[0]), "rad/s"},
                                             {"omega y", value_of(start.omega[1]), "rad/s"},
                                             {"omega z", value_of(start.omega[2]), "rad/s"}});
  if (value_of(start.attitude.w) == 0 && value_of(start.attitude.x) == 0 && value_of(start.attitude.y) == 0 &&
      value_of(start.attitude.z) == 0)
    throw std::invalid_argument("free rotation: the attitude is the zero quaternion");
  for (const double t : times)
    if (!(t >= 0 && std::isfinite(t)))
      throw std::invalid_argument(fmt::format("free rotation: time {} s is not in [0, inf)", t));
  double last = 1;
  for (const double t : times) last = std::max(last, t);
  for (const S& w : start.omega)
    if (!(std::abs(value_of(w)) * last <= kMostTurn))
      throw std::invalid_argument(
          fmt::format("free rotation: omega {} rad/s is not in [-{:g}, {:g}] rad/s over {} s", value_of(w),
                      kMostTurn / last, kMostTurn / last, last));
}

}  // namespace

template <class S>
Rotation<S>::Rotation(const Vec3<S>& inertia, const RotationState<S>& start, const S& damping, double last,
                      const dynamics::IntegratorOptions& options) {
  validate(inertia, start, {last});
  dynamics::require_finite("free rotation", {{"damping", value_of(damping), "1/s"}});
  attitude_ = normalised(start.attitude);
  omega_ = start.omega;
  last_ = last;
  const Vec3<S> ratios = inertia_ratios(inertia);
  spin_rate_ = spin_rate(ratios, damping, omega_);
  // A difference of zero may still carry a derivative; then the closed form would lose it.
  closed_form_ =
      (is_zero(S(inertia[0] - inertia[1])) && is_zero(S(inertia[1] - inertia[2])) && is_zero(damping)) ||
      !(last > 0);
  if (closed_form_) return;
  flow_ = dynamics::integrate_flow<S, 7>(
      Turning<S>(ratios, damping), {S(1), S(0), S(0), S(0), omega_[0], omega_[1], omega_[2]}, last, options);
}

template <class S>
RotationState<S> Rotation<S>::at(const S& t) const {
  if (!(value_of(t) >= 0 && value_of(t) <= last_))
    throw std::out_of_range(fmt::format("free rotation: time {} s is not in [0, {}] s", value_of(t), last_));
  if (closed_form_ || !(value_of(t) > 0))  // at the start the first order carries all derivatives
    return {attitude_ * exp(scaled(t, omega_)), sum(omega_, scaled(t, spin_rate_))};
  const State<S, 7> y = flow_.trajectory.at(t);
  return {attitude_ * normalised(Quaternion<S>{y[0], y[1], y[2], y[3]}), {y[4], y[5], y[6]}};
}

template <class S>
FreeRotation<S> rotate_freely(const Vec3<S>& inertia, const RotationState<S>& start,
                              const std::vector<double>& times, const dynamics::IntegratorOptions& options) {
  validate(inertia, start, times);
  const double last = times.empty() ? 0 : *std::max_element(times.begin(), times.end());
  const Rotation<S> rotation(inertia, start, S(0), last, options);
  FreeRotation<S> out{rotation.outcome(), {}};
  if (out.outcome != dynamics::Outcome::horizon) return out;
  out.states.reserve(times.size());
  for (const double t : times) out.states.push_back(rotation.at(S(t)));
  return out;
}

template class Rotation<double>;
template class Rotation<Dual>;
template FreeRotation<double> rotate_freely(const Vec3<double>&, const RotationState<double>&,
                                            const std::vector<double>&, const dynamics::IntegratorOptions&);
template FreeRotation<Dual> rotate_freely(const Vec3<Dual>&, const RotationState<Dual>&,
                                          const std::vector<double>&, const dynamics::IntegratorOptions&);

}  // namespace unhand::flight
