// Derivatives through the landing against differences.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "flight/fly.hpp"
#include "tests/flight/tight.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand::flight {
namespace {

using dynamics::Dual;
using dynamics::independent;

struct DerivativeCase {
  const char* name;
  double drag, tracked;
};
class LandingDerivatives : public testing::TestWithParam<DerivativeCase> {};
INSTANTIATE_TEST_SUITE_P(, LandingDerivatives,
                         testing::Values(DerivativeCase{"Projectile", 0, 0}, DerivativeCase{"Drag", 0.3, 0},
                                         DerivativeCase{"TrackedPoint", 0, 0.08},
                                         DerivativeCase{"Both", 0.3, 0.08}),
                         [](const auto& test) { return test.param.name; });

TEST_P(LandingDerivatives, AgreeWithCentralDifferences) {
  // z, vx, vz, omega, g_x, g_z, drag, tracked x; theta and the height in a second sweep.
  const std::array<double, 10> p{1.1, 1.5, 2.0, 6.0, 0.4, -9.81, GetParam().drag, GetParam().tracked,
                                 0.3, 0.05};
  const auto land = [&](const std::array<Dual, 10>& x) {
    FlightProblem<Dual> problem;
    problem.pose = {Dual(0.1), x[0], x[8]};
    problem.twist = {x[1], x[2], x[3]};
    problem.gravity = {x[4], x[5]};
    problem.drag_k = x[6];
    problem.tracked = {x[7], Dual(0)};
    problem.landing_height = x[9];
    const auto result = fly(problem, kTight);
    EXPECT_EQ(result.outcome, FlightOutcome::landed);
    const auto& l = result.landing;
    return std::array<Dual, 7>{l.flight_time, l.pose.x,   l.pose.z,     l.pose.theta,
                               l.twist.vx,    l.twist.vz, l.twist.omega};
  };
  for (const std::size_t first : {0, 8}) {
    const auto exact = land(support::seeded(p, first));
    for (std::size_t k = first; k < (first == 0 ? 8 : 10); ++k) {
      if (k == 6 && p[k] == 0) continue;  // drag has one side at zero: below
      // The bottom of the V: truncation of order 10 step², noise of the steps' choice 1e-12 over the step.
      const auto off = support::best_differences_by(k, land, p, exact, 1e-1, first);
      for (std::size_t i = 0; i < 7; ++i) EXPECT_LT(off[i], 5e-7) << "parameter " << k << " component " << i;
    }
  }
}

TEST(LandingDerivative, ByDragAtNoDrag) {
  FlightProblem<Dual> p;
  p.pose = {Dual(0.0), Dual(1.0), Dual(0.0)};
  p.twist = {Dual(2.0), Dual(1.5), Dual(3.0)};
  p.gravity = {Dual(0.0), Dual(-9.81)};
  p.drag_k = independent(0.0, 0);
  const Dual x = fly(p, kTight).landing.pose.x;
  const auto at = [&](double k) {
    p.drag_k = Dual(k);
    return fly(p, kTight).landing.pose.x.a;
  };
  double best = INFINITY;  // one-sided, of second order
  for (double step = 1e-2; step > 1e-7; step *= 0.1)
    best = std::min(best, std::abs((4 * at(step) - at(2 * step) - 3 * at(0)) / (2 * step) - x.v[0]));
  EXPECT_LT(best, 1e-6);
  EXPECT_LT(x.v[0], 0);
}

}  // namespace
}  // namespace unhand::flight
