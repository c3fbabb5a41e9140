// The corners of what may be asked of a release, in every combination: each model answers, typed and finite,
// within a budget.
#include <cmath>

#include "tests/contract/every_model.hpp"

namespace unhand {
namespace {

class Corners : public EveryModel {};
UNHAND_EVERY_MODEL(Corners);

TEST_P(Corners, HaveFiniteAnswers) {
  for (const double mu : {0.0, 5.0})
    for (const double radius : {1e-9, 1e-8, 1e-6, 0.1})  // m; a radius of zero is refused
      for (const double lever : {0.0, 0.3})
        for (const double opening : {1e-6, 10.0})
          for (const double mass : {1e-3, 100.0})
            for (const double spin : {0.0, 50.0}) {
              std::array<support::SwayingHand::Coordinate, 3> c{};
              c[2].v = spin;
              const support::SwayingHand hand(c, opening + 0.02);
              const contact::ProfileNormalForce force({0.001, 30, 0, opening, 1});
              contact::ContactParameters<double> p;
              p.patch = {mu, radius};
              p.open_command = 0.001;
              p.delay = 0.7 * opening;
              const auto model = make(p);
              const release::ReleaseProblem<double> problem{
                  hand, force, *model, {mass, mass * 0.05 * 0.05}, {0, -9.81}, {lever, 0.3}, 0.0, {}, 0.0};
              std::ostringstream inputs;
              inputs << "mu " << mu << " radius " << radius << " lever " << lever << " opening " << opening
                     << " mass " << mass << " spin " << spin;
              const auto result = simulate_release(problem);
              EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached)
                  << to_string(result.integration) << ", " << inputs.str();
              const auto& d = result.detach;
              for (const double x :
                   {d.time, d.pose.x, d.pose.z, d.pose.theta, d.twist.vx, d.twist.vz, d.twist.omega})
                EXPECT_TRUE(std::isfinite(x)) << inputs.str();
              EXPECT_LT(result.statistics.steps, 200'000) << inputs.str();
              // Nothing at all holds an object without friction: it falls freely while the pads open.
              if (mu == 0 && !carried()) {
                EXPECT_NEAR(d.twist.vz, spin * lever * std::cos(0.3) - 9.81 * d.time,
                            1e-6 * (1 + 9.81 * d.time))
                    << inputs.str();
                EXPECT_NEAR(d.twist.omega, spin, 1e-9 * (1 + spin)) << inputs.str();
              }
            }
}

}  // namespace
}  // namespace unhand
