#include "dynamics/integrator.hpp"

#include <fmt/core.h>

#include <optional>
#include <stdexcept>

#include "dynamics/guard_roots.hpp"
#include "dynamics/steppers.hpp"
#include "dynamics/zeno.hpp"

namespace unhand::dynamics {

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::finished:
      return "finished";
    case Outcome::horizon:
      return "horizon";
    case Outcome::zeno:
      return "zeno";
    case Outcome::event_budget_spent:
      return "event_budget_spent";
    case Outcome::step_budget_spent:
      return "step_budget_spent";
    case Outcome::mode_cycle:
      return "mode_cycle";
    case Outcome::not_converged:
      return "not_converged";
    case Outcome::step_too_small:
      return "step_too_small";
    case Outcome::not_finite:
      return "not_finite";
  }
  return "";
}

namespace {

/// A phase shorter than this [s] is over: no tolerance can be met in so few spacings of times.
constexpr double kNoTime = 1e-12;

template <class S, int N>
class Run {
 public:
  Run(const HybridSystem<N>& system, const IntegratorOptions& options)
      : system_(system),
        options_(options),
        steppers_(options),
        watch_(system, options.method),
        roots_(system, watch_, options.guard_interval, solution_.statistics.grazings) {}

  Solution<S, N> operator()(const Entry<S, N>& start, const S& t_end) {
    solution_.events.reserve(32);
    begin_windows(start, t_end);
    record_lead(start, window_);
    Entry<S, N> entry = start;
    phase_.mode = kNoMode;
    for (;;) {
      if (!finite(entry)) return end(Outcome::not_finite, entry);
      if (system_.kind(entry.mode) == FlowKind::finished) return end(Outcome::finished, entry);
      const Departure departure = run_phase(entry);
      if (departure.outcome) return end(*departure.outcome, departure.at);
      entry = departure.at;
    }
  }

 private:
  static constexpr int kNoMode = std::numeric_limits<int>::min();
  struct Departure {
    Entry<S, N> at;
    std::optional<Outcome> outcome;
  };

  // ---------------------------------------------------------------- windows between time events

  void begin_windows(const Entry<S, N>& start, const S& t_end) {
    system_.time_events(times_);
    const double t = value_of(start.t) - value_of(start.lead);
    skipped_ = static_cast<int>(
        std::count_if(times_.begin(), times_.end(), [&](const S& x) { return value_of(x) <= t; }));
    std::erase_if(times_, [&](const S& x) { return !(value_of(x) > t) || value_of(x) >= value_of(t_end); });
    times_.push_back(t_end);
    window_ = {t, value_of(times_.front())};
  }

  const S& window_end() const { return times_[next_time_]; }
  bool last_window() const { return next_time_ + 1 == times_.size(); }

  Departure leave_window(int mode, const State<S, N>& y) {
    const S t = window_end();
    if (last_window()) return {{mode, t, y, S(0)}, Outcome::horizon};
    const int index = skipped_ + static_cast<int>(next_time_);
    ++next_time_;
    window_ = {value_of(t), value_of(window_end())};
    Departure departure{within_window(system_.on_time(mode, window_, t, y)), {}};
    record_lead(departure.at, window_);
    log(EventKind::time, index, mode, departure.at);
    return departure;
  }

  /// The state at the window's end of an entry as good as there, by the flow in force in between: an entry's
  /// time may also move otherwise with the parameters.
  State<S, N> at_window_end(const Entry<S, N>& entry) const {
    State<S, N> y = entry.y;
    const S ahead = window_end() - entry.t;
    const FlowKind kind = system_.kind(entry.mode);
    if (is_zero(ahead) || kind == FlowKind::frozen || kind == FlowKind::finished) return y;
    State<double, N> rate;
    system_.flow({entry.mode, window_}, value_of(entry.t), values<S, N>(y), rate);
    for (int i = 0; i < N; ++i) y[i] += rate[i] * ahead;
    return y;
  }

  /// What a transition follows in closed form ends with the window: a slip may stop just beyond.
  Entry<S, N> within_window(Entry<S, N> entry) const {
    const S beyond = entry.t - window_end();
    if (!(value_of(beyond) > 0)) return entry;
    entry.y = at_window_end(entry);
    entry.t = window_end();
    if (value_of(entry.lead) > 0) entry.lead -= beyond;
    return entry;
  }

  // ---------------------------------------------------------------- one phase

  Departure run_phase(const Entry<S, N>& entry) {
    const bool same_mode = entry.mode == phase_.mode;
    const bool goes_on = same_mode && phase_.window.end == window_.begin && value_of(entry.lead) == 0;
    if (!same_mode) watch_.fired = watch_.kNone;
    phase_ = {entry.mode, window_};
    watch_.enter(phase_);

    const double t = value_of(entry.t);
    if (!(window_.end - t > std::max(shortest_step(t), kNoTime))) {
      const State<S, N> y = at_window_end(entry);
      record_straight(phase_, entry.t, entry.y, window_end(), y);
      return leave_window(entry.mode, y);
    }

    const int immediate = watch_.arm(entry, same_mode);
    if (immediate == watch_.kNotFinite) return {entry, Outcome::not_finite};
    if (immediate >= 0) return transition(immediate, entry.t, entry.y);

    Stepper<S, N>& stepper = steppers_.of(system_.kind(entry.mode), system_.is_paced(entry.mode));
    if (goes_on) stepper.goes_on();
    stepper.start(system_, phase_, entry.t, entry.y);
    for (bool first_step = true;;) {
      if (++solution_.statistics.steps > options_.step_budget)
        return {{entry.mode, stepper.t1(), stepper.y1(), S(0)}, Outcome::step_budget_spent};
      const StepStatus status = stepper.step(window_end(), longest_step(stepper));
      if (status != StepStatus::accepted)
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)},
                status == StepStatus::too_small ? Outcome::step_too_small : Outcome::not_finite};
      // A guess at a first step that is below the spacing of times: the next ones grow fivefold.
      if (!(value_of(stepper.t1()) > value_of(stepper.t0()))) continue;
      Bracket first;
      if (watch_.count > 0 && !roots_.find_first(stepper, first_step, first))
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)}, Outcome::not_finite};
      if (first.guard >= 0) {
        const Entry<S, N> root = roots_.polish(stepper, first);
        record(stepper, root.t);
        return transition(first.guard, root.t, root.y);
      }
      record(stepper, stepper.t1());
      if (!(value_of(window_end()) - value_of(stepper.t1()) > shortest_step(value_of(stepper.t1()))))
        return leave_window(entry.mode, stepper.y1());
      first_step = false;
    }
  }

  double longest_step(const Stepper<S, N>& stepper) const {
    double longest = options_.longest_step;
    if (watch_.count > 0 && !watch_.monotone)
      longest = std::min(longest, (options_.method == Method::cvode ? 1 : 16) * options_.guard_interval);
    if (system_.kind(phase_.mode) == FlowKind::frozen || system_.is_paced(phase_.mode)) return longest;
    const double t = value_of(stepper.t1());
    return std::min(
        {longest, system_.max_step(phase_, t, values<S, N>(stepper.y1())), watch_.longest_step(t)});
  }

  Departure transition(int guard, const S& t, const State<S, N>& y) {
    Departure departure{within_window(system_.on_guard(phase_, guard, t, y)), {}};
    record_straight(phase_, t, y, departure.at.t - departure.at.lead, departure.at.event_state());
    record_lead(departure.at, window_);
    watch_.fired = guard;
    log(EventKind::guard, guard, phase_.mode, departure.at);
    if (static_cast<int>(solution_.events.size()) >= options_.event_budget)
      departure.outcome = Outcome::event_budget_spent;
    else if (stuck_at_instant(solution_.events, options_.events_per_instant))
      departure.outcome = Outcome::mode_cycle;
    else
      leave_zeno(guard, departure);
    return departure;
  }

  /// Where events accumulate: into the system's state there, or to the outcome `zeno` if it knows none.
  void leave_zeno(int guard, Departure& departure) {
    const auto left =
        time_to_accumulation(solution_.events, value_of(departure.at.t), options_.zeno_tolerance);
    if (!left) return;
    const S limit = departure.at.t + *left;
    if (value_of(limit) >= window_.end) return;
    if (!system_.has_limit(departure.at.mode, guard)) {
      departure.outcome = Outcome::zeno;
      departure.at.t = limit;
      return;
    }
    const int before = departure.at.mode;
    departure = Departure{system_.at_limit({before, window_}, limit, departure.at.y), {}};
    log(EventKind::limit, guard, before, departure.at);
  }

  // ---------------------------------------------------------------- log and end

  void log(EventKind kind, int index, int before, const Entry<S, N>& after) {
    solution_.events.push_back(
        {kind, index, before, after.mode, S(after.t - after.lead), after.event_state()});
  }

  /// Where a step was not taken in time its dense output is no polynomial of time: then in parts.
  void record(const Stepper<S, N>& stepper, const S& until) {
    if (!options_.record) return;
    const double t0 = value_of(stepper.t0()), length = value_of(stepper.t1()) - t0;
    const double end = length > 0 ? (value_of(until) - t0) / length : 0.0;
    const int parts = system_.is_paced(phase_.mode) ? stepper.parts() : 1;
    const double whole = parts > 1 ? stepper.fraction(end * length) : 0;
    // The nodes lie at fixed fractions of the step: their times have the derivatives of the step, not of
    // `until`.
    const auto time = [&](double fraction) {
      S t = fraction < end ? S(t0 + fraction * length) : until;
      if constexpr (!std::is_same_v<S, double>)
        t.v = (stepper.t0() + fraction * (stepper.t1() - stepper.t0())).v;
      return t;
    };
    double from = 0;
    for (int part = 1; part <= parts; ++part) {
      const double to = part < parts ? (stepper.point(whole * part / parts).t - t0) / length : end;
      TrajectoryPiece<S, N> piece{time(from), time(to), phase_, {}};
      for (int k = 0; k < piece.kNodes; ++k)
        stepper.interpolate(from + k * (to - from) / (piece.kNodes - 1), piece.nodes[k]);
      solution_.trajectory.pieces.push_back(piece);
      from = to;
    }
  }

  /// The first instants of an entry, or the last ones before an event, that a transition knew in closed form.
  void record_straight(const Phase& phase, const S& t0, const State<S, N>& y0, const S& t1,
                       const State<S, N>& y1) {
    if (!options_.record || !(value_of(t1) > value_of(t0))) return;
    TrajectoryPiece<S, N> piece{t0, t1, phase, {}};
    for (int k = 0; k < piece.kNodes; ++k)
      for (int i = 0; i < N; ++i)
        piece.nodes[k][i] = y0[i] + static_cast<double>(k) / (piece.kNodes - 1) * (y1[i] - y0[i]);
    solution_.trajectory.pieces.push_back(piece);
  }
  void record_lead(const Entry<S, N>& entry, const Window& window) {
    record_straight({entry.mode, window}, entry.t - entry.lead, entry.event_state(), entry.t, entry.y);
  }

  static bool finite(const Entry<S, N>& entry) {
    bool ok = std::isfinite(value_of(entry.t));
    for (int i = 0; i < N; ++i) ok = ok && std::isfinite(value_of(entry.y[i]));
    return ok;
  }

  Solution<S, N> end(Outcome outcome, const Entry<S, N>& at) {
    solution_.outcome = outcome;
    solution_.mode = at.mode;
    solution_.t = at.t;
    solution_.y = at.y;
    steppers_.count(solution_.statistics);
    return std::move(solution_);
  }

  const HybridSystem<N>& system_;
  const IntegratorOptions& options_;
  Steppers<S, N> steppers_;
  Solution<S, N> solution_;
  GuardWatch<S, N> watch_;
  GuardRoots<S, N> roots_;
  std::vector<S> times_;
  std::size_t next_time_{};
  int skipped_{};  // time events before the start
  Window window_;
  Phase phase_;
};

/// With none, a component that is zero has no scale: 0/0.
constexpr double kLeastAbsolute = 1e-18;

}  // namespace

void validate(const IntegratorOptions& o) {
  const auto require = [](bool right, const char* name, double value, const char* accepted) {
    if (!right)
      throw std::invalid_argument(
          fmt::format("integrator options: {} = {} is not {}", name, value, accepted));
  };
  const auto& [relative, absolute] = o.tolerances;
  require(relative >= 0 && std::isfinite(relative), "relative tolerance", relative, "in [0, inf)");
  require(absolute >= kLeastAbsolute && std::isfinite(absolute), "absolute tolerance", absolute,
          "in [1e-18, inf)");
  require(o.guard_interval > 0, "guard_interval", o.guard_interval, "> 0 s");
  require(o.longest_step > 0, "longest_step", o.longest_step, "> 0 s");
  require(o.zeno_tolerance >= 0, "zeno_tolerance", o.zeno_tolerance, ">= 0");
  require(o.step_budget >= 0, "step_budget", static_cast<double>(o.step_budget), ">= 0");
  require(o.event_budget >= 0, "event_budget", o.event_budget, ">= 0");
  require(o.events_per_instant >= 2, "events_per_instant", o.events_per_instant, ">= 2");
}

template <class S, int N>
Solution<S, N> integrate(const HybridSystem<N>& system, const Entry<S, N>& start, const S& t_end,
                         const IntegratorOptions& options) {
  validate(options);
  if (!std::isfinite(value_of(start.t)) || !std::isfinite(value_of(t_end)) ||
      value_of(t_end) < value_of(start.t))
    throw std::invalid_argument(
        fmt::format("integrate: t_end = {} s must be finite and not before the start, {} s", value_of(t_end),
                    value_of(start.t)));
  for (int i = 0; i < N; ++i)
    if (!std::isfinite(value_of(start.y[i])))
      throw std::invalid_argument(fmt::format("integrate: component {} of the start is not finite", i));
  return Run<S, N>(system, options)(start, t_end);
}

template Solution<double, 2> integrate(const HybridSystem<2>&, const Entry<double, 2>&, const double&,
                                       const IntegratorOptions&);
template Solution<double, 6> integrate(const HybridSystem<6>&, const Entry<double, 6>&, const double&,
                                       const IntegratorOptions&);
template Solution<double, 7> integrate(const HybridSystem<7>&, const Entry<double, 7>&, const double&,
                                       const IntegratorOptions&);
template Solution<double, 10> integrate(const HybridSystem<10>&, const Entry<double, 10>&, const double&,
                                        const IntegratorOptions&);
template Solution<Dual, 2> integrate(const HybridSystem<2>&, const Entry<Dual, 2>&, const Dual&,
                                     const IntegratorOptions&);
template Solution<Dual, 6> integrate(const HybridSystem<6>&, const Entry<Dual, 6>&, const Dual&,
                                     const IntegratorOptions&);
template Solution<Dual, 7> integrate(const HybridSystem<7>&, const Entry<Dual, 7>&, const Dual&,
                                     const IntegratorOptions&);

}  // namespace unhand::dynamics
