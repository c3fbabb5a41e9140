// Events that pile up at one instant.
#pragma once

#include <optional>
#include <vector>

#include "dynamics/integrator.hpp"

namespace unhand::dynamics {

/// Whether the last `span` events took no time.
template <class S, int N>
bool stuck_at_instant(const std::vector<Event<S, N>>& events, int span);

/// How long after `t` [s], the last event's instant, the events accumulate. A pattern of one to four guards
/// that repeats in intervals shrinking by a stable ratio r accumulates at t + D r/(1 − r), with the last
/// interval D ([Johansson1999], [Heymann2005] on Zeno executions). Nothing while what is left of the state's
/// change is above `tolerance` (SI units). Both are instantiated as `integrate` is.
template <class S, int N>
std::optional<S> time_to_accumulation(const std::vector<Event<S, N>>& events, double t, double tolerance);

}  // namespace unhand::dynamics
