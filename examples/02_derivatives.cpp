// How a landing changes with friction, pad radius, mass, inertia and lever: exact, through every event.
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

using namespace unhand;
using dynamics::Dual;

/// x [m] at the landing, of the parameters (mu, radius, mass, inertia, lever). Throws where there is none: a
/// result has a meaning only if its outcome says so.
template <class S>
S landing_x(const S (&p)[5]) {
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.03, {3.0, 3.0, 0.0}}, {0.20, {-8.0, -8.0, 0.0}}});
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.02, 60.0, 0.010, 0.070, 2.0});
  contact::ContactParameters<S> pads;
  pads.patch.mu = p[0];
  pads.patch.radius = p[1];
  const auto law = contact::make_contact_model("limit_surface_disc", pads);
  const auto gravity = dynamics::level_gravity(S(9.81));
  const auto let_go =
      release::simulate_release<S>({hand, force, *law, {p[2], p[3]}, gravity, {p[4], S(-0.7)}});
  if (let_go.outcome != release::ReleaseOutcome::detached)
    throw std::runtime_error(release::in_words(let_go.outcome));
  const auto flown = flight::fly<S>({let_go.detach.pose, let_go.detach.twist, gravity});
  if (flown.outcome != flight::FlightOutcome::landed)
    throw std::runtime_error(flight::in_words(flown.outcome));
  return flown.landing.pose.x;
}

int main() {
  const double at[5] = {0.5, 0.0106, 0.246, 2.4e-3, 0.10};
  const char* names[5] = {"mu", "radius [m]", "mass [kg]", "inertia [kg m2]", "lever [m]"};
  Dual seeded[5];
  for (int k = 0; k < 5; ++k) seeded[k] = dynamics::independent(at[k], k);
  const Dual x = landing_x(seeded);  // one run, all derivatives
  std::printf("x = %.5f m\n", x.a);
  bool right = true;
  for (int k = 0; k < 5; ++k) {
    double up[5], down[5];
    for (int i = 0; i < 5; ++i) up[i] = down[i] = at[i];
    const double h = 1e-3 * at[k];
    up[k] += h;
    down[k] -= h;
    const double difference = (landing_x(up) - landing_x(down)) / (2 * h);
    std::printf("dx/d %-16s %12.5f   central difference %12.5f\n", names[k], x.v[k], difference);
    right = right && at[k] * std::abs(x.v[k] - difference) < 1e-6;  // m per relative change of the parameter
  }
  return right ? 0 : 1;
}
