// The event-detected integrator of hybrid systems.
#pragma once

#include <vector>

#include "dynamics/hybrid_system.hpp"
#include "dynamics/stepper.hpp"
#include "dynamics/trajectory.hpp"

namespace unhand::dynamics {

/// Tolerances and budgets of an integration.
struct IntegratorOptions {
  Method method{Method::automatic};  ///< `automatic` unless methods are compared
  /// Of the local error of the values. With Dual the derivatives are those of the steps that the values ask
  /// for, so their error is not controlled; it falls with the tolerance (release/simulate_release.hpp has
  /// measured ones).
  Tolerances tolerances;
  /// Guards are sampled at least every third of this [s], and through the cubic in between: two roots closer
  /// than a third of it may be missed, or than about a ninth where the guard is nearly a cubic.
  double guard_interval{5e-3};
  double longest_step{0.05};   ///< [s]; steps with guards are no longer than sixteen guard intervals
  long step_budget{200'000};   ///< steps in all, before the answer is `step_budget_spent`
  int event_budget{10'000};    ///< events in all, with which the answer is `event_budget_spent`
  int events_per_instant{24};  ///< mode changes without time passing, >= 2, with which it is `mode_cycle`
  /// Events accumulate at t∞: jump there when what is left of the state's change is below this (SI units).
  double zeno_tolerance{1e-7};
  bool record{false};  ///< keep the trajectory
};

/// Throws std::invalid_argument, naming the option, its value and the accepted range: tolerances finite, the
/// relative one not negative, the absolute one >= 1e-18; intervals > 0; budgets not negative;
/// events_per_instant >= 2.
void validate(const IntegratorOptions& options);

/// How an integration ended. Only the first two are answers; the rest say why there is none.
enum class Outcome {
  finished,            ///< a mode of kind `finished` was entered
  horizon,             ///< t_end was reached
  zeno,                ///< events accumulate at the returned time and the system knows no state there
  event_budget_spent,  ///< as many events as the options allow
  step_budget_spent,   ///< more steps than the options allow
  mode_cycle,          ///< no mode is consistent at the returned instant
  not_converged,       ///< the equations of a step were not solved
  step_too_small,      ///< the tolerances cannot be met above the spacing of representable times
  not_finite,          ///< a flow or a guard returned NaN or infinity
};
/// The outcome's name, as it is written above.
const char* to_string(Outcome);

/// Why an event happened.
enum class EventKind {
  guard,  ///< a guard passed zero
  time,   ///< data jump or kink at an instant known in advance
  limit,  ///< events accumulated here
};

/// One entry of the event log: what fired, when, and the mode and state right after.
template <class S, int N>
struct Event {
  EventKind kind{};                 ///< why it happened
  int index{};                      ///< the guard's or time event's index in the mode left
  int mode_before{}, mode_after{};  ///< indices of the modes
  S t{};                            ///< s; with Dual, its derivatives are those of the event's time
  State<S, N> y{};                  ///< the state right after
};

/// What an integration cost.
struct IntegratorStatistics {
  long steps{}, rejected_steps{}, flow_evaluations{};  ///< accepted; rejected; calls of the flow
  int grazings{};  ///< guards that came within tolerance of zero without passing it: derivatives there are
                   ///< one-sided
};

/// How an integration ended, where, and what happened on the way.
template <class S, int N>
struct Solution {
  Outcome outcome{};                ///< only `finished` and `horizon` are answers
  int mode{};                       ///< index of the last mode
  S t{};                            ///< s: where it ended
  State<S, N> y{};                  ///< the state there
  std::vector<Event<S, N>> events;  ///< in order of time
  Trajectory<S, N> trajectory;      ///< empty unless options.record
  IntegratorStatistics statistics;  ///< what it cost
};

/// Integrates from `start` to `t_end` [s] or to a finished mode.
///
/// Events fire once, on (t0, t1], at the earliest root; roots found on the dense output are polished with
/// true steps. Guards that fire together are handled in the order of their indices, each transition deciding
/// anew. A guard that is at zero when a phase begins is armed once it has been seen on its safe side. Time
/// events are stepped to exactly. Instantiated for N = 2, 6, 7 with double and Dual. Throws
/// std::invalid_argument when `start` is not finite, t_end lies before it, an option is none, or derivatives
/// are asked of a method that has none. N = 10 is there with double and smooth flows only.
template <class S, int N>
Solution<S, N> integrate(const HybridSystem<N>& system, const Entry<S, N>& start, const S& t_end,
                         const IntegratorOptions& options = {});

}  // namespace unhand::dynamics
