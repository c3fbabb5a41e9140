// The library's own steppers against CVODE on a thousand random throws.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand {
namespace {

struct Comparison {
  const char* model;
  int throws;
};
void PrintTo(const Comparison& c, std::ostream* out) { *out << c.model; }

class Cvode : public testing::TestWithParam<Comparison> {
 protected:
  struct Answer {
    dynamics::Twist<double> twist;
    std::vector<int> modes;
    double closest{1};  ///< shortest time between two events [s]
  };
  static Answer release(const support::RandomThrow& thrown, dynamics::Method method, double relative) {
    const auto model = contact::make_contact_model(GetParam().model, support::parameters_of(thrown));
    release::ReleaseOptions options;
    options.integrator = support::tight(relative, 1e-2 * relative);
    options.integrator.method = method;
    const auto result = simulate_release(support::problem_of(thrown, *model), options);
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << to_string(result.integration);
    Answer answer{result.detach.twist, {}, 1};
    double before = -1;
    for (const auto& event : result.events) {
      answer.modes.push_back(event.mode_after);
      answer.closest = std::min(answer.closest, event.t - before);
      before = event.t;
    }
    return answer;
  }
};
INSTANTIATE_TEST_SUITE_P(, Cvode,
                         testing::Values(Comparison{"sliding_pivot", 1000}, Comparison{"limit_surface", 1000},
                                         Comparison{"limit_surface_disc", 200},
                                         Comparison{"limit_surface_quartic", 100}),
                         [](const auto& comparison) { return std::string(comparison.param.model); });

TEST_P(Cvode, AgreesOnTheDetachTwist) {
  std::mt19937_64 random(71);
  int other_sequence = 0, switches = 0;
  double worst = 0;
  for (int i = 0; i < GetParam().throws; ++i) {
    const auto thrown = support::random_throw(random, i % 2);  // shaken and smooth by turns
    const Answer ours = release(thrown, dynamics::Method::automatic, 1e-10);
    const Answer cvode = release(thrown, dynamics::Method::cvode, 1e-11);
    switches += static_cast<int>(ours.modes.size());
    if (ours.modes != cvode.modes) {
      // A demand that just touches its limit may or may not count as a slip: counted, not compared.
      ++other_sequence;
      continue;
    }
    const double difference =
        std::max({std::abs(ours.twist.vx - cvode.twist.vx), std::abs(ours.twist.vz - cvode.twist.vz),
                  std::abs(ours.twist.omega - cvode.twist.omega)});
    worst = std::max(worst, difference);
    // 1e-7 m/s and rad/s: a slip that lasts amplifies what each step may err (1e-10, and 1e-11 for CVODE,
    // whose local error makes some ten times the global one) by up to a thousand.
    EXPECT_LT(difference, 1e-7) << "throw " << i << " of seed 71, " << ours.modes.size() << " events, mass "
                                << thrown.body.mass << " inertia " << thrown.body.inertia << " offset "
                                << thrown.grasp.com_offset;
  }
  EXPECT_LE(other_sequence, GetParam().throws / 100);
  EXPECT_GT(switches, 3 * GetParam().throws);
  RecordProperty("worst", std::to_string(worst));
  RecordProperty("other_sequence", other_sequence);
}

}  // namespace
}  // namespace unhand
