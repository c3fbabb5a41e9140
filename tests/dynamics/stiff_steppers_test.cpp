// Stiff flows: accuracy with few steps, and decay in one.
#include "dynamics/radau.hpp"
#include "dynamics/rosenbrock.hpp"
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Stiff : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(, Stiff,
                         testing::Values(Method::automatic, Method::rosenbrock, Method::radau, Method::cvode),
                         [](const auto& test) { return name_of(test.param); });

IntegratorOptions stiff_options(Method method, double tolerance) {
  IntegratorOptions o;
  o.method = method;
  o.tolerances = {tolerance, tolerance};
  o.longest_step = INFINITY;
  return o;
}

TEST_P(Stiff, ProtheroRobinson) {
  // y' = λ (y − φ) + φ', y = φ = sin t: the order reduces, the tolerance must be kept with few steps all the
  // same.
  for (const double lambda : {-1e2, -1e4, -1e6}) {
    const auto problem = free_flow(
        [lambda](int, const auto& t, const auto& y, auto& dy) {
          using std::cos;
          using std::sin;
          dy[0] = lambda * (y[0] - sin(t)) + cos(t);
          dy[1] = lambda * (y[1] - y[0] * y[0]) + 2.0 * y[0] * cos(t);
        },
        FlowKind::stiff);
    const auto end = run(problem, {0.0, 0.0}, 10.0, stiff_options(GetParam(), 1e-7));
    EXPECT_EQ(end.outcome, Outcome::horizon);
    EXPECT_NEAR(end.y[0], std::sin(10.0), 1e-5) << lambda;  // a hundred tolerances
    EXPECT_NEAR(end.y[1], std::sin(10.0) * std::sin(10.0), 1e-5) << lambda;
    EXPECT_LT(end.statistics.steps, 6000) << lambda;  // an explicit method needs |λ|·10/3: 3e6 for the last
  }
}

TEST_P(Stiff, VanDerPolAgainstTightCvode) {
  // In the scaling x' = y, ε y' = (1 − x²) y − x with ε = μ^-2 and t in units of μ; past two jumps.
  for (const double mu : {1e3, 1e6}) {
    const double eps = 1 / (mu * mu);
    const auto problem = free_flow(
        [eps](int, const auto&, const auto& y, auto& dy) {
          dy[0] = y[1];
          dy[1] = ((1.0 - y[0] * y[0]) * y[1] - y[0]) / eps;
        },
        FlowKind::stiff);
    auto tight = stiff_options(Method::cvode, 1e-12);
    const auto oracle = run(problem, {2.0, -2.0 / 3}, 2.0, tight);
    const auto end = run(problem, {2.0, -2.0 / 3}, 2.0, stiff_options(GetParam(), 1e-8));
    ASSERT_EQ(oracle.outcome, Outcome::horizon);
    EXPECT_EQ(end.outcome, Outcome::horizon);
    // The jumps pass on an error of their time times the slow speed: a few hundred tolerances.
    EXPECT_NEAR(end.y[0], oracle.y[0], 1e-5) << mu;
    EXPECT_LT(end.statistics.steps, 12'000) << mu;
    if (mu == 1e3) {
      EXPECT_NEAR(oracle.y[0], 1.706167732170469, 1e-6);  // [HairerWanner1996] IV.10: ε = 1e-6, t = 2
    }
  }
}

template <class T>
class LStable : public testing::Test {};
using Implicit = testing::Types<Rosenbrock<2>, Radau<2>>;
TYPED_TEST_SUITE(LStable, Implicit);

TYPED_TEST(LStable, AnInfinitelyFastDecayIsGoneInOneStep) {
  const auto problem = free_flow(
      [](int, const auto& t, const auto& y, auto& dy) {
        dy[0] = -1e8 * y[0];
        dy[1] = 0.0 * y[1] + 0.0 * t;
      },
      FlowKind::stiff);
  TypeParam stepper(Tolerances{1.0, 10.0});  // the step is accepted as asked
  stepper.start(problem, kPhase, 0.0, {1.0, 1.0});
  ASSERT_EQ(stepper.step(10.0, 1.0), StepStatus::accepted);
  while (stepper.t1() - stepper.t0() < 0.999) {
    stepper.start(problem, kPhase, 0.0, {1.0, 1.0});
    ASSERT_EQ(stepper.step(10.0, 1.0), StepStatus::accepted);
  }
  // R(z) ~ C/z at infinity, z = −1e8.
  EXPECT_LT(std::abs(stepper.y1()[0]), 1e-6);
  EXPECT_NEAR(stepper.y1()[1], 1.0, 1e-14);
}

}  // namespace
}  // namespace unhand::dynamics
