// A smooth flow without guards, integrated once and read anywhere.
#pragma once

#include <limits>
#include <utility>

#include "dynamics/integrator.hpp"

namespace unhand::dynamics {

/// A system of one smooth mode that nothing ends: Derived has flow_ (HybridSystemFrom) and no more.
template <class Derived, int N>
class SmoothSystem : public HybridSystemFrom<Derived, N> {
 public:
  FlowKind kind(int) const override { return FlowKind::smooth; }
  std::string_view mode_name(int) const override { return "smooth"; }
  int guard_count(int) const override { return 0; }
  Guard guard(int, int) const override { return {}; }
  /// HybridSystem's functions for either scalar: there are no guards.
  /// @{
  template <class S>
  void guards_(const Phase&, const S&, const State<S, N>&, S*) const {}
  template <class S>
  Entry<S, N> on_guard_(const Phase& from, int, const S& t, const State<S, N>& y) const {
    return {from.mode, t, y, S(0)};
  }
  /// @}
};

/// Options under which the local error alone chooses the steps of a flow: there are no guards to miss.
inline IntegratorOptions error_controlled(const Tolerances& tolerances = {}) {
  return {.tolerances = tolerances, .longest_step = std::numeric_limits<double>::infinity()};
}

/// A flow from time 0 on, or why there is none.
template <class S, int N>
struct Flow {
  Outcome outcome{};            ///< only `horizon` has a trajectory to the end
  Trajectory<S, N> trajectory;  ///< of the state, SI units
};

/// The flow of `system` in `mode` from the state `y` at 0 to `last` > 0 [s]; recorded, whatever the options
/// say of that. Throws as integrate() does, and is there for what integrate() is.
template <class S, int N>
Flow<S, N> integrate_flow(const HybridSystem<N>& system, const State<S, N>& y, double last,
                          IntegratorOptions options, int mode = 0) {
  options.record = true;
  auto solution = integrate<S, N>(system, Entry<S, N>{mode, S(0), y, S(0)}, S(last), options);
  return {solution.outcome, std::move(solution.trajectory)};
}

}  // namespace unhand::dynamics
