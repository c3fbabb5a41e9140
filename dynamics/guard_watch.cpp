#include "dynamics/guard_watch.hpp"

#include <fmt/core.h>

#include <optional>
#include <stdexcept>

namespace unhand::dynamics {
namespace {

constexpr double kAtZero = 1e-9;     // s
constexpr double kRounding = 1e-13;  // of a guard of order one
constexpr double kNoRate = 1e-6;     // 1/s

}  // namespace

template <class S, int N>
void GuardWatch<S, N>::enter(const Phase& entered) {
  phase = entered;
  count = system_.guard_count(phase.mode);
  if (count > kMaxGuards)
    throw std::logic_error(fmt::format("integrate: mode \"{}\" has {} guards, more than {}",
                                       system_.mode_name(phase.mode), count, kMaxGuards));
  monotone = true;
  for (int i = 0; i < count; ++i) {
    const Guard guard = system_.guard(phase.mode, i);
    sign[i] = guard.crossing == Crossing::rising ? 1 : -1;
    monotone = monotone && guard.monotone;
  }
}

template <class S, int N>
double GuardWatch<S, N>::longest_step(double t) const {
  return t < short_until_ ? short_step_ : std::numeric_limits<double>::infinity();
}

template <class S, int N>
bool GuardWatch<S, N>::evaluate(double t, const State<double, N>& y, double* G) const {
  system_.guards(phase, t, y, G);
  bool all_finite = true;
  for (int i = 0; i < count; ++i) {
    all_finite = all_finite && std::isfinite(G[i]);
    G[i] *= sign[i];
  }
  return all_finite;
}

template <class S, int N>
int GuardWatch<S, N>::arm(const Entry<S, N>& entry, bool same_mode) {
  short_until_ = short_step_ = std::numeric_limits<double>::infinity();
  if (count == 0) return kNone;
  double G[kMaxGuards];
  if (!evaluate(value_of(entry.t), values<S, N>(entry.y), G)) return kNotFinite;
  std::optional<std::array<double, kMaxGuards>> slope;
  int immediate = kNone;
  for (int i = 0; i < count; ++i) {
    const bool spent = same_mode && (i == fired || !armed[i]);
    start[i] = G[i];
    hidden[i] = false;
    armed[i] = G[i] < 0;
    if (armed[i] && !spent) continue;
    if (!slope) slope = slopes(entry);
    const double rate = (*slope)[i];
    if (!std::isfinite(rate)) return kNotFinite;
    if (std::abs(G[i]) > kAtZero * std::abs(rate) + kRounding) continue;
    // A rate of nothing but rounding is how slip begins at a breakaway: there only the first step can tell.
    armed[i] = hidden[i] = rate < 0 || (!spent && rate <= kNoRate);
    if (rate < 0 && method_ == Method::cvode) resolve_return(entry, i, rate);
    if (armed[i] || spent) continue;
    armed[i] = true;  // it fires now or, where a lower index comes first, next
    if (immediate < 0) immediate = i;
  }
  fired = kNone;
  return immediate;
}

/// CVODE restarts with order one, and its interpolant errs by the absolute tolerance: a guard that returns
/// sooner than that resolves needs short steps until it has. The return is judged by dG/dt and its rate.
template <class S, int N>
void GuardWatch<S, N>::resolve_return(const Entry<S, N>& entry, int guard, double rate) {
  constexpr double kAhead = 1e-7;  // s
  const State<double, N> y = values<S, N>(entry.y);
  State<double, N> dy{};
  const double t = value_of(entry.t);
  if (system_.kind(phase.mode) == FlowKind::frozen) return;
  system_.flow(phase, t, y, dy);
  Entry<S, N> ahead{entry.mode, S(t + kAhead), {}, S(0)};
  for (int i = 0; i < N; ++i) ahead.y[i] = S(y[i] + kAhead * dy[i]);
  const double bend = (slopes(ahead)[guard] - rate) / kAhead;
  if (!(bend > 0)) return;
  const double back = -2 * rate / bend;
  short_step_ = std::min(short_step_, back / 50);
  short_until_ = t + 2 * back;
}

template <class S, int N>
std::array<double, kMaxGuards> GuardWatch<S, N>::slopes(const Entry<S, N>& entry) const {
  const State<double, N> y = values<S, N>(entry.y);
  State<double, N> dy{};
  const double t = value_of(entry.t);
  if (system_.kind(phase.mode) != FlowKind::frozen) system_.flow(phase, t, y, dy);
  State<Dual, N> yd;
  for (int i = 0; i < N; ++i) yd[i] = Dual(y[i]);
  Dual still[kMaxGuards], moving[kMaxGuards];
  // The parameters of the system may carry derivatives of their own: they must not be taken for those along
  // the flow.
  if constexpr (!std::is_same_v<S, double>) system_.guards(phase, Dual(t), yd, still);
  for (int i = 0; i < N; ++i) yd[i].v[0] = dy[i];
  system_.guards(phase, independent(t, 0), yd, moving);
  std::array<double, kMaxGuards> slope{};
  for (int i = 0; i < count; ++i) slope[i] = sign[i] * (moving[i].v[0] - still[i].v[0]);
  return slope;
}

template class GuardWatch<double, 2>;
template class GuardWatch<double, 6>;
template class GuardWatch<double, 7>;
template class GuardWatch<double, 10>;
template class GuardWatch<Dual, 2>;
template class GuardWatch<Dual, 6>;
template class GuardWatch<Dual, 7>;

}  // namespace unhand::dynamics
