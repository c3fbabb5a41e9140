// Small hybrid systems written in place: a flow, the guards and what they do, as generic lambdas.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "dynamics/integrator.hpp"

namespace unhand::dynamics {

/// A constant of a toy as the scalar of the moment.
template <class S>
S as(const Dual& x) {
  return convert<S>(x);
}

struct ToyMode {
  FlowKind kind{FlowKind::smooth};
  std::vector<Guard> guards;
};

/// flow(mode, t, y, dy); guards(mode, t, y, g); on_guard(mode, guard, t, y) -> Entry<S, 2>.
template <class Flow, class Guards, class OnGuard>
class Toy final : public HybridSystemFrom<Toy<Flow, Guards, OnGuard>, 2> {
 public:
  Toy(std::vector<ToyMode> modes, Flow flow, Guards guards, OnGuard on_guard)
      : modes_(std::move(modes)), flow_of_(flow), guards_of_(guards), on_guard_of_(on_guard) {}

  FlowKind kind(int mode) const override { return modes_[mode].kind; }
  std::string_view mode_name(int) const override { return "toy"; }
  int guard_count(int mode) const override { return static_cast<int>(modes_[mode].guards.size()); }
  Guard guard(int mode, int index) const override { return modes_[mode].guards[index]; }
  bool has_limit(int, int) const override { return limit_mode >= 0; }

  template <class S>
  void flow_(const Phase& phase, const S& t, const State<S, 2>& y, State<S, 2>& dy) const {
    flow_of_(phase.mode, t, y, dy);
  }
  template <class S>
  void guards_(const Phase& phase, const S& t, const State<S, 2>& y, S* g) const {
    guards_of_(phase.mode, t, y, g);
  }
  template <class S>
  Entry<S, 2> on_guard_(const Phase& from, int guard, const S& t, const State<S, 2>& y) const {
    return on_guard_of_(from.mode, guard, t, y);
  }
  template <class S>
  void time_events_(std::vector<S>& out) const {
    out.clear();
    for (const double t : times) out.push_back(S(t));
  }
  template <class S>
  Entry<S, 2> at_limit_(const Phase&, const S& t, const State<S, 2>&) const {
    return {limit_mode, t, State<S, 2>{}, S(0)};
  }

  std::vector<double> times;
  int limit_mode{-1};  ///< where an accumulation of events ends, with a state of zeros; -1: nowhere

 private:
  std::vector<ToyMode> modes_;
  Flow flow_of_;
  Guards guards_of_;
  OnGuard on_guard_of_;
};

/// on_guard that ends the integration: enters `mode` with the state as it is.
inline auto enter(int mode) {
  return [mode](int, int, const auto& t, const auto& y) {
    using S = std::decay_t<decltype(t)>;
    return Entry<S, 2>{mode, t, y, S(0)};
  };
}

/// One mode (0) of the kind given, left for a finished one (1) when a guard fires.
template <class Flow, class Guards>
auto until_guard(std::vector<Guard> list, Flow flow, Guards guards, FlowKind kind = FlowKind::smooth) {
  return Toy(std::vector<ToyMode>{{kind, std::move(list)}, {FlowKind::finished, {}}}, flow, guards, enter(1));
}

inline auto no_guards() {
  return [](int, const auto&, const auto&, auto*) {};
}
/// The only phase of a run without events.
inline constexpr Phase kPhase{0, {0, 100}};

/// One flow, no guards.
template <class Flow>
auto free_flow(Flow flow, FlowKind kind = FlowKind::smooth) {
  return Toy({{kind, {}}}, flow, no_guards(), enter(0));
}

/// x'' = -x.
inline auto oscillator() {
  return [](int, const auto&, const auto& y, auto& dy) {
    dy[0] = y[1];
    dy[1] = -y[0];
  };
}

/// A ball over a floor at 0: fly (0), rest (1). Restitution e, gravity g [m/s²].
inline auto bouncing_ball(Dual gravity, Dual restitution, bool rests = true) {
  Toy ball(
      std::vector<ToyMode>{{FlowKind::smooth, {{"floor", Crossing::falling}}}, {FlowKind::frozen, {}}},
      [gravity](int, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = y[1];
        dy[1] = -as<S>(gravity);
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; },
      [restitution](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{0, t, {y[0], S(-as<S>(restitution) * y[1])}, S(0)};
      });
  if (rests) ball.limit_mode = 1;
  return ball;
}

/// A pendulum in units of √(length/gravity): passes its lowest point falling (0).
inline auto pendulum() {
  return Toy(
      std::vector<ToyMode>{{FlowKind::smooth, {{"down", Crossing::falling}}}},
      [](int, const auto&, const auto& y, auto& dy) {
        using std::sin;
        dy[0] = y[1];
        dy[1] = -sin(y[0]);
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; }, enter(0));
}

/// A block with dry friction on a shaken plate, relative to a plate of acceleration sin t, in units of its
/// amplitude: u'' = −sin t − s ρ with ρ = μ g/A and s the direction of slip. Modes: slip forward (0), slip
/// back (1), stick (2). y = (u, u').
inline auto plate(Dual rho) {
  return Toy(
      std::vector<ToyMode>{{FlowKind::smooth, {{"stops", Crossing::falling}}},
                           {FlowKind::smooth, {{"stops", Crossing::rising}}},
                           {FlowKind::frozen, {{"forward", Crossing::falling}, {"back", Crossing::rising}}}},
      [rho](int mode, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        using std::sin;
        dy[0] = y[1];
        dy[1] = -sin(t) + (mode == 0 ? -1.0 : 1.0) * as<S>(rho);
      },
      [rho](int mode, const auto& t, const auto& y, auto* g) {
        using S = std::decay_t<decltype(t)>;
        using std::sin;
        if (mode != 2) {
          g[0] = y[1];
        } else {
          g[0] = sin(t) + as<S>(rho);  // forward slip where −sin t > ρ
          g[1] = sin(t) - as<S>(rho);
        }
      },
      [rho](int mode, int guard, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        if (mode == 2) return Entry<S, 2>{guard, t, {y[0], S(0)}, S(0)};
        const double demand = -std::sin(value_of(t)), grip = rho.a;
        return Entry<S, 2>{demand > grip ? 0 : demand < -grip ? 1 : 2, t, {y[0], S(0)}, S(0)};
      });
}

/// Whether the block on the plate still sticks once the start is forgotten: after t = 300.
inline bool sticks_late(const Solution<double, 2>& plate) {
  for (const auto& event : plate.events)
    if (event.t > 300 && event.mode_after == 2) return true;
  return false;
}

template <class System>
Solution<double, 2> run(const System& system, const State<double, 2>& y, double t_end,
                        const IntegratorOptions& options, double t0 = 0) {
  return integrate<double, 2>(system, Entry<double, 2>{0, t0, y, 0.0}, t_end, options);
}

template <class S, int N>
int count(const Solution<S, N>& solution, EventKind kind) {
  int n = 0;
  for (const auto& event : solution.events) n += event.kind == kind;
  return n;
}

}  // namespace unhand::dynamics
