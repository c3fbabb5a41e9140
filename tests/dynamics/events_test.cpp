// Events: where they are, and that they fire once.
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Events : public EveryMethod {};
UNHAND_EVERY_METHOD(Events);

// What every test of an event's time asks: 1e-9 s, the accuracy the library promises. The global error of the
// methods at tolerances of 1e-12 is 1e-11 to 1e-10 over these spans.
constexpr double kEventTime = 1e-9;

auto still() {
  return [](int, const auto&, const auto&, auto& dy) { dy = {}; };
}

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
  swing.times = {-1.0, 0.0, 0.1, 1e-16 + 0.1, 0.3, 2.0};
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

TEST_P(Events, ResidualsAfterAResetDoNotFireAgain) {
  for (const double residual : {-1e-18, 0.0, 1e-18, -1e-15, 1e-15}) {
    const Toy ball({{FlowKind::smooth, {{"floor", Crossing::falling}}}}, free_fall(), falling_floor(),
                   [residual](int, int, const auto& t, const auto& y) {
                     using S = std::decay_t<decltype(t)>;
                     return Entry<S, 2>{0, t, {S(residual), S(-y[1])}, S(0)};
                   });
    const auto end = run(ball, {1.0, 0.0}, 5.0, options());
    const double fall = std::sqrt(2 / kGravity);
    ASSERT_EQ(end.events.size(), 6u) << residual;  // (2k + 1) falls <= 5 s
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(end.events[k].t, (2 * k + 1) * fall, 1e-8) << residual;
  }
}

TEST_P(Events, AResetFarFromTheGuardArmsItAtOnce) {
  // A sawtooth with a period far below the longest step, so that every crossing lies in a first step.
  constexpr double kPeriod = 1e-3;
  const Toy saw(
      {{FlowKind::smooth, {{"full", Crossing::rising}}}},
      [](int, const auto&, const auto&, auto& dy) {
        dy[0] = decltype(dy[0] + 0.0)(1 / kPeriod);
        dy[1] = decltype(dy[0] + 0.0)(0);
      },
      [](int, const auto&, const auto& y, auto* g) { g[0] = y[0] - 1.0; },
      [](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{0, t, {S(y[0] - 1.0), y[1]}, S(0)};
      });
  const auto end = run(saw, {0.0, 0.0}, 0.05 + 0.5 * kPeriod, options());
  EXPECT_EQ(end.events.size(), 50u);
}

// ------------------------------------------------------------------ more than one root in a step

TEST_P(Events, TwoRootsInsideOneStepAreSeen) {
  // |t - t*| < d in the unsafe set, d down to a ninth of the longest step as promised.
  for (const double width : {2e-3, 1.2e-3, 6e-4}) {
    int seen = 0;
    for (int k = 0; k < 20; ++k) {
      const double middle = 0.5 + 2.5e-4 * k;
      const auto clock =
          until_guard({{"bump", Crossing::rising}}, still(), [=](int, const auto& t, const auto&, auto* g) {
            g[0] = 0.25 * width * width - (t - middle) * (t - middle);
          });
      const auto end = run(clock, {1.0, 0.0}, 1.0, options());
      if (end.outcome != Outcome::finished) continue;
      ++seen;
      EXPECT_NEAR(end.t, middle - 0.5 * width, kEventTime);
    }
    EXPECT_EQ(seen, 20) << width;
  }
}

TEST_P(Events, APairOfRootsBeforeAThirdInTheSameStepIsSeen) {
  // A cubic in time with three roots inside one step of 5 ms: the first is the event, not the last.
  for (int k = 0; k < 10; ++k) {
    const double begin = 0.4 + 5e-4 * k;
    const auto clock =
        until_guard({{"cubic", Crossing::rising}}, still(), [=](int, const auto& t, const auto&, auto* g) {
          g[0] = 1e9 * (t - begin) * (t - begin - 1.2e-3) * (t - begin - 4e-3);
        });
    const auto end = run(clock, {1.0, 0.0}, 1.0, options());
    EXPECT_EQ(end.outcome, Outcome::finished);
    EXPECT_NEAR(end.t, begin, kEventTime) << k;
  }
}

TEST_P(Events, AnEvenRootIsAGrazingAndNotAnEvent) {
  for (const FlowKind kind : {FlowKind::smooth, FlowKind::frozen})
    for (const double touch : {1.0, 0.501234, 0.5}) {
      const auto clock = until_guard(
          {{"touch", Crossing::falling}, {"touch", Crossing::rising}}, still(),
          [touch](int, const auto& t, const auto&, auto* g) {
            g[0] = (t - touch) * (t - touch);
            g[1] = -g[0];
          },
          kind);
      const auto end = run(clock, {1.0, 0.0}, 2.0, options());
      EXPECT_EQ(end.outcome, Outcome::horizon) << touch;
      EXPECT_EQ(end.events.size(), 0u) << touch;
      EXPECT_EQ(end.statistics.grazings, 2) << touch;
    }
}

TEST_P(Events, ANormAsAGuardEndsTyped) {
  // |v| of a decelerating slip: never negative, so it never fires, and the kink is no false event either.
  const auto slip = until_guard(
      {{"norm", Crossing::falling}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = y[1];
        dy[1] = decltype(y[1] + 0.0)(-1.0);
      },
      [](int, const auto&, const auto& y, auto* g) {
        using std::abs;
        g[0] = abs(y[1]);
      });
  const auto end = run(slip, {0.0, 0.50123}, 1.0, options());
  EXPECT_TRUE(end.outcome == Outcome::horizon || end.outcome == Outcome::finished);
  if (end.outcome == Outcome::finished) {
    EXPECT_NEAR(end.t, 0.50123, 1e-6);  // only a node that hits zero exactly
  }
}

TEST_P(Events, ATouchThatGoesThroughFires) {
  // A triple root passes zero with no slope. The time of such a root is only resolved to eps^(1/3).
  const auto clock = until_guard(
      {{"flat", Crossing::rising}}, still(),
      [](int, const auto& t, const auto&, auto* g) { g[0] = (t - 0.7001) * (t - 0.7001) * (t - 0.7001); });
  const auto end = run(clock, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 0.7001, 2e-5);
}

TEST_P(Events, AHiddenFirstExcursionDoesNotFallThroughTheFloor) {
  // A bounce so low that the whole next flight is shorter than any third of the step that follows it.
  for (const double speed : {1e-2, 1e-3, 1e-5, 1e-8}) {
    const Toy ball({{FlowKind::smooth, {{"floor", Crossing::falling}}}, {FlowKind::finished, {}}},
                   free_fall(), falling_floor(), [speed](int, int, const auto& t, const auto& y) {
                     using S = std::decay_t<decltype(t)>;
                     const int next = value_of(y[1]) < -1.0 ? 0 : 1;
                     return Entry<S, 2>{next, t, {S(0), S(speed)}, S(0)};
                   });
    const auto end = run(ball, {1.0, 0.0}, 5.0, options());
    EXPECT_EQ(end.outcome, Outcome::finished) << speed;
    ASSERT_EQ(end.events.size(), 2u) << speed;
    // CVODE restarts with order one, and its interpolant errs by its absolute tolerance, 1e-13 m.
    const double interpolant = GetParam() == Method::cvode ? 1e-13 / speed : 0.0;
    EXPECT_NEAR(end.events[1].t - end.events[0].t, 2 * speed / kGravity, kEventTime + interpolant) << speed;
  }
}

TEST_P(Events, SimultaneousGuardsComeInTheOrderOfTheirIndices) {
  // The same root through three different functions; each transition goes on to the next mode.
  const std::vector<Guard> three{
      {"cube", Crossing::rising}, {"line", Crossing::rising}, {"root", Crossing::falling}};
  const Toy swing(
      {{FlowKind::smooth, three}, {FlowKind::smooth, three}, {FlowKind::finished, {}}}, oscillator(),
      [](int mode, const auto&, const auto& y, auto* g) {
        const auto x = y[0] - 0.5;
        using std::exp;
        g[0] = mode == 0 ? exp(3.0 * x) - 1.0 : x * 0.0 - 1.0;
        g[1] = mode == 0 ? x : exp(x) - 1.0;
        g[2] = -x - x * x * x;
      },
      [](int mode, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{mode + 1, t, y, S(0)};
      });
  const auto end = run(swing, {0.0, 1.0}, 2.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  ASSERT_EQ(end.events.size(), 2u);
  EXPECT_EQ(end.events[0].index, 0);
  EXPECT_EQ(end.events[1].index, 1);
  EXPECT_NEAR(end.events[0].t, std::asin(0.5), kEventTime);
  EXPECT_NEAR(end.events[1].t, std::asin(0.5), kEventTime);
}

TEST_P(Events, AGuardPastItsRootAtTheStartWaitsForItsSafeSide) {
  const auto swing = until_guard({{"falling", Crossing::falling}}, oscillator(), falling_floor());
  const auto end = run(swing, {-0.5, 0.0}, 10.0, options());  // −cos: safe from π/2 on, falls through at 3π/2
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 1.5 * M_PI, kEventTime);
}

TEST_P(Events, AGuardOnItsRootAtTheStartFiresAtOnceOrNotAccordingToItsWay) {
  for (const double way : {1.0, -1.0}) {
    const auto clock = until_guard({{"root", Crossing::rising}}, still(),
                                   [way](int, const auto& t, const auto&, auto* g) { g[0] = way * t; });
    const auto end = run(clock, {1.0, 0.0}, 1.0, options());
    EXPECT_EQ(end.outcome, way > 0 ? Outcome::finished : Outcome::horizon);
    EXPECT_EQ(end.t, way > 0 ? 0.0 : 1.0);
  }
}

TEST_P(Events, AGuardThatIsIdenticallyZeroNeverFires) {
  const auto swing = until_guard({{"zero", Crossing::rising}, {"zero", Crossing::falling}}, oscillator(),
                                 [](int, const auto&, const auto& y, auto* g) { g[0] = g[1] = 0.0 * y[0]; });
  const auto end = run(swing, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::horizon);
}

TEST_P(Events, AGuardThatStartsAtZeroAndDriftsOffWithoutSlopeFiresThere) {
  // Zero with zero slope at the start, then unsafe: not silently passed over.
  const auto clock = until_guard({{"lift", Crossing::rising}}, still(),
                                 [](int, const auto& t, const auto&, auto* g) { g[0] = t * t; });
  const auto end = run(clock, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 0.0, kEventTime);
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
