// Collocation in size and direction: a slip that is known beforehand, under friction of any strength.
#include "dynamics/directed_stepper.hpp"

#include <gmock/gmock.h>

#include <random>

#include "dynamics/dormand_prince.hpp"

namespace unhand::dynamics {
namespace {

constexpr double kWeight[3] = {1, 1, 0.02};  // of the components of u: two speeds and a turning rate

/// u = s n with s = a₂ t² + a₃ t³ + a₄ t⁴ and n turning along a great circle, which solves u' = −K
/// n + b with b = s' n + s n' + K n; and z' = u.
struct Known {
  double strength, a2, a3, a4, rate{7};  // K, a, rad/s

  struct At {
    std::array<double, 3> n, slope;
    double size, growth;
  };
  At at(double t) const {
    const double c = std::cos(rate * t), s = std::sin(rate * t);
    return {{c, 0.6 * s, 0.8 * s},
            {-rate * s, 0.6 * rate * c, 0.8 * rate * c},
            t * t * (a2 + t * (a3 + t * a4)),
            t * (2 * a2 + t * (3 * a3 + 4 * a4 * t))};
  }
  State<double, 6> state(double t, double integral_step = 1e-4) const {
    State<double, 6> y{};
    const At now = at(t);
    for (int k = 0; k < 3; ++k) y[3 + k] = now.size * now.n[k] / kWeight[k];
    // z by Simpson's rule, on so fine a grid that its error is of the order of rounding
    const int count = 2 * std::max(1, static_cast<int>(t / integral_step / 2));
    for (int i = 0; i <= count; ++i) {
      const At then = at(t * i / count);
      const double weight = (i == 0 || i == count ? 1 : i % 2 == 1 ? 4 : 2) * t / (3 * count);
      for (int k = 0; k < 3; ++k) y[k] += weight * then.size * then.n[k] / kWeight[k];
    }
    return y;
  }
};

class KnownSlip final : public HybridSystemFrom<KnownSlip, 6> {
 public:
  explicit KnownSlip(const Known& known) : known_(known) {}
  FlowKind kind(int) const override { return FlowKind::stiff; }
  std::string_view mode_name(int) const override { return "slip"; }
  int guard_count(int) const override { return 0; }
  Guard guard(int, int) const override { return {}; }
  State<double, 6> pace_weights() const override { return {0, 0, 0, kWeight[0], kWeight[1], kWeight[2]}; }

  template <class S>
  void flow_(const Phase&, const S& t, const State<S, 6>& y, State<S, 6>& dy) const {
    using std::sqrt;
    const Known::At known = known_.at(value_of(t));
    S u[3], square(0);
    for (int k = 0; k < 3; ++k) {
      dy[k] = y[3 + k];
      u[k] = kWeight[k] * y[3 + k];
      square += u[k] * u[k];
    }
    for (int k = 0; k < 3; ++k)
      dy[3 + k] = (known.growth * known.n[k] + known.size * known.slope[k] +
                   known_.strength * (known.n[k] - u[k] / sqrt(square))) /
                  kWeight[k];
  }
  template <class S>
  void guards_(const Phase&, const S&, const State<S, 6>&, S*) const {}
  template <class S>
  Entry<S, 6> on_guard_(const Phase& p, int, const S& t, const State<S, 6>& y) const {
    return {p.mode, t, y, S(0)};
  }

 private:
  Known known_;
};

constexpr Phase kOnePhase{0, {0, 1}};

double error_of(const State<double, 6>& y, const State<double, 6>& exact) {
  double most = 0;
  for (int k = 0; k < 3; ++k)
    most = std::max(
        {most, std::abs(y[k] - exact[k]) * kWeight[k], std::abs(y[3 + k] - exact[3 + k]) * kWeight[k]});
  return most;
}

DirectedStepper<6> stepper_of(const Tolerances& tolerances) {
  return DirectedStepper<6>(tolerances, std::make_unique<DormandPrince<double, 6>>(tolerances));
}

/// The stepper's way from t0 to t1; the number of steps.
int run(Stepper<double, 6>& stepper, const KnownSlip& system, double t0, double t1,
        const State<double, 6>& y) {
  stepper.start(system, kOnePhase, t0, y);
  int steps = 0;
  while (stepper.t1() < t1 && ++steps < 5000)
    EXPECT_EQ(stepper.step(t1, 1.0), StepStatus::accepted) << "at " << stepper.t1();
  return steps;
}

TEST(DirectedStepper, FollowsASlipFromNextToNothingUnderAnyFriction) {
  const Tolerances tolerances{1e-8, 1e-10};
  int fewest = 5000, most = 0;
  for (const double strength :
       {1e3, 1e5, 1e7}) {  // relaxes within 1e-13 s at the start, up to 1e-3 s at the end
    const Known known{strength, 3, -2, 1};
    auto stepper = stepper_of(tolerances);
    const int steps = run(stepper, KnownSlip(known), 1e-5, 0.6, known.state(1e-5));
    // u = 0.8 at the end: some ten errors of 1e-8 of it
    EXPECT_LT(error_of(stepper.y1(), known.state(0.6)), 2e-7) << "K = " << strength;
    fewest = std::min(fewest, steps);
    most = std::max(most, steps);
  }
  // From s = 3e-10, over nine decades: the steps know of the turning alone, 4.2 rad of it.
  EXPECT_LT(most, 40);
  EXPECT_LE(most, fewest + 3);
}

TEST(DirectedStepper, TheErrorFollowsTheToleranceForFewMoreSteps) {
  const Known known{1e6, 3, -2, 1};
  int steps[3];
  for (int k = 0; k < 3; ++k) {
    const double tolerance = std::pow(100, -2 - k);
    auto stepper = stepper_of({tolerance, 0.01 * tolerance});
    steps[k] = run(stepper, KnownSlip(known), 1e-4, 0.6, known.state(1e-4));
    EXPECT_LT(error_of(stepper.y1(), known.state(0.6)), 10 * tolerance);
  }
  // A method of order five would take 6.3 times the steps, one of order nine 2.8 times.
  EXPECT_LT(steps[2], 4 * steps[0]);
}

TEST(DirectedStepper, EndsJustBeforeAStop) {
  std::mt19937_64 random(5);
  for (int k = 0; k < 20; ++k) {
    const double end = std::uniform_real_distribution<double>(0.1, 0.6)(random);
    const Known known{std::pow(10, std::uniform_real_distribution<double>(3, 7)(random)), 2, -2 / end, 0};
    auto stepper = stepper_of({1e-8, 1e-10});
    const KnownSlip system(known);
    stepper.start(system, kOnePhase, 1e-4, known.state(1e-4));
    int steps = 0;
    for (; steps < 60; ++steps) {
      ASSERT_EQ(stepper.step(1.0, 1.0), StepStatus::accepted);
      ASSERT_LT(stepper.t1(), end) << "a step over a stop, K = " << known.strength;
      if (end - stepper.t1() < 1e-7) break;
    }
    // 4e-9 s before it; s falls at 2 end there, and may be wrong by some 1e-10.
    EXPECT_NEAR(end - stepper.t1(), 4e-9, 1e-9) << "K = " << known.strength << " end " << end;
    EXPECT_LT(steps, 40);
  }
}

/// s falls below zero for a few thousandths of a step that begins and ends well above, and has a node nowhere
/// near.
TEST(DirectedStepper, SeesAStopBetweenTheNodes) {
  for (const double depth : {1e-3, 1e-5, 1e-7})
    for (const double bottom : {0.2, 0.25, 0.3, 0.35}) {
      // s = t² (t − bottom)²/bottom² − depth t²: zero at bottom (1 ∓ √depth)
      const double k = 1 / (bottom * bottom);
      const Known known{1e5, 1 - depth, -2 * k * bottom, k, 2};
      const double end = bottom * (1 - std::sqrt(depth));
      auto stepper = stepper_of({1e-8, 1e-10});
      const KnownSlip system(known);
      stepper.start(system, kOnePhase, 0.02, known.state(0.02));
      for (int steps = 0; steps < 60 && end - stepper.t1() > 1e-7; ++steps) {
        ASSERT_EQ(stepper.step(1.0, 1.0), StepStatus::accepted);
        ASSERT_LT(stepper.t1(), end) << "a step over a stop, depth " << depth << " bottom " << bottom;
      }
      EXPECT_LT(end - stepper.t1(), 1e-7) << "depth " << depth << " bottom " << bottom;
    }
}

TEST(DirectedStepper, DenseOutputIsAsGoodAsTheStep) {
  const Known known{1e6, 3, -2, 1};
  auto stepper = stepper_of({1e-8, 1e-10});
  const KnownSlip system(known);
  stepper.start(system, kOnePhase, 1e-3, known.state(1e-3));
  while (stepper.t1() < 0.5) {
    ASSERT_EQ(stepper.step(0.5, 1.0), StepStatus::accepted);
    for (const double theta : {0.0, 0.2, 0.45, 0.7, 0.95, 1.0}) {
      const StepPoint<6> point = stepper.point(theta);
      // order six in between: 1e-6 of what the step changes
      EXPECT_LT(error_of(point.y, known.state(point.t)), 1e-6) << point.t;
      EXPECT_NEAR(stepper.fraction(point.t - stepper.t0()), theta, 1e-12);
    }
  }
}

TEST(DirectedStepper, LeavesADirectionThatIsFreeToTheOther) {
  const Known known{0.5, 3, -2, 1};  // relaxes in seconds
  const Tolerances tolerances{1e-9, 1e-11};
  auto stepper = stepper_of(tolerances);
  run(stepper, KnownSlip(known), 0.1, 0.6, known.state(0.1));
  EXPECT_LT(error_of(stepper.y1(), known.state(0.6)), 1e-7);
  DormandPrince<double, 6> alone(tolerances);
  run(alone, KnownSlip(known), 0.1, 0.6, known.state(0.1));
  // beside what the trials cost: three evaluations each
  EXPECT_LT(stepper.flow_evaluations(), alone.flow_evaluations() + 60);
}

}  // namespace
}  // namespace unhand::dynamics
