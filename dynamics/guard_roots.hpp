// Where a guard passes zero inside the last step.
#pragma once

#include "dynamics/guard_watch.hpp"

namespace unhand::dynamics {

/// A root of one guard in the stretch of the last step that is searched, between fractions of the stretch on
/// its safe and unsafe side with the guard's values there. `root` and `slope` are found on the dense output:
/// first in fractions of the stretch, in the answer of find_first in seconds since the step began. A root
/// without a slope is as good as it gets.
struct Bracket {
  int guard{-1};                  ///< its index; −1 for none
  double safe{}, unsafe{};        ///< ends of the bracket [-]
  double at_safe{}, at_unsafe{};  ///< the guard's signed values there, <= 0 and >= 0
  double root{}, slope{};         ///< where it passes zero, and its slope there, per unit of `root`
};

/// The search for roots. A step is searched in stretches no longer than the guard interval: guards are
/// sampled at the thirds of a stretch and through the cubic in between (monotone ones at the end of the step
/// only). Where steps are shorter than a third of the interval their ends are samples enough, as long as the
/// cubic through the last four of them stays well below zero. A root is bracketed on the dense output and
/// polished with true steps. Instantiated as `integrate` is.
template <class S, int N>
class GuardRoots {
 public:
  /// Guards that come within rounding of zero without passing it are counted in `grazings`.
  GuardRoots(const HybridSystem<N>& system, GuardWatch<S, N>& watch, double interval, int& grazings)
      : system_(system), watch_(watch), interval_(interval), grazings_(grazings) {}

  /// The earliest root in the last step, if any, in `first`. False if a guard is not finite.
  bool find_first(Stepper<S, N>& stepper, bool first_step, Bracket& first);

  /// The root with true steps instead of the interpolant; with Dual, one Newton step carries the derivatives
  /// of the event's time: dt*/dp = −(g_y dy/dp + g_p)/(dg/dt).
  Entry<S, N> polish(Stepper<S, N>& stepper, const Bracket& bracket);

 private:
  using Samples = double[4][kMaxGuards];  // of every guard at the four nodes of a stretch

  /// Where the last samples at the ends of stretches were taken, newest first.
  struct Past {
    int count{};
    double t[2]{};
    double G[2][kMaxGuards]{};
  };

  bool search(Stepper<S, N>& stepper, Bracket& first);
  bool is_quiet(const Samples& G, double t0, double t1) const;
  StepPoint<N> point(const Stepper<S, N>& stepper, double theta) const;
  bool sample(const Stepper<S, N>& stepper, double theta, double* G);
  double sample_one(const Stepper<S, N>& stepper, double theta, int guard);
  double slope_at(const Stepper<S, N>& stepper, double theta, int guard) const;
  bool touches(const Stepper<S, N>& stepper, const Samples& G, int guard, int node) const;
  bool shrink_to_first_excursion(const Stepper<S, N>& stepper, Bracket& bracket);
  bool begin_of_rise(const Stepper<S, N>& stepper, Bracket& bracket) const;
  bool find_hidden_peak(const Stepper<S, N>& stepper, const Samples& G, double safe_from, bool known,
                        Bracket& bracket);
  void locate(const Stepper<S, N>& stepper, Bracket& bracket);
  void add_root_derivative(int guard, Entry<S, N>& root) const;

  const HybridSystem<N>& system_;
  GuardWatch<S, N>& watch_;
  double interval_;
  int& grazings_;
  bool first_stretch_{};              // of a phase
  double from_{}, span_{}, whole_{};  // the stretch and the step, in the variable that the step is taken in
  double begin_{}, sampled_at_{};     // s: of the stretch, and the last sample's
  Past past_;
};

extern template class GuardRoots<double, 2>;
extern template class GuardRoots<double, 6>;
extern template class GuardRoots<double, 7>;
extern template class GuardRoots<Dual, 2>;
extern template class GuardRoots<Dual, 6>;
extern template class GuardRoots<Dual, 7>;

}  // namespace unhand::dynamics
