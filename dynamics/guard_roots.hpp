// Where a guard passes zero inside the last step.
#pragma once

#include "dynamics/guard_watch.hpp"

namespace unhand::dynamics {

/// A root of one guard inside the last step, between the fractions of the step on its safe and unsafe side
/// with the guard's values there; then the root itself on the dense output, with the guard's slope over the
/// fraction. A root without a slope is as good as it gets.
struct Bracket {
  int guard{-1};
  double safe{}, unsafe{};
  double at_safe{}, at_unsafe{};
  double root{}, slope{};
};

/// The search for roots: guards are sampled at the thirds of a step and through the cubic in between
/// (monotone ones at its end only), a root is bracketed on the dense output and polished with true steps.
/// Instantiated as `integrate` is.
template <class S, int N>
class GuardRoots {
 public:
  /// Guards that come within rounding of zero without passing it are counted in `grazings`.
  GuardRoots(const HybridSystem<N>& system, GuardWatch<S, N>& watch, int& grazings)
      : system_(system), watch_(watch), grazings_(grazings) {}

  /// The earliest root in the last step, if any, in `first`. False if a guard is not finite.
  bool find_first(Stepper<S, N>& stepper, bool first_step, Bracket& first);

  /// The root with true steps instead of the interpolant; with Dual, one Newton step carries the derivatives
  /// of the event's time: dt*/dp = −(g_y dy/dp + g_p)/(dg/dt).
  Entry<S, N> polish(Stepper<S, N>& stepper, const Bracket& bracket);

 private:
  using Samples = double[4][kMaxGuards];  // of every guard at the four nodes of a step

  bool sample(Stepper<S, N>& stepper, double theta, double* G);
  double sample_one(Stepper<S, N>& stepper, double theta, int guard);
  double slope_at(const Stepper<S, N>& stepper, double theta, int guard) const;
  bool touches(const Stepper<S, N>& stepper, const Samples& G, int guard, int node) const;
  bool shrink_to_first_excursion(Stepper<S, N>& stepper, Bracket& bracket);
  bool begin_of_rise(Stepper<S, N>& stepper, Bracket& bracket) const;
  bool find_hidden_peak(Stepper<S, N>& stepper, const Samples& G, double safe_from, bool known,
                        Bracket& bracket);
  void locate(Stepper<S, N>& stepper, Bracket& bracket);
  void add_root_derivative(int guard, Entry<S, N>& root) const;

  const HybridSystem<N>& system_;
  GuardWatch<S, N>& watch_;
  int& grazings_;
  bool first_step_{};
};

extern template class GuardRoots<double, 2>;
extern template class GuardRoots<double, 6>;
extern template class GuardRoots<double, 7>;
extern template class GuardRoots<Dual, 2>;
extern template class GuardRoots<Dual, 6>;
extern template class GuardRoots<Dual, 7>;

}  // namespace unhand::dynamics
