// Synthetic free flights in space, by equations and an integrator of their own: what the library's flights
// are held against.
#pragma once

#include <Eigen/Geometry>
#include <random>
#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::test {

struct SpatialTruth {
  double drag{}, linear_drag{}, lift{}, cubic_drag{}, spin_damping{};  // 1/m, 1/s, -, 1/m, 1/s
  double gravity_ratio{}, length_scale{}, time_scale{};                // -
  double tilt_x{}, tilt_y{};                                           // rad
  Eigen::Vector3d com{0, 0, 0};                                        // m
  Eigen::Vector3d axis_drag{0, 0, 0};                                  // 1/m, traceless
  Eigen::Vector3d inertia{1, 1, 1};                                    // of the body; declared are equal ones
  double side_force{};            ///< m/s², along body x: what no catalogue lists
  double third_power{};           ///< s/m², drag in proportion to v³: nor this
  Eigen::Vector3d wind{0, 0, 0};  // m/s
};

struct SpatialDesign {
  int flights{40}, samples{40};
  double rate{150};                            // 1/s
  double sigma{1e-4}, sigma_quaternion{5e-4};  // m, -
  double speed{3}, spin{8};                    // m/s, rad/s: about what each starts with
};

/// RK4 with five steps per sample, on (p, v, q, ω).
inline datasets::ThrowLog spatial_flights(const SpatialTruth& truth, const SpatialDesign& design,
                                          unsigned seed) {
  using Eigen::Quaterniond;
  using Eigen::Vector3d;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto gauss = [&] {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Vector3d(x, y, z);
  };
  datasets::ThrowLog log;
  log.dimension = 3;
  log.title = "synthetic free flights";
  log.source = "synthetic";
  log.gravity = 9.81;
  datasets::Object body;
  body.mass = 0.3;
  body.inertia = std::vector<double>{1e-3, 1e-3, 1e-3};
  log.objects.emplace("body", body);
  struct State {
    Vector3d p, v;
    Quaterniond q;
    Vector3d w;
  };
  const auto flow = [&](const State& s) {
    const Vector3d u = s.v - truth.wind;
    const double g = 9.81 * (1 + truth.gravity_ratio), speed = u.norm();
    Vector3d a(g * std::sin(truth.tilt_x) * std::cos(truth.tilt_y), g * std::sin(truth.tilt_y),
               -g * std::cos(truth.tilt_x) * std::cos(truth.tilt_y));
    const Vector3d body_v = s.q.conjugate() * u;
    a -= (truth.drag * speed + truth.linear_drag + truth.third_power * speed * speed) * u;
    a += truth.lift * (s.q * s.w).cross(u);
    a -= speed * (s.q * truth.axis_drag.cwiseProduct(body_v));
    const double fourth = body_v.array().pow(4).sum() / std::pow(speed, 4);
    a -= truth.cubic_drag * (fourth - 0.6) * speed * u;
    a += truth.side_force * (s.q * Vector3d::UnitX());
    const Vector3d I = truth.inertia;
    const Vector3d w_dot = (-s.w.cross(I.cwiseProduct(s.w))).cwiseQuotient(I) - truth.spin_damping * s.w;
    Quaterniond q_dot = s.q * Quaterniond(0, s.w[0], s.w[1], s.w[2]);
    q_dot.coeffs() *= 0.5;
    return State{s.v, a, q_dot, w_dot};
  };
  const auto moved = [](const State& s, const State& d, double h) {
    State out{s.p + h * d.p, s.v + h * d.v, s.q, s.w + h * d.w};
    out.q.coeffs() += h * d.q.coeffs();
    out.q.normalize();
    return out;
  };
  for (int k = 0; k < design.flights; ++k) {
    datasets::Throw one;
    one.id = "flight-" + std::to_string(1000 + k);
    one.object = "body";
    one.condition = "flight";
    one.repetition = k;
    one.split = k % 5 == 4 ? datasets::Split::test : datasets::Split::train;
    datasets::MocapLog& mocap = one.mocap.emplace();
    const double s = design.sigma, sq = design.sigma_quaternion;
    mocap.time.cols = 1, mocap.pose.cols = 7;
    mocap.pose.sigma = {s, s, s, sq, sq, sq, sq};
    State now{Vector3d(0, 0, 1) + 0.2 * gauss(), design.speed * (gauss() + Vector3d(0, 0, 0.7)) / 1.7,
              Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized(),
              design.spin / 1.7 * gauss()};
    const double dt = 1 / design.rate / (1 + truth.time_scale);  // true time between samples
    for (int i = 0; i < design.samples; ++i) {
      const Vector3d tracked = (1 + truth.length_scale) * (now.p - now.q * truth.com) + s * gauss();
      Eigen::Vector4d q(now.q.w(), now.q.x(), now.q.y(), now.q.z());
      for (int j = 0; j < 4; ++j) q[j] += sq * normal(random);
      q.normalize();
      mocap.time.data.push_back(i / design.rate);
      mocap.pose.data.insert(mocap.pose.data.end(),
                             {tracked[0], tracked[1], tracked[2], q[0], q[1], q[2], q[3]});
      const int steps = 5;
      const double h = dt / steps;
      for (int n = 0; n < steps; ++n) {
        const State a = flow(now), b = flow(moved(now, a, h / 2)), c = flow(moved(now, b, h / 2)),
                    d = flow(moved(now, c, h));
        State mean{(a.p + 2 * b.p + 2 * c.p + d.p) / 6, (a.v + 2 * b.v + 2 * c.v + d.v) / 6, a.q,
                   (a.w + 2 * b.w + 2 * c.w + d.w) / 6};
        mean.q.coeffs() = (a.q.coeffs() + 2 * b.q.coeffs() + 2 * c.q.coeffs() + d.q.coeffs()) / 6;
        now = moved(now, mean, h);
      }
    }
    mocap.time.rows = mocap.pose.rows = static_cast<std::size_t>(design.samples);
    one.free_flight = {mocap.time(0), mocap.time(mocap.time.rows - 1)};
    log.throws.push_back(std::move(one));
  }
  return log;
}

}  // namespace unhand::test
