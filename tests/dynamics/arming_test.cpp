// When a guard counts: after a reset, twice in a step, at a touch, together with others, on its root at the
// start.
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Arming : public EveryMethod {};
UNHAND_EVERY_METHOD(Arming);

TEST_P(Arming, ResidualsAfterAResetDoNotFireAgain) {
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

TEST_P(Arming, AResetFarFromTheGuardArmsItAtOnce) {
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

TEST_P(Arming, TwoRootsInsideOneStepAreSeen) {
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

TEST_P(Arming, APairOfRootsBeforeAThirdInTheSameStepIsSeen) {
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

TEST_P(Arming, AnEvenRootIsAGrazingAndNotAnEvent) {
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

TEST_P(Arming, APeakOfRoundingOnlyTouches) {
  // 1e-7 of what the guard changes by from sample to sample: at a sample (each 1/96 s) or between two.
  auto o = options();
  o.longest_step = o.guard_interval = 1.0 / 32;
  for (const double touch : {0.5, 0.5 + 1.0 / 96, 0.5 + 2.0 / 96, 0.515, 0.5271}) {
    const auto clock = until_guard(
        {{"touch", Crossing::rising}}, still(),
        [touch](int, const auto& t, const auto&, auto* g) { g[0] = 1e-11 - (t - touch) * (t - touch); },
        FlowKind::frozen);
    const auto end = run(clock, {1.0, 0.0}, 1.0, o);
    EXPECT_EQ(end.outcome, Outcome::horizon) << touch;
    EXPECT_EQ(end.statistics.grazings, 1) << touch;
  }
}

TEST_P(Arming, APeakBelowZeroIsNoGrazing) {
  for (const double below : {1e-2, 1e-4}) {  // of what the guard changes by over a stretch
    const auto clock =
        until_guard({{"near", Crossing::rising}}, still(), [below](int, const auto& t, const auto&, auto* g) {
          g[0] = -below * 1e-5 - (t - 0.5023) * (t - 0.5023);
        });
    const auto end = run(clock, {1.0, 0.0}, 1.0, options());
    EXPECT_EQ(end.outcome, Outcome::horizon) << below;
    EXPECT_EQ(end.statistics.grazings, 0) << below;
  }
}

/// Whether every one of twenty excursions is seen where it begins: of a guard with two roots `width` apart,
/// in steps of the given length, both in guard intervals.
template <class Guard>
void expect_seen(IntegratorOptions o, double step, double width, const Guard& guard) {
  o.longest_step = step * o.guard_interval;
  for (int k = 0; k < 20; ++k) {
    const double half = 0.5 * width * o.guard_interval, middle = 0.04 + 0.053 * k * o.guard_interval;
    const auto clock = until_guard(
        {{"bump", Crossing::rising}}, still(),
        [=](int, const auto& t, const auto&, auto* g) { g[0] = guard((t - middle) / half); },
        FlowKind::frozen);
    const auto end = run(clock, {1.0, 0.0}, 0.06, o);
    EXPECT_EQ(end.outcome, Outcome::finished) << step << " " << width << " " << k;
    EXPECT_NEAR(end.t, middle - half, kEventTime) << step << " " << width << " " << k;
  }
}

TEST_P(Arming, TwoRootsInsideOneStepAreSeenHoweverShortTheStep) {
  for (const double step : {0.15, 0.3, 0.5, 0.9}) {
    // What shows long before: down to a ninth of the interval.
    for (const double width : {0.12, 0.3})
      expect_seen(options(), step, width, [](const auto& u) { return 1.0 - u * u; });
    // What shows nothing before: no wider than samples are apart.
    for (const double width : {0.34, 0.6})
      expect_seen(options(), step, width, [](const auto& u) {
        using std::exp;
        return exp(-u * u) - std::exp(-1.0);
      });
  }
}

TEST_P(Arming, APairOfRootsAfterTheGuardHasBecomeSafeInTheSameStretchIsSeen) {
  // Unsafe at the start, safe from a quarter of the stretch on, and unsafe for an instant between its last
  // samples.
  auto o = options();
  const double stretch = o.guard_interval;
  const auto clock = until_guard(
      {{"cubic", Crossing::rising}}, still(),
      [=](int, const auto& t, const auto&, auto* g) {
        const auto u = t / stretch;
        g[0] = -(u - 0.25) * (u - 0.75) * (u - 0.92);
      },
      FlowKind::frozen);
  const auto end = run(clock, {1.0, 0.0}, stretch, o);
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 0.75 * stretch, kEventTime);
}

TEST_P(Arming, AGuardThatBecameSafeInTheStretchOfAnEventFiresWithIt) {
  // Both pass zero at the same instant; the second has been unsafe at the beginning of the stretch.
  const double stretch = options().guard_interval, root = 0.9 * stretch;
  const Toy two(
      {{FlowKind::frozen, {{"line", Crossing::rising}, {"parabola", Crossing::rising}}}}, still(),
      [=](int, const auto& t, const auto& y, auto* g) {
        g[0] = (t - root) / stretch - y[1];
        g[1] = (t - 0.2 * stretch) * (t - root) / (stretch * stretch);
      },
      [](int, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{0, t, {y[0], S(y[1] + 1.0)}, S(0)};
      });
  const auto end = run(two, {1.0, 0.0}, stretch, options());
  ASSERT_EQ(end.events.size(), 2u);
  EXPECT_EQ(end.events[0].index, 0);
  EXPECT_EQ(end.events[1].index, 1);
  for (const auto& event : end.events) EXPECT_NEAR(event.t, root, kEventTime);
}

TEST_P(Arming, ANormAsAGuardEndsTyped) {
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

TEST_P(Arming, ATouchThatGoesThroughFires) {
  // A triple root passes zero with no slope. The time of such a root is only resolved to eps^(1/3).
  const auto clock = until_guard(
      {{"flat", Crossing::rising}}, still(),
      [](int, const auto& t, const auto&, auto* g) { g[0] = (t - 0.7001) * (t - 0.7001) * (t - 0.7001); });
  const auto end = run(clock, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 0.7001, 2e-5);
}

TEST_P(Arming, AHiddenFirstExcursionDoesNotFallThroughTheFloor) {
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

TEST_P(Arming, SimultaneousGuardsComeInTheOrderOfTheirIndices) {
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

TEST_P(Arming, OfTwoGuardsInOneStepTheEarlierFires) {
  // Whichever comes first in the list.
  for (const double apart : {1e-3, 1e-5, 1e-7})
    for (const bool listed_first : {true, false}) {
      const double first = 0.50123, second = first + apart;
      const auto clock = until_guard({{"a", Crossing::rising}, {"b", Crossing::rising}}, still(),
                                     [=](int, const auto& t, const auto&, auto* g) {
                                       g[listed_first ? 0 : 1] = t - first;
                                       g[listed_first ? 1 : 0] = t - second;
                                     });
      const auto end = run(clock, {1.0, 0.0}, 1.0, options());
      ASSERT_EQ(end.events.size(), 1u);
      EXPECT_EQ(end.events[0].index, listed_first ? 0 : 1) << apart;
      EXPECT_NEAR(end.t, first, kEventTime) << apart;
    }
}

TEST_P(Arming, AGuardPastItsRootAtTheStartWaitsForItsSafeSide) {
  const auto swing = until_guard({{"falling", Crossing::falling}}, oscillator(), falling_floor());
  const auto end = run(swing, {-0.5, 0.0}, 10.0, options());  // −cos: safe from π/2 on, falls through at 3π/2
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 1.5 * M_PI, kEventTime);
}

TEST_P(Arming, AGuardOnItsRootAtTheStartFiresAtOnceOrNotAccordingToItsWay) {
  for (const double way : {1.0, -1.0}) {
    const auto clock = until_guard({{"root", Crossing::rising}}, still(),
                                   [way](int, const auto& t, const auto&, auto* g) { g[0] = way * t; });
    const auto end = run(clock, {1.0, 0.0}, 1.0, options());
    EXPECT_EQ(end.outcome, way > 0 ? Outcome::finished : Outcome::horizon);
    EXPECT_EQ(end.t, way > 0 ? 0.0 : 1.0);
  }
}

TEST_P(Arming, AGuardThatIsIdenticallyZeroNeverFires) {
  const auto swing = until_guard({{"zero", Crossing::rising}, {"zero", Crossing::falling}}, oscillator(),
                                 [](int, const auto&, const auto& y, auto* g) { g[0] = g[1] = 0.0 * y[0]; });
  const auto end = run(swing, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::horizon);
}

TEST_P(Arming, AGuardThatStartsAtZeroAndDriftsOffWithoutSlopeFiresThere) {
  // Zero with zero slope at the start, then unsafe: not silently passed over.
  const auto clock = until_guard({{"lift", Crossing::rising}}, still(),
                                 [](int, const auto& t, const auto&, auto* g) { g[0] = t * t; });
  const auto end = run(clock, {1.0, 0.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::finished);
  EXPECT_NEAR(end.t, 0.0, kEventTime);
}

}  // namespace
}  // namespace unhand::dynamics
