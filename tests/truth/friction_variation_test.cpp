// Departures from Coulomb's law where the answer is a formula: when a soft or sticky grip gives way, and how
// a block slides to rest when friction depends on its speed.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/friction_effects.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::contact {
namespace {

using Variation = FrictionVariation<double>;

// n μ N₀ = 16 N on 0.25 kg, τ₀ = c a 16 N on 4e-4 kg m²; linear release in T.
constexpr double kFullGrip = 20, kForce = 16, kTorque = 16 * 0.01 * 2 / 3, kT = 0.05, kBodyMass = 0.25,
                 kInertia = 4e-4;

class FrictionVariationTruth : public testing::TestWithParam<const char*> {
 protected:
  std::unique_ptr<ContactModel> law(const Variation& variation) {
    ContactParameters<double> p;
    p.patch = {0.4, 0.01, 2.0 / 3, 2};
    p.variation = variation;
    return make_contact_model(GetParam(), p);
  }
  struct Give {
    double slip{std::nan("")}, detach{}, omega{};
  };
  /// When a grip first slips and when it is gone, the hand accelerating from rest at `a`.
  Give release(const dynamics::Acceleration<double>& a, const Variation& variation,
               const NormalForce& force) {
    const auto hand = support::accelerating_hand(a, 0.1);
    const auto model = law(variation);
    const release::ReleaseProblem<double> problem{
        hand, force, *model, {kBodyMass, kInertia}, {0, 0}, {0, 0.3}, 0.0, {}, 0.0};
    const auto result = simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}}});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
    for (const auto& event : result.events)
      if (event.kind == dynamics::EventKind::guard)
        return {event.t, result.detach.time, result.detach.twist.omega};
    return {std::nan(""), result.detach.time, result.detach.twist.omega};
  }
  /// Relative state after `t`, from the slip `speed` [m/s] and `spin` [rad/s] on pads at rest that never
  /// open.
  Relative<double> thrown_across(double speed, double spin, const Variation& variation, double t) {
    const auto hand = support::still_hand(t);
    const support::ConstantForce force(kFullGrip);
    const auto model = law(variation);
    const release::ReleaseProblem<double> problem{
        hand, force, *model, {kBodyMass, kInertia}, {0, 0}, {0, 0}, 0.0, {speed, 0}, spin};
    return simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}, .record = true}}).relative;
  }
  /// The block's path and speed [m, m/s] after `t`, thrown at `speed`.
  std::pair<double, double> slide(double speed, const Variation& variation, double t) {
    const auto y = thrown_across(speed, 0, variation, t);
    return {lever(Scene<double>{}, y).x, y.slip.x};
  }
  const ProfileNormalForce opening{OpeningProfile<double>{0, kFullGrip, 0, kT, 1}};
};
INSTANTIATE_TEST_SUITE_P(, FrictionVariationTruth,
                         testing::Values("sliding_pivot", "limit_surface", "limit_surface_disc",
                                         "limit_surface_quartic"),
                         [](const auto& name) { return std::string(name.param); });

TEST_P(FrictionVariationTruth, ASoftPatchPivotsLaterOrEarlierAndSlidesAsEver) {
  for (const double gamma : {-0.5, 0.33, 1.0, 2.0}) {
    Variation soft;
    soft.softness = gamma;
    soft.reference_force = kFullGrip;
    // L is positive at f_N = 0, which adds (10⁻⁵ f₀/f_N)² γ/2 to it: 1e-8 where a patch that widens as it is
    // let go holds to the end; else an event's 1e-9
    for (const double tau : {0.002, 0.02, 0.08})
      EXPECT_NEAR(release({0, 0, tau / kInertia}, soft, opening).slip,
                  kT * (1 - std::pow(tau / kTorque, 1 / (1 + gamma))), gamma > 0 ? 1e-9 : 1e-8)
          << gamma << ' ' << tau;
    EXPECT_NEAR(release({6 / kBodyMass, 0, 0}, soft, opening).slip, kT * (1 - 6 / kForce), 1e-9);
  }
}

// Left behind by the hand at t₁, the object is dragged on by τ₀ (1 − t/T)^(1+γ) until the end.
TEST_P(FrictionVariationTruth, ASoftPatchDragsAPivotOnByItsFadingTorque) {
  for (const double gamma : {-0.5, 0.33, 1.0, 2.0}) {
    Variation soft;
    soft.softness = gamma;
    soft.reference_force = kFullGrip;
    for (const double tau : {0.02, 0.08}) {
      const double alpha = tau / kInertia, begin = kT * (1 - std::pow(tau / kTorque, 1 / (1 + gamma)));
      EXPECT_NEAR(release({0, 0, alpha}, soft, opening).omega,
                  alpha * begin + kTorque / kInertia * kT / (2 + gamma) * std::pow(1 - begin / kT, 2 + gamma),
                  1e-6)  // of some 10 rad/s, as the onset's 1e-8 s
          << gamma << ' ' << tau;
    }
  }
}

TEST_P(FrictionVariationTruth, AStribeckPatchHoldsToItsStaticLimit) {
  Variation stribeck;
  stribeck.static_ratio = 1.25;
  stribeck.stribeck_speed = 0.02;
  EXPECT_NEAR(release({6 / kBodyMass, 0, 0}, stribeck, opening).slip, kT * (1 - 6 / (1.25 * kForce)), 1e-9);
  EXPECT_NEAR(release({0, 0, 0.03 / kInertia}, stribeck, opening).slip, kT * (1 - 0.03 / (1.25 * kTorque)),
              1e-9);
}

TEST_P(FrictionVariationTruth, AStickyPatchHoldsBeyondItsNormalForce) {
  const double adhesion = 1.5, parting = 0.004;  // μ n f_adh = 1.2 N
  const AdhesiveForce sticky(opening, Dual(adhesion), Dual(parting));
  const auto strong = release({6 / kBodyMass, 0, 0}, {}, sticky),
             weak = release({0.3 / kBodyMass, 0, 0}, {}, sticky);
  EXPECT_NEAR(strong.slip, kT * (1 - (6 / (kForce / kFullGrip) - adhesion) / kFullGrip), 1e-9);
  EXPECT_NEAR(weak.slip, kT + parting * (1 - 0.3 / (kForce / kFullGrip) / adhesion), 1e-9)
      << "while it parts";
  EXPECT_NEAR(strong.detach, kT + parting, 1e-12);
  EXPECT_NEAR(weak.detach, kT + parting, 1e-12);
}

TEST_P(FrictionVariationTruth, AViscousSlideDecaysExponentially) {
  // v' = −A (1 + v/v₀): v = (V + v₀) exp(−A t/v₀) − v₀, at rest after (v₀/A) ln(1 + V/v₀)
  const double A = kForce / kBodyMass, V = 1.5;
  for (const double v0 : {0.5, 4.0}) {
    Variation viscous;
    viscous.viscous = 1 / v0;
    const double stop = v0 / A * std::log(1 + V / v0), t = 0.4 * stop;
    const auto [x, v] = slide(V, viscous, t);
    EXPECT_NEAR(v, (V + v0) * std::exp(-A * t / v0) - v0, 1e-9);
    EXPECT_NEAR(x, v0 / A * (V + v0) * (1 - std::exp(-A * t / v0)) - v0 * t, 1e-9);
    const auto [path, rest] = slide(V, viscous, 1.5 * stop);
    EXPECT_EQ(rest, 0);
    EXPECT_NEAR(path, v0 / A * (V - v0 * std::log(1 + V / v0)), 1e-9);
  }
}

TEST_P(FrictionVariationTruth, AViscousSpinDecaysAsASlideAtTheSpeedLOmega) {
  // u = L ω: I ω' = −L f (1 + u/v₀), so u' = −A (1 + u/v₀) with A = L² f/I. On the disc every point resists
  // at its own speed: the mean of ω r² over it is ω a²/2 = 9/8 L² ω, so that there v₀ is 8/9 of what it is.
  const double L = 0.01 * 2 / 3, A = L * kTorque / kInertia, spin = 45, U = L * spin;
  const bool local = std::string_view(GetParam()) == "limit_surface_disc";
  for (const double v0 : {0.1, 2.0}) {
    Variation viscous;
    viscous.viscous = (local ? 8.0 / 9 : 1.0) / v0;
    const double stop = v0 / A * std::log(1 + U / v0), t = 0.4 * stop;
    const auto y = thrown_across(0, spin, viscous, t), rest = thrown_across(0, spin, viscous, 1.5 * stop);
    EXPECT_NEAR(L * y.spin, (U + v0) * std::exp(-A * t / v0) - v0, 1e-9);
    EXPECT_NEAR(L * y.angle, v0 / A * (U + v0) * (1 - std::exp(-A * t / v0)) - v0 * t, 1e-9);
    EXPECT_EQ(rest.spin, 0);
    EXPECT_NEAR(L * rest.angle, v0 / A * (U - v0 * std::log(1 + U / v0)), 1e-9);
  }
}

TEST_P(FrictionVariationTruth, AStribeckSlideStopsWhereTheIntegralSays) {
  // ∫ v dv/(A (1 + (r − 1) exp(−(v/v_s)²))) from 0 to V, by Simpson's rule
  const double A = kForce / kBodyMass, V = 0.6;
  for (const double ratio : {0.7, 1.4}) {
    Variation stribeck;
    stribeck.static_ratio = ratio;
    stribeck.stribeck_speed = 0.15;
    const auto integrand = [&](double v) {
      return v / (A * (1 + (ratio - 1) * std::exp(-v * v / (0.15 * 0.15))));
    };
    constexpr int n = 4000;
    double path = integrand(0) + integrand(V);
    for (int i = 1; i < n; ++i) path += (i % 2 == 1 ? 4 : 2) * integrand(V * i / n);
    path *= V / (3 * n);
    const auto [x, v] = slide(V, stribeck, 0.2);
    EXPECT_EQ(v, 0);
    EXPECT_NEAR(x, path, 1e-9);
  }
}

}  // namespace
}  // namespace unhand::contact
