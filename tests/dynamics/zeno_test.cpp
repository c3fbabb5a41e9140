// Accumulating events: the limit is found where there is one, and nothing falls through the floor before it.
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Zeno : public EveryMethod {
 protected:
  /// At the jump flights are 1e-15 m high: CVODE sees them only with an absolute tolerance below that. (The
  /// single-step methods are exact for parabolas.)
  static IntegratorOptions options() {
    auto o = EveryMethod::options();
    if (GetParam() == Method::cvode) o.tolerances.absolute = 1e-16;
    return o;
  }
};
UNHAND_EVERY_METHOD(Zeno);

/// t∞ of a ball dropped from rest at `height` [s].
double accumulation(double height, double restitution) {
  return std::sqrt(2 * height / kGravity) * (1 + restitution) / (1 - restitution);
}

TEST_P(Zeno, ABouncingBallComesToRestAtItsLimit) {
  EXPECT_NEAR(accumulation(1.0, 0.5), 1.354570923, 1e-9);
  EXPECT_NEAR(accumulation(1.0, 0.9), 8.578949179, 1e-9);
  for (const double restitution : {0.2, 0.5, 0.9, 0.99}) {
    auto o = options();
    o.record = true;
    const double limit = accumulation(1.0, restitution);
    const auto end = run(bouncing_ball(Dual(kGravity), Dual(restitution)), {1.0, 0.0}, limit + 1.0, o);
    EXPECT_EQ(end.outcome, Outcome::horizon) << restitution;
    EXPECT_EQ(end.mode, 1) << restitution;
    EXPECT_EQ(end.t, limit + 1.0);
    ASSERT_FALSE(end.events.empty());
    EXPECT_EQ(end.events.back().kind, EventKind::limit);
    // What is left at the jump is 1e-7 m/s, or 2e-8 s; errors of single flights are far below.
    // At 0.99 an error of CVODE, 1e-12 of each speed, counts 1/(1 − e)² times in 90 s.
    const bool far = GetParam() == Method::cvode && restitution > 0.9;
    EXPECT_NEAR(end.events.back().t, limit, far ? 3e-5 : 1e-6) << restitution;
    // From 4.4 m/s to 1e-7 m/s.
    EXPECT_LE(end.events.size(), 10 + std::log(1e-8) / std::log(restitution)) << restitution;
    double lowest = 0;
    for (const auto& piece : end.trajectory.pieces)
      for (const auto& node : piece.nodes) lowest = std::min(lowest, node[0]);
    EXPECT_GE(lowest, -1e-9) << restitution;  // an event's time, 1e-10 s, times the speed
  }
}

TEST_P(Zeno, DefaultTolerancesWillDo) {
  IntegratorOptions o;
  o.method = GetParam();
  const auto end = run(bouncing_ball(Dual(kGravity), Dual(0.5)), {1.0, 0.0}, 3.0, o);
  EXPECT_EQ(end.mode, 1);
  ASSERT_FALSE(end.events.empty());
  // Parabolas are exact in the single-step methods; CVODE errs by 1e-8 of the state at each bounce.
  EXPECT_NEAR(end.events.back().t, accumulation(1.0, 0.5), GetParam() == Method::cvode ? 1e-5 : 1e-6);
}

TEST_P(Zeno, WithoutALimitTheOutcomeSaysZeno) {
  for (const double restitution : {0.5, 0.9}) {
    const double limit = accumulation(1.0, restitution);
    const auto end =
        run(bouncing_ball(Dual(kGravity), Dual(restitution), false), {1.0, 0.0}, limit + 1.0, options());
    EXPECT_EQ(end.outcome, Outcome::zeno);
    EXPECT_NEAR(end.t, limit, 1e-6);
    EXPECT_LE(end.events.size(), 250u);
  }
}

TEST_P(Zeno, AHorizonBeforeTheLimitIsReachedInFlight) {
  const double limit = accumulation(1.0, 0.9);
  for (const double before : {1.0, 1e-3, 1e-6}) {
    const auto end = run(bouncing_ball(Dual(kGravity), Dual(0.9)), {1.0, 0.0}, limit - before, options());
    EXPECT_EQ(end.outcome, Outcome::horizon) << before;
    EXPECT_EQ(end.mode, 0) << before;
    EXPECT_GE(end.y[0], -1e-12) << before;
  }
  // Nor is it passed where a limit may be jumped to from afar.
  auto o = options();
  o.zeno_tolerance = 1e30;
  const auto end = run(bouncing_ball(Dual(kGravity), Dual(0.9)), {1.0, 0.0}, limit - 1.0, o);
  EXPECT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(end.t, limit - 1.0);
  EXPECT_EQ(end.mode, 0);
}

TEST_P(Zeno, IntervalsThatShrinkLikeAPowerAreNotJumped) {
  // The ramp is reset by the next interval k^-p: for p = 2 events accumulate at π²/6, for p = 1 they do not
  // at all.
  for (const double power : {1.0, 2.0}) {
    const Toy ramp(
        {{FlowKind::smooth, {{"end", Crossing::rising}}}},
        [](int, const auto&, const auto& y, auto& dy) {
          dy[0] = 1.0 + 0.0 * y[0];
          dy[1] = 0.0 * y[0];
        },
        [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; },
        [power](int, int, const auto& t, const auto& y) {
          using S = std::decay_t<decltype(t)>;
          return Entry<S, 2>{0, t, {S(-std::pow(value_of(y[1]), -power)), S(y[1] + 1.0)}, S(0)};
        });
    auto o = options();
    o.event_budget = 1500;
    o.zeno_tolerance = 1e30;  // only the ratios decide
    const auto end = run(ramp, {-1.0, 2.0}, 10.0, o);
    EXPECT_EQ(end.outcome, Outcome::event_budget_spent) << power;
    double sum = 0;
    for (int k = 1; k <= 1500; ++k) sum += std::pow(k, -power);
    EXPECT_NEAR(end.t, sum, 1e-9) << power;
  }
}

TEST_P(Zeno, APatternOfTwoModesAccumulatesToo) {
  // A ball between two impacts of different restitution: floor and floor, alternately hard and soft.
  Toy ball(
      {{FlowKind::smooth, {{"hard", Crossing::falling}}},
       {FlowKind::smooth, {{"soft", Crossing::falling}}},
       {FlowKind::frozen, {}}},
      [](int, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = y[1];
        dy[1] = S(-kGravity);
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; },
      [](int mode, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{1 - mode, t, {y[0], S((mode == 0 ? -0.9 : -0.4) * y[1])}, S(0)};
      });
  ball.limit_mode = 2;
  const auto end = run(ball, {1.0, 0.0}, 10.0, options());
  EXPECT_EQ(end.mode, 2);
  ASSERT_FALSE(end.events.empty());
  EXPECT_EQ(end.events.back().kind, EventKind::limit);
  // Flights 2v/g with v = v0 (0.9, 0.9·0.4, 0.9²·0.4, ...).
  const double fall = std::sqrt(2 / kGravity);
  EXPECT_NEAR(end.events.back().t, fall + 2 * fall * (0.9 + 0.36) / (1 - 0.36), 1e-6);
}

TEST_P(Zeno, AStateThatTravelsOnIsNotJumped) {
  // The bounces die out while the other component still changes by order one: the limit waits until it is
  // small.
  const Toy shrinking(
      {{FlowKind::smooth, {{"end", Crossing::rising}}}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = 1.0 + 0.0 * y[0];
        dy[1] = 0.0 * y[0];
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; },
      [](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        const S next = 0.5 * y[1];
        return Entry<S, 2>{0, t, {S(-next), next}, S(0)};
      });
  auto o = options();
  o.zeno_tolerance = 1e-4;
  const auto end = run(shrinking, {-1.0, 1.0}, 10.0, o);
  EXPECT_EQ(end.outcome, Outcome::zeno);
  EXPECT_NEAR(end.t, 2.0, 1e-9);
  EXPECT_EQ(end.events.size(), 14u);  // 2^-14 is the first below 1e-4
}

}  // namespace
}  // namespace unhand::dynamics
