// A small campaign for the loop.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/discovery/discover.hpp"

namespace unhand::fitting::support {

/// Tolerances that are fast enough for tests.
inline DiscoverOptions loop_options(const std::string& model = "limit_surface_disc") {
  DiscoverOptions options;
  options.campaign.model = model;
  options.campaign.integrator.tolerances = {1e-5, 1e-8};
  return options;
}

/// What the loop finds by the disc's law, with three refits a step.
inline Discovery found_in(const datasets::ThrowLog& log, std::vector<std::string> forget = {}) {
  DiscoverOptions options = loop_options();
  options.forget = std::move(forget);
  options.refits = 3;
  return discover(log, "synthetic", options);
}

/// 24 throws of two bars, six conditions each, two repetitions.
inline experiment::CampaignDesign loop_design() {
  experiment::CampaignDesign design = experiment::campaign_design("batch180");
  design.name = "loop";
  design.postures.resize(2);
  design.release_accelerations.resize(3);
  design.repetitions = 2;
  return design;
}

inline datasets::ThrowLog loop_campaign(const experiment::EffectSettings& effects, std::uint64_t seed = 3) {
  experiment::CampaignDesign design = loop_design();
  design.effects = effects;
  return experiment::generate_campaign(design, seed);
}

/// The same under a drag that no effect has, a = −rate(|v|) v, rate [1/s] of a speed [m/s]: from its true
/// detach on, each flight is moved by what the classical Runge-Kutta formula says that it differs from the
/// parabola by. The noise stays.
template <class Rate>
datasets::ThrowLog loop_campaign_in_drag(const Rate& rate, std::uint64_t seed = 3) {
  const experiment::CampaignDesign design = loop_design();
  datasets::ThrowLog log = experiment::campaign_header(design, seed);
  for (int i = 0; i < design.throws(); ++i) {
    auto [record, truth] = experiment::generate_throw(design, seed, i);
    const double g = design.gravity, vx = truth.detach_twist.vx, vz = truth.detach_twist.vz;
    using Flight = std::array<double, 4>;  // what (x, z, vx, vz) differ by
    const auto slope = [&](double t, const Flight& d) {
      const double u = vx + d[2], w = vz - g * t + d[3], r = rate(std::hypot(u, w));
      return Flight{d[2], d[3], -r * u, -r * w};
    };
    const auto moved = [&](double t) {  // after t [s] of flight
      constexpr int kSteps = 50;
      const double h = t / kSteps;
      const auto ahead = [](const Flight& d, double step, const Flight& k) {
        return Flight{d[0] + step * k[0], d[1] + step * k[1], d[2] + step * k[2], d[3] + step * k[3]};
      };
      Flight d{};
      for (int step = 0; step < kSteps; ++step) {
        const double at = step * h;
        const Flight a = slope(at, d), b = slope(at + h / 2, ahead(d, h / 2, a)),
                     c = slope(at + h / 2, ahead(d, h / 2, b)), e = slope(at + h, ahead(d, h, c));
        for (std::size_t j = 0; j < 4; ++j) d[j] += h / 6 * (a[j] + 2 * b[j] + 2 * c[j] + e[j]);
      }
      return d;
    };
    for (std::size_t k = 0; k < record.mocap->time.rows; ++k) {
      const double t = record.mocap->time(k) - truth.detach_time;
      if (t <= 0) continue;
      const Flight by = moved(t);
      record.mocap->pose(k, 0) += by[0];
      record.mocap->pose(k, 1) += by[1];
    }
    double landed = truth.landing_time - truth.detach_time;
    const double before = landed;
    for (int iteration = 0; iteration < 20; ++iteration) {  // Newton, on its parabola and what moves it
      const double z = truth.detach_pose.z + vz * landed - 0.5 * g * landed * landed + moved(landed)[1];
      landed += (z - design.landing_height) / (g * landed - vz);
    }
    record.landing->time(0) += landed - before;
    record.landing->pose(0, 0) += vx * (landed - before) + moved(landed)[0];
    record.landing->pose(0, 1) += truth.detach_twist.omega * (landed - before);
    log.throws.push_back(std::move(record));
  }
  return log;
}

}  // namespace unhand::fitting::support
