// Closed forms of friction, and of objects that are held, slip and stop.
#include "bench/validation_rows.hpp"
#include "contact/disc_friction.hpp"
#include "contact/limit_surface.hpp"
#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand::bench {
namespace {

contact::ContactParameters<double> pads(double mu, double radius, int count = 2) {
  contact::ContactParameters<double> p;
  p.patch = {mu, radius, 2.0 / 3, count};
  return p;
}

release::ReleaseOptions tight(double relative = 1e-11, double absolute = 1e-14) {
  release::ReleaseOptions options;
  options.integrator = support::tight(relative, absolute);
  options.integrator.record = true;
  return options;
}

/// A free disc, R = 1 m, with speeds and μ g of 1e-6: time to rest, and slip ratio 1e-6 of the unit before,
/// extrapolated.
struct Rest {
  double time{}, ratio{};
};
Rest free_disc(double k, double slip) {
  constexpr double kUnit = 1e-6;
  const auto hand = support::still_hand(20);
  const support::ConstantForce force(kUnit);
  const auto model = contact::make_contact_model("limit_surface_disc", pads(1, 1, 1));
  const release::ReleaseProblem<double> problem{
      hand, force, *model, {1.0, k}, {0, 0}, {0, 0}, 0.0, {kUnit * slip, 0}, kUnit};
  const auto result = simulate_release(problem, tight());
  Rest out;
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) out.time = event.t;
  double e[3]{};
  for (int i = 0; i < 3; ++i) {
    const auto s = sample_release(problem, result, out.time - std::pow(10, -5 - i));
    e[i] = norm(s.relative.slip) / std::abs(s.relative.spin);
  }
  out.ratio = e[2] - (e[2] - e[1]) * (e[2] - e[1]) / (e[2] - 2 * e[1] + e[0]);
  return out;
}

/// When a held object first moves under a linear release N₀ (1 − t/T), T = 0.1 s, in a hand with a constant
/// acceleration; and its spin at detach. `softness`: γ of the patch.
struct Onset {
  double time{std::nan("")}, omega{};
};
Onset onset(const dynamics::Acceleration<double>& a, double lever, double softness = 0) {
  const auto hand = support::accelerating_hand(a, 0.2);
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.0, 10, 0.0, 0.1, 1.0});
  auto p = pads(0.5, 0.03);
  p.variation.softness = softness;
  p.variation.reference_force = 10;
  const auto model = contact::make_contact_model("sliding_pivot", p);
  const release::ReleaseProblem<double> problem{hand,       force, *model, {0.5, 1e-3}, {0, 0},
                                                {lever, 0}, 0.0,   {},     0.0};
  const auto result = simulate_release(problem, tight());
  for (const auto& event : result.events)
    if (event.kind == dynamics::EventKind::guard) return {event.t, result.detach.twist.omega};
  return {};
}

/// A bar that pivots on two small, strong pads of τ_max = 0.05 N m, f_N = 20 N: its spin after 80 ms, and the
/// friction's torque at 40 ms, over τ_max, with the √(1 − ρ²) of the force that then carries the contact
/// point. (tests/truth/pivot_limit_test.cpp)
struct Pivot {
  double omega{}, torque{}, closed_form{};
};
Pivot strong_pivot(const char* law, double mu) {
  const double force_limit = 2 * mu * 20, torque_limit = 0.05;
  const support::SwayingHand hand({{{0, 0.4, 3, 0, 1, 0}, {0, 0.5, 6, 0, 1, 0}, {0, 1, -20, 0, 1, 0}}}, 0.08);
  const support::ConstantForce force(20);
  const auto model = contact::make_contact_model(law, pads(mu, 1.5 * torque_limit / force_limit));
  const release::ReleaseProblem<double> problem{hand, force, *model, {0.2, 1.2e-3}, {0, -9.81}, {0.12, 0.1},
                                                0.0,  {},    0.0};
  const auto result = simulate_release(problem, tight(1e-9, 1e-11));
  const auto s = sample_release(problem, result, 0.04);
  const auto& [m, I] = problem.body;
  const dynamics::Vec2<double> r{s.pose.x - s.hand.pose.x, s.pose.z - s.hand.pose.z},
      a{s.hand.acceleration.ax, s.hand.acceleration.az + 9.81};
  const double alpha = (m * (r.z * a.x - r.x * a.z) + s.wrench.tau) / (I + m * dot(r, r)),
               square = s.twist.omega * s.twist.omega;
  const double rho =
      m / force_limit * std::hypot(a.x - alpha * r.z - square * r.x, a.z + alpha * r.x - square * r.z);
  return {result.detach.twist.omega, std::abs(s.wrench.tau) / torque_limit, std::sqrt(1 - rho * rho)};
}

/// 0.2 kg held level on a lever of 1 cm, which is the patches' length as well; two pads of μ 0.5 open from 30
/// N to nothing in 0.1 s. The twist at detach. (tests/truth/both_limits_test.cpp)
dynamics::Twist<double> level_bar() {
  const auto hand = support::still_hand(0.2);
  const contact::ProfileNormalForce force({0.02, 30, 0, 0.1, 1});
  const auto model = contact::make_contact_model("sliding_pivot", pads(0.5, 0.015));
  const release::ReleaseProblem<double> problem{hand,      force, *model, {0.2, 1e-5}, {0, -9.81},
                                                {0.01, 0}, 0.0,   {},     0.0};
  return simulate_release(problem, tight()).detach.twist;
}

}  // namespace

Section friction_and_release() {
  Section out{"Friction and release", {}};
  const std::string disc = "[Farkas2003], elliptic integrals";
  out.row("disc at ε = 0.3: force / (μN)", disc, 0.296585919, contact::disc_friction(0.3).force, 1e-9);
  out.row("disc at ε = 0.3: torque / (μNR)", disc, 0.622435826, contact::disc_friction(0.3).torque, 1e-9);
  out.row("disc at ε = 1: force", "8/(3π)", 8 / (3 * M_PI), contact::disc_friction(1).force, 1e-12);
  out.row("disc at ε = 1: torque", "8/(9π)", 8 / (9 * M_PI), contact::disc_friction(1).torque, 1e-12);
  double far = 0;
  for (double e = 0.5; e < 1;
       e += 1e-4) {  // on the ray of the same slip: radius of the ellipsoid over the disc's
    const auto f = contact::disc_friction(e);
    far = std::max(far, 1 / std::hypot(f.force, 1.5 * f.torque));
  }
  out.row("ellipsoid's radius over the disc's, at most", "numerical maximum at ε = 0.766", 1.0704, far, 5e-5);
  out.row("torque factor, Hertz pressure", "3π/16", 3 * M_PI / 16, contact::torque_factor(0.5), 1e-12);
  out.row("torque factor, pressure (1 − (r/a)³)^(1/3)", "integral", 0.62025, contact::torque_factor_power(3),
          1e-5);
  const Rest half = free_disc(0.5, 0.3), fast = free_disc(0.5, 2);
  out.row("free disc, k = 1/2: final slip ratio", "[Farkas2003]", 0.6530017892, half.ratio, 1e-6);
  out.row("free disc from v = 0.3: time to rest", "quadrature", 0.83398447, half.time, 1e-8);
  out.row("free disc from v = 2: time to rest", "quadrature", 2.24337057, fast.time, 1e-8);
  out.row("free disc, k = 0.4: final slip ratio", "F/ε = T/k", 0.853513, free_disc(0.4, 0.8).ratio, 2e-6);
  out.row("free disc, k = 0.6: final slip ratio", "F/ε = T/k", 0.404383, free_disc(0.6, 0.4).ratio, 2e-6);
  // f_max = 10 N on 0.5 kg; τ_max = 0.2 N m on I = 1e-3 kg m² without a lever
  out.row("linear release, slides at T (1 − f/f₀) [s]", "closed form", 0.1 * (1 - 0.5 * 8 / 10.0),
          onset({8, 0, 0}, 0).time, 1e-9);
  out.row("linear release, pivots at T (1 − τ/τ₀) [s]", "closed form", 0.1 * (1 - 0.1 / 0.2),
          onset({0, 0, 100}, 0).time, 1e-9);
  const double soft = 1.0 / 3, begun = 0.1 * (1 - std::pow(0.5, 1 / (1 + soft)));
  const Onset pivots = onset({0, 0, 100}, 0, soft);
  out.row("a soft patch, γ = 1/3, pivots at T (1 − (τ/τ₀)^(1/(1+γ))) [s]", "closed form", begun, pivots.time,
          1e-9);
  out.row("and detaches with ω = α t₁ + τ₀ T/(I (2+γ)) (1 − t₁/T)^(2+γ) [rad/s]", "closed form",
          100 * begun + 200 * 0.1 / (2 + soft) * std::pow(1 - begun / 0.1, 2 + soft), pivots.omega, 1e-7);
  const Pivot surface = strong_pivot("limit_surface", 1);
  out.row("the ellipsoid pivots about small, strong pads (f_max = 40 N, ρ = f/f_max): torque over τ_max",
          "√(1 − ρ²), up to ρ² L/l", surface.closed_form, surface.torque, 1e-6);
  out.row("and at 320 N: its spin after 80 ms, against the sliding pivot's [rad/s]", "limit ρ → 0",
          strong_pivot("sliding_pivot", 8).omega, strong_pivot("limit_surface", 8).omega, 1e-4);
  const auto bar = level_bar();
  out.row("a level bar's force and torque reach their limits together: v_z at detach, −g τ/2 [m/s]",
          "closed form, `sliding_pivot`", -9.81 * 0.1 * 0.2 * 9.81 / 30 / 2, bar.vz, 1e-9);
  out.row("and its spin [rad/s]", "the force that is left just holds it", 0, bar.omega, 1e-9);
  {
    const auto hand = support::still_hand(10);
    const support::ConstantForce force(4);
    const auto model = contact::make_contact_model("limit_surface_disc", pads(0.5, 0.3));
    const auto stop = [&](double slip, double spin) {
      const release::ReleaseProblem<double> problem{hand,   force, *model,    {1.0, 0.045}, {0, 0},
                                                    {0, 0}, 0.0,   {slip, 0}, spin};
      for (const auto& event : simulate_release(problem, tight(1e-10, 1e-12)).events)
        if (event.kind == dynamics::EventKind::guard) return event.t;
      return std::nan("");
    };
    out.row("pure slide stops at v₀/(μg) [s]", "closed form", 0.25, stop(1, 0), 1e-10);
    out.row("pure spin stops at 3Rω₀/(4μg) [s]", "closed form", 3 * 0.3 * 2 / 16, stop(0, 2), 1e-10);
    const release::ReleaseProblem<double> held{hand,     force, *model, {0.2, 1e-3}, {0, -9.81},
                                               {0.1, 0}, 0.0,   {},     0.0};
    out.row("held for 10 s: how far it has crept [m]", "stick is a mode", 0,
            std::abs(simulate_release(held, tight()).relative.arm.z), 0);
  }
  return out;
}

}  // namespace unhand::bench
