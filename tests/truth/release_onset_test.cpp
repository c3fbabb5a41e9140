// A linear release, N = N₀ (1 − t/T), under a constant demand: when the grip gives way.
#include <gtest/gtest.h>

#include "contact/limit_surface_shapes.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

class Onset : public testing::TestWithParam<const char*> {
 protected:
  struct First {
    double time;
    std::string cause, mode;
  };
  /// The first event that a guard fired; hand from rest at a constant acceleration, no gravity, lever 0.
  static First first_slip(const dynamics::Acceleration<double>& a, const OpeningProfile<double>& opening) {
    const auto hand = support::accelerating_hand(a, opening.opening_time + 0.01);
    const ProfileNormalForce force(opening);
    ContactParameters<double> p;
    p.patch = {0.4, 0.01, 2.0 / 3, 2};
    const auto model = make_contact_model(GetParam(), p);
    const release::ReleaseProblem<double> problem{hand,     force, *model, {0.25, 4e-4}, {0, 0},
                                                  {0, 0.3}, 0.0,   {},     0.0};
    const auto result = simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
    const auto words = mode_events(problem, result);
    for (std::size_t i = 0; i < words.size(); ++i)
      if (result.events[i].kind == dynamics::EventKind::guard)
        return {words[i].time, words[i].cause, words[i].mode};
    return {std::nan(""), "", ""};
  }
};
// Every law that can slip.
INSTANTIATE_TEST_SUITE_P(, Onset,
                         testing::Values("sliding_pivot", "limit_surface", "limit_surface_disc",
                                         "limit_surface_quartic"),
                         [](const auto& law) { return std::string(law.param); });

// f₀ = n μ N₀ = 16 N, τ₀ = c a f₀ = 0.1067 N m at the start; 1e-9 s is what event times are asked to hold.
constexpr double kGripForce = 20, kForce = 16, kTorque = 16 * 0.01 * 2 / 3;

TEST_P(Onset, OfSlideUnderAConstantForce) {
  for (const double f : {0.5, 4.0, 12.0, 15.5})
    for (const double direction : {0.0, 0.7, 2.5, -1.8}) {
      const double a = f / 0.25;
      const First first =
          first_slip({a * std::cos(direction), a * std::sin(direction), 0}, {0, kGripForce, 0, 0.05, 1});
      EXPECT_NEAR(first.time, 0.05 * (1 - f / kForce), 1e-9) << "force " << f << " direction " << direction;
    }
}

TEST_P(Onset, OfSpinUnderAConstantTorque) {
  for (const double tau : {0.001, 0.02, 0.08, -0.08}) {
    const First first = first_slip({0, 0, tau / 4e-4}, {0, kGripForce, 0, 0.05, 1});
    EXPECT_NEAR(first.time, 0.05 * (1 - std::abs(tau) / kTorque), 1e-9) << "torque " << tau;
    if (std::string(GetParam()) == "sliding_pivot") {
      EXPECT_EQ(first.mode, tau > 0 ? "pivot-" : "pivot+");  // the object lags behind the hand
    }
  }
}

TEST_P(Onset, FollowsTheShapeOfTheOpening) {
  // f₀ (1 − t/T)^p = f
  for (const double p : {1.0, 1.25, 2.0})
    EXPECT_NEAR(first_slip({4.0 / 0.25, 0, 0}, {0, kGripForce, 0, 0.05, p}).time,
                0.05 * (1 - std::pow(4.0 / kForce, 1 / p)), 1e-9)
        << "shape " << p;
}

TEST(CombinedOnset, FollowsEachLimitSurface) {
  // Force and torque together: decoupled limits give way at the first of the two, an ellipsoid at (f/f₀)² +
  // (τ/τ₀)² = N², the exact disc before it and by at most its 7.04 %.
  const double f = 6, tau = 0.04, T = 0.05;
  const auto time_of = [&](const char* name) {
    const auto hand = support::accelerating_hand({f / 0.25, 0, tau / 4e-4}, 0.06);
    const ProfileNormalForce force(OpeningProfile<double>{0, kGripForce, 0, T, 1});
    ContactParameters<double> p;
    p.patch = {0.4, 0.01, 2.0 / 3, 2};
    const auto model = make_contact_model(name, p);
    const release::ReleaseProblem<double> problem{hand,   force, *model, {0.25, 4e-4}, {0, 0},
                                                  {0, 0}, 0.0,   {},     0.0};
    const auto result = simulate_release(problem);
    for (const auto& event : result.events)
      if (event.kind == dynamics::EventKind::guard) return event.t;
    return std::nan("");
  };
  const double both = std::hypot(f / kForce, tau / kTorque);
  EXPECT_NEAR(time_of("sliding_pivot"), T * (1 - std::max(f / kForce, tau / kTorque)), 1e-9);
  EXPECT_NEAR(time_of("limit_surface"), T * (1 - both), 1e-9);
  const double w = UniformDisc{}.gauge(Vec3<double>{f / kForce, 0, tau / kTorque});
  EXPECT_NEAR(time_of("limit_surface_disc"), T * (1 - w), 1e-9);
  EXPECT_GT(w, both);
  EXPECT_LT(w, 1.0704 * both);
}

}  // namespace
}  // namespace unhand::contact
