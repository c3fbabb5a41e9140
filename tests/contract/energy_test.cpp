// Friction takes energy, stays within its limits, and every joule is accounted for.
#include <cmath>

#include "contact/convex_quartic.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "tests/contract/every_model.hpp"

namespace unhand {
namespace {

class Energy : public EveryModel {
 protected:
  static release::ReleaseOptions options() {
    return {.integrator = {.tolerances = {1e-9, 1e-11}}, .ledger = true};
  }

  /// Calls `visit(sample, limits)` at several instants of every recorded step of random throws.
  template <class Visitor>
  static void on_random_throws(unsigned seed, int throws, Visitor&& visit) {
    std::mt19937_64 random(seed);
    for (int i = 0; i < throws; ++i) {
      const auto thrown = support::random_throw(random, 0.5 * (i % 3));
      const auto p = support::parameters_of(thrown);
      const auto model = make(p);
      const auto problem = support::problem_of(thrown, *model);
      const auto result = simulate_release(problem, options());
      ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << describe(thrown);
      for (const auto& piece : result.trajectory.pieces)
        for (const double fraction : {0.01, 0.3, 0.7, 0.99}) {
          const double t = piece.t0 + fraction * (piece.t1 - piece.t0);
          if (!(t > piece.t0 && t < piece.t1)) continue;
          visit(sample_release(problem, result, t), p.patch, thrown);
        }
    }
  }
};
UNHAND_EVERY_MODEL(Energy);

TEST_P(Energy, FrictionNeverDrives) {
  on_random_throws(31, 60, [](const auto& s, const contact::Patch<double>& patch, const auto& thrown) {
    const double f_max = patch.f_max(s.normal_force), tau_max = patch.tau_max(s.normal_force);
    const double torsional = s.wrench.tau * s.relative.spin, linear = dot(s.wrench.force(), s.relative.slip);
    if (carried()) {
      EXPECT_EQ(torsional, 0.0);
      EXPECT_EQ(linear, 0.0);
      return;
    }
    // 1e-8 of a metre or radian per second: what the record is wrong by between steps where a slip begins or
    // ends
    EXPECT_LE(torsional, 1e-8 * tau_max) << s.mode << ' ' << describe(thrown);
    const bool slide = decoupled() && s.mode.starts_with("slide");
    EXPECT_LE(linear, slide ? f_max * norm(s.relative.slip) * (1 + 1e-12) : 1e-8 * f_max)
        << s.mode << ' ' << describe(thrown);
  });
}

class Limits : public Energy {};
UNHAND_EVERY_MODEL_WITH_FRICTION(Limits);

TEST_P(Limits, HoldTheWrench) {
  on_random_throws(32, 60, [](const auto& s, const contact::Patch<double>& patch, const auto& thrown) {
    const double f_max = patch.f_max(s.normal_force), tau_max = patch.tau_max(s.normal_force);
    const double force = norm(s.wrench.force()) / f_max, torque = s.wrench.tau / tau_max;
    if (decoupled()) {
      EXPECT_LE(force, 1 + 1e-9) << s.mode << ' ' << describe(thrown);
      EXPECT_LE(std::abs(torque), 1 + 1e-9) << s.mode << ' ' << describe(thrown);
      return;
    }
    const contact::Vec3<double> w{force, 0, torque};  // of surfaces that are round in the plane of sliding
    const auto along = dynamics::rotate(-s.hand.pose.theta, s.wrench.force());
    const contact::Vec3<dynamics::Dual> in_hand{dynamics::Dual(along.x / f_max),
                                                dynamics::Dual(along.z / f_max), dynamics::Dual(torque)};
    double gauge = 0;
    if (GetParam() == "limit_surface")
      gauge = contact::Ellipsoid{}.gauge(w);
    else if (GetParam() == "limit_surface_disc")
      gauge = contact::UniformDisc{}.gauge(w);
    else if (GetParam() == "limit_surface_quartic")
      gauge = contact::ConvexQuartic::closest_to_disc().gauge(w);
    else
      gauge = contact::wrench_gauges(GetParam()).front()(in_hand).a;
    EXPECT_LE(gauge, 1 + 1e-9) << s.mode << ' ' << describe(thrown);
    if (s.mode == "slip") {
      EXPECT_NEAR(gauge, 1, 1e-9) << describe(thrown);
    }
  });
}

TEST_P(Energy, TheLedgerCloses) {
  std::mt19937_64 random(33);
  double fed = 0;
  int quiet = 0;
  for (int i = 0; i < 100; ++i) {
    const auto thrown = support::random_throw(random, 0.5 * (i % 3));
    const auto model = make(support::parameters_of(thrown));
    const auto result = simulate_release(support::problem_of(thrown, *model), options());
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    const auto& e = result.ledger;
    const double size = std::abs(e.mechanical_change) + std::abs(e.hand_work) + std::abs(e.linear_friction) +
                        std::abs(e.torsional_friction) + e.nonphysical_work;
    // The dense output is of order 4: some 1e-7, and 1e-8 J, between steps whose ends are good to 1e-9. A
    // slip that stops and at once starts anew is recorded as straight lines of up to 5 us, on which the
    // force's direction means nothing.
    int turns = 0;
    for (std::size_t k = 0; k < result.events.size(); ++k)
      turns += surface() && result.events[k].kind == dynamics::EventKind::guard &&
               result.events[k].mode_before != 0;
    const double f_max = 2 * thrown.patch.mu * thrown.force.profile().grip_force.a, speed = 3;  // N, m/s
    EXPECT_NEAR(e.residual, 0, 1e-7 * size + 1e-8 + turns * f_max * speed * 5e-6) << describe(thrown);
    quiet += turns == 0;
    EXPECT_LE(e.torsional_friction, 1e-12 * size) << describe(thrown);
    if (decoupled()) {
      EXPECT_GE(e.nonphysical_work, 0.0);
      fed += e.nonphysical_work;
    } else {
      EXPECT_EQ(e.nonphysical_work, 0.0);
      EXPECT_LE(e.linear_friction, 1e-12 * size) << describe(thrown);
    }
  }
  EXPECT_GE(quiet, 30) << "throws that test the ledger to its last digit";
  if (decoupled()) {
    EXPECT_GT(fed, 0.0) << "a surrogate that is known to feed energy on such throws";
  }
}

}  // namespace
}  // namespace unhand
