// The answer is the tolerances' limit, and the same every time.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "dynamics/median.hpp"
#include "tests/contract/every_model.hpp"

namespace unhand {
namespace {

class Convergence : public EveryModel {
 protected:
  static dynamics::Twist<double> twist(const support::RandomThrow& thrown, double tolerance) {
    const auto model = make(support::parameters_of(thrown));
    const auto result = simulate_release(support::problem_of(thrown, *model),
                                         {.integrator = {.tolerances = {tolerance, 1e-2 * tolerance}}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    return result.detach.twist;
  }
  static double distance(const dynamics::Twist<double>& a, const dynamics::Twist<double>& b) {
    return std::hypot(a.vx - b.vx, a.vz - b.vz, 0.05 * (a.omega - b.omega));  // m/s; an arm of 5 cm
  }
};
UNHAND_EVERY_MODEL(Convergence);

TEST_P(Convergence, TighterIsCloser) {
  constexpr int kThrows = 40;
  constexpr double kTolerance[] = {1e-4, 1e-6, 1e-8, 1e-10};
  std::mt19937_64 random(41);
  std::vector<double> errors[4];
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    const auto reference = twist(thrown, 1e-12);
    for (int k = 0; k < 4; ++k) errors[k].push_back(distance(twist(thrown, kTolerance[k]), reference));
  }
  double median[4];
  for (int k = 0; k < 4; ++k) {
    median[k] = dynamics::median(errors[k]);
    // The error of a throw is that of some tens of steps, each amplified by the slip that follows.
    EXPECT_LE(median[k], 30 * kTolerance[k]) << "tolerance " << kTolerance[k];
    // A hundredth of the tolerance is at least a tenth of the error, until rounding and stops (1e-8 s) are
    // seen.
    if (k > 0) {
      EXPECT_LE(median[k], std::max(0.1 * median[k - 1], 3e-11)) << "tolerance " << kTolerance[k];
    }
  }
}

TEST_P(Convergence, TheSameTwice) {
  std::mt19937_64 random(42);
  for (int i = 0; i < 20; ++i) {
    const auto thrown = support::random_throw(random, 1);
    const auto a = twist(thrown, 1e-8), b = twist(thrown, 1e-8);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0) << describe(thrown);
  }
}

TEST_P(Convergence, RecordingChangesNothing) {
  std::mt19937_64 random(43);
  for (int i = 0; i < 20; ++i) {
    const auto thrown = support::random_throw(random, 1);
    const auto model = make(support::parameters_of(thrown));
    const auto problem = support::problem_of(thrown, *model);
    release::ReleaseOptions recorded;
    recorded.ledger = true;
    const auto a = simulate_release(problem), b = simulate_release(problem, recorded);
    EXPECT_EQ(std::memcmp(&a.detach, &b.detach, sizeof a.detach), 0) << describe(thrown);
  }
}

}  // namespace
}  // namespace unhand
