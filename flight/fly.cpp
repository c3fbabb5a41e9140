#include "flight/fly.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dynamics/require_finite.hpp"
#include "dynamics/smooth_flow.hpp"
#include "flight/aerodynamics.hpp"

namespace unhand::flight {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Entry;
using dynamics::Phase;
using dynamics::Pose;
using dynamics::State;
using dynamics::value_of;
using dynamics::Vec2;

const char* to_string(FlightOutcome outcome) {
  constexpr const char* kNames[] = {"landed", "never_reaches", "not_solved"};
  return kNames[static_cast<int>(outcome)];
}

const char* in_words(FlightOutcome outcome) {
  constexpr const char* kWords[] = {"the object lands",
                                    "the object never comes down through the landing height",
                                    "the simulation of the flight stopped before the landing"};
  return kWords[static_cast<int>(outcome)];
}

namespace {

constexpr int kBelow = 0, kAbove = 1, kLanded = 2;

template <class S>
Landing<S> tracked_point(const Landing<S>& com, const Vec2<S>& offset) {
  const Vec2<S> d = dynamics::rotate(com.pose.theta, offset), swing = com.twist.omega * dynamics::perp(d);
  return {com.flight_time,
          {com.pose.x + d.x, com.pose.z + d.z, com.pose.theta},
          {com.twist.vx + swing.x, com.twist.vz + swing.z, com.twist.omega}};
}

/// State: pose and twist of the CoM. Below the landing height the guard is that the tracked point rises
/// through it, above that it falls through it. With the second alone, a short visit above the height would go
/// unseen: a guard waits until it is sampled on its safe side, while one that is armed is also searched for
/// between samples.
template <class P>
class Flying final : public dynamics::HybridSystemFrom<Flying<P>, 6> {
 public:
  Flying(const FlightProblem<P>& problem, bool lands) : problem_(problem), lands_(lands) {}
  dynamics::FlowKind kind(int mode) const override {
    return mode == kLanded ? dynamics::FlowKind::finished : dynamics::FlowKind::smooth;
  }
  std::string_view mode_name(int mode) const override {
    return mode == kLanded ? "landed" : mode == kAbove ? "above" : "below";
  }
  int guard_count(int) const override { return lands_ ? 1 : 0; }
  dynamics::Guard guard(int mode, int) const override {
    return {"landing height", mode == kAbove ? dynamics::Crossing::falling : dynamics::Crossing::rising};
  }
  /// θ grows linearly, so the error allows steps of several turns: the tracked point's swing must be sampled
  /// finer.
  double max_step(const Phase&, double, const State<double, 6>& y) const override {
    const bool swings = lands_ && (value_of(problem_.tracked.x) != 0 || value_of(problem_.tracked.z) != 0);
    return swings && y[5] != 0 ? 1.0 / std::abs(y[5]) : std::numeric_limits<double>::infinity();
  }

  template <class S>
  void flow_(const Phase&, const S&, const State<S, 6>& y, State<S, 6>& dy) const {
    const Vec2<S> against_air{y[3] - convert<S>(problem_.wind.x), y[4] - convert<S>(problem_.wind.z)};
    const Vec2<S> drag = quadratic_drag(convert<S>(problem_.drag_k), against_air),
                  lift = magnus_lift(convert<S>(problem_.lift_km), y[5], against_air);
    dy = {y[3],
          y[4],
          y[5],
          drag.x + lift.x + convert<S>(problem_.gravity.x),
          drag.z + lift.z + convert<S>(problem_.gravity.z),
          S(0)};
  }
  template <class S>
  void guards_(const Phase&, const S&, const State<S, 6>& y, S* g) const {
    const Vec2<S> offset{convert<S>(problem_.tracked.x), convert<S>(problem_.tracked.z)};
    g[0] = y[1] + dynamics::rotate(y[2], offset).z - convert<S>(problem_.landing_height);
  }
  template <class S>
  Entry<S, 6> on_guard_(const Phase& from, int, const S& t, const State<S, 6>& y) const {
    return {from.mode == kBelow ? kAbove : kLanded, t, y, S(0)};
  }

 private:
  const FlightProblem<P>& problem_;
  bool lands_;
};

template <class S>
void validate(const FlightProblem<S>& p) {
  dynamics::require_finite("flight", {{"pose x", value_of(p.pose.x), "m"},
                                      {"pose z", value_of(p.pose.z), "m"},
                                      {"pose theta", value_of(p.pose.theta), "rad"},
                                      {"twist vx", value_of(p.twist.vx), "m/s"},
                                      {"twist vz", value_of(p.twist.vz), "m/s"},
                                      {"twist omega", value_of(p.twist.omega), "rad/s"},
                                      {"gravity x", value_of(p.gravity.x), "m/s²"},
                                      {"gravity z", value_of(p.gravity.z), "m/s²"},
                                      {"landing_height", value_of(p.landing_height), "m"},
                                      {"tracked x", value_of(p.tracked.x), "m"},
                                      {"tracked z", value_of(p.tracked.z), "m"},
                                      {"lift_km", value_of(p.lift_km), ""},
                                      {"wind x", value_of(p.wind.x), "m/s"},
                                      {"wind z", value_of(p.wind.z), "m/s"}});
  if (!(value_of(p.drag_k) >= 0 && std::isfinite(value_of(p.drag_k))))
    throw std::invalid_argument(
        fmt::format("flight: drag_k = {} is not in [0, inf) 1/m", value_of(p.drag_k)));
  if (!(p.longest >= 0 && std::isfinite(p.longest)))
    throw std::invalid_argument(fmt::format("flight: longest = {} is not in [0, inf) s", p.longest));
}

template <class S>
State<S, 6> state_of(const FlightProblem<S>& p) {
  return {p.pose.x, p.pose.z, p.pose.theta, p.twist.vx, p.twist.vz, p.twist.omega};
}
template <class S>
Landing<S> landing_from(const S& t, const State<S, 6>& y, const Vec2<S>& tracked) {
  return tracked_point(Landing<S>{t, {y[0], y[1], y[2]}, {y[3], y[4], y[5]}}, tracked);
}

}  // namespace

template <class S>
bool is_ballistic(const FlightProblem<S>& p) {
  return dynamics::is_zero(p.drag_k) && dynamics::is_zero(p.lift_km);
}

template <class S>
FlightResult<S> fly(const FlightProblem<S>& problem, const dynamics::IntegratorOptions& options) {
  validate(problem);
  const bool centred = dynamics::is_zero(problem.tracked.x) && dynamics::is_zero(problem.tracked.z);
  if (centred && is_ballistic(problem)) {
    const auto landing = project(problem.pose, problem.twist, problem.gravity, problem.landing_height);
    if (!landing || value_of(landing->flight_time) > problem.longest)
      return {FlightOutcome::never_reaches, {}, {}};
    return {FlightOutcome::landed, dynamics::Outcome::finished, *landing};
  }
  const Flying<S> system(problem, true);
  dynamics::IntegratorOptions smooth = options;
  smooth.guard_interval =
      std::max(options.guard_interval, 0.05);  // the guard is a smooth height: no need for fine samples
  const Pose<S> start = tracked_point(Landing<S>{S(0), problem.pose, problem.twist}, problem.tracked).pose;
  const int mode = value_of(start.z) < value_of(problem.landing_height) ? kBelow : kAbove;
  const auto solution = dynamics::integrate<S, 6>(system, Entry<S, 6>{mode, S(0), state_of(problem), S(0)},
                                                  S(problem.longest), smooth);
  const FlightOutcome outcome = solution.outcome == dynamics::Outcome::finished ? FlightOutcome::landed
                                : solution.outcome == dynamics::Outcome::horizon
                                    ? FlightOutcome::never_reaches
                                    : FlightOutcome::not_solved;
  if (outcome != FlightOutcome::landed) return {outcome, solution.outcome, {}};
  return {outcome, solution.outcome, landing_from(solution.t, solution.y, problem.tracked)};
}

template <class S>
std::vector<Pose<S>> fly_through(const FlightProblem<S>& problem, const std::vector<double>& times,
                                 const dynamics::IntegratorOptions& options) {
  validate(problem);
  for (const double t : times)
    if (!(t >= 0 && std::isfinite(t)))
      throw std::invalid_argument(fmt::format("flight: time {} s is not in [0, inf) s after the state", t));
  std::vector<Pose<S>> out;
  out.reserve(times.size());
  if (is_ballistic(problem)) {
    for (const double t : times)
      out.push_back(
          tracked_point(ballistic(problem.pose, problem.twist, problem.gravity, S(t)), problem.tracked).pose);
    return out;
  }
  double last = 0;
  for (const double t : times) last = std::max(last, t);
  if (!(last > 0)) {
    for (std::size_t i = 0; i < times.size(); ++i)
      out.push_back(landing_from(S(0), state_of(problem), problem.tracked).pose);
    return out;
  }
  const RecordedFlight<S> flown = record_flight(problem, last, options);
  for (const double t : times)
    out.push_back(landing_from(S(t), flown.trajectory.at(S(t)), problem.tracked).pose);
  return out;
}

template <class S>
RecordedFlight<S> record_flight(const FlightProblem<S>& problem, double longest,
                                const dynamics::IntegratorOptions& options) {
  validate(problem);
  if (!(longest > 0 && std::isfinite(longest)))
    throw std::invalid_argument(fmt::format("flight: longest = {} is not in (0, inf) s", longest));
  auto flow =
      dynamics::integrate_flow<S, 6>(Flying<S>(problem, false), state_of(problem), longest, options, kAbove);
  if (flow.outcome != dynamics::Outcome::horizon)
    throw std::runtime_error(fmt::format("flight: not solved ({})", to_string(flow.outcome)));
  return {std::move(flow.trajectory)};
}

template bool is_ballistic(const FlightProblem<double>&);
template FlightResult<double> fly(const FlightProblem<double>&, const dynamics::IntegratorOptions&);
template RecordedFlight<double> record_flight(const FlightProblem<double>&, double,
                                              const dynamics::IntegratorOptions&);
template RecordedFlight<Dual> record_flight(const FlightProblem<Dual>&, double,
                                            const dynamics::IntegratorOptions&);
template bool is_ballistic(const FlightProblem<Dual>&);
template FlightResult<Dual> fly(const FlightProblem<Dual>&, const dynamics::IntegratorOptions&);
template std::vector<Pose<double>> fly_through(const FlightProblem<double>&, const std::vector<double>&,
                                               const dynamics::IntegratorOptions&);
template std::vector<Pose<Dual>> fly_through(const FlightProblem<Dual>&, const std::vector<double>&,
                                             const dynamics::IntegratorOptions&);

}  // namespace unhand::flight
