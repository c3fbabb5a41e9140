// Derivatives through events: dual numbers against closed forms and against central differences over powers
// of ten.

#include "tests/dynamics/every_method.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::dynamics {
namespace {

using support::best_difference;

class Derivatives : public testing::TestWithParam<Method> {
 protected:
  static IntegratorOptions options() {
    IntegratorOptions options;
    options.method = GetParam();
    options.tolerances = {1e-13, 1e-14};
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(, Derivatives,
                         testing::Values(Method::automatic, Method::dormand_prince, Method::rosenbrock,
                                         Method::radau),
                         [](const auto& test) { return name_of(test.param); });

TEST_P(Derivatives, DropBounceAndTime) {
  // Height and speed at t = 1 s of a ball dropped from h: one bounce at sqrt(2h/g).
  const double p[3] = {9.81, 0.8, 1.0};  // g, e, h
  auto fly = [this](Dual g, Dual e, Dual h) {
    return integrate<Dual, 2>(bouncing_ball(g, e), Entry<Dual, 2>{0, Dual(0), {h, Dual(0)}, Dual(0)},
                              Dual(1.0), options());
  };
  const auto end = fly(independent(p[0], 0), independent(p[1], 1), independent(p[2], 2));
  ASSERT_EQ(end.events.size(), 1u);

  const Dual g = independent(p[0], 0), e = independent(p[1], 1), h = independent(p[2], 2);
  const Dual hit = sqrt(2.0 * h / g), since = 1.0 - hit, up = e * g * hit;
  const Dual expected[2] = {up * since - 0.5 * g * since * since, up - g * since};
  for (int i = 0; i < 2; ++i)
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(end.y[i].v[k], expected[i].v[k], 1e-10);  // a parabola is exact
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(end.events[0].t.v[k], hit.v[k], 1e-11);
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 2; ++i) {
      const auto f = [&](double x) {
        double q[3] = {p[0], p[1], p[2]};
        q[k] = x;
        return fly(Dual(q[0]), Dual(q[1]), Dual(q[2])).y[i].a;
      };
      EXPECT_LT(best_difference(f, p[k], end.y[i].v[k]), 1e-8)
          << k << i;  // rounding over the step: 1e-13 / 1e-5
    }
}

TEST_P(Derivatives, TheRestTimeOfAZenoBallIsDifferentiable) {
  const Dual g = independent(9.81, 0), e = independent(0.5, 1), h = independent(1.0, 2);
  const auto end = integrate<Dual, 2>(bouncing_ball(g, e), Entry<Dual, 2>{0, Dual(0), {h, Dual(0)}, Dual(0)},
                                      Dual(3.0), options());
  ASSERT_EQ(end.events.back().kind, EventKind::limit);
  const Dual expected = sqrt(2.0 * h / g) * (1.0 + e) / (1.0 - e);
  // The last flight's length, 1e-8 s, is known to 1e-15 s; the tail's derivative divides by it once.
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(end.events.back().t.v[k], expected.v[k], 1e-6) << k;
  // The tail may be most of the time, and all of its derivative.
  auto o = options();
  o.zeno_tolerance = 1e30;
  const auto early = integrate<Dual, 2>(bouncing_ball(g, e),
                                        Entry<Dual, 2>{0, Dual(0), {h, Dual(0)}, Dual(0)}, Dual(3.0), o);
  ASSERT_EQ(early.events.back().kind, EventKind::limit);
  EXPECT_LT(early.events.size(), 10u);
  EXPECT_NEAR(early.events.back().t.a, expected.a, 1e-8);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(early.events.back().t.v[k], expected.v[k], 1e-6) << k;
}

/// x'' = −c x' − k x until x falls through `level`, then y -> R y + offset and x'' = b for the rest: every
/// term of S+ = R S− + R_p − (f+ − R f−) dt*/dp is at work.
auto kicked(Dual c, Dual k, Dual level, Dual b, Dual r) {
  return Toy(
      {{FlowKind::smooth, {{"level", Crossing::falling}}}, {FlowKind::smooth, {}}},
      [=](int mode, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = y[1];
        if (mode == 0)
          dy[1] = -as<S>(c) * y[1] - as<S>(k) * y[0] * (1.0 + 0.3 * t);
        else
          dy[1] = as<S>(b) + 0.1 * t * y[0];
      },
      [=](int, const auto& t, const auto& y, auto* g) {
        using S = std::decay_t<decltype(t)>;
        g[0] = y[0] - as<S>(level) - 0.05 * t * t;
      },
      [=](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{1, t, {S(y[0] + 0.2 * t), S(-as<S>(r) * y[1] + as<S>(k) * t)}, S(0)};
      });
}

TEST_P(Derivatives, EveryTermOfTheJumpOfTheSensitivity) {
  const std::array p{0.3, 2.0, 0.1, 0.7, 0.6, 1.0, 0.2, 0.05};  // c, k, level, b, r, x0, v0, t0
  auto integrate_with = [this](const std::array<Dual, 8>& q) {
    return integrate<Dual, 2>(kicked(q[0], q[1], q[2], q[3], q[4]),
                              Entry<Dual, 2>{0, q[7], {q[5], q[6]}, Dual(0)}, Dual(2.0), options());
  };
  std::array<Dual, 8> seeded = support::seeded(p);
  const auto end = integrate_with(seeded);
  ASSERT_EQ(end.events.size(), 1u);
  // Which slot a parameter takes must not matter: the integrator uses slots of its own for slopes and
  // Jacobians.
  for (int first = 1; first < 8; ++first) {
    for (int k = 0; k < 8; ++k) seeded[k] = independent(p[k], (k + first) % 8);
    const auto turned = integrate_with(seeded);
    for (int k = 0; k < 8; ++k)
      for (int i = 0; i < 2; ++i)
        EXPECT_NEAR(turned.y[i].v[(k + first) % 8], end.y[i].v[k], 1e-10)
            << first << k;  // the order of iterations
  }
  const auto state = [&](const std::array<Dual, 8>& q) { return integrate_with(q).y; };
  for (std::size_t k = 0; k < 8; ++k) {
    // The bottom of the V: truncation 1e-8, rounding and step-control noise 1e-13 over a step of 1e-4.
    const auto off = support::best_differences_by(k, state, p, end.y);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(off[i], 3e-8) << "parameter " << k << " component " << i;
  }
}

TEST_P(Derivatives, TheHorizonMayBeAParameter) {
  const Dual end_time = independent(1.3, 0);
  const auto end =
      integrate<Dual, 2>(Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0)),
                         Entry<Dual, 2>{0, Dual(0), {Dual(1), Dual(0)}, Dual(0)}, end_time, options());
  EXPECT_NEAR(end.y[0].v[0], -std::sin(1.3), 1e-10);  // dy/dt_end is the flow there
  EXPECT_NEAR(end.t.v[0], 1.0, 1e-15);
}

TEST_P(Derivatives, AnEventAtTheHorizonKeepsThoseOfTheFlowAfterIt) {
  // x' = p until x passes 1, at t = 1/p, then x' = 5; the horizon is at 1. For p from 1 on x(1) = 6 − 5/p.
  const Dual p = independent(1.0, 0);
  const Toy kink(
      {{FlowKind::smooth, {{"passes", Crossing::rising}}}, {FlowKind::smooth, {}}},
      [p](int mode, const auto& t, const auto&, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = mode == 0 ? as<S>(p) : S(5);
        dy[1] = S(0);
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0] - (1 - 3e-15); }, enter(1));
  const auto end =
      integrate<Dual, 2>(kink, Entry<Dual, 2>{0, Dual(0), {Dual(0), Dual(0)}, Dual(0)}, Dual(1.0), options());
  ASSERT_EQ(end.events.size(), 1u);
  EXPECT_NEAR(end.y[0].a, 1, 1e-13);
  EXPECT_NEAR(end.y[0].v[0], 5, 1e-10);
}

TEST_P(Derivatives, ARecordedTrajectoryHasTheDerivativesAtAFixedTime) {
  // The step that an event cuts short too: at a fixed time before the event nothing of the event's shift may
  // show.
  auto o = options();
  o.record = true;
  const Dual h = independent(1.0, 0);
  const auto end = integrate<Dual, 2>(bouncing_ball(Dual(9.81), Dual(0.5)),
                                      Entry<Dual, 2>{0, Dual(0), {h, Dual(0)}, Dual(0)}, Dual(0.6), o);
  ASSERT_EQ(end.events.size(), 1u);
  const double hit = std::sqrt(2 / 9.81);
  for (const double before : {1e-1, 1e-2, 1e-3, 1e-4}) {
    const auto y = end.trajectory.at(Dual(hit - before));
    EXPECT_NEAR(y[0].v[0], 1.0, 1e-9) << before;
    EXPECT_NEAR(y[1].v[0], 0.0, 1e-9) << before;
  }
}

TEST_P(Derivatives, AHorizonThatMovesDoesNotShowBeforeIt) {
  // A fall recorded up to an end that is a parameter: its last step moves with it, the fall itself does not.
  auto o = options();
  o.record = true;
  const Dual last = independent(0.3, 0);
  const auto fall = free_flow(free_fall());
  const auto end =
      integrate<Dual, 2>(fall, Entry<Dual, 2>{0, Dual(0), {Dual(1), Dual(0.5)}, Dual(0)}, last, o);
  EXPECT_NEAR(end.y[0].v[0], 0.5 - kGravity * 0.3, 1e-9);
  for (const double t : {0.1, 0.29, 0.2999}) {
    const auto y = end.trajectory.at(Dual(t, 1));
    EXPECT_NEAR(y[0].a, 1 + 0.5 * t - 0.5 * kGravity * t * t, 1e-9) << t;
    EXPECT_NEAR(y[0].v[0], 0, 1e-9) << t;
    EXPECT_NEAR(y[1].v[0], 0, 1e-9) << t;
    EXPECT_NEAR(y[0].v[1], 0.5 - kGravity * t, 1e-7) << t;
  }
}

TEST_P(Derivatives, AFrozenPhaseCarriesThem) {
  // Stuck until demand t·a passes 1, at t = 1/a, then x' = 1.
  const Dual a = independent(2.0, 0);
  const Toy block(
      {{FlowKind::frozen, {{"breaks", Crossing::rising}}}, {FlowKind::smooth, {}}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = 1.0 + 0.0 * y[0];
        dy[1] = 0.0 * y[0];
      },
      [a](int, const auto& t, const auto&, auto* g) {
        using S = std::decay_t<decltype(t)>;
        g[0] = as<S>(a) * t - 1.0;
      },
      enter(1));
  const auto end = integrate<Dual, 2>(block, Entry<Dual, 2>{0, Dual(0), {Dual(0), Dual(0)}, Dual(0)},
                                      Dual(1.0), options());
  EXPECT_NEAR(end.y[0].a, 0.5, 1e-13);
  EXPECT_NEAR(end.y[0].v[0], 0.25, 1e-12);  // 1 − 1/a
}

TEST(DerivativesRefused, ByTheOracle) {
  IntegratorOptions o;
  o.method = Method::cvode;
  const Toy swing({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
  EXPECT_THROW(
      (integrate<Dual, 2>(swing, Entry<Dual, 2>{0, Dual(0), {Dual(1), Dual(0)}, Dual(0)}, Dual(1.0), o)),
      std::invalid_argument);
}

}  // namespace
}  // namespace unhand::dynamics
