#include "dynamics/integrator.hpp"

#include <fmt/core.h>

#include <memory>
#include <optional>
#include <stdexcept>

#include "dynamics/dormand_prince.hpp"
#include "dynamics/rosenbrock.hpp"
#include "dynamics/sdirk.hpp"

namespace unhand::dynamics {

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::finished: return "finished";
    case Outcome::horizon: return "horizon";
    case Outcome::zeno: return "zeno";
    case Outcome::event_budget_spent: return "event_budget_spent";
    case Outcome::step_budget_spent: return "step_budget_spent";
    case Outcome::mode_cycle: return "mode_cycle";
    case Outcome::step_too_small: return "step_too_small";
    case Outcome::not_finite: return "not_finite";
  }
  return "unknown";
}

namespace {

constexpr int kMaxGuards = 8;
constexpr int kLongestCycle = 4;  // mode changes in the longest periodic pattern that the Zeno test knows

/// y' = 0: nothing to integrate, steps only sample the guards.
template <class S, int N>
class Frozen final : public Stepper<S, N> {
 public:
  void start(const HybridSystem<N>&, const Phase&, const S& t, const State<S, N>& y) override {
    this->t1_ = t;
    this->y1_ = y;
  }
  StepStatus step(const S& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    const double left = value_of(limit) - value_of(this->t0_);
    this->t1_ = left <= longest * (1 + 1e-9) ? limit : S(this->t0_ + left / std::ceil(left / longest));
    return StepStatus::accepted;
  }
  void interpolate(double, State<S, N>& y) const override { y = this->y0_; }
  void retake(double, State<S, N>& y) override { y = this->y0_; }
};

/// The steppers of one integration, each made when first needed.
template <class S, int N>
class Steppers {
 public:
  explicit Steppers(const IntegratorOptions& options) : options_(options) {}

  Stepper<S, N>& of(FlowKind kind) {
    if (kind == FlowKind::frozen) return frozen_;
    switch (method(kind)) {
      case Method::cvode:
        if constexpr (std::is_same_v<S, double>) {
          auto& cvode = kind == FlowKind::stiff ? bdf_ : adams_;
          if (!cvode) cvode = make_cvode_stepper<N>(options_.tolerances, kind);
          return *cvode;
        }
        throw std::invalid_argument("integrate: method cvode has no derivatives; use automatic with Dual");
      case Method::rosenbrock:
        if constexpr (std::is_same_v<S, double>) {
          if (!rosenbrock_) rosenbrock_.emplace(options_.tolerances);
          return *rosenbrock_;
        }
        throw std::invalid_argument("integrate: method rosenbrock has no derivatives; use automatic with Dual");
      case Method::sdirk:
        if (!sdirk_) sdirk_.emplace(options_.tolerances);
        return *sdirk_;
      default:
        if (!explicit_) explicit_.emplace(options_.tolerances);
        return *explicit_;
    }
  }

  void count(IntegratorStatistics& statistics) const {
    auto add = [&](const auto& stepper) {
      if (!stepper) return;
      statistics.flow_evaluations += stepper->flow_evaluations();
      statistics.rejected_steps += stepper->rejected_steps();
    };
    add(explicit_);
    add(sdirk_);
    add(adams_);
    add(bdf_);
    if constexpr (std::is_same_v<S, double>) add(rosenbrock_);
  }

 private:
  Method method(FlowKind kind) const {
    if (options_.method != Method::automatic) return options_.method;
    if (kind == FlowKind::smooth) return Method::dormand_prince;
    return std::is_same_v<S, double> ? Method::rosenbrock : Method::sdirk;
  }

  const IntegratorOptions& options_;
  Frozen<S, N> frozen_;
  std::optional<DormandPrince<S, N>> explicit_;
  std::conditional_t<std::is_same_v<S, double>, std::optional<Rosenbrock<N>>, int> rosenbrock_{};
  std::optional<Sdirk<S, N>> sdirk_;
  std::unique_ptr<Stepper<S, N>> adams_, bdf_;
};

/// A root of one guard inside the last step: the fractions of the step on its safe and unsafe side.
struct Bracket {
  int guard{-1};
  double safe{}, unsafe{};
};

template <class S, int N>
class Run {
 public:
  Run(const HybridSystem<N>& system, const IntegratorOptions& options)
      : system_(system), options_(options), steppers_(options) {}

  Solution<S, N> operator()(const Entry<S, N>& start, const S& t_end) {
    solution_.events.reserve(32);
    begin_windows(start, t_end);
    Entry<S, N> entry = start;
    int fired = -1;  // the guard that led here by a transition of a mode to itself
    for (;;) {
      if (!finite(entry)) return end(Outcome::not_finite, entry);
      if (system_.kind(entry.mode) == FlowKind::finished) return end(Outcome::finished, entry);
      const Departure departure = run_phase(entry, fired);
      if (departure.outcome) return end(*departure.outcome, departure.at);
      entry = departure.at;
      fired = departure.self_transition_of;
    }
  }

 private:
  struct Departure {
    Entry<S, N> at;
    int self_transition_of{-1};
    std::optional<Outcome> outcome;
  };

  // ---------------------------------------------------------------- windows between time events

  void begin_windows(const Entry<S, N>& start, const S& t_end) {
    system_.time_events(times_);
    const double t = value_of(start.t);
    std::erase_if(times_, [&](const S& x) { return !(value_of(x) > t) || value_of(x) >= value_of(t_end); });
    times_.push_back(t_end);
    window_ = {t, value_of(times_.front())};
  }

  const S& window_end() const { return times_[next_time_]; }
  bool last_window() const { return next_time_ + 1 == times_.size(); }

  Departure leave_window(int mode, const State<S, N>& y) {
    const S t = window_end();
    if (last_window()) return {{mode, t, y, S(0)}, -1, Outcome::horizon};
    const int index = static_cast<int>(next_time_);
    ++next_time_;
    window_ = {value_of(t), value_of(window_end())};
    Departure departure{system_.on_time(mode, window_, t, y), -1, {}};
    record_lead(departure.at, y);
    log(EventKind::time, index, mode, departure.at);
    return departure;
  }

  // ---------------------------------------------------------------- one phase

  Departure run_phase(const Entry<S, N>& entry, int self_transition_of) {
    phase_ = {entry.mode, window_};
    guards_ = system_.guard_count(entry.mode);
    if (guards_ > kMaxGuards) throw std::logic_error("integrate: a mode has too many guards");
    for (int i = 0; i < guards_; ++i) sign_[i] = system_.guard(entry.mode, i).crossing == Crossing::rising ? 1 : -1;

    if (!(value_of(window_end()) - value_of(entry.t) > shortest_step(value_of(entry.t))))
      return leave_window(entry.mode, entry.y);

    const int immediate = arm(entry, self_transition_of);
    if (immediate == kNotFinite) return {entry, -1, Outcome::not_finite};
    if (immediate >= 0) return transition(immediate, entry.t, entry.y);

    Stepper<S, N>& stepper = steppers_.of(system_.kind(entry.mode));
    stepper.start(system_, phase_, entry.t, entry.y);
    for (;;) {
      if (++solution_.statistics.steps > options_.step_budget)
        return {{entry.mode, stepper.t1(), stepper.y1(), S(0)}, -1, Outcome::step_budget_spent};
      const StepStatus status = stepper.step(window_end(), longest_step(stepper));
      if (status != StepStatus::accepted)
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)}, -1,
                status == StepStatus::too_small ? Outcome::step_too_small : Outcome::not_finite};
      Bracket first;
      if (guards_ > 0 && !find_first_root(stepper, first))
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)}, -1, Outcome::not_finite};
      if (first.guard >= 0) {
        const Entry<S, N> root = polish(stepper, first);
        record(stepper, root.t);
        return transition(first.guard, root.t, root.y);
      }
      record(stepper, stepper.t1());
      if (!(value_of(window_end()) - value_of(stepper.t1()) > shortest_step(value_of(stepper.t1()))))
        return leave_window(entry.mode, stepper.y1());
    }
  }

  double longest_step(const Stepper<S, N>& stepper) const {
    if (system_.kind(phase_.mode) == FlowKind::frozen) return options_.longest_step;
    State<double, N> y;
    for (int i = 0; i < N; ++i) y[i] = value_of(stepper.y1()[i]);
    const double bound = system_.max_step(phase_, value_of(stepper.t1()), y);
    return std::min(options_.longest_step, bound);
  }

  Departure transition(int guard, const S& t, const State<S, N>& y) {
    Departure departure{system_.on_guard(phase_, guard, t, y), -1, {}};
    record_straight(phase_, t, y, departure.at.t - departure.at.lead, departure.at.y);
    record_lead(departure.at, y);
    if (departure.at.mode == phase_.mode) departure.self_transition_of = guard;
    log(EventKind::guard, guard, phase_.mode, departure.at);
    if (static_cast<int>(solution_.events.size()) >= options_.event_budget)
      departure.outcome = Outcome::event_budget_spent;
    else if (stuck_at_instant())
      departure.outcome = Outcome::mode_cycle;
    else
      leave_zeno(guard, departure);
    return departure;
  }

  // ---------------------------------------------------------------- guards

  static constexpr int kNotFinite = -2;
  static constexpr double kAtZero = 1e-9;  // s

  /// Signed so that every guard fires upwards: G < 0 is the safe side.
  bool evaluate(const S& t, const State<S, N>& y, double* G) const {
    if constexpr (std::is_same_v<S, double>) {
      system_.guards(phase_, t, y, G);
    } else {
      State<double, N> values;
      for (int i = 0; i < N; ++i) values[i] = value_of(y[i]);
      system_.guards(phase_, value_of(t), values, G);
    }
    bool all_finite = true;
    for (int i = 0; i < guards_; ++i) {
      all_finite = all_finite && std::isfinite(G[i]);
      G[i] *= sign_[i];
    }
    return all_finite;
  }

  /// Arms the guards at the start of a phase. One on its safe side is armed. One at zero (its crossing lies within
  /// kAtZero of now) is armed if it leaves for the safe side and fires at once, returning its index, if it goes on
  /// through, unless it has just fired. One on its unsafe side waits until it has been seen on the safe side.
  int arm(const Entry<S, N>& entry, int self_transition_of) {
    if (guards_ == 0) return -1;
    double G[kMaxGuards];
    if (!evaluate(entry.t, entry.y, G)) return kNotFinite;
    std::optional<std::array<double, kMaxGuards>> slope;
    for (int i = 0; i < guards_; ++i) {
      start_[i] = G[i];
      hidden_[i] = false;
      armed_[i] = G[i] < 0;
      if (armed_[i] && i != self_transition_of) continue;
      if (!slope) slope = guard_slopes(entry);
      const double rate = (*slope)[i];
      if (!std::isfinite(rate)) return kNotFinite;
      if (std::abs(G[i]) > kAtZero * std::abs(rate)) continue;
      armed_[i] = hidden_[i] = rate < 0;
      if (rate > 0 && i != self_transition_of) return i;
    }
    return -1;
  }

  /// dG/dt along the flow at the entry, exactly.
  std::array<double, kMaxGuards> guard_slopes(const Entry<S, N>& entry) const {
    State<double, N> y, dy{};
    for (int i = 0; i < N; ++i) y[i] = value_of(entry.y[i]);
    const double t = value_of(entry.t);
    if (system_.kind(phase_.mode) != FlowKind::frozen) system_.flow(phase_, t, y, dy);
    State<Dual, N> yd;
    for (int i = 0; i < N; ++i) {
      yd[i] = Dual(y[i]);
      yd[i].v[0] = dy[i];
    }
    Dual g[kMaxGuards];
    system_.guards(phase_, independent(t, 0), yd, g);
    std::array<double, kMaxGuards> slope{};
    for (int i = 0; i < guards_; ++i) slope[i] = sign_[i] * g[i].v[0];
    return slope;
  }

  /// The earliest root in the last step, if any, in `first`. False if a guard is not finite.
  bool find_first_root(Stepper<S, N>& stepper, Bracket& first) {
    constexpr double kNode[4] = {0, 1.0 / 3, 2.0 / 3, 1};
    double G[4][kMaxGuards];
    std::copy_n(start_, guards_, G[0]);
    for (int node = 1; node <= 3; ++node)
      if (!sample(stepper, kNode[node], G[node])) return false;
    std::copy_n(G[3], guards_, start_);

    double earliest = 2;
    for (int i = 0; i < guards_; ++i) {
      Bracket bracket{i, 0, 0};
      bool found = false;
      for (int node = 1; node <= 3 && !found; ++node) {
        if (G[node][i] < 0) {
          armed_[i] = true;
          hidden_[i] = false;
        } else if (armed_[i]) {
          bracket.safe = kNode[node - 1];
          bracket.unsafe = kNode[node];
          found = true;
          if (hidden_[i] && !shrink_to_first_excursion(stepper, bracket)) return false;
          hidden_[i] = false;
        }
      }
      if (!found && armed_[i] && G[0][i] < 0) found = find_hidden_peak(stepper, G, bracket);
      if (!found) continue;
      const double root = bisect(stepper, bracket);
      if (root < earliest) {
        earliest = root;
        first = bracket;
      }
    }
    return true;
  }

  bool sample(Stepper<S, N>& stepper, double theta, double* G) {
    State<S, N> y;
    if (theta >= 1) return evaluate(stepper.t1(), stepper.y1(), G);
    stepper.interpolate(theta, y);
    return evaluate(stepper.t0() + theta * (stepper.t1() - stepper.t0()), y, G);
  }
  double sample_one(Stepper<S, N>& stepper, double theta, int guard) {
    double G[kMaxGuards];
    sample(stepper, theta, G);
    return G[guard];
  }

  /// The guard began at zero towards its safe side and is unsafe at the first node: the excursion ended in between.
  bool shrink_to_first_excursion(Stepper<S, N>& stepper, Bracket& bracket) {
    double theta = bracket.unsafe;
    for (int k = 0; k < 200; ++k) {
      const double trial = 0.5 * theta;
      if (sample_one(stepper, trial, bracket.guard) < 0) {
        bracket.safe = trial;
        bracket.unsafe = theta;
        return true;
      }
      theta = trial;
    }
    bracket.safe = bracket.unsafe = 0;
    return true;
  }

  /// All nodes are safe; the cubic through them may still pass zero twice. `true` if the guard really does.
  bool find_hidden_peak(Stepper<S, N>& stepper, const double (*G)[kMaxGuards], Bracket& bracket) {
    const int i = bracket.guard;
    const double a = G[0][i], b = G[1][i], c = G[2][i], d = G[3][i];
    const double top = std::max({a, b, c, d}), bottom = std::min({a, b, c, d});
    if (top + 0.3 * (top - bottom) < 0) return false;
    // Newton's form on u = 3θ: a + u Δ1 + u(u−1)/2 Δ2 + u(u−1)(u−2)/6 Δ3; its derivative is a quadratic in u.
    const double d1 = b - a, d2 = c - 2 * b + a, d3 = d - 3 * c + 3 * b - a;
    const double q2 = 0.5 * d3, q1 = d2 - d3, q0 = d1 - 0.5 * d2 + d3 / 3;
    double roots[2];
    int count = 0;
    if (std::abs(q2) > 1e-14 * (std::abs(q1) + std::abs(q0))) {
      const double disc = q1 * q1 - 4 * q2 * q0;
      if (disc < 0) return false;
      const double r = -0.5 * (q1 + std::copysign(std::sqrt(disc), q1));
      roots[count++] = r / q2;
      if (r != 0) roots[count++] = q0 / r;
    } else if (q1 != 0) {
      roots[count++] = -q0 / q1;
    }
    std::sort(roots, roots + count);
    for (int k = 0; k < count; ++k) {
      if (!(roots[k] > 0 && roots[k] < 3) || q1 + 2 * q2 * roots[k] >= 0) continue;  // a maximum inside
      double left = roots[k] / 3, width = 1.0 / 12;
      double best = sample_one(stepper, left, i);
      for (int refine = 0; refine < 12 && best < 0; ++refine, width *= 0.5)  // climb to the true maximum
        for (const double trial : {left - width, left + width}) {
          if (trial <= 0 || trial >= 1) continue;
          const double value = sample_one(stepper, trial, i);
          if (value > best) { best = value; left = trial; break; }
        }
      if (best >= 0) {
        bracket.unsafe = left;
        bracket.safe = left > 2.0 / 3 ? 2.0 / 3 : left > 1.0 / 3 ? 1.0 / 3 : 0.0;
        return true;
      }
      if (best > -1e-6 * (top - bottom)) ++solution_.statistics.grazings;
    }
    return false;
  }

  /// Narrows the bracket on the dense output (Illinois' false position, safeguarded) and returns the root's fraction.
  double bisect(Stepper<S, N>& stepper, Bracket& bracket) {
    double a = bracket.safe, b = bracket.unsafe;
    double Ga = a > 0 ? sample_one(stepper, a, bracket.guard) : std::min(sample_one(stepper, a, bracket.guard), 0.0);
    double Gb = sample_one(stepper, b, bracket.guard);
    double wa = Ga, wb = Gb;
    for (int k = 0; k < 80 && b - a > 1e-9 * b && Gb > 0; ++k) {
      double m = (k % 6 == 5 || !(wa < 0)) ? 0.5 * (a + b) : (a * wb - b * wa) / (wb - wa);
      if (!(m > a && m < b)) m = 0.5 * (a + b);
      const double Gm = sample_one(stepper, m, bracket.guard);
      if (Gm < 0) {
        a = m;
        wa = Gm;
        wb *= 0.5;
      } else {
        b = m;
        Gb = wb = Gm;
        wa *= 0.5;
      }
    }
    bracket.safe = a;
    bracket.unsafe = b;
    return b;
  }

  /// The root with true steps instead of the interpolant; with Dual, one Newton step carries the derivatives of the
  /// event's time: dt*/dp = −(g_y dy/dp + g_p)/(dg/dt).
  Entry<S, N> polish(Stepper<S, N>& stepper, const Bracket& bracket) {
    const double t0 = value_of(stepper.t0()), length = value_of(stepper.t1()) - t0;
    double h = bracket.unsafe * length;
    State<S, N> y;
    double G[kMaxGuards];
    double slope = (sample_one(stepper, std::min(1.0, bracket.unsafe + 1e-3), bracket.guard) -
                    sample_one(stepper, std::max(0.0, bracket.unsafe - 1e-3), bracket.guard)) /
                   ((std::min(1.0, bracket.unsafe + 1e-3) - std::max(0.0, bracket.unsafe - 1e-3)) * length);
    double h_last = h, G_last = 0;
    for (int k = 0; k < 8; ++k) {
      stepper.retake(h, y);
      evaluate(stepper.t0() + h, y, G);
      const double now = G[bracket.guard];
      if (k > 0 && h != h_last && (now - G_last) / (h - h_last) > 0) slope = (now - G_last) / (h - h_last);
      if (!(slope > 0) || !std::isfinite(now)) break;
      const double move = std::clamp(-now / slope, -0.1 * length, 0.1 * length);
      const double next = std::clamp(h + move, 0.0, length);
      if (std::abs(next - h) <= 1e-14 + 4e-16 * std::abs(t0)) break;
      h_last = h;
      G_last = now;
      h = next;
    }
    stepper.retake(h, y);
    Entry<S, N> root{phase_.mode, S(stepper.t0() + h), y, S(0)};
    if constexpr (!std::is_same_v<S, double>) add_root_derivative(bracket.guard, root);
    return root;
  }

  void add_root_derivative(int guard, Entry<S, N>& root) const {
    S g[kMaxGuards];
    system_.guards(phase_, root.t, root.y, g);
    const double rate = sign_[guard] * guard_slopes(root)[guard];
    if (rate == 0) return;  // grazing: the event time has no derivative
    S shift = -g[guard] / rate;
    shift.a = 0;
    State<double, N> y, dy{};
    for (int i = 0; i < N; ++i) y[i] = value_of(root.y[i]);
    if (system_.kind(phase_.mode) != FlowKind::frozen) system_.flow(phase_, value_of(root.t), y, dy);
    root.t += shift;
    for (int i = 0; i < N; ++i) root.y[i] += dy[i] * shift;
  }

  // ---------------------------------------------------------------- too many events

  bool stuck_at_instant() const {
    const auto& events = solution_.events;
    const int n = static_cast<int>(events.size()), span = options_.events_per_instant;
    return n >= span && value_of(events[n - 1].t) - value_of(events[n - span].t) <=
                            shortest_step(value_of(events[n - 1].t));
  }

  /// A pattern of 1 to kLongestCycle guards that repeats in intervals shrinking by a stable ratio r accumulates at
  /// t + D r/(1 − r), D the last interval ([Johansson1999], [Heymann2005] on Zeno executions).
  void leave_zeno(int guard, Departure& departure) {
    const auto& events = solution_.events;
    const int n = static_cast<int>(events.size());
    for (int period = 1; period <= kLongestCycle && n > 4 * period; ++period) {
      if (!repeats(n, period)) continue;
      double D[4];
      for (int j = 0; j < 4; ++j)
        D[j] = value_of(events[n - 1 - j * period].t) - value_of(events[n - 1 - (j + 1) * period].t);
      const double t = value_of(departure.at.t);
      if (!(D[0] > shortest_step(t))) {
        departure.outcome = Outcome::zeno;
        return;
      }
      const double r = D[0] / D[1], r1 = D[1] / D[2], r2 = D[2] / D[3];
      const double noise = 1e-3 + 4 * shortest_step(t) / D[0];
      if (!(r < 1 - 1e-3) || std::abs(r - r1) > noise * r || std::abs(r1 - r2) > noise * r) continue;
      double left = 0;
      for (int i = 0; i < N; ++i)
        left = std::max(left, std::abs(value_of(events[n - 1].y[i] - events[n - 1 - period].y[i])) * r / (1 - r));
      if (left > options_.zeno_tolerance) continue;
      const S remaining = [&] {
        const S d0 = events[n - 1].t - events[n - 1 - period].t, d1 = events[n - 1 - period].t - events[n - 1 - 2 * period].t;
        const S ratio = d0 / d1;
        return S(d0 * ratio / (1.0 - ratio));
      }();
      const S limit = departure.at.t + remaining;
      if (value_of(limit) >= window_.end) return;
      if (!system_.has_limit(departure.at.mode, guard)) {
        departure.outcome = Outcome::zeno;
        departure.at.t = limit;
        return;
      }
      const int before = departure.at.mode;
      departure = Departure{system_.at_limit({before, window_}, limit, departure.at.y), -1, {}};
      log(EventKind::limit, guard, before, departure.at);
      return;
    }
  }

  bool repeats(int n, int period) const {
    const auto& events = solution_.events;
    for (int j = 0; j < 4 * period; ++j) {
      const auto& later = events[n - 1 - j];
      if (later.kind != EventKind::guard) return false;
      if (j >= period) continue;
      for (int k = 1; k < 4; ++k) {
        const auto& earlier = events[n - 1 - j - k * period];
        if (earlier.kind != EventKind::guard || earlier.index != later.index || earlier.mode_before != later.mode_before)
          return false;
      }
    }
    return true;
  }

  // ---------------------------------------------------------------- log and end

  void log(EventKind kind, int index, int before, const Entry<S, N>& after) {
    solution_.events.push_back({kind, index, before, after.mode, S(after.t - after.lead), after.y});
  }

  void record(const Stepper<S, N>& stepper, const S& until) {
    if (!options_.record) return;
    TrajectoryPiece<S, N> piece{stepper.t0(), until, phase_, {}};
    const double whole = value_of(stepper.t1()) - value_of(stepper.t0());
    const double part = whole > 0 ? (value_of(until) - value_of(stepper.t0())) / whole : 0.0;
    for (int k = 0; k < 5; ++k) stepper.interpolate(0.25 * k * part, piece.nodes[k]);
    solution_.trajectory.pieces.push_back(piece);
  }

  /// The first instants of an entry, or the last ones before an event, that a transition knew in closed form.
  void record_straight(const Phase& phase, const S& t0, const State<S, N>& y0, const S& t1, const State<S, N>& y1) {
    if (!options_.record || !(value_of(t1) > value_of(t0))) return;
    TrajectoryPiece<S, N> piece{t0, t1, phase, {}};
    for (int k = 0; k < 5; ++k)
      for (int i = 0; i < N; ++i) piece.nodes[k][i] = y0[i] + 0.25 * k * (y1[i] - y0[i]);
    solution_.trajectory.pieces.push_back(piece);
  }
  void record_lead(const Entry<S, N>& entry, const State<S, N>& before) {
    record_straight({entry.mode, window_}, entry.t - entry.lead, before, entry.t, entry.y);
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
  std::vector<S> times_;
  std::size_t next_time_{};
  Window window_;
  Phase phase_;
  int guards_{};
  double sign_[kMaxGuards]{}, start_[kMaxGuards]{};
  bool armed_[kMaxGuards]{}, hidden_[kMaxGuards]{};
};

}  // namespace

template <class S, int N>
Solution<S, N> integrate(const HybridSystem<N>& system, const Entry<S, N>& start, const S& t_end,
                         const IntegratorOptions& options) {
  if (!std::isfinite(value_of(start.t)) || !std::isfinite(value_of(t_end)) || value_of(t_end) < value_of(start.t))
    throw std::invalid_argument(fmt::format("integrate: t_end = {} s must be finite and not before the start, {} s",
                                            value_of(t_end), value_of(start.t)));
  for (int i = 0; i < N; ++i)
    if (!std::isfinite(value_of(start.y[i])))
      throw std::invalid_argument(fmt::format("integrate: component {} of the start is not finite", i));
  return Run<S, N>(system, options)(start, t_end);
}

template Solution<double, 2> integrate(const HybridSystem<2>&, const Entry<double, 2>&, const double&, const IntegratorOptions&);
template Solution<double, 6> integrate(const HybridSystem<6>&, const Entry<double, 6>&, const double&, const IntegratorOptions&);
template Solution<double, 7> integrate(const HybridSystem<7>&, const Entry<double, 7>&, const double&, const IntegratorOptions&);
template Solution<Dual, 2> integrate(const HybridSystem<2>&, const Entry<Dual, 2>&, const Dual&, const IntegratorOptions&);
template Solution<Dual, 6> integrate(const HybridSystem<6>&, const Entry<Dual, 6>&, const Dual&, const IntegratorOptions&);
template Solution<Dual, 7> integrate(const HybridSystem<7>&, const Entry<Dual, 7>&, const Dual&, const IntegratorOptions&);

}  // namespace unhand::dynamics
