// The steppers one by one: order, dense output, restarts and derivatives of the discrete solution.
#include "dynamics/dormand_prince.hpp"
#include "dynamics/radau.hpp"
#include "dynamics/rosenbrock.hpp"
#include "dynamics/switching_stepper.hpp"
#include "dynamics/tangent_stepper.hpp"
#include "tests/dynamics/every_method.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::dynamics {
namespace {

constexpr Tolerances kLoose{1e30, 1e30};  // every step is accepted at the length asked for

/// Nonlinear, non-autonomous, coupled, with a closed form: y0 = exp(sin t), y1 = cos t + y0².
auto smooth_problem() {
  return free_flow([](int, const auto& t, const auto& y, auto& dy) {
    using std::cos;
    using std::sin;
    const auto c = cos(t), s = sin(t);
    dy[0] = y[0] * c + 0.5 * (y[1] - c - y[0] * y[0]);
    dy[1] = -s + 2.0 * y[0] * dy[0] - (y[1] - c - y[0] * y[0]);
  });
}
State<double, 2> smooth_solution(double t) {
  const double y0 = std::exp(std::sin(t));
  return {y0, std::cos(t) + y0 * y0};
}

template <class T>
class SingleSteps : public testing::Test {};
using Steppers = testing::Types<DormandPrince<double, 2>, Rosenbrock<2>, Radau<2>>;
TYPED_TEST_SUITE(SingleSteps, Steppers);

template <class Stepper, class System>
double error_of_fixed_steps(const System& system, State<double, 2> y, double t0, double t1, int steps,
                            State<double, 2> exact, Tolerances tolerances) {
  Stepper stepper(tolerances);
  for (int k = 0; k < steps; ++k) {
    const double t = t0 + (t1 - t0) * k / steps;
    stepper.start(system, kPhase, t, y);
    // One accepted step, then the wanted length through `retake`, which is how events use it.
    if (stepper.step(t + 2 * (t1 - t0) / steps, 2 * (t1 - t0) / steps) != StepStatus::accepted) return NAN;
    const double h = (t1 - t0) / steps;
    if (value_of(stepper.t1()) - t < h * (1 - 1e-9)) {  // the first guess was shorter: let it grow
      State<double, 2> taken = y;
      stepper.start(system, kPhase, t, taken);
      while (stepper.t1() - t < h * (1 - 1e-9)) {
        stepper.start(system, kPhase, t, y);
        if (stepper.step(t + 2 * h, 2 * h) != StepStatus::accepted) return NAN;
      }
    }
    State<double, 2> next;
    stepper.retake(h, next);
    y = next;
  }
  return std::max(std::abs(y[0] - exact[0]), std::abs(y[1] - exact[1]));
}

TYPED_TEST(SingleSteps, ConvergeWithTheirOrder) {
  // A wrong digit in any coefficient leaves an error of lower order, which halving the step uncovers.
  const auto problem = smooth_problem();
  const double order = TypeParam::kOrder;
  if (std::is_same_v<TypeParam, Radau<2>>) {
    // Its Newton iterations stop at a fraction of the step tolerance, so the order shows in the error against
    // the number of steps, over four decades of the tolerance: the solution is of order 5, with noise from
    // what Newton leaves (kOrder is that of the error estimate).
    double first = NAN, first_steps = NAN;
    for (const double tolerance : {1e-5, 1e-9}) {
      IntegratorOptions o;
      o.method = Method::radau;
      o.tolerances = {tolerance, tolerance};
      o.longest_step = 10;
      const auto end = run(problem, smooth_solution(0.2), 3.0, o, 0.2);
      const auto exact = smooth_solution(3.0);
      const double error = std::hypot(end.y[0] - exact[0], end.y[1] - exact[1]);
      const double steps = static_cast<double>(end.statistics.steps);
      if (first > 0) {
        EXPECT_NEAR(std::log(first / error) / std::log(steps / first_steps), order + 1, 1.0);
      }
      first = error;
      first_steps = steps;
    }
    return;
  }
  double last = NAN;
  // Of order eight, steps three times as long are far enough from rounding.
  for (const int steps : order > 5 ? std::array{7, 14, 28} : std::array{20, 40, 80}) {
    const double error = error_of_fixed_steps<TypeParam>(problem, smooth_solution(0.2), 0.2, 2.2, steps,
                                                         smooth_solution(2.2), kLoose);
    if (last > 0) {
      EXPECT_NEAR(std::log2(last / error), order, 0.6) << steps;  // the next order is still visible
    }
    last = error;
  }
  EXPECT_LT(last, 1e-5);
}

TYPED_TEST(SingleSteps, TheErrorFollowsTheTolerance) {
  const auto problem = smooth_problem();
  for (const double tolerance : {1e-5, 1e-7, 1e-9, 1e-11}) {
    TypeParam stepper(Tolerances{tolerance, tolerance});
    stepper.start(problem, kPhase, 0.2, smooth_solution(0.2));
    while (stepper.t1() < 4.0) ASSERT_EQ(stepper.step(4.0, 10.0), StepStatus::accepted);
    EXPECT_EQ(stepper.t1(), 4.0);
    // Errors grow by the flow's own expansion, a factor below 50 here, over some 100 steps at most.
    EXPECT_NEAR(stepper.y1()[0], smooth_solution(4.0)[0], 300 * tolerance) << tolerance;
    EXPECT_NEAR(stepper.y1()[1], smooth_solution(4.0)[1], 300 * tolerance) << tolerance;
  }
}

TYPED_TEST(SingleSteps, AKinkInOneComponentIsSeenBesideAnotherThatSways) {
  // y0 sways; y1 is pushed by a force that ends as (t1 − t)^p, or by a spline with a jump in its second
  // derivative at a knot, as hands and normal forces do. Each over places of the end in the rhythm of the
  // steps. The bounds: a knot inside a step errs by at most 3.8 times the finer of DormandPrince's estimates,
  // of which at least a tenth is counted, over √2 (the norm) and of at most 1.3 tolerances: 70. Each estimate
  // alone has zeros where a knot goes unseen, as close to each other as a thousandth of a step: hence so
  // many of it, and a tenth of them for the others.
  const int every = std::is_same_v<TypeParam, DormandPrince<double, 2>> ? 1 : 10;
  for (const double tolerance : {1e-7, 1e-9}) {
    for (int k = 0; k < 2000; k += every) {
      const double end = 3.0 + 0.00034 * k, power = 1.1 + 0.0002 * k;
      const auto released = free_flow([&](int, const auto& t, const auto& y, auto& dy) {
        using std::cos, std::pow;
        using S = std::decay_t<decltype(y[0])>;
        dy[0] = 5.0 * cos(5.0 * t);
        const S left = end - t;
        dy[1] = left > 0.0 ? S(pow(left, power)) : S(0.0);
      });
      TypeParam stepper(Tolerances{tolerance, tolerance});
      stepper.start(released, kPhase, 0.0, {0, 0});
      while (stepper.t1() < end) ASSERT_EQ(stepper.step(end, 10.0), StepStatus::accepted);
      const double pushed = std::pow(end, power + 1) / (power + 1);
      EXPECT_NEAR(stepper.y1()[1], pushed, 20 * tolerance * (1 + pushed)) << "power " << power;

      const double knot = 1.0 + 0.00046 * k;
      const auto knotted = free_flow([&](int, const auto& t, const auto& y, auto& dy) {
        using std::cos;
        using S = std::decay_t<decltype(y[0])>;
        dy[0] = 5.0 * cos(5.0 * t);
        const S past = t - knot;
        dy[1] = past > 0.0 ? S(past * past) : S(0.0);
      });
      stepper.start(knotted, kPhase, 0.0, {0, 0});
      while (stepper.t1() < 2.0) ASSERT_EQ(stepper.step(2.0, 10.0), StepStatus::accepted);
      EXPECT_NEAR(stepper.y1()[1], std::pow(2 - knot, 3) / 3, 70 * tolerance) << "knot " << knot;
    }
  }
}

TYPED_TEST(SingleSteps, TheDenseOutputIsOfOrderThreeOrBetter) {
  // Worst error inside one step of length h: falls at least with h⁴ (a polynomial of degree three), with h⁸
  // where the method is of order eight, and both ends meet.
  const bool eight = TypeParam::kOrder > 5;
  const auto problem = smooth_problem();
  double last = NAN;
  for (const double h : eight ? std::array{0.4, 0.2, 0.1} : std::array{0.1, 0.05, 0.025}) {
    TypeParam stepper(eight ? Tolerances{0.1, 0.1} : Tolerances{1e-3, 1e-3});
    stepper.start(problem, kPhase, 1.0, smooth_solution(1.0));
    ASSERT_EQ(stepper.step(1.0 + 1e-3, 1.0), StepStatus::accepted);  // a step length to grow from
    while (stepper.t1() - stepper.t0() < 0.999 * h) {
      stepper.start(problem, kPhase, 1.0, smooth_solution(1.0));
      ASSERT_EQ(stepper.step(1.0 + 2 * h, h), StepStatus::accepted);
    }
    double worst = 0;
    State<double, 2> y;
    for (int k = 0; k <= 20; ++k) {
      stepper.interpolate(k / 20.0, y);
      const auto exact = smooth_solution(1.0 + h * k / 20.0);
      worst = std::max({worst, std::abs(y[0] - exact[0]), std::abs(y[1] - exact[1])});
    }
    stepper.interpolate(1.0, y);
    EXPECT_NEAR(y[0], stepper.y1()[0], 1e-14);
    stepper.interpolate(0.0, y);
    EXPECT_NEAR(y[0], stepper.y0()[0], 1e-14);
    if (last > 0) {
      EXPECT_GT(std::log2(last / worst), eight ? 7.5 : 3.3) << h;  // less what the next order still adds
    }
    last = worst;
  }
}

TYPED_TEST(SingleSteps, TheGuessAtAFirstStepLooksNoFurtherThanTheLimit) {
  double furthest = 0;
  const auto watched = free_flow([&](int, const auto& t, const auto& y, auto& dy) {
    furthest = std::max(furthest, value_of(t));
    using std::cos;
    dy[0] = cos(t) * y[1];
    dy[1] = -1.0 * y[0];
  });
  for (const double limit : {1e-9, 1e-7, 1e-4}) {
    furthest = 0;
    TypeParam stepper(Tolerances{1e-8, 1e-8});
    stepper.start(watched, kPhase, 0.0, {1.0, 1.0});  // whose rate alone would say a trial of some 0.01
    ASSERT_EQ(stepper.step(limit, 10.0), StepStatus::accepted);
    EXPECT_LE(furthest, limit);
  }
}

TYPED_TEST(SingleSteps, RetakingTheWholeStepIsTheStepAndLeavesItAlone) {
  const auto problem = smooth_problem();
  TypeParam stepper(Tolerances{1e-8, 1e-8});
  stepper.start(problem, kPhase, 0.2, smooth_solution(0.2));
  for (int k = 0; k < 5; ++k) {
    ASSERT_EQ(stepper.step(4.0, 10.0), StepStatus::accepted);
    State<double, 2> before, after, half, whole;
    stepper.interpolate(0.4, before);
    stepper.retake(0.5 * (stepper.t1() - stepper.t0()), half);
    stepper.retake(stepper.t1() - stepper.t0(), whole);
    stepper.interpolate(0.4, after);
    EXPECT_EQ(before[0], after[0]);
    // Radau's iterations start elsewhere and stop at a fiftieth of the tolerance, 1e-8 (1 + |y|).
    EXPECT_NEAR(whole[0], stepper.y1()[0], 0.02 * 1e-8 * (1 + std::abs(whole[0])));
    const auto exact = smooth_solution(0.5 * (stepper.t0() + stepper.t1()));
    EXPECT_NEAR(half[0], exact[0], 1e-6);
  }
}

TYPED_TEST(SingleSteps, ARestartForgetsEverythingButTheStepLength) {
  // The same phase after another one of a different flow gives the same answer to the last bit of the
  // method's own.
  const auto problem = smooth_problem();
  const auto other = free_flow([](int, const auto& t, const auto& y, auto& dy) {
    dy[0] = 5.0 * y[1] + t;
    dy[1] = -3.0 * y[0];
  });
  TypeParam used(Tolerances{1e-9, 1e-9}), fresh(Tolerances{1e-9, 1e-9});
  used.start(other, kPhase, 0.0, {1.0, 1.0});
  while (used.t1() < 1.0) ASSERT_EQ(used.step(1.0, 1e-2), StepStatus::accepted);
  for (TypeParam* stepper : {&used, &fresh}) {
    stepper->start(problem, kPhase, 0.2, smooth_solution(0.2));
    while (stepper->t1() < 3.0) ASSERT_EQ(stepper->step(3.0, 10.0), StepStatus::accepted);
    EXPECT_NEAR(stepper->y1()[0], smooth_solution(3.0)[0], 1e-7);
  }
  EXPECT_NEAR(used.y1()[0], fresh.y1()[0], 1e-7);
}

TYPED_TEST(SingleSteps, AStepCutShortByALimitDoesNotShortenTheNext) {
  const auto problem = smooth_problem();
  TypeParam stepper(Tolerances{1e-7, 1e-7});
  stepper.start(problem, kPhase, 0.2, smooth_solution(0.2));
  while (stepper.t1() < 1.0) ASSERT_EQ(stepper.step(1.0, 10.0), StepStatus::accepted);
  const auto y = stepper.y1();
  stepper.start(problem, kPhase, 1.0, y);
  ASSERT_EQ(stepper.step(1.0 + 1e-11, 10.0), StepStatus::accepted);  // a sliver
  ASSERT_EQ(stepper.step(3.0, 10.0), StepStatus::accepted);
  EXPECT_GT(stepper.t1() - stepper.t0(), 1e-3);
}

TEST(Fsal, TheLastStageIsTheFirstOfTheNextStep) {
  const auto problem = smooth_problem();
  DormandPrince<double, 2> stepper(Tolerances{1e-6, 1e-6});
  stepper.start(problem, kPhase, 0.2, smooth_solution(0.2));
  ASSERT_EQ(stepper.step(3.0, 1e-3), StepStatus::accepted);
  const long first = stepper.flow_evaluations();
  EXPECT_EQ(first, 1 + 1 + 12);  // at the start, a trial for the first length, the stages
  ASSERT_EQ(stepper.step(3.0, 1e-3), StepStatus::accepted);
  EXPECT_EQ(stepper.flow_evaluations(), first + 12);
  State<double, 2> y;
  stepper.interpolate(0.3, y);
  stepper.interpolate(0.7, y);
  EXPECT_EQ(stepper.flow_evaluations(), first + 12 + 3);  // the dense output's, once
}

// ------------------------------------------------------------------ derivatives

/// A TangentStepper around a stepper of values.
template <class Values>
class TangentOf {
 public:
  explicit TangentOf(const Tolerances& tolerances) : stepper_(std::make_unique<Values>(tolerances, true)) {}
  void start(const HybridSystem<2>& system, const Phase& phase, const Dual& t, const State<Dual, 2>& y) {
    stepper_.start(system, phase, t, y);
  }
  StepStatus step(const Dual& limit, double longest) { return stepper_.step(limit, longest); }
  const Dual& t1() const { return stepper_.t1(); }
  const State<Dual, 2>& y1() const { return stepper_.y1(); }

 private:
  TangentStepper<2> stepper_;
};

template <class T>
class WithDual : public testing::Test {};
using Differentiable = testing::Types<DormandPrince<Dual, 2>, TangentOf<Rosenbrock<2>>, TangentOf<Radau<2>>,
                                      TangentOf<SwitchingStepper<2>>>;
TYPED_TEST_SUITE(WithDual, Differentiable);

TYPED_TEST(WithDual, DataMayEndWhereAParameterSaysWithAnyPower) {
  // x' = (1 − t/T)^p, y' = x until T: x = T/(p + 1), y = T²/(p + 2). At fixed t, ∂x'/∂T has a pole at T.
  const double T = 0.7;
  for (const double power : {0.3, 0.5, 0.8, 1.5}) {
    const Dual end = independent(T, 0);
    const auto problem = free_flow(
        [&](int, const auto& t, const auto& y, auto& dy) {
          using S = std::decay_t<decltype(t)>;
          const S left = 1.0 - t / as<S>(end);
          const double u = std::max(value_of(left), 0.0);
          if constexpr (std::is_same_v<S, double>)
            dy[0] = std::pow(u, power);
          else
            dy[0] = S(std::pow(u, power), power * std::pow(std::max(u, 1e-9), power - 1) * left.v);
          dy[1] = y[0];
        },
        FlowKind::stiff);
    TypeParam stepper(Tolerances{1e-6, 1e-8});
    stepper.start(problem, kPhase, Dual(0.0), {Dual(0.0), Dual(0.0)});
    while (stepper.t1().a < T) ASSERT_EQ(stepper.step(end, 10.0), StepStatus::accepted);
    EXPECT_NEAR(stepper.y1()[0].v[0], 1 / (power + 1), 1e-3) << power;
    EXPECT_NEAR(stepper.y1()[1].v[0], 2 * T / (power + 2), 1e-3) << power;
  }
}

TYPED_TEST(WithDual, IsThatOfTheSolution) {
  // x'' = −k x − c x' + sin t from (t0, x0, v0): derivatives with respect to k, c, x0, v0 and t0.
  auto at_end = [](const std::array<Dual, 5>& q) {
    const auto problem = free_flow(
        [q](int, const auto& t, const auto& y, auto& dy) {
          using S = std::decay_t<decltype(t)>;
          using std::sin;
          dy[0] = y[1];
          dy[1] = -as<S>(q[0]) * y[0] * (1.0 + y[0] * y[0]) - as<S>(q[1]) * y[1] + sin(t);
        },
        FlowKind::stiff);
    TypeParam stepper(Tolerances{1e-11, 1e-12});
    stepper.start(problem, kPhase, q[4], {q[2], q[3]});
    while (stepper.t1().a < 3.0) EXPECT_EQ(stepper.step(Dual(3.0), 0.1), StepStatus::accepted);
    return stepper.y1();
  };
  const std::array p{4.0, 0.5, 1.0, -0.2, 0.3};
  const auto exact = at_end(support::seeded(p));
  for (std::size_t k = 0; k < 5; ++k) {
    // The bottom of the V: truncation 1e-8 against step-control noise 1e-10 over 1e-4 to 1e-3.
    const auto off = support::best_differences_by(k, at_end, p, exact);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(off[i], 2e-7) << "parameter " << k << " component " << i;
  }
}

// ------------------------------------------------------------------ one stepper for several phases of a run

class Phases : public EveryMethod {};
UNHAND_EVERY_METHOD(Phases);

TEST_P(Phases, ModesAlternateAndReuseTheSteppers) {
  // Four quarter turns, alternately declared smooth and stiff, are one whole turn.
  auto swing = Toy(
      {{FlowKind::smooth, {{"x", Crossing::falling}}},
       {FlowKind::stiff, {{"v", Crossing::rising}}},
       {FlowKind::smooth, {{"x", Crossing::rising}}},
       {FlowKind::stiff, {{"v", Crossing::falling}}}},
      oscillator(), [](int mode, const auto&, const auto& y, auto* g) { g[0] = y[mode % 2]; },
      [](int mode, int, const auto& t, const auto& y) {
        using S = std::decay_t<decltype(t)>;
        return Entry<S, 2>{(mode + 1) % 4, t, y, S(0)};
      });
  auto o = options();
  const auto end = run(swing, {1.0, 0.0}, 6 * M_PI + 0.5, o);
  EXPECT_EQ(end.outcome, Outcome::horizon);
  ASSERT_EQ(end.events.size(), 12u);
  for (int k = 0; k < 12; ++k)
    EXPECT_NEAR(end.events[k].t, 0.5 * (k + 1) * M_PI, 1e-8);  // 1e-12 in 4,000 steps
  EXPECT_NEAR(end.y[0], std::cos(0.5), 1e-8);
}

}  // namespace
}  // namespace unhand::dynamics
