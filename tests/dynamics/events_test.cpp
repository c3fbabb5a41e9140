// Events: where they are, and that they fire once.
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Events : public EveryMethod {};
UNHAND_EVERY_METHOD(Events);

// ------------------------------------------------------------------ the time of an event

TEST_P(Events, ProjectileLandsWhenTheClosedFormSays) {
  const auto ball = until_guard({{"floor", Crossing::falling}}, free_fall(), falling_floor());
  const auto end = run(ball, {1.0, 2.0}, 5.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, (2.0 + std::sqrt(4.0 + 2 * kGravity)) / kGravity, kEventTime);
  EXPECT_NEAR(end.y[0], 0, 1e-9);  // kEventTime times the speed, some 5 m/s
  ASSERT_EQ(end.events.size(), 1u);
}

TEST_P(Events, OnlyTheDeclaredDirectionFires) {
  // Thrown from below the height: passes it rising first, and lands on it falling.
  const auto ball = until_guard({{"floor", Crossing::falling}}, free_fall(), falling_floor());
  const auto end = run(ball, {-0.5, 5.0}, 5.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, (5.0 + std::sqrt(25.0 - kGravity)) / kGravity, kEventTime);
}

TEST_P(Events, PendulumPeriodIsTheEllipticIntegralAndEnergyIsKept) {
  constexpr double kStart = 2.5;  // [rad], far from small
  const double period = 4 * std::comp_ellint_1(std::sin(kStart / 2));
  const auto end = run(pendulum(), {kStart, 0.0}, 5 * period, options());
  ASSERT_EQ(end.outcome, Outcome::horizon);
  ASSERT_EQ(end.events.size(), 5u);
  // Each step may err by 1e-12 of the state; the phase collects that over some 10,000 steps.
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(end.events[k].t, (k + 0.25) * period, 2e-8);
  EXPECT_NEAR(0.5 * end.y[1] * end.y[1] - std::cos(end.y[0]), -std::cos(kStart), 1e-8);
}

TEST_P(Events, GuardsMayDependOnTimeInEveryKindOfFlow) {
  for (const FlowKind kind : {FlowKind::smooth, FlowKind::stiff, FlowKind::frozen}) {
    const auto clock = until_guard(
        {{"late", Crossing::rising}}, still(),
        [](int, const auto& t, const auto& y, auto* g) {
          using std::exp;
          g[0] = exp(t) - 2.0 - y[0];
        },
        kind);
    const auto end = run(clock, {1.0, 0.0}, 5.0, options());
    EXPECT_EQ(end.outcome, Outcome::finished);
    EXPECT_NEAR(end.t, std::log(3.0), 1e-12);  // nothing is integrated: Newton's iteration to rounding
  }
}

TEST_P(Events, TheScaleOfAGuardDoesNotMatter) {
  for (const double scale : {1.0, 1e-170, 1e150}) {
    const Toy swing(
        {{FlowKind::smooth, {{"zero", Crossing::falling}, {"high", Crossing::rising}}}}, oscillator(),
        [scale](int, const auto&, const auto& y, auto* g) {
          g[0] = scale * y[0];
          g[1] = scale * (y[0] - 0.999999);  // two roots 2.8e-3 s apart around the top
        },
        enter(0));
    const auto end = run(swing, {0.0, 1.0}, 10.0, options());
    EXPECT_EQ(end.outcome, Outcome::horizon) << scale;
    ASSERT_EQ(end.events.size(), 4u) << scale;
    EXPECT_NEAR(end.events[0].t, std::asin(0.999999), 1e-8) << scale;  // slope 1.4e-3 at the root
    EXPECT_NEAR(end.events[1].t, M_PI, kEventTime) << scale;
    EXPECT_NEAR(end.events[2].t, 2 * M_PI + std::asin(0.999999), 1e-7) << scale;
    EXPECT_NEAR(end.events[3].t, 3 * M_PI, kEventTime) << scale;
  }
}

// ------------------------------------------------------------------ once, on (t0, t1]

TEST_P(Events, AnObservedGuardFiresOncePerCrossing) {
  // The transition changes nothing: the root it leaves behind must not fire again.
  const Toy swing(
      {{FlowKind::smooth, {{"zero", Crossing::falling}, {"zero", Crossing::rising}}}}, oscillator(),
      [](int, const auto&, const auto& y, auto* g) { g[0] = g[1] = y[0]; }, enter(0));
  const auto end = run(swing, {1.0, 0.0}, 100.0, options());
  ASSERT_EQ(end.events.size(), 32u);  // π/2 + kπ <= 100
  for (int k = 0; k < 32; ++k) {
    EXPECT_NEAR(end.events[k].t, (k + 0.5) * M_PI, 1e-8);  // 1e-12 a step over 20,000 steps
    EXPECT_EQ(end.events[k].index, k % 2);
  }
}

TEST_P(Events, ObserversAtSeveralLevelsFireOnceEach) {
  // Whatever fires, by a guard or by time, those that are past their own root must not fire again.
  auto ramp = Toy(
      {{FlowKind::smooth, {{"0.2", Crossing::rising}, {"0.5", Crossing::rising}, {"0.7", Crossing::rising}}}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = 1.0 + 0.0 * y[0];
        dy[1] = 0.0 * y[0];
      },
      [](int, const auto&, const auto& y, auto* g) {
        g[0] = y[0] - 0.2;
        g[1] = y[0] - 0.5;
        g[2] = y[0] - 0.7;
      },
      enter(0));
  ramp.times = {0.1, 0.3, 0.6, 0.7, 0.8};
  const auto end = run(ramp, {0.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(count(end, EventKind::guard), 3);
  EXPECT_EQ(count(end, EventKind::time), 5);
}

TEST_P(Events, ARootExactlyAtATimeEventFiresOnceAndBeforeIt) {
  for (const double root : {0.5, std::nextafter(0.5, 0.0)}) {
    auto clock = Toy(
        {{FlowKind::smooth, {{"half", Crossing::rising}}}}, still(),
        [root](int, const auto& t, const auto&, auto* g) { g[0] = t - root; }, enter(0));
    clock.times = {0.25, 0.5, 0.75};
    const auto end = run(clock, {1.0, 1.0}, 1.0, options());
    EXPECT_EQ(end.outcome, Outcome::horizon);
    EXPECT_EQ(count(end, EventKind::guard), 1);
    EXPECT_EQ(count(end, EventKind::time), 3);
    ASSERT_EQ(end.events.size(), 4u);
    EXPECT_EQ(end.events[1].kind, EventKind::guard);
    EXPECT_DOUBLE_EQ(end.events[1].t, 0.5);
  }
}

TEST_P(Events, ARootJustAfterATimeEventFiresOnce) {
  auto clock = Toy(
      {{FlowKind::smooth, {{"half", Crossing::rising}}}}, still(),
      [](int, const auto& t, const auto&, auto* g) { g[0] = t - std::nextafter(0.5, 1.0); }, enter(0));
  clock.times = {0.5};
  const auto end = run(clock, {1.0, 1.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(count(end, EventKind::guard), 1);
  EXPECT_EQ(count(end, EventKind::time), 1);
}

TEST_P(Events, ARootExactlyAtTheHorizonFires) {
  const auto clock = until_guard({{"one", Crossing::rising}}, still(),
                                 [](int, const auto& t, const auto&, auto* g) { g[0] = t - 1.0; });
  const auto end = run(clock, {1.0, 1.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_EQ(end.t, 1.0);
}

TEST_P(Events, ATimeEventCloserToTheHorizonThanTimeResolves) {
  auto swing = Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
  swing.times = {std::nextafter(1.0, 0.0)};
  const auto end = run(swing, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(end.t, 1.0);
  EXPECT_EQ(count(end, EventKind::time), 1);
  EXPECT_NEAR(end.y[0], std::cos(1.0), 1e-9);
}

TEST_P(Events, TimeEventsAreReachedExactlyAndKeepTheirPlaceInTheList) {
  auto swing = Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
  swing.times = {-1.0, 0.0, 0.1, 1e-16 + 0.1, 0.3, 1.0, 2.0};  // the end is none of them
  const auto end = run(swing, {1.0, 0.0}, 1.0, options());
  ASSERT_EQ(end.events.size(), 3u);
  EXPECT_EQ(end.events[0].t, 0.1);
  EXPECT_EQ(end.events[2].t, 0.3);
  EXPECT_EQ(end.events[0].index, 2);
  EXPECT_EQ(end.events[2].index, 4);
}

TEST_P(Events, AnEmptySpanReturnsItsStart) {
  const auto swing = until_guard({{"zero", Crossing::falling}}, oscillator(), falling_floor());
  const auto end = run(swing, {1.0, 0.5}, 2.0, options(), 2.0);
  EXPECT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(end.t, 2.0);
  EXPECT_EQ(end.y[0], 1.0);
  EXPECT_EQ(end.y[1], 0.5);
  EXPECT_THROW(run(swing, {1.0, 0.5}, 1.0, options(), 2.0), std::invalid_argument);
  EXPECT_THROW(run(swing, {NAN, 0.5}, 3.0, options(), 2.0), std::invalid_argument);
}

/// A start whose first instants are known in closed form: the record begins where it does, not after them.
TEST_P(Events, TheRecordBeginsAtTheStartItself) {
  const auto swing = Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
  constexpr double kLead = 1e-6, kStart = 0.5;
  IntegratorOptions recorded = options();
  recorded.record = true;
  const Entry<double, 2> start{0, kStart + kLead, {1.0, -kLead}, kLead, {1.0, 0.0}};
  const auto end = integrate<double, 2>(swing, start, 1.0, recorded);
  ASSERT_EQ(end.outcome, Outcome::horizon);
  EXPECT_EQ(end.trajectory.at(kStart)[1], 0.0);
  EXPECT_NEAR(end.trajectory.at(kStart + kLead)[1], -kLead, 1e-12);
  EXPECT_NEAR(end.trajectory.at(0.8)[0], std::cos(0.3), 1e-8);
}

/// What a transition knows in closed form ends with the window; the event stays where it was.
TEST_P(Events, ALeadThatReachesPastATimeEventEndsThere) {
  constexpr double kEvent = 0.5, kLead = 1e-3, kWindow = kEvent + 4e-4;
  auto swing = Toy(
      {{FlowKind::smooth, {{"half", Crossing::rising}}}, {FlowKind::smooth, {}}}, oscillator(),
      [=](int, const auto& t, const auto&, auto* g) { g[0] = t - kEvent; },
      [=](int, int, const auto& t, const auto&) {
        using S = std::decay_t<decltype(t)>;
        using std::cos;
        using std::sin;
        const S ahead = t + kLead;
        return Entry<S, 2>{1, ahead, {cos(ahead), -sin(ahead)}, S(kLead), {cos(t), -sin(t)}};
      });
  swing.times = {kWindow};
  const auto end = run(swing, {1.0, 0.0}, 1.0, options());
  ASSERT_EQ(end.events.size(), 2u);
  EXPECT_NEAR(end.events[0].t, kEvent, kEventTime);
  EXPECT_NEAR(end.events[0].y[0], std::cos(kEvent), 1e-9);
  EXPECT_EQ(end.events[1].t, kWindow);
  // Back from the lead's end to the window's along a straight line, which a curvature of one bends by 2e-7.
  EXPECT_NEAR(end.y[0], std::cos(1.0), 2.5e-7);
}

// ------------------------------------------------------------------ Coulomb friction with a true stick mode

/// A block on an incline: y = (position up the slope, velocity). Modes: slides up (0), stuck (1), slides down
/// (2).
auto incline(double angle, double mu) {
  const double pull = kGravity * std::sin(angle), grip = mu * kGravity * std::cos(angle);
  return Toy(
      {{FlowKind::smooth, {{"stops", Crossing::falling}}}, {FlowKind::frozen, {}}, {FlowKind::smooth, {}}},
      [=](int mode, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = y[1];
        dy[1] = S(-pull + (mode == 0 ? -grip : mode == 2 ? grip : 0.0));
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[1]; },
      [=](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{pull <= grip ? 1 : 2, t, {y[0], S(0)}, S(0)};
      });
}

TEST_P(Events, ABlockOnAnInclineTakesTheRightBranch) {
  constexpr double kAngle = 0.4, kSpeed = 3.0, kEnd = 4.0;
  for (const double mu : {0.3, 0.6}) {  // tan 0.4 = 0.4228
    const auto end = run(incline(kAngle, mu), {0.0, kSpeed}, kEnd, options());
    const double up = kGravity * (std::sin(kAngle) + mu * std::cos(kAngle));
    const double down = kGravity * (std::sin(kAngle) - mu * std::cos(kAngle));
    ASSERT_EQ(end.events.size(), 1u);
    EXPECT_NEAR(end.events[0].t, kSpeed / up, kEventTime);
    const double top = 0.5 * kSpeed * kSpeed / up, since = kEnd - kSpeed / up;
    EXPECT_EQ(end.mode, mu > std::tan(kAngle) ? 1 : 2);
    EXPECT_NEAR(end.y[0], mu > std::tan(kAngle) ? top : top - 0.5 * down * since * since, 1e-8);
  }
}

TEST_P(Events, StuckIsStillToTheLastBit) {
  const auto end = run(incline(0.4, 0.6), {0.0, 3.0}, 101.0, options());
  ASSERT_EQ(end.events.size(), 1u);
  EXPECT_EQ(end.y[0], end.events[0].y[0]);
  EXPECT_EQ(end.y[1], 0.0);
}

TEST_P(Events, ABreakawayStartsWithoutSlopeAndGoesOn) {
  // Demand 2 sin t against grip 1: at breakaway slip and slip rate are both zero to rounding, whatever their
  // sign.
  for (const double phase : {0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7}) {
    const Toy block(
        {{FlowKind::frozen, {{"breaks", Crossing::rising}}},
         {FlowKind::smooth, {{"stops", Crossing::falling}}}},
        [phase](int, const auto& t, const auto& y, auto& dy) {
          using std::sin;
          dy[0] = y[1];
          dy[1] = 2.0 * sin(t - phase) - 1.0;
        },
        [phase](int mode, const auto& t, const auto& y, auto* g) {
          using std::sin;
          g[0] = mode == 0 ? 2.0 * sin(t - phase) - 1.0 : y[1];
        },
        [](int mode, int, const auto& t, const auto& y) {
          using S = std::decay_t<decltype(t)>;
          return Entry<S, 2>{1 - mode, t, {y[0], S(0)}, S(0)};
        });
    const auto end = run(block, {0.0, 0.0}, 4.0 + phase, options());
    EXPECT_EQ(end.outcome, Outcome::horizon) << phase;
    ASSERT_EQ(end.events.size(), 2u) << phase;
    EXPECT_NEAR(end.events[0].t, M_PI / 6 + phase, kEventTime) << phase;
    const double s = end.events[1].t - phase;  // slip −2 cos s − s + 2 cos(π/6) + π/6 = 0
    EXPECT_NEAR(-2 * std::cos(s) - s + std::sqrt(3.0) + M_PI / 6, 0.0, 1e-8) << phase;
  }
}

TEST(FirstStep, MayBeGuessedBelowTheSpacingOfTimes) {
  // At the breakaway the rate is rounding, so the guess looks far ahead, where a polynomial of the data is
  // beyond everything: the first steps are then too short to move t. y₁ = 65 Δ² meets 1e-3 at √(1e-3/65).
  constexpr double kBegin = 0.07;
  const auto toy = until_guard(
      {{"level", Crossing::rising}},
      [](int, const auto& t, const auto&, auto& dy) {
        const auto delta = t - kBegin;
        auto far = delta;
        for (int k = 1; k < 14; ++k) far = far * delta;
        dy[0] = decltype(delta + 0.0)(0.0);
        dy[1] = 2e-14 + 130.0 * delta + 1e6 * far;
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[1] - 1e-3; });
  for (const Method method : {Method::automatic, Method::dormand_prince, Method::rosenbrock, Method::radau}) {
    IntegratorOptions options;
    options.method = method;
    const auto end = integrate<double, 2>(toy, {0, kBegin, {0.14, 0.0}, 0.0}, kBegin + 0.01, options);
    EXPECT_EQ(end.outcome, Outcome::finished) << name_of(method);
    EXPECT_NEAR(end.t - kBegin, std::sqrt(1e-3 / 65), kEventTime) << name_of(method);
  }
}

}  // namespace
}  // namespace unhand::dynamics
