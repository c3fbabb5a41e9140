// The known truths, computed: what is expected, what the library gives, how far apart they may be.
//   build/release/bench/validation > docs/validation.md
// Ends with 1 if any fails. The tests in tests/truth ask more of each (directions, orders, every law).
#include <fmt/core.h>

#include <cmath>
#include <string>
#include <vector>

#include "contact/disc_friction.hpp"
#include "contact/limit_surface.hpp"
#include "contact/registry.hpp"
#include "crosscheck/bullet_release.hpp"
#include "crosscheck/distributed_patch.hpp"
#include "flight/fly.hpp"
#include "tests/support/simple_scenes.hpp"

namespace {

using namespace unhand;

struct Row {
  std::string truth, source;
  double expected, got, tolerance;
  bool holds() const { return std::abs(got - expected) <= tolerance; }
};

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
/// acceleration.
double onset(const dynamics::Acceleration<double>& a, double lever) {
  const auto hand = support::accelerating_hand(a, 0.2);
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.0, 10, 0.0, 0.1, 1.0});
  const auto model = contact::make_contact_model("sliding_pivot", pads(0.5, 0.03));
  const release::ReleaseProblem<double> problem{hand,       force, *model, {0.5, 1e-3}, {0, 0},
                                                {lever, 0}, 0.0,   {},     0.0};
  for (const auto& event : simulate_release(problem, tight()).events)
    if (event.kind == dynamics::EventKind::guard) return event.t;
  return std::nan("");
}

std::vector<Row> rows() {
  std::vector<Row> out;
  const auto row = [&](std::string truth, std::string source, double expected, double got, double tolerance) {
    out.push_back({std::move(truth), std::move(source), expected, got, tolerance});
  };
  const std::string disc = "[Farkas2003], elliptic integrals";
  row("disc at ε = 0.3: force / (μN)", disc, 0.296585919, contact::disc_friction(0.3).force, 1e-9);
  row("disc at ε = 0.3: torque / (μNR)", disc, 0.622435826, contact::disc_friction(0.3).torque, 1e-9);
  row("disc at ε = 1: force", "8/(3π)", 8 / (3 * M_PI), contact::disc_friction(1).force, 1e-12);
  row("disc at ε = 1: torque", "8/(9π)", 8 / (9 * M_PI), contact::disc_friction(1).torque, 1e-12);
  double far = 0;
  for (double e = 0.5; e < 1;
       e += 1e-4) {  // on the ray of the same slip: radius of the ellipsoid over the disc's
    const auto f = contact::disc_friction(e);
    far = std::max(far, 1 / std::hypot(f.force, 1.5 * f.torque));
  }
  row("ellipsoid's radius over the disc's, at most", "numerical maximum at ε = 0.766", 1.0704, far, 5e-5);
  row("torque factor, Hertz pressure", "3π/16", 3 * M_PI / 16, contact::torque_factor(0.5), 1e-12);
  row("torque factor, pressure (1 − (r/a)³)^(1/3)", "integral", 0.62025, contact::torque_factor_power(3),
      1e-5);
  const Rest half = free_disc(0.5, 0.3), fast = free_disc(0.5, 2);
  row("free disc, k = 1/2: final slip ratio", "[Farkas2003]", 0.6530017892, half.ratio, 1e-6);
  row("free disc from v = 0.3: time to rest", "quadrature", 0.83398447, half.time, 1e-8);
  row("free disc from v = 2: time to rest", "quadrature", 2.24337057, fast.time, 1e-8);
  row("free disc, k = 0.4: final slip ratio", "F/ε = T/k", 0.853513, free_disc(0.4, 0.8).ratio, 2e-6);
  row("free disc, k = 0.6: final slip ratio", "F/ε = T/k", 0.404383, free_disc(0.6, 0.4).ratio, 2e-6);
  // f_max = 10 N on 0.5 kg; τ_max = 0.2 N m on I = 1e-3 kg m² without a lever
  row("linear release, slides at T (1 − f/f₀) [s]", "closed form", 0.1 * (1 - 0.5 * 8 / 10.0),
      onset({8, 0, 0}, 0), 1e-9);
  row("linear release, pivots at T (1 − τ/τ₀) [s]", "closed form", 0.1 * (1 - 0.1 / 0.2),
      onset({0, 0, 100}, 0), 1e-9);
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
    row("pure slide stops at v₀/(μg) [s]", "closed form", 0.25, stop(1, 0), 1e-10);
    row("pure spin stops at 3Rω₀/(4μg) [s]", "closed form", 3 * 0.3 * 2 / 16, stop(0, 2), 1e-10);
    const release::ReleaseProblem<double> held{hand,     force, *model, {0.2, 1e-3}, {0, -9.81},
                                               {0.1, 0}, 0.0,   {},     0.0};
    row("held for 10 s: how far it has crept [m]", "stick is a mode", 0,
        std::abs(simulate_release(held, tight()).relative.arm.z), 0);
  }
  {
    const auto flown = flight::fly<double>({{0, 1, 0}, {2, 3, 10}, {0, -9.81}});
    row("projectile, time to land [s]", "closed form", (3 + std::sqrt(9 + 2 * 9.81)) / 9.81,
        flown.landing.flight_time, 1e-12);
    flight::FlightProblem<double> rising{{0, -0.5, 0}, {0, 2.5, 0}, {0, -9.81}};
    row("from z = −0.5 m at 2.5 m/s: never reaches the height 0 (1)", "erratum of [DarkoD46] 2.1.1", 1,
        flight::fly(rising).outcome == flight::FlightOutcome::never_reaches ? 1 : 0, 0);
  }
  // Other codes on the same release
  std::mt19937_64 random(71);
  const auto thrown = support::random_throw(random, 0);
  const auto model = contact::make_contact_model("limit_surface_disc", support::parameters_of(thrown));
  const auto problem = support::problem_of(thrown, *model);
  const auto own = simulate_release(problem, tight(1e-9, 1e-11)).detach.twist;
  auto cvode = tight(1e-11, 1e-13);
  cvode.integrator.method = dynamics::Method::cvode;
  row("a throw's ω at detach, against CVODE [rad/s]", "SUNDIALS",
      simulate_release(problem, cvode).detach.twist.omega, own.omega, 1e-7);
  const auto points = crosscheck::simulate_distributed_patch(
      problem, {thrown.patch.mu, thrown.patch.radius, crosscheck::disc_points(12)});
  row("the same, against 432 points with bristles [rad/s]", "crosscheck/distributed_patch.hpp",
      points.detach.twist.omega, own.omega, 5e-3);
  return out;
}

}  // namespace

int main() {
  fmt::print(
      "# Validation\n\n```sh\nbuild/release/bench/validation > docs/validation.md\n```\n\n"
      "Known truths that the numbers must meet, computed by the library as it is built. More about each, "
      "over directions, orders\n"
      "and laws, is in [tests/truth](../tests/truth) and [tests/contract](../tests/contract).\n\n"
      "| truth | from | expected | got | difference | tolerance | |\n| --- | --- | ---: | ---: | ---: | ---: "
      "| --- |\n");
  int failed = 0, count = 0;
  for (const auto& row : rows()) {
    ++count;
    failed += row.holds() ? 0 : 1;
    fmt::print("| {} | {} | {:.10g} | {:.10g} | {:.1e} | {:.0e} | {} |\n", row.truth, row.source,
               row.expected, row.got, std::abs(row.got - row.expected), row.tolerance,
               row.holds() ? "pass" : "**FAIL**");
  }
  fmt::print(
      "\n{} of {} hold.\n\n"
      "## Beyond the closed forms\n\n"
      "- Other integrators: 1,000 random throws per law agree with CVODE to 1e-7 with the same modes\n"
      "  (`ctest --preset release -R crosscheck.*Cvode`); `unhand crosscheck log.h5 --engine cvode` does so "
      "on your log.\n"
      "- Other physics: a patch of points that knows no limit surface, and where each model holds against "
      "it:\n"
      "  [where-the-models-hold.md](where-the-models-hold.md).\n"
      "- Another engine: Bullet in double precision, throw by throw, and where it departs: "
      "[crosscheck.md](crosscheck.md).\n"
      "- Work and precision beside MuJoCo and Bullet: [peers.md](peers.md).\n"
      "- Every law on random and extreme input: energy, cone, symmetry, derivatives, typed outcomes\n"
      "  (`ctest --preset release -L contract`); readers on damaged files (`-L fuzz`).\n",
      count - failed, count);
  return failed == 0 ? 0 : 1;
}
