#include "flight/point_flight.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "flight/aerodynamics.hpp"

namespace unhand::flight {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Entry;
using dynamics::Phase;
using dynamics::State;
using dynamics::value_of;

namespace {

/// State: position and velocity.
template <class P>
class Falling final : public dynamics::HybridSystemFrom<Falling<P>, 6> {
 public:
  explicit Falling(const PointFlight<P>& flight) : flight_(flight) {}
  dynamics::FlowKind kind(int) const override { return dynamics::FlowKind::smooth; }
  std::string_view mode_name(int) const override { return "flying"; }
  int guard_count(int) const override { return 0; }
  dynamics::Guard guard(int, int) const override { return {}; }

  template <class S>
  void flow_(const Phase&, const S&, const State<S, 6>& y, State<S, 6>& dy) const {
    const Vec3<S> drag = quadratic_drag(convert<S>(flight_.drag_k), Vec3<S>{y[3], y[4], y[5]});
    for (int i = 0; i < 3; ++i) {
      dy[i] = y[3 + i];
      dy[3 + i] = drag[i] + convert<S>(flight_.gravity[i]);
    }
  }
  template <class S>
  void guards_(const Phase&, const S&, const State<S, 6>&, S*) const {}
  template <class S>
  Entry<S, 6> on_guard_(const Phase& from, int, const S& t, const State<S, 6>& y) const {
    return {from.mode, t, y, S(0)};
  }

 private:
  const PointFlight<P>& flight_;
};

template <class S>
void validate(const PointFlight<S>& f, const std::vector<double>& times) {
  for (const Vec3<S>* v : {&f.position, &f.velocity, &f.gravity})
    for (const S& x : *v)
      if (!std::isfinite(value_of(x))) throw std::invalid_argument("point flight: a component is not finite");
  if (!(value_of(f.drag_k) >= 0 && std::isfinite(value_of(f.drag_k))))
    throw std::invalid_argument(
        fmt::format("point flight: drag_k = {} is not in [0, inf) 1/m", value_of(f.drag_k)));
  for (const double t : times)
    if (!(t >= 0 && std::isfinite(t)))
      throw std::invalid_argument(fmt::format("point flight: time {} s is not in [0, inf)", t));
}

}  // namespace

template <class S>
std::vector<Vec3<S>> positions(const PointFlight<S>& flight, const std::vector<double>& times,
                               const dynamics::IntegratorOptions& options) {
  validate(flight, times);
  std::vector<Vec3<S>> out;
  out.reserve(times.size());
  const Vec3<S>&p = flight.position, &v = flight.velocity, &g = flight.gravity;
  if (is_zero(flight.drag_k)) {
    for (const double t : times) out.push_back(sum(p, scaled(S(t), sum(v, scaled(S(0.5 * t), g)))));
    return out;
  }
  const double last = times.empty() ? 0 : *std::max_element(times.begin(), times.end());
  dynamics::IntegratorOptions recorded = options;
  recorded.record = true;
  recorded.longest_step =
      std::max(options.longest_step, last);  // no guards: the error alone chooses the step
  const auto solution = dynamics::integrate<S, 6>(
      Falling<S>(flight), Entry<S, 6>{0, S(0), {p[0], p[1], p[2], v[0], v[1], v[2]}, S(0)}, S(last),
      recorded);
  if (solution.outcome != dynamics::Outcome::horizon)
    throw std::runtime_error(fmt::format("point flight: not solved ({})", to_string(solution.outcome)));
  for (const double t : times) {
    if (!(t > 0)) {
      out.push_back(p);
      continue;
    }
    const State<S, 6> at = solution.trajectory.at(S(t));
    out.push_back({at[0], at[1], at[2]});
  }
  return out;
}

template std::vector<Vec3<double>> positions(const PointFlight<double>&, const std::vector<double>&,
                                             const dynamics::IntegratorOptions&);
template std::vector<Vec3<Dual>> positions(const PointFlight<Dual>&, const std::vector<double>&,
                                           const dynamics::IntegratorOptions&);

}  // namespace unhand::flight
