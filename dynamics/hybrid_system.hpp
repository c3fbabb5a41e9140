// A hybrid dynamical system: modes with a flow each, guards that leave a mode, and what happens there.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::dynamics {

/// The state of a system with N components, SI units.
template <class S, int N>
using State = std::array<S, N>;

/// Local error per step: see HybridSystem::error_scale; the norm is the root mean square over the components.
struct Tolerances {
  double relative{1e-8};   ///< of the size of each component [-]
  double absolute{1e-10};  ///< in the unit of each component (m, rad, m/s, rad/s); >= 1e-18
};

/// What the flow of a mode asks of a stepper.
enum class FlowKind {
  frozen,    ///< the state does not change: y' = 0 exactly, and no stepper is needed
  smooth,    ///< not stiff: explicit Runge-Kutta
  stiff,     ///< fast contracting directions: an L-stable implicit stepper
  mixed,     ///< smooth as a rule and stiff at times: explicit until that shows
  finished,  ///< nothing is left to simulate: entering the mode ends the integration
};

/// Most guards that a mode may have.
inline constexpr int kMaxGuards = 8;

/// A guard g(t, y) fires where it passes zero in this direction, once, on (t0, t1].
enum class Crossing {
  rising,   ///< from below zero to above
  falling,  ///< from above zero to below
};

/// An event function of a mode: its name, its direction, and whether it can turn back.
struct Guard {
  std::string_view name;  ///< what the event log calls it; must outlive the system
  Crossing crossing{};    ///< the direction in which it fires
  bool monotone{
      false};  ///< passes zero at most once in a step, however long: sampled at the ends of steps only
};

/// A mode inside a window of smooth data.
struct Phase {
  int mode{};     ///< index of the mode
  Window window;  ///< the data in force
};

/// Where a phase begins: the mode with its state at t. Where the first instants after an event are known in
/// closed form, t lies `lead` after the event, and `at_event` is the state there.
template <class S, int N>
struct Entry {
  int mode{};              ///< index of the mode
  S t{};                   ///< s
  State<S, N> y{};         ///< state at t
  S lead{};                ///< s, >= 0; 0 where nothing is known in closed form
  State<S, N> at_event{};  ///< state at t − lead; only read where lead > 0

  /// The state at the event itself, t − lead.
  const State<S, N>& event_state() const { return value_of(lead) > 0 ? at_event : y; }
};

/// Everything the integrator knows of a system. One overload serves double and one Dual (virtual functions
/// cannot be templates); HybridSystemFrom writes both from one template.
template <int N>
class HybridSystem {
 public:
  virtual ~HybridSystem() = default;

  /// What the flow of a mode asks of a stepper.
  virtual FlowKind kind(int mode) const = 0;
  /// What the event log calls a mode.
  virtual std::string_view mode_name(int mode) const = 0;
  /// Guards of a mode, at most kMaxGuards.
  virtual int guard_count(int mode) const = 0;
  /// The descriptor of a guard; 0 <= index < guard_count(mode).
  virtual Guard guard(int mode, int index) const = 0;

  /// Instants [s], increasing, at which data jump or kink; the integrator steps exactly to each.
  virtual void time_events(std::vector<double>& out) const = 0;
  virtual void time_events(std::vector<Dual>& out) const = 0;

  /// dy/dt of the mode.
  virtual void flow(const Phase&, double t, const State<double, N>& y, State<double, N>& dy) const = 0;
  virtual void flow(const Phase&, const Dual& t, const State<Dual, N>& y, State<Dual, N>& dy) const = 0;

  /// The guards of the mode, `guard_count(mode)` values of order one.
  virtual void guards(const Phase&, double t, const State<double, N>& y, double* g) const = 0;
  virtual void guards(const Phase&, const Dual& t, const State<Dual, N>& y, Dual* g) const = 0;

  /// What happens when `guard` of `from` fires at t. The window is the one in force.
  virtual Entry<double, N> on_guard(const Phase& from, int guard, double t,
                                    const State<double, N>& y) const = 0;
  virtual Entry<Dual, N> on_guard(const Phase& from, int guard, const Dual& t,
                                  const State<Dual, N>& y) const = 0;

  /// What happens at a time event; `window` is the one that begins there.
  virtual Entry<double, N> on_time(int mode, const Window&, double t, const State<double, N>& y) const = 0;
  virtual Entry<Dual, N> on_time(int mode, const Window&, const Dual& t, const State<Dual, N>& y) const = 0;

  /// Whether events of this guard may accumulate in the mode, and at_limit() knows what comes then.
  virtual bool has_limit(int /*mode*/, int /*guard*/) const { return false; }
  /// The state at an accumulation point t [s] of events, whose last phase is `from`. Only asked for where
  /// has_limit() says so.
  virtual Entry<double, N> at_limit(const Phase& from, double t, const State<double, N>& y) const {
    return {from.mode, t, y, 0.0};
  }
  virtual Entry<Dual, N> at_limit(const Phase& from, const Dual& t, const State<Dual, N>& y) const {
    return {from.mode, t, y, Dual(0.0)};
  }

  /// Whether the flow of a mode depends on a part u of the state by its direction alone, and so is regular in
  /// a variable σ with dt/dσ = |u|; see paced_stepper.hpp and directed_stepper.hpp.
  virtual bool is_paced(int /*mode*/) const { return false; }
  /// |u| = √Σ (w y)²: weights w of the part u of the state, zero for the rest.
  virtual State<double, N> pace_weights() const { return {}; }

  /// The error that one step may make in each component of a state that goes from y0 to y1 (SI units):
  /// absolute + relative · size. Flows that are singular at a point may ask for errors relative to their
  /// distance.
  virtual void error_scale(const Phase&, const Tolerances& tolerances, const State<double, N>& y0,
                           const State<double, N>& y1, State<double, N>& scale) const {
    for (int i = 0; i < N; ++i)
      scale[i] = tolerances.absolute + tolerances.relative * std::max(std::abs(y0[i]), std::abs(y1[i]));
  }

  /// An upper bound [s] on the next step, for flows whose guards change faster than the flow itself.
  virtual double max_step(const Phase&, double /*t*/, const State<double, N>& /*y*/) const {
    return std::numeric_limits<double>::infinity();
  }
};

/// Writes both overloads of every function from the templates flow_, guards_, on_guard_, on_time_ of Derived.
/// `time_events_` has a default (none), as has at_limit_.
template <class Derived, int N>
class HybridSystemFrom : public HybridSystem<N> {
 public:
  void time_events(std::vector<double>& out) const override { self().time_events_(out); }
  void time_events(std::vector<Dual>& out) const override { self().time_events_(out); }
  void flow(const Phase& p, double t, const State<double, N>& y, State<double, N>& dy) const override {
    self().flow_(p, t, y, dy);
  }
  void flow(const Phase& p, const Dual& t, const State<Dual, N>& y, State<Dual, N>& dy) const override {
    self().flow_(p, t, y, dy);
  }
  void guards(const Phase& p, double t, const State<double, N>& y, double* g) const override {
    self().guards_(p, t, y, g);
  }
  void guards(const Phase& p, const Dual& t, const State<Dual, N>& y, Dual* g) const override {
    self().guards_(p, t, y, g);
  }
  Entry<double, N> on_guard(const Phase& p, int i, double t, const State<double, N>& y) const override {
    return self().on_guard_(p, i, t, y);
  }
  Entry<Dual, N> on_guard(const Phase& p, int i, const Dual& t, const State<Dual, N>& y) const override {
    return self().on_guard_(p, i, t, y);
  }
  Entry<double, N> on_time(int mode, const Window& w, double t, const State<double, N>& y) const override {
    return self().on_time_(mode, w, t, y);
  }
  Entry<Dual, N> on_time(int mode, const Window& w, const Dual& t, const State<Dual, N>& y) const override {
    return self().on_time_(mode, w, t, y);
  }
  Entry<double, N> at_limit(const Phase& p, double t, const State<double, N>& y) const override {
    return self().at_limit_(p, t, y);
  }
  Entry<Dual, N> at_limit(const Phase& p, const Dual& t, const State<Dual, N>& y) const override {
    return self().at_limit_(p, t, y);
  }

 protected:
  /// The default: no time events.
  template <class S>
  void time_events_(std::vector<S>& out) const {
    out.clear();
  }
  /// The default: mode and state go on unchanged across a time event.
  template <class S>
  Entry<S, N> on_time_(int mode, const Window&, const S& t, const State<S, N>& y) const {
    return {mode, t, y, S(0)};
  }
  /// The default, for systems without accumulation points: the state as it is.
  template <class S>
  Entry<S, N> at_limit_(const Phase& from, const S& t, const State<S, N>& y) const {
    return {from.mode, t, y, S(0)};
  }

 private:
  const Derived& self() const { return static_cast<const Derived&>(*this); }
};

}  // namespace unhand::dynamics
