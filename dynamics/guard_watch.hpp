// The guards of one phase: which of them are armed, their values, and their slopes along the flow.
#pragma once

#include <array>
#include <limits>

#include "dynamics/hybrid_system.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// What is known of the guards of the phase at hand. Values are signed so that every guard fires upwards:
/// below zero is the safe side. Instantiated as `integrate` is.
template <class S, int N>
class GuardWatch {
 public:
  /// The system is kept by reference; `method` says how finely guards must be sampled.
  GuardWatch(const HybridSystem<N>& system, Method method) : system_(system), method_(method) {}

  /// Begins the phase. Throws std::logic_error where a mode has more than kMaxGuards guards.
  void enter(const Phase&);

  /// Arms the guards at the start of a phase. One on its safe side is armed. One at zero (its crossing lies
  /// within kAtZero of now) is armed if it leaves for the safe side and fires at once, returning its index,
  /// if it goes on through, unless the mode is as before and it has not been safe since it last fired. One on
  /// its unsafe side waits until it has been seen on the safe side. kNone if none fires, kNotFinite if a
  /// guard is not finite.
  int arm(const Entry<S, N>& entry, bool same_mode);
  static constexpr int kNone = -1, kNotFinite = -2;  ///< answers of `arm` that are no index of a guard

  /// The signed values at (t, y); false if one is not finite.
  bool evaluate(double t, const State<double, N>& y, double* G) const;

  /// dG/dt along the flow at the entry, exactly.
  std::array<double, kMaxGuards> slopes(const Entry<S, N>& entry) const;

  /// The longest step [s] from t with which a guard's return to zero is not missed.
  double longest_step(double t) const;

  Phase phase;                                     ///< the phase at hand
  int count{};                                     ///< its guards, at most kMaxGuards
  bool monotone{};                                 ///< all of them: sampled at the ends of steps only
  std::array<double, kMaxGuards> sign{}, start{};  ///< start: the values where the next step begins
  std::array<bool, kMaxGuards> armed{}, hidden{};  ///< hidden: began at zero, no node has told where it went
  int fired{kNone};                                ///< the guard whose transition led to this phase

 private:
  void resolve_return(const Entry<S, N>& entry, int guard, double rate);

  const HybridSystem<N>& system_;
  Method method_;
  // None by default: no step is too long at any time.
  double short_step_{std::numeric_limits<double>::infinity()},
      short_until_{std::numeric_limits<double>::infinity()};
};

extern template class GuardWatch<double, 2>;
extern template class GuardWatch<double, 6>;
extern template class GuardWatch<double, 7>;
extern template class GuardWatch<Dual, 2>;
extern template class GuardWatch<Dual, 6>;
extern template class GuardWatch<Dual, 7>;

}  // namespace unhand::dynamics
