// Everything awkward ends in a typed outcome.
#include <gmock/gmock.h>

#include <random>

#include "tests/dynamics/every_method.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::dynamics {
namespace {

class Outcomes : public EveryMethod {};
UNHAND_EVERY_METHOD(Outcomes);

// ------------------------------------------------------------------ typed failures

TEST_P(Outcomes, NotANumberInAFlow) {
  const auto never = Toy(
      {{FlowKind::smooth, {}}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = y[1] * std::nan("");
        dy[1] = y[0];
      },
      no_guards(), enter(0));
  EXPECT_EQ(run(never, {1.0, 1.0}, 1.0, options()).outcome, Outcome::not_finite);

  const auto midway = Toy(
      {{FlowKind::smooth, {}}},
      [](int, const auto& t, const auto& y, auto& dy) {
        using S = std::decay_t<decltype(t)>;
        dy[0] = y[1] + (value_of(t) > 0.503 ? S(NAN) : S(0));
        dy[1] = S(-1);
      },
      no_guards(), enter(0));
  const auto end = run(midway, {1.0, 1.0}, 1.0, options());
  EXPECT_EQ(end.outcome, Outcome::not_finite);
  EXPECT_LE(end.t, 0.503);
  EXPECT_TRUE(std::isfinite(end.y[0]));
}

TEST_P(Outcomes, NotANumberInAGuard) {
  for (const double since : {-1.0, 0.503}) {
    const auto swing = until_guard({{"odd", Crossing::falling}}, oscillator(),
                                   [since](int, const auto& t, const auto& y, auto* g) {
                                     using S = std::decay_t<decltype(t)>;
                                     g[0] = value_of(t) > since ? S(NAN) : S(y[0] + 5.0);
                                   });
    EXPECT_EQ(run(swing, {1.0, 0.0}, 1.0, options()).outcome, Outcome::not_finite) << since;
  }
}

TEST_P(Outcomes, NotANumberFromATransition) {
  const Toy ball({{FlowKind::smooth, {{"floor", Crossing::falling}}}}, free_fall(), falling_floor(),
                 [](int, int, const auto& t, const auto& y) {
                   using S = std::decay_t<decltype(t)>;
                   return Entry<S, 2>{0, t, {y[0], S(NAN)}, S(0)};
                 });
  EXPECT_EQ(run(ball, {1.0, 0.0}, 1.0, options()).outcome, Outcome::not_finite);
}

TEST_P(Outcomes, AFlowThatExplodesEndsTyped) {
  // y' = y²: infinite at t = 1.
  const auto blow = Toy(
      {{FlowKind::smooth, {}}},
      [](int, const auto&, const auto& y, auto& dy) {
        dy[0] = y[0] * y[0];
        dy[1] = 0.0 * y[1];
      },
      no_guards(), enter(0));
  auto o = options();
  o.step_budget = 20'000;
  const auto end = run(blow, {1.0, 0.0}, 2.0, o);
  EXPECT_TRUE(end.outcome == Outcome::step_too_small || end.outcome == Outcome::not_finite ||
              end.outcome == Outcome::step_budget_spent)
      << to_string(end.outcome);
  EXPECT_NEAR(end.t, 1.0, 1e-6);
}

// No instant is special: clocks may be below zero, and a mode may have nothing to watch.
TEST_P(Outcomes, AModeWithoutGuardsFlowsAtAnyTime) {
  const auto swing = Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
  for (const double start : {-0.05, -1e-9, 0.0}) {
    const auto end = integrate<double, 2>(swing, {0, start, {1.0, 0.0}, 0.0}, start + 1, options());
    EXPECT_EQ(end.outcome, Outcome::horizon) << start;
    EXPECT_NEAR(end.y[0], std::cos(1.0), 1e-7) << start;
  }
}

TEST_P(Outcomes, InconsistentModesAreACycle) {
  // Each mode sends to the next at once; both the short cycles and a long one.
  for (const int length : {1, 2, 3, 4, 5, 7}) {
    std::vector<ToyMode> modes(length, {FlowKind::smooth, {{"out", Crossing::rising}}});
    if (length == 1) modes.push_back(modes.front());  // 0 -> 1 -> 1: an observed guard is no cycle
    const Toy ring(
        modes, oscillator(), [](int, const auto& t, const auto&, auto* g) { g[0] = t; },
        [length](int mode, int, const auto& t, const auto& y) {
          using S = std::decay_t<decltype(t)>;
          return Entry<S, 2>{length == 1 ? 1 : (mode + 1) % length, t, y, S(0)};
        });
    const auto end = run(ring, {1.0, 0.0}, 1.0, options());
    EXPECT_EQ(end.outcome, length == 1 ? Outcome::horizon : Outcome::mode_cycle) << length;
    if (length > 1) {
      EXPECT_EQ(end.t, 0.0);
      EXPECT_LE(end.events.size(), 24u);  // events_per_instant
    }
  }
}

TEST(IntegratorOptions, AreChecked) {
  const auto complaint = [](auto change) {
    IntegratorOptions options;
    change(options);
    const auto swing = Toy({{FlowKind::smooth, {}}}, oscillator(), no_guards(), enter(0));
    return support::refusal([&] { run(swing, {1.0, 0.0}, 1.0, options); });
  };
  EXPECT_EQ(complaint([](auto&) {}), "accepted");
  EXPECT_EQ(complaint([](auto& o) { o.tolerances.relative = 0; }), "accepted");  // absolute alone
  using testing::HasSubstr;
  EXPECT_THAT(complaint([](auto& o) { o.tolerances.relative = -1; }), HasSubstr("relative tolerance = -1"));
  EXPECT_THAT(complaint([](auto& o) { o.tolerances.absolute = NAN; }), HasSubstr("absolute tolerance = nan"));
  for (const double relative : {0.0, 1e-6})  // a component that is zero would have no scale
    EXPECT_THAT(complaint([&](auto& o) {
                  o.tolerances = {relative, 0};
                }),
                HasSubstr("absolute tolerance = 0"));
  EXPECT_THAT(complaint([](auto& o) { o.guard_interval = 0; }), HasSubstr("guard_interval = 0"));
  EXPECT_THAT(complaint([](auto& o) { o.longest_step = NAN; }), HasSubstr("longest_step = nan"));
  EXPECT_THAT(complaint([](auto& o) { o.zeno_tolerance = -1; }), HasSubstr("zeno_tolerance = -1"));
  EXPECT_THAT(complaint([](auto& o) { o.step_budget = -1; }), HasSubstr("step_budget = -1"));
  for (const int n : {0, 1})  // two events are what shows that no time passes
    EXPECT_THAT(complaint([&](auto& o) { o.events_per_instant = n; }), HasSubstr("events_per_instant"));
}

TEST_P(Outcomes, BudgetsAreKept) {
  const Toy swing({{FlowKind::smooth, {{"zero", Crossing::falling}}}}, oscillator(), falling_floor(),
                  enter(0));
  auto o = options();
  o.event_budget = 3;
  const auto events = run(swing, {1.0, 0.0}, 1000.0, o);
  EXPECT_EQ(events.outcome, Outcome::event_budget_spent);
  EXPECT_EQ(events.events.size(), 3u);
  EXPECT_NEAR(events.t, 4.5 * M_PI, 1e-8);

  o = options();
  o.step_budget = 10;
  const auto steps = run(swing, {1.0, 0.0}, 1000.0, o);
  EXPECT_EQ(steps.outcome, Outcome::step_budget_spent);
  EXPECT_LE(steps.t, 10 * o.longest_step);
  EXPECT_TRUE(std::isfinite(steps.y[0]));
}

// ------------------------------------------------------------------ anything at all

/// A hybrid system drawn at random: three modes with linear flows, sometimes singular; two guards each, lines
/// in the state and in time; transitions to a random mode with a random linear reset; some time events.
struct Draw {
  explicit Draw(unsigned seed) : random(seed) {}
  double real(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  int whole(int count) { return std::uniform_int_distribution<int>(0, count - 1)(random); }
  std::mt19937 random;
};

class Fuzz : public EveryMethod {};
UNHAND_EVERY_METHOD(Fuzz);

TEST_P(Fuzz, RandomHybridSystemsAlwaysEndTyped) {
  std::array<int, 8> outcomes{};
  for (unsigned seed = 0; seed < 500; ++seed) {
    Draw draw(seed);
    double A[3][2][3], guards[3][2][4], reset[3][2][2][3];
    int to[3][2];
    bool singular[3];
    std::vector<ToyMode> modes;
    for (int m = 0; m < 3; ++m) {
      for (auto& row : A[m])
        for (double& a : row) a = draw.real(-3, 3);
      singular[m] = draw.whole(10) == 0;
      const FlowKind kind = draw.whole(4) == 0   ? FlowKind::frozen
                            : draw.whole(3) == 0 ? FlowKind::stiff
                                                 : FlowKind::smooth;
      modes.push_back({kind, {}});
      for (int i = 0; i < 2; ++i) {
        modes[m].guards.push_back({"line", draw.whole(2) ? Crossing::rising : Crossing::falling});
        for (double& c : guards[m][i]) c = draw.whole(4) == 0 ? 0.0 : draw.real(-1, 1);
        to[m][i] = draw.whole(8) == 0 ? 3 : draw.whole(3);
        for (auto& row : reset[m][i])
          for (double& c : row) c = draw.whole(3) == 0 ? 0.0 : draw.real(-1, 1);
      }
    }
    modes.push_back({FlowKind::finished, {}});
    Toy system(
        modes,
        [&](int m, const auto& t, const auto& y, auto& dy) {
          for (int i = 0; i < 2; ++i) dy[i] = A[m][i][0] * y[0] + A[m][i][1] * y[1] + A[m][i][2] * (1.0 + t);
          if (singular[m]) dy[0] += 0.1 / (y[1] - y[0]);
        },
        [&](int m, const auto& t, const auto& y, auto* g) {
          for (int i = 0; i < 2; ++i)
            g[i] = guards[m][i][0] * y[0] + guards[m][i][1] * y[1] + guards[m][i][2] * t + guards[m][i][3];
        },
        [&](int m, int i, const auto& t, const auto& y) {
          using S = std::decay_t<decltype(t)>;
          const auto& r = reset[m][i];
          return Entry<S, 2>{
              to[m][i],
              t,
              {S(r[0][0] * y[0] + r[0][1] * y[1] + r[0][2]), S(r[1][0] * y[0] + r[1][1] * y[1] + r[1][2])},
              S(0)};
        });
    for (double t = draw.real(0, 1); t < 2; t += draw.real(1e-9, 1)) system.times.push_back(t);

    IntegratorOptions o;
    o.method = GetParam();
    o.longest_step = 0.05;
    o.step_budget = 5'000;
    o.event_budget = 500;
    o.record = true;
    const auto end = run(system, {draw.real(-1, 1), draw.real(-1, 1)}, 2.0, o);
    ++outcomes[static_cast<int>(end.outcome)];
    EXPECT_GE(end.t, 0.0) << "seed " << seed;
    EXPECT_LE(end.t, 2.0) << "seed " << seed;
    EXPECT_LE(end.events.size(), 500u) << "seed " << seed;
    EXPECT_LE(end.statistics.steps, 5'001) << "seed " << seed;
    EXPECT_EQ(end.outcome == Outcome::finished, end.mode == 3) << "seed " << seed;
    if (end.outcome == Outcome::horizon) {
      EXPECT_EQ(end.t, 2.0) << "seed " << seed;
    }
    double last = 0;
    for (const auto& event : end.events) {
      EXPECT_GE(event.t, last) << "seed " << seed;
      last = event.t;
    }
    for (std::size_t k = 1; k < end.trajectory.pieces.size(); ++k)
      EXPECT_GE(end.trajectory.pieces[k].t0, end.trajectory.pieces[k - 1].t1 * (1 - 1e-14))
          << "seed " << seed;
  }
  // The draw is of use only if it reaches more than one kind of ending.
  EXPECT_GT(outcomes[static_cast<int>(Outcome::horizon)], 50);
  EXPECT_GT(outcomes[static_cast<int>(Outcome::finished)], 20);
}

}  // namespace
}  // namespace unhand::dynamics
