// A throw from the grip to the ground: the least that a program needs.
#include <cstdio>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

using namespace unhand;

int main() {
  // The hand moves along +x and +z and turns; it brakes from 30 ms on.
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.03, {3.0, 3.0, 0.0}}, {0.20, {-8.0, -8.0, 0.0}}});
  // One pad's normal force: told to open at 20 ms, 60 N until 30 ms, gone at 100 ms.
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.02, 60.0, 0.010, 0.070, 2.0});
  contact::ContactParameters<double> pads;
  pads.patch = {0.5, 0.0106};  // friction coefficient, radius [m]
  const auto gravity = dynamics::level_gravity(9.81);

  for (const char* model : {"limit_surface_disc", "limit_surface", "sliding_pivot"}) {
    const auto law = contact::make_contact_model(model, pads);
    const release::ReleaseProblem<double> problem{hand, force, *law, {0.246, 2.4e-3}, gravity, {0.10, -0.7}};
    const auto let_go = release::simulate_release(problem);
    if (let_go.outcome != release::ReleaseOutcome::detached) return 1;
    const auto flown = flight::fly<double>({let_go.detach.pose, let_go.detach.twist, gravity});
    if (flown.outcome != flight::FlightOutcome::landed) return 1;
    std::printf("%-20s lands at x = %.4f m, theta = %.3f rad\n", model, flown.landing.pose.x,
                flown.landing.pose.theta);
    for (const auto& event : release::mode_events(problem, let_go))
      std::printf("    %7.2f ms  %s\n", 1e3 * event.time, event.mode.c_str());
  }
}
