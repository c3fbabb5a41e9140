#include "dynamics/integrator.hpp"

#include <fmt/core.h>

#include <memory>
#include <optional>
#include <stdexcept>

#include "dynamics/dormand_prince.hpp"
#include "dynamics/paced_stepper.hpp"
#include "dynamics/radau.hpp"
#include "dynamics/rosenbrock.hpp"

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
    case Outcome::step_too_small:
      return "step_too_small";
    case Outcome::not_finite:
      return "not_finite";
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

template <class S, int N>
std::unique_ptr<Stepper<S, N>> make_stepper(Method method, FlowKind kind, const Tolerances& tolerances) {
  if (method == Method::dormand_prince) return std::make_unique<DormandPrince<S, N>>(tolerances);
  if (method == Method::radau) return std::make_unique<Radau<S, N>>(tolerances);
  if constexpr (std::is_same_v<S, double>) {
    if (method == Method::rosenbrock) return std::make_unique<Rosenbrock<N>>(tolerances);
    return make_cvode_stepper<N>(tolerances, kind);
  }
  throw std::invalid_argument(
      "integrate: methods rosenbrock and cvode have no derivatives; use automatic with Dual");
}

/// The steppers of one integration, each made when first needed.
template <class S, int N>
class Steppers {
 public:
  explicit Steppers(const IntegratorOptions& options) : options_(options) {}

  Stepper<S, N>& of(FlowKind kind, bool paced) {
    if (kind == FlowKind::frozen) return frozen_;
    auto& stepper = made_[kind == FlowKind::stiff][paced];
    if (!stepper) {
      if constexpr (N + 2 <= kDualSize) {
        if (paced) {
          stepper = std::make_unique<PacedStepper<S, N>>(
              make_stepper<S, N + 1>(method(kind), kind, options_.tolerances));
          return *stepper;
        }
      }
      stepper = make_stepper<S, N>(method(kind), kind, options_.tolerances);
    }
    return *stepper;
  }

  void count(IntegratorStatistics& statistics) const {
    for (const auto& row : made_)
      for (const auto& stepper : row) {
        if (!stepper) continue;
        statistics.flow_evaluations += stepper->flow_evaluations();
        statistics.rejected_steps += stepper->rejected_steps();
      }
  }

 private:
  Method method(FlowKind kind) const {
    if (options_.method != Method::automatic) return options_.method;
    if (kind == FlowKind::smooth) return Method::dormand_prince;
    return std::is_same_v<S, double> ? Method::rosenbrock : Method::radau;
  }

  const IntegratorOptions& options_;
  Frozen<S, N> frozen_;
  std::unique_ptr<Stepper<S, N>> made_[2][2];  // by stiffness and pace
};

constexpr double kNode[4] = {0, 1.0 / 3, 2.0 / 3, 1};  // where guards are sampled in a step

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
  struct Departure {
    Entry<S, N> at;
    std::optional<Outcome> outcome;
  };

  // ---------------------------------------------------------------- windows between time events

  void begin_windows(const Entry<S, N>& start, const S& t_end) {
    system_.time_events(times_);
    const double t = value_of(start.t);
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
    Departure departure{system_.on_time(mode, window_, t, y), {}};
    record_lead(departure.at, y);
    log(EventKind::time, index, mode, departure.at);
    return departure;
  }

  // ---------------------------------------------------------------- one phase

  Departure run_phase(const Entry<S, N>& entry) {
    const bool same_mode = entry.mode == phase_.mode;
    if (!same_mode) fired_ = -1;
    phase_ = {entry.mode, window_};
    guards_ = system_.guard_count(entry.mode);
    if (guards_ > kMaxGuards) throw std::logic_error("integrate: a mode has too many guards");
    monotone_ = true;
    for (int i = 0; i < guards_; ++i) {
      const Guard guard = system_.guard(entry.mode, i);
      sign_[i] = guard.crossing == Crossing::rising ? 1 : -1;
      monotone_ = monotone_ && guard.monotone;
    }

    if (!(value_of(window_end()) - value_of(entry.t) > shortest_step(value_of(entry.t))))
      return leave_window(entry.mode, entry.y);

    const int immediate = arm(entry, same_mode);
    if (immediate == kNotFinite) return {entry, Outcome::not_finite};
    if (immediate >= 0) return transition(immediate, entry.t, entry.y);

    Stepper<S, N>& stepper = steppers_.of(system_.kind(entry.mode), system_.is_paced(entry.mode));
    stepper.start(system_, phase_, entry.t, entry.y);
    first_step_ = true;
    for (;; first_step_ = false) {
      if (++solution_.statistics.steps > options_.step_budget)
        return {{entry.mode, stepper.t1(), stepper.y1(), S(0)}, Outcome::step_budget_spent};
      const StepStatus status = stepper.step(window_end(), longest_step(stepper));
      if (status != StepStatus::accepted)
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)},
                status == StepStatus::too_small ? Outcome::step_too_small : Outcome::not_finite};
      Bracket first;
      if (guards_ > 0 && !find_first_root(stepper, first))
        return {{entry.mode, stepper.t0(), stepper.y0(), S(0)}, Outcome::not_finite};
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
    if (system_.kind(phase_.mode) == FlowKind::frozen || system_.is_paced(phase_.mode))
      return options_.longest_step;
    State<double, N> y;
    for (int i = 0; i < N; ++i) y[i] = value_of(stepper.y1()[i]);
    const double bound = system_.max_step(phase_, value_of(stepper.t1()), y);
    const bool returning = value_of(stepper.t1()) < short_until_;
    return std::min({options_.longest_step, bound, returning ? short_step_ : bound});
  }

  Departure transition(int guard, const S& t, const State<S, N>& y) {
    Departure departure{system_.on_guard(phase_, guard, t, y), {}};
    record_straight(phase_, t, y, departure.at.t - departure.at.lead, departure.at.y);
    record_lead(departure.at, y);
    fired_ = guard;
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

  static constexpr int kNotFinite = -2, kNoMode = std::numeric_limits<int>::min();
  static constexpr double kAtZero = 1e-9;     // s
  static constexpr double kRounding = 1e-13;  // of a guard of order one
  static constexpr double kNoRate = 1e-6;     // 1/s
  static constexpr double kGrazing =
      1e-6;  // of a guard's range over a step: a peak this close to zero only touches
  static constexpr double kTogether =
      4e-9;  // of a step: roots this close on the dense output are one instant

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

  /// Arms the guards at the start of a phase. One on its safe side is armed. One at zero (its crossing lies
  /// within kAtZero of now) is armed if it leaves for the safe side and fires at once, returning its index,
  /// if it goes on through, unless the mode is as before and it has not been safe since it last fired. One on
  /// its unsafe side waits until it has been seen on the safe side.
  int arm(const Entry<S, N>& entry, bool same_mode) {
    if (guards_ == 0) return -1;
    double G[kMaxGuards];
    if (!evaluate(entry.t, entry.y, G)) return kNotFinite;
    std::optional<std::array<double, kMaxGuards>> slope;
    int immediate = -1;
    short_until_ = short_step_ = std::numeric_limits<double>::infinity();
    for (int i = 0; i < guards_; ++i) {
      const bool spent = same_mode && (i == fired_ || !armed_[i]);
      start_[i] = G[i];
      hidden_[i] = false;
      armed_[i] = G[i] < 0;
      if (armed_[i] && !spent) continue;
      if (!slope) slope = guard_slopes(entry);
      const double rate = (*slope)[i];
      if (!std::isfinite(rate)) return kNotFinite;
      if (std::abs(G[i]) > kAtZero * std::abs(rate) + kRounding) continue;
      // A rate of nothing but rounding is how slip begins at a breakaway: there only the first step can tell.
      armed_[i] = hidden_[i] = rate < 0 || (!spent && rate <= kNoRate);
      if (rate < 0 && options_.method == Method::cvode) resolve_return(entry, i, rate);
      if (armed_[i] || spent) continue;
      armed_[i] = true;  // it fires now or, where a lower index comes first, next
      if (immediate < 0) immediate = i;
    }
    fired_ = -1;
    return immediate;
  }

  /// CVODE restarts with order one, and its interpolant errs by the absolute tolerance: a guard that returns
  /// sooner than that resolves needs short steps until it has. The return is judged by dG/dt and its rate.
  void resolve_return(const Entry<S, N>& entry, int guard, double rate) {
    constexpr double kAhead = 1e-7;  // s
    State<double, N> y, dy{};
    for (int i = 0; i < N; ++i) y[i] = value_of(entry.y[i]);
    const double t = value_of(entry.t);
    if (system_.kind(phase_.mode) == FlowKind::frozen) return;
    system_.flow(phase_, t, y, dy);
    Entry<S, N> ahead{entry.mode, S(t + kAhead), {}, S(0)};
    for (int i = 0; i < N; ++i) ahead.y[i] = S(y[i] + kAhead * dy[i]);
    const double bend = (guard_slopes(ahead)[guard] - rate) / kAhead;
    if (!(bend > 0)) return;
    const double back = -2 * rate / bend;
    short_step_ = std::min(short_step_, back / 50);
    short_until_ = t + 2 * back;
  }

  /// dG/dt along the flow at the entry, exactly.
  std::array<double, kMaxGuards> guard_slopes(const Entry<S, N>& entry) const {
    State<double, N> y, dy{};
    for (int i = 0; i < N; ++i) y[i] = value_of(entry.y[i]);
    const double t = value_of(entry.t);
    if (system_.kind(phase_.mode) != FlowKind::frozen) system_.flow(phase_, t, y, dy);
    State<Dual, N> yd;
    for (int i = 0; i < N; ++i) yd[i] = Dual(y[i]);
    Dual still[kMaxGuards], moving[kMaxGuards];
    // The parameters of the system may carry derivatives of their own: they must not be taken for those along
    // the flow.
    if constexpr (!std::is_same_v<S, double>) system_.guards(phase_, Dual(t), yd, still);
    for (int i = 0; i < N; ++i) yd[i].v[0] = dy[i];
    system_.guards(phase_, independent(t, 0), yd, moving);
    std::array<double, kMaxGuards> slope{};
    for (int i = 0; i < guards_; ++i) slope[i] = sign_[i] * (moving[i].v[0] - still[i].v[0]);
    return slope;
  }

  /// The earliest root in the last step, if any, in `first`. False if a guard is not finite.
  bool find_first_root(Stepper<S, N>& stepper, Bracket& first) {
    double G[4][kMaxGuards];
    std::copy_n(start_, guards_, G[0]);
    if (!sample(stepper, 1, G[3])) return false;
    bool quiet = monotone_;
    for (int i = 0; i < guards_; ++i) quiet = quiet && armed_[i] && !hidden_[i] && G[3][i] < 0;
    std::copy_n(G[3], guards_, start_);
    if (quiet) return true;
    for (int node = 1; node <= 2; ++node)
      if (!sample(stepper, kNode[node], G[node])) return false;

    double earliest = 2;
    bool armed_before[kMaxGuards];
    std::copy_n(armed_, guards_, armed_before);
    for (int i = 0; i < guards_; ++i) {
      Bracket bracket{i, 0, 0};
      bool found = false;
      double hidden_before = 0;  // the node by which a hidden excursion had ended
      double safe_from = armed_[i] && !hidden_[i] ? 0.0 : 1.0;
      for (int node = 1; node <= 3 && !found; ++node) {
        if (G[node][i] < 0) {
          safe_from = std::min(safe_from, kNode[node]);
          armed_[i] = true;
          hidden_[i] = false;
        } else if (armed_[i] && !(hidden_[i] && G[node][i] == 0)) {
          if (!hidden_[i] && touches(stepper, G, i, node)) continue;
          bracket.safe = kNode[node - 1];
          bracket.unsafe = kNode[node];
          if (hidden_[i]) {
            hidden_before = bracket.unsafe;
            if (!shrink_to_first_excursion(stepper, bracket)) continue;
          }
          found = true;
          hidden_[i] = false;
        }
      }
      if (armed_[i] && !hidden_[i]) found = find_hidden_peak(stepper, G, safe_from, found, bracket) || found;
      if (!found) continue;
      double root = bisect(stepper, bracket);
      if (hidden_before > 0 && !(slope_at(stepper, root, i) > 0)) {
        bracket.unsafe = hidden_before;
        if (!begin_of_rise(stepper, bracket)) continue;
        root = bracket.unsafe;
      }
      if (root < earliest * (1 - kTogether)) {
        earliest = root;
        first = bracket;
      }
    }
    if (first.guard >= 0)  // what the guards did after the root did not happen
      for (int i = 0; i < guards_; ++i) {
        armed_[i] = armed_before[i];
        for (int node = 1; node <= 3 && kNode[node] <= earliest; ++node)
          armed_[i] = armed_[i] || G[node][i] < 0;
      }
    return true;
  }

  /// Whether the guard is at zero at this node only because it turns back there; then the search for peaks
  /// judges it.
  bool touches(const Stepper<S, N>& stepper, const double (*G)[kMaxGuards], int guard, int node) const {
    const double range = range_of(G, guard);
    if (G[node][guard] > kGrazing * range || !(G[node - 1][guard] < 0)) return false;
    if (node < 3) return G[node + 1][guard] < 0;
    const double bend = G[3][guard] - 2 * G[2][guard] + G[1][guard];
    const double length = value_of(stepper.t1()) - value_of(stepper.t0());
    return bend < 0 &&
           guard_slopes({phase_.mode, stepper.t1(), stepper.y1(), S(0)})[guard] * length < 2e-3 * range;
  }

  static double range_of(const double (*G)[kMaxGuards], int i) {
    return std::max({G[0][i], G[1][i], G[2][i], G[3][i]}) - std::min({G[0][i], G[1][i], G[2][i], G[3][i]});
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

  /// The guard began at zero and is unsafe at a node: its excursion to the safe side, if any, ended in
  /// between. False if it has not set out yet: what an event leaves of a guard takes an instant to pass.
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
    return begin_of_rise(stepper, bracket);
  }

  /// There was no excursion, or one too small for the dense output: the root is where the guard rises from
  /// then on.
  bool begin_of_rise(Stepper<S, N>& stepper, Bracket& bracket) const {
    if (!(slope_at(stepper, bracket.unsafe, bracket.guard) > 0)) return false;
    for (int k = 0; k < 200 && slope_at(stepper, 0.5 * bracket.unsafe, bracket.guard) > 0; ++k)
      bracket.unsafe *= 0.5;
    bracket.safe = bracket.unsafe;
    return true;
  }

  double slope_at(const Stepper<S, N>& stepper, double theta, int guard) const {
    Entry<S, N> at{phase_.mode, S(stepper.t0() + theta * (stepper.t1() - stepper.t0())), {}, S(0)};
    stepper.interpolate(theta, at.y);
    return guard_slopes(at)[guard];
  }

  /// Between safe nodes the cubic through the four may still pass zero twice. `true`, with the bracket, if
  /// the guard really does after `safe_from` and, where a crossing is `known`, before that one.
  bool find_hidden_peak(Stepper<S, N>& stepper, const double (*G)[kMaxGuards], double safe_from, bool known,
                        Bracket& bracket) {
    const int i = bracket.guard;
    const double range = range_of(G, i);
    if (!(range > 0)) return false;
    const double a = G[0][i] / range, b = G[1][i] / range, c = G[2][i] / range, d = G[3][i] / range;
    if (std::max({a, b, c, d}) + 0.3 < 0) return false;
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
    // A peak at the joint of two steps belongs to the first of them.
    const double from = std::max(safe_from, first_step_ ? 0.0 : 1e-3), to = known ? bracket.safe : 1.001;
    for (int k = 0; k < count; ++k) {  // a cubic has one maximum
      if (!(roots[k] > 3 * from && roots[k] < 3 * to) || q1 + 2 * q2 * roots[k] >= 0) continue;
      double peak = std::min(roots[k] / 3, 1.0), width = 1.0 / 12;
      double best = sample_one(stepper, peak, i) / range;
      for (int refine = 0; refine < 12 && best <= kGrazing;
           ++refine, width *= 0.5)  // climb to the true maximum
        for (const double trial : {peak - width, peak + width}) {
          if (trial <= from || trial >= std::min(to, 1.0)) continue;
          const double value = sample_one(stepper, trial, i) / range;
          if (value > best) {
            best = value;
            peak = trial;
            break;
          }
        }
      if (best > kGrazing) {
        bracket.unsafe = peak;
        bracket.safe = from;
        for (int node = 1; node < 3; ++node)
          if (kNode[node] < peak && kNode[node] > from && G[node][i] < 0) bracket.safe = kNode[node];
        return true;
      }
      if (best > -kGrazing) ++solution_.statistics.grazings;
    }
    return false;
  }

  /// Narrows the bracket on the dense output (Illinois' false position, safeguarded) and returns the root's
  /// fraction.
  double bisect(Stepper<S, N>& stepper, Bracket& bracket) {
    double a = bracket.safe, b = bracket.unsafe;
    double Ga =
        a > 0 ? sample_one(stepper, a, bracket.guard) : std::min(sample_one(stepper, a, bracket.guard), 0.0);
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

  /// The root with true steps instead of the interpolant; with Dual, one Newton step carries the derivatives
  /// of the event's time: dt*/dp = −(g_y dy/dp + g_p)/(dg/dt).
  Entry<S, N> polish(Stepper<S, N>& stepper, const Bracket& bracket) {
    const double t0 = value_of(stepper.t0()), length = value_of(stepper.t1()) - t0;
    double h = bracket.unsafe * length;
    State<S, N> y;
    double G[kMaxGuards];
    double slope = (sample_one(stepper, std::min(1.0, bracket.unsafe + 1e-3), bracket.guard) -
                    sample_one(stepper, std::max(0.0, bracket.unsafe - 1e-3), bracket.guard)) /
                   ((std::min(1.0, bracket.unsafe + 1e-3) - std::max(0.0, bracket.unsafe - 1e-3)) * length);
    double h_last = h, G_last = 0, h_best = h, G_best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 8 && bracket.safe < bracket.unsafe; ++k) {
      retake(stepper, h, y);
      evaluate(stepper.t0() + h, y, G);
      const double now = G[bracket.guard];
      if (std::abs(now) < G_best) {
        G_best = std::abs(now);
        h_best = h;
      }
      if (k > 0 && h != h_last && (now - G_last) / (h - h_last) > 0) slope = (now - G_last) / (h - h_last);
      if (!(slope > 0) || !std::isfinite(now)) break;
      const double move = std::clamp(-now / slope, -0.1 * length, 0.1 * length);
      const double next = std::clamp(h + move, 0.0, length);
      if (std::abs(next - h) <= 1e-14 + 4e-16 * std::abs(t0)) break;
      h_last = h;
      G_last = now;
      h = next;
    }
    h = h_best;
    retake(stepper, h, y);
    Entry<S, N> root{phase_.mode, S(stepper.t0() + h), y, S(0)};
    if constexpr (!std::is_same_v<S, double>) add_root_derivative(bracket.guard, root);
    return root;
  }

  static void retake(Stepper<S, N>& stepper, double h, State<S, N>& y) {
    if (h > 0)
      stepper.retake(h, y);
    else
      y = stepper.y0();
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

  /// A pattern of 1 to kLongestCycle guards that repeats in intervals shrinking by a stable ratio r
  /// accumulates at t + D r/(1 − r), D the last interval ([Johansson1999], [Heymann2005] on Zeno executions).
  void leave_zeno(int guard, Departure& departure) {
    const auto& events = solution_.events;
    const int n = static_cast<int>(events.size());
    for (int period = 1; period <= kLongestCycle && n > 4 * period; ++period) {
      if (!repeats(n, period)) continue;
      double D[4];
      for (int j = 0; j < 4; ++j)
        D[j] = value_of(events[n - 1 - j * period].t) - value_of(events[n - 1 - (j + 1) * period].t);
      const double t = value_of(departure.at.t), resolved = shortest_step(t);
      if (!(D[0] > resolved)) continue;  // no time passes: a cycle of modes, if it goes on
      const double r = D[0] / D[1], r1 = D[1] / D[2], r2 = D[2] / D[3];
      // Intervals like k^−p have a ratio that drifts by (1 − r)²/p each time: that is not a geometric series.
      const double drift = 0.01 * (1 - r) * (1 - r) + 4 * resolved / D[0];
      if (!(r < 1 - 1e-3) || std::abs(r - r1) > drift || std::abs(r1 - r2) > drift) continue;
      double left = 0;
      for (int i = 0; i < N; ++i)
        left = std::max(left,
                        std::abs(value_of(events[n - 1].y[i] - events[n - 1 - period].y[i])) * r / (1 - r));
      if (left > options_.zeno_tolerance) continue;
      const S remaining = [&] {
        const S d0 = events[n - 1].t - events[n - 1 - period].t,
                d1 = events[n - 1 - period].t - events[n - 1 - 2 * period].t;
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
      departure = Departure{system_.at_limit({before, window_}, limit, departure.at.y), {}};
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
        if (earlier.kind != EventKind::guard || earlier.index != later.index ||
            earlier.mode_before != later.mode_before)
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
    const double whole = value_of(stepper.t1()) - value_of(stepper.t0());
    const double part = whole > 0 ? (value_of(until) - value_of(stepper.t0())) / whole : 0.0;
    // The nodes lie at fixed fractions of the step: their times have the derivatives of the step, not of
    // `until`.
    S last = until;
    if constexpr (!std::is_same_v<S, double>)
      last.v = (stepper.t0() + part * (stepper.t1() - stepper.t0())).v;
    TrajectoryPiece<S, N> piece{stepper.t0(), last, phase_, {}};
    for (int k = 0; k < 5; ++k) stepper.interpolate(0.25 * k * part, piece.nodes[k]);
    solution_.trajectory.pieces.push_back(piece);
  }

  /// The first instants of an entry, or the last ones before an event, that a transition knew in closed form.
  void record_straight(const Phase& phase, const S& t0, const State<S, N>& y0, const S& t1,
                       const State<S, N>& y1) {
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
  int skipped_{};  // time events before the start
  Window window_;
  Phase phase_;
  int guards_{};
  bool monotone_{};
  double sign_[kMaxGuards]{}, start_[kMaxGuards]{};
  bool armed_[kMaxGuards]{}, hidden_[kMaxGuards]{};  // hidden: began at zero, no node has told where it went
  int fired_{-1};                                    // the guard whose transition led to this phase
  bool first_step_{};
  double short_step_{}, short_until_{};
};

}  // namespace

template <class S, int N>
Solution<S, N> integrate(const HybridSystem<N>& system, const Entry<S, N>& start, const S& t_end,
                         const IntegratorOptions& options) {
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
template Solution<Dual, 2> integrate(const HybridSystem<2>&, const Entry<Dual, 2>&, const Dual&,
                                     const IntegratorOptions&);
template Solution<Dual, 6> integrate(const HybridSystem<6>&, const Entry<Dual, 6>&, const Dual&,
                                     const IntegratorOptions&);
template Solution<Dual, 7> integrate(const HybridSystem<7>&, const Entry<Dual, 7>&, const Dual&,
                                     const IntegratorOptions&);

}  // namespace unhand::dynamics
