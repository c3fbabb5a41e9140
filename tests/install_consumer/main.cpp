#include <cstdio>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

int main() {
  using namespace unhand;
  // The hand from t = 0 s: pose (x [m], z [m], theta [rad]), twist (m/s, m/s, rad/s), and how it accelerates
  // (m/s^2, m/s^2, rad/s^2) until 30 ms and from then on.
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.03, {3.0, 3.0, 0.0}}, {0.20, {-8.0, -8.0, 0.0}}});
  // One pad's normal force: 60 N, told to open at 20 ms, falls from 30 ms on as (1 - s)^2, gone at 100 ms.
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.02, 60.0, 0.010, 0.070, 2.0});
  contact::ContactParameters<double> pads;
  pads.patch = {0.5, 0.0106};  // friction coefficient, pad radius [m]
  const auto law = contact::make_contact_model("limit_surface_disc", pads);
  const dynamics::RigidBody<double> bar{0.246, 2.4e-3};  // kg, kg m^2
  const auto gravity = dynamics::level_gravity(9.81);    // [m/s^2]

  // Held 0.10 m from its centre of mass, turned by -0.7 rad against the hand.
  const auto let_go = release::simulate_release<double>({hand, force, *law, bar, gravity, {0.10, -0.7}});
  if (let_go.outcome != release::ReleaseOutcome::detached) return 1;
  const auto flown = flight::fly<double>({let_go.detach.pose, let_go.detach.twist, gravity});
  if (flown.outcome != flight::FlightOutcome::landed) return 1;
  std::printf("free at %.4f s, turning at %.3f rad/s\n", let_go.detach.time, let_go.detach.twist.omega);
  std::printf("lands at x = %.4f m, theta = %.3f rad\n", flown.landing.pose.x, flown.landing.pose.theta);
  // free at 0.1000 s, turning at 1.700 rad/s
  // lands at x = 1.6398 m, theta = 1.396 rad
}
