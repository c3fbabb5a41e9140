#include "flight/free_rotation.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace unhand::flight {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Entry;
using dynamics::Phase;
using dynamics::State;
using dynamics::value_of;

namespace {

/// State: the attitude against the start's (w, x, y, z) and ω in the body.
template <class P>
class Turning final : public dynamics::HybridSystemFrom<Turning<P>, 7> {
 public:
  explicit Turning(const Vec3<P>& inertia)
      : ratios_{P((inertia[1] - inertia[2]) / inertia[0]), P((inertia[2] - inertia[0]) / inertia[1]),
                P((inertia[0] - inertia[1]) / inertia[2])} {}
  dynamics::FlowKind kind(int) const override { return dynamics::FlowKind::smooth; }
  std::string_view mode_name(int) const override { return "turning"; }
  int guard_count(int) const override { return 0; }
  dynamics::Guard guard(int, int) const override { return {}; }

  template <class S>
  void flow_(const Phase&, const S&, const State<S, 7>& y, State<S, 7>& dy) const {
    const Quaternion<S> rate = Quaternion<S>{y[0], y[1], y[2], y[3]} * Quaternion<S>{S(0), y[4], y[5], y[6]};
    dy = {0.5 * rate.w,
          0.5 * rate.x,
          0.5 * rate.y,
          0.5 * rate.z,
          convert<S>(ratios_[0]) * y[5] * y[6],
          convert<S>(ratios_[1]) * y[6] * y[4],
          convert<S>(ratios_[2]) * y[4] * y[5]};
  }
  template <class S>
  void guards_(const Phase&, const S&, const State<S, 7>&, S*) const {}
  template <class S>
  Entry<S, 7> on_guard_(const Phase& from, int, const S& t, const State<S, 7>& y) const {
    return {from.mode, t, y, S(0)};
  }

 private:
  Vec3<P> ratios_;
};

template <class S>
void validate(const Vec3<S>& inertia, const RotationState<S>& start, const std::vector<double>& times) {
  for (const S& x : inertia)
    if (!(value_of(x) > 0 && std::isfinite(value_of(x))))
      throw std::invalid_argument(fmt::format("free rotation: inertia {} is not in (0, inf)", value_of(x)));
  for (const S* x : {&start.attitude.w, &start.attitude.x, &start.attitude.y, &start.attitude.z,
                     &start.omega[0], &start.omega[1], &start.omega[2]})
    if (!std::isfinite(value_of(*x)))
      throw std::invalid_argument("free rotation: a component of the start is not finite");
  if (value_of(start.attitude.w) == 0 && value_of(start.attitude.x) == 0 && value_of(start.attitude.y) == 0 &&
      value_of(start.attitude.z) == 0)
    throw std::invalid_argument("free rotation: the attitude is the zero quaternion");
  for (const double t : times)
    if (!(t >= 0 && std::isfinite(t)))
      throw std::invalid_argument(fmt::format("free rotation: time {} s is not in [0, inf)", t));
}

bool is_zero(double x) { return x == 0; }
bool is_zero(const Dual& x) { return x.a == 0 && x.v.isZero(); }

}  // namespace

template <class S>
std::vector<RotationState<S>> rotate_freely(const Vec3<S>& inertia, const RotationState<S>& start,
                                            const std::vector<double>& times,
                                            const dynamics::IntegratorOptions& options) {
  validate(inertia, start, times);
  const Quaternion<S> attitude = normalised(start.attitude);
  std::vector<RotationState<S>> out;
  out.reserve(times.size());
  // A difference of zero may still carry a derivative; then the closed form would lose it.
  if (is_zero(S(inertia[0] - inertia[1])) && is_zero(S(inertia[1] - inertia[2]))) {
    for (const double t : times) out.push_back({attitude * exp(scaled(S(t), start.omega)), start.omega});
    return out;
  }
  const double last = times.empty() ? 0 : *std::max_element(times.begin(), times.end());
  dynamics::IntegratorOptions recorded = options;
  recorded.record = true;
  recorded.longest_step =
      std::max(options.longest_step, last);  // no guards: the error alone chooses the step
  const State<S, 7> y{S(1), S(0), S(0), S(0), start.omega[0], start.omega[1], start.omega[2]};
  const auto solution =
      dynamics::integrate<S, 7>(Turning<S>(inertia), Entry<S, 7>{0, S(0), y, S(0)}, S(last), recorded);
  if (solution.outcome != dynamics::Outcome::horizon)
    throw std::runtime_error(fmt::format("free rotation: not solved ({})", to_string(solution.outcome)));
  for (const double t : times) {
    const State<S, 7> at = t > 0 ? solution.trajectory.at(S(t)) : y;
    out.push_back({attitude * normalised(Quaternion<S>{at[0], at[1], at[2], at[3]}), {at[4], at[5], at[6]}});
  }
  return out;
}

template std::vector<RotationState<double>> rotate_freely(const Vec3<double>&, const RotationState<double>&,
                                                          const std::vector<double>&,
                                                          const dynamics::IntegratorOptions&);
template std::vector<RotationState<Dual>> rotate_freely(const Vec3<Dual>&, const RotationState<Dual>&,
                                                        const std::vector<double>&,
                                                        const dynamics::IntegratorOptions&);

}  // namespace unhand::flight
