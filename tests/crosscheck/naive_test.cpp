// The sign law at a fixed step tends to the event-detected answer, slowly, and never stops chattering.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/registry.hpp"
#include "release/naive_release.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand {
namespace {

TEST(Naive, TendsToTheEventDetectedAnswerAndChattersOnTheWay) {
  constexpr int kThrows = 20;
  constexpr double kStep[] = {1e-3, 1e-4, 1e-5, 1e-6};
  std::mt19937_64 random(73);
  double error[4]{}, reversals[4]{};
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, 0);
    const auto model = contact::make_contact_model("limit_surface", support::parameters_of(thrown));
    const auto problem = support::problem_of(thrown, *model);
    release::ReleaseOptions options;
    options.integrator = support::tight(1e-9, 1e-11);
    const auto exact = simulate_release(problem, options).detach.twist;
    for (int k = 0; k < 4; ++k) {
      const auto naive = simulate_release_naive(problem, thrown.patch, {kStep[k], 0});
      ASSERT_EQ(naive.outcome, release::ReleaseOutcome::detached);
      const auto& v = naive.detach.twist;
      error[k] += std::hypot(v.vx - exact.vx, v.vz - exact.vz, 0.1 * (v.omega - exact.omega)) / kThrows;
      reversals[k] += static_cast<double>(naive.reversals) / kThrows;
    }
  }
  for (int k = 1; k < 4; ++k) {
    EXPECT_LT(error[k], error[k - 1]) << "step " << kStep[k];
    // chatter does not vanish: it goes on at every step size, with more reversals at shorter steps
    EXPECT_GT(reversals[k], 2 * reversals[k - 1]) << "step " << kStep[k];
  }
  EXPECT_GT(error[0], 0.05) << "a millisecond is far from the answer [m/s]";
  EXPECT_LT(error[3], 0.02 * error[0]) << "it does tend to the same answer";
  EXPECT_GT(error[3], 1e-7) << "where the event-detected one has long arrived";
}

TEST(Naive, AnObjectThatSlipsFromTheStartAndProblemsThatAreNone) {
  std::mt19937_64 random(74);
  const auto thrown = support::random_throw(random, 0);
  const auto model = contact::make_contact_model("limit_surface", support::parameters_of(thrown));
  const auto held = support::problem_of(thrown, *model);
  const release::ReleaseProblem<double> slips{
      held.hand, held.normal_force, *model, held.body, held.gravity, held.grasp, 0.0, {0.3, -0.2}, 5.0};
  release::ReleaseOptions options;
  options.integrator = support::tight(1e-9, 1e-11);
  const auto exact = simulate_release(slips, options).detach, still = simulate_release(held, options).detach;
  const auto naive = simulate_release_naive(slips, thrown.patch, {1e-7, 0}).detach;
  const auto off = [](const auto& a, const auto& b) {
    return std::hypot(a.pose.x - b.pose.x, a.pose.z - b.pose.z, 0.1 * (a.pose.theta - b.pose.theta));
  };
  EXPECT_LT(off(naive, exact), 0.02 * off(still, exact));

  const auto with = [&](double mass, double start) {
    return release::ReleaseProblem<double>{
        held.hand, held.normal_force, *model, {mass, 1e-3}, held.gravity, held.grasp, start, {}, 0.0};
  };
  EXPECT_THROW(simulate_release_naive(with(-1, 0), thrown.patch), std::invalid_argument);
  EXPECT_THROW(simulate_release_naive(with(NAN, 0), thrown.patch), std::invalid_argument);
  EXPECT_THROW(simulate_release_naive(with(0.1, -0.5), thrown.patch), std::invalid_argument);
}

TEST(Naive, SmoothingHidesTheChatterAndCreeps) {
  // A held object: the smoothed law slips at v_s f/f_max for ever, the event-detected one does not move.
  const auto hand = support::still_hand(1);
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.9, 20, 0, 0.05, 1});
  const contact::Patch<double> patch{0.5, 0.01, 2.0 / 3, 2};
  contact::ContactParameters<double> p;
  p.patch = patch;
  const auto model = contact::make_contact_model("limit_surface", p);
  const release::ReleaseProblem<double> problem{hand,   force, *model, {0.2, 1e-3}, {0, -9.81},
                                                {0, 0}, 0.0,   {},     0.0};
  const auto naive = simulate_release_naive(problem, patch, {1e-5, 1e-2});
  release::ReleaseOptions options;
  options.integrator.record = true;
  const auto exact = simulate_release(problem, options);
  EXPECT_EQ(sample_release(problem, exact, 0.8).relative.arm.z, 0.0);
  // f/f_max = 1.962/20: sqrt(1 − ρ²) v = ρ v_s, over 0.9 s, and then the fall: at least 0.8 mm of creep
  EXPECT_LT(naive.detach.pose.z, exact.detach.pose.z - 8e-4);
}

TEST(Naive, RefusesAStepThatIsNone) {
  std::mt19937_64 random(74);
  const auto thrown = support::random_throw(random, 0);
  const auto model = contact::make_contact_model("limit_surface", support::parameters_of(thrown));
  for (const double step : {0.0, -1e-3, 1e-20, 0.2, std::nan("")})
    EXPECT_THROW(simulate_release_naive(support::problem_of(thrown, *model), thrown.patch, {step, 0}),
                 std::invalid_argument);
}

}  // namespace
}  // namespace unhand
