// The same releases by other integrators, other physics and another engine.
#include <random>

#include "bench/validation_rows.hpp"
#include "contact/registry.hpp"
#include "crosscheck/bullet_release.hpp"
#include "crosscheck/distributed_patch.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::bench {
namespace {

release::ReleaseOptions tight_to(double relative) {
  release::ReleaseOptions options;
  options.integrator = support::tight(relative, 1e-2 * relative);
  return options;
}

/// Largest difference of the detach twist, ours against CVODE's, over random throws [m/s, rad/s].
double against_cvode(const char* law) {
  std::mt19937_64 random(71);
  double worst = 0;
  for (int k = 0; k < 20; ++k) {
    const auto thrown = support::random_throw(random, k % 2);  // smooth and shaken by turns
    const auto model = contact::make_contact_model(law, support::parameters_of(thrown));
    const auto problem = support::problem_of(thrown, *model);
    auto cvode = tight_to(1e-11);
    cvode.integrator.method = dynamics::Method::cvode;
    const auto a = simulate_release(problem, tight_to(1e-10)).detach.twist;
    const auto b = simulate_release(problem, cvode).detach.twist;
    worst = std::max({worst, std::abs(a.vx - b.vx), std::abs(a.vz - b.vz), std::abs(a.omega - b.omega)});
  }
  return worst;
}

void points_with_bristles(Section& out) {
  std::mt19937_64 random(71);
  const auto thrown = support::random_throw(random, 0);
  const auto model = contact::make_contact_model("limit_surface_disc", support::parameters_of(thrown));
  const auto problem = support::problem_of(thrown, *model);
  const auto points = crosscheck::simulate_distributed_patch(
      problem, {thrown.patch.mu, thrown.patch.radius, crosscheck::disc_points(12)});
  out.row("a throw's ω at detach, against 432 points with bristles [rad/s]",
          "[crosscheck/distributed_patch.hpp](../crosscheck/distributed_patch.hpp)",
          points.detach.twist.omega, simulate_release(problem, tight_to(1e-9)).detach.twist.omega, 5e-3);
}

/// Both pads 4 N, μ = 0.5: 8 m/s² on 0.5 kg, and 53.3 rad/s² on 1e-3 kg m² of a disc of 2 cm.
void bullet(Section& out) {
  if (!crosscheck::has_bullet()) return;
  const contact::Patch<double> patch{0.5, 0.02, 2.0 / 3, 2};
  contact::ContactParameters<double> p;
  p.patch = patch;
  const auto model = contact::make_contact_model("limit_surface_disc", p);
  const auto hand = support::still_hand(0.1);
  const support::ConstantForce force(4);
  const crosscheck::BulletOptions pins{1e-3, crosscheck::BulletPads::pins, 3, 50,
                                       crosscheck::BulletFriction::along};
  const release::ReleaseProblem<double> slide{hand,   force, *model, {0.5, 1e-3}, {0, 0},
                                              {0, 0}, 0.0,   {1, 0}, 0.0};
  const release::ReleaseProblem<double> spin{hand, force, *model, {0.5, 1e-3}, {0, 0}, {0, 0}, 0.0, {}, 10.0};
  out.row("slip left of 1 m/s after 0.1 s of sliding, against Bullet [m/s]", "27 pins a pad, rows along",
          crosscheck::simulate_in_bullet(slide, patch, pins).relative.slip.x,
          simulate_release(slide).relative.slip.x, 1e-5);
  out.row("spin left of 10 rad/s after 0.1 s, against Bullet [rad/s]", "27 pins a pad, rows along",
          crosscheck::simulate_in_bullet(spin, patch, pins).relative.spin,
          simulate_release(spin).relative.spin, 1e-5);
}

}  // namespace

Section other_codes() {
  Section out{"Other codes on the same release", {}};
  for (const char* law : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    out.row(std::string("20 random throws, `") + law + "`: largest difference of the detach twist to CVODE's",
            "SUNDIALS", 0, against_cvode(law), 1e-7);
  points_with_bristles(out);
  bullet(out);
  return out;
}

}  // namespace unhand::bench
