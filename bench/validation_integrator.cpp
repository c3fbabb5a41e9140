// Closed forms of events in time: pendulum, bouncing ball, shaken plate, flight.
#include "bench/validation_rows.hpp"
#include "flight/fly.hpp"
#include "tests/dynamics/toy_systems.hpp"

namespace unhand::bench {
namespace {

using dynamics::Dual;

dynamics::IntegratorOptions tightest() {
  dynamics::IntegratorOptions options;
  options.tolerances = {1e-12, 1e-13};
  return options;
}

void pendulum(Section& out) {
  constexpr double kStart = 2.5;  // rad, far from small
  const double period = 4 * std::comp_ellint_1(std::sin(kStart / 2));
  const auto end = dynamics::run(dynamics::pendulum(), {kStart, 0.0}, 5 * period, tightest());
  out.row("pendulum from 2.5 rad: fifth time at the bottom, in √(l/g)",
          "17 quarters of the elliptic integral", 4.25 * period,
          end.events.size() == 5 ? end.events[4].t : std::nan(""), 2e-8);
  out.row("its energy over m g l after five periods", "kept", -std::cos(kStart),
          0.5 * end.y[1] * end.y[1] - std::cos(end.y[0]), 1e-8);
}

/// A ball dropped from 1 m: infinitely many bounces until √(2h/g) (1 + e)/(1 − e).
void zeno(Section& out) {
  constexpr double kGravity = 9.81;
  for (const double e : {0.5, 0.9, 0.99}) {
    const double limit = std::sqrt(2 / kGravity) * (1 + e) / (1 - e);
    const auto end =
        dynamics::run(dynamics::bouncing_ball(Dual(kGravity), Dual(e)), {1.0, 0.0}, limit + 1, tightest());
    const bool rests = end.mode == 1 && !end.events.empty();
    out.row("Zeno: a ball with restitution " + std::to_string(e).substr(0, 4) + " rests at [s]",
            "geometric series", limit, rests ? end.events.back().t : std::nan(""), 1e-6);
    if (e == 0.5) out.row("and lies at the height [m]", "the floor", 0, end.y[0], 1e-12);
  }
}

/// A block on a plate shaken with the acceleration sin t; ρ = μ g over the amplitude.
void plate(Section& out) {
  const dynamics::Entry<double, 2> start{2, 0.0, {0.0, 0.0}, 0.0};
  const auto shake = [&](double rho, double t_end, double guard_interval) {
    auto options = tightest();
    options.guard_interval = guard_interval;
    return dynamics::integrate<double, 2>(dynamics::plate(Dual(rho)), start, t_end, options);
  };
  const auto slid = shake(0.8, 3.9, 0.1);
  const double begin = slid.events.size() > 1 ? slid.events[0].t : std::nan("");
  const double stop = slid.events.size() > 1 ? slid.events[1].t : std::nan("");
  out.row("shaken plate, ρ = 0.8: slip begins at", "asin ρ", std::asin(0.8), begin, 1e-9);
  out.row("and ends where cos t − cos t₀ + ρ (t − t₀) is", "closed form", 0,
          std::cos(stop) - std::cos(begin) + 0.8 * (stop - begin), 1e-9);
  double never = 0.5, ever = 0.6;  // bisected to 2e-4; near the threshold the transient is slow
  while (ever - never > 2e-4) {
    const double middle = 0.5 * (never + ever);
    (dynamics::sticks_late(shake(middle, 400, 0.05)) ? ever : never) = middle;
  }
  out.row("the smallest ρ at which it ever sticks", "1/√(1 + π²/4)", 1 / std::sqrt(1 + 0.25 * M_PI * M_PI),
          0.5 * (never + ever), 1e-3);
  out.row("events in 20 units of time at ρ = 1.001", "holds always", 0,
          static_cast<double>(shake(1.001, 20, 0.1).events.size()), 0);
}

void flight(Section& out) {
  const auto flown = flight::fly<double>({{0, 1, 0}, {2, 3, 10}, {0, -9.81}});
  out.row("projectile, time to land [s]", "closed form", (3 + std::sqrt(9 + 2 * 9.81)) / 9.81,
          flown.landing.flight_time, 1e-12);
  const flight::FlightProblem<double> rising{{0, -0.5, 0}, {0, 2.5, 0}, {0, -9.81}};
  out.row("from z = −0.5 m at 2.5 m/s: never reaches the height 0 (1)", "erratum of [DarkoD46] 2.1.1", 1,
          flight::fly(rising).outcome == flight::FlightOutcome::never_reaches ? 1 : 0, 0);
}

}  // namespace

Section integrator_and_flight() {
  Section out{"Events and flight", {}};
  pendulum(out);
  zeno(out);
  plate(out);
  flight(out);
  return out;
}

}  // namespace unhand::bench
