#include <fmt/core.h>

#include "bench/peers/truths.hpp"
#include "contact/registry.hpp"
#include "crosscheck/bullet_release.hpp"
#include "tests/dynamics/toy_systems.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::bench {
namespace {

/// A truth as a release from a hand that accelerates against the push: what a plate does to what lies on it.
struct Scene {
  release::PolynomialHand hand;
  std::unique_ptr<contact::NormalForce> force;
  contact::Patch<double> patch{kMu, 1.5 * kLength};
  std::unique_ptr<contact::ContactModel> model;

  explicit Scene(const Truth& truth) : hand(release::PolynomialHand::segments(0, {}, {}, stretches(truth))) {
    if (truth.releases)
      force = std::make_unique<contact::ProfileNormalForce>(
          contact::OpeningProfile<double>{0.0, kNormal / 2, 0.0, truth.end, 1.0});
    else
      force = std::make_unique<support::ConstantForce>(kNormal / 2);
    contact::ContactParameters<double> p;
    p.patch = patch;
    model = contact::make_contact_model("limit_surface", p);
  }
  static std::vector<release::HandSegment> stretches(const Truth& truth) {
    std::vector<release::HandSegment> out;
    for (const auto& [until, along] : truth.pushes) out.push_back({until, {-along, 0, 0}, {}});
    return out;
  }
  release::ReleaseProblem<double> problem(const Truth& truth) const {
    return {hand, *force, *model, {kMass, kInertia}, {0, 0}, {0, 0}, 0.0, {truth.slide, 0}, truth.spin};
  }
};

}  // namespace

std::vector<Work> run_unhand() {
  std::vector<Work> out;
  for (const double tolerance : {1e-3, 1e-6, 1e-9, 1e-12}) {
    const std::string setting = fmt::format("rtol {:g}", tolerance);
    for (const Truth& truth : truths()) {
      const Scene scene(truth);
      const auto problem = scene.problem(truth);
      release::ReleaseOptions options;
      options.integrator = support::tight(tolerance, 1e-2 * tolerance);
      release::ReleaseResult<double> result;
      const double seconds = fastest([&] { result = simulate_release(problem, options); });
      out.push_back({"unhand", setting, truth.name,
                     error_of(truth, result.relative.arm.x, result.relative.angle), seconds / truth.end});
    }
    const auto ball = dynamics::bouncing_ball(dynamics::Dual(kBallGravity), dynamics::Dual(kRestitution));
    dynamics::Solution<double, 2> solution;
    const double seconds = fastest([&] {
      solution = dynamics::run(ball, {1.0, 0.0}, kBallTime, support::tight(tolerance, 1e-2 * tolerance));
    });
    out.push_back(
        {"unhand", setting, "bounce", std::abs(solution.y[0] - ball_height()), seconds / kBallTime});
  }
  return out;
}

std::vector<Work> run_bullet() {
  std::vector<Work> out;
  if (!crosscheck::has_bullet()) return out;
  using crosscheck::BulletFriction;
  using crosscheck::BulletPads;
  for (const double step : {1e-3, 1e-4, 2e-5})
    for (const auto friction : {BulletFriction::along, BulletFriction::across})
      for (const Truth& truth : truths()) {
        const Scene scene(truth);
        const auto problem = scene.problem(truth);
        crosscheck::BulletResult result;
        const auto run = [&] {
          result = crosscheck::simulate_in_bullet(problem, scene.patch,
                                                  {step, BulletPads::point, 1, 50, friction});
        };
        const double seconds = fastest(run);
        out.push_back({"Bullet", fmt::format("{:g} ms, rows {}", 1e3 * step, to_string(friction)), truth.name,
                       error_of(truth, result.relative.arm.x, result.relative.angle), seconds / truth.end});
      }
  return out;
}

}  // namespace unhand::bench
