#include "dynamics/zeno.hpp"

#include <cmath>

#include "dynamics/stepper.hpp"

namespace unhand::dynamics {
namespace {

constexpr int kLongestCycle = 4;  // mode changes in the longest periodic pattern that is looked for

/// Whether the last four periods were the same guards in the same modes.
template <class S, int N>
bool repeats(const std::vector<Event<S, N>>& events, int period) {
  const int n = static_cast<int>(events.size());
  for (int j = 0; j < period; ++j) {
    const auto& later = events[n - 1 - j];
    for (int k = 0; k < 4; ++k) {
      const auto& earlier = events[n - 1 - j - k * period];
      if (earlier.kind != EventKind::guard || earlier.index != later.index ||
          earlier.mode_before != later.mode_before)
        return false;
    }
  }
  return true;
}

}  // namespace

template <class S, int N>
bool stuck_at_instant(const std::vector<Event<S, N>>& events, int span) {
  const int n = static_cast<int>(events.size());
  return n >= span &&
         value_of(events[n - 1].t) - value_of(events[n - span].t) <= shortest_step(value_of(events[n - 1].t));
}

template <class S, int N>
std::optional<S> time_to_accumulation(const std::vector<Event<S, N>>& events, double t, double tolerance) {
  const int n = static_cast<int>(events.size());
  for (int period = 1; period <= kLongestCycle && n > 4 * period; ++period) {
    if (!repeats(events, period)) continue;
    double D[4];
    for (int j = 0; j < 4; ++j)
      D[j] = value_of(events[n - 1 - j * period].t) - value_of(events[n - 1 - (j + 1) * period].t);
    const double resolved = shortest_step(t);
    if (!(D[0] > resolved)) continue;  // no time passes: a cycle of modes, if it goes on
    const double r = D[0] / D[1], r1 = D[1] / D[2], r2 = D[2] / D[3];
    // Intervals like k^−p have a ratio that drifts by (1 − r)²/p each time: that is not a geometric series.
    const double drift = 0.01 * (1 - r) * (1 - r) + 4 * resolved / D[0];
    if (!(r < 1 - 1e-3) || std::abs(r - r1) > drift || std::abs(r1 - r2) > drift) continue;
    double left = 0;
    for (int i = 0; i < N; ++i)
      left =
          std::max(left, std::abs(value_of(events[n - 1].y[i] - events[n - 1 - period].y[i])) * r / (1 - r));
    if (left > tolerance) continue;
    const S d0 = events[n - 1].t - events[n - 1 - period].t,
            d1 = events[n - 1 - period].t - events[n - 1 - 2 * period].t;
    const S ratio = d0 / d1;
    return S(d0 * ratio / (1.0 - ratio));
  }
  return std::nullopt;
}

template bool stuck_at_instant(const std::vector<Event<double, 2>>&, int);
template std::optional<double> time_to_accumulation(const std::vector<Event<double, 2>>&, double, double);
template bool stuck_at_instant(const std::vector<Event<double, 6>>&, int);
template std::optional<double> time_to_accumulation(const std::vector<Event<double, 6>>&, double, double);
template bool stuck_at_instant(const std::vector<Event<double, 7>>&, int);
template bool stuck_at_instant(const std::vector<Event<double, 10>>&, int);
template std::optional<double> time_to_accumulation(const std::vector<Event<double, 7>>&, double, double);
template std::optional<double> time_to_accumulation(const std::vector<Event<double, 10>>&, double, double);
template bool stuck_at_instant(const std::vector<Event<Dual, 2>>&, int);
template std::optional<Dual> time_to_accumulation(const std::vector<Event<Dual, 2>>&, double, double);
template bool stuck_at_instant(const std::vector<Event<Dual, 6>>&, int);
template std::optional<Dual> time_to_accumulation(const std::vector<Event<Dual, 6>>&, double, double);
template bool stuck_at_instant(const std::vector<Event<Dual, 7>>&, int);
template std::optional<Dual> time_to_accumulation(const std::vector<Event<Dual, 7>>&, double, double);

}  // namespace unhand::dynamics
