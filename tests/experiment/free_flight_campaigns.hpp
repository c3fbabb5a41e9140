// Free flights whose truth is known, as a tracker would see them, and how far a fit is from it.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/free_flight.hpp"
#include "flight/fly.hpp"
#include "flight/spatial_flight.hpp"

namespace unhand::experiment {

using datasets::Throw;
using datasets::ThrowLog;
using flight::Quaternion;
using flight::RotationState;
using flight::Vec3;

inline constexpr double kSigmaP = 2e-4, kSigmaQ = 5e-4, kRate = 120;  // m, 1, Hz

struct Truth {
  Vec3<double> position{}, velocity{};
  RotationState<double> rotation;
};

struct Campaign {
  ThrowLog log;
  std::vector<Truth> truth;
};

inline Vec3<double> random_vector(std::mt19937_64& random, double size) {
  std::normal_distribution<double> normal;
  return {size * normal(random), size * normal(random), size * normal(random)};
}

/// Spatial flights of 0.4 s or so, tracked with noise of `noise` times the declared sigma.
inline Campaign spatial(int throws, const Vec3<double>& inertia, double drag_k, double noise,
                        unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Campaign out;
  out.log.dimension = 3;
  datasets::Object object;
  object.mass = 0.3;
  object.inertia = std::vector<double>(inertia.begin(), inertia.end());
  if (drag_k > 0) object.drag_k = drag_k;
  out.log.objects.emplace("thing", object);
  for (int k = 0; k < throws; ++k) {
    Truth truth{random_vector(random, 1),
                random_vector(random, 2),
                {flight::exp(random_vector(random, 2)), random_vector(random, 8)}};
    truth.velocity[2] += 2;
    Throw one;
    one.id = "flight-" + std::to_string(100 + k);
    one.object = "thing";
    one.split = k % 4 == 3 ? datasets::Split::test : datasets::Split::train;
    const std::size_t n = 40 + k % 20;
    std::vector<double> times;
    for (std::size_t i = 0; i < n; ++i) times.push_back(static_cast<double>(i) / kRate);
    const flight::SpatialAir<double> air{.gravity = {0, 0, -out.log.gravity}, .drag_k = drag_k};
    const auto flown = flight::fly_in_space<double>({truth.position, truth.velocity, truth.rotation, inertia},
                                                    air, times, {.tolerances = {1e-12, 1e-13}});
    auto& mocap = one.mocap.emplace();
    mocap.time = {n, 1, times, {}};
    mocap.pose = {n, 7, {}, {kSigmaP, kSigmaP, 2 * kSigmaP, kSigmaQ, kSigmaQ, kSigmaQ, kSigmaQ}};
    for (double& t : mocap.time.data) t += 17.5;
    for (std::size_t i = 0; i < n; ++i) {
      const double s = noise * kSigmaP, r = noise * kSigmaQ;
      const auto& p = flown.states[i].position;
      Quaternion<double> a = flown.states[i].rotation.attitude;
      a = normalised(Quaternion<double>{a.w + r * normal(random), a.x + r * normal(random),
                                        a.y + r * normal(random), a.z + r * normal(random)});
      const double sign = i % 3 == 1 ? -1 : 1;  // either sign is the same orientation
      for (const double x : {p[0] + s * normal(random), p[1] + s * normal(random),
                             p[2] + 2 * s * normal(random), sign * a.w, sign * a.x, sign * a.y, sign * a.z})
        mocap.pose.data.push_back(x);
    }
    out.log.throws.push_back(one);
    out.truth.push_back(truth);
  }
  return out;
}

inline Campaign planar(int throws, double drag_k, double noise) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Campaign out;
  datasets::Object object;
  object.mass = 0.3;
  if (drag_k > 0) object.drag_k = drag_k;
  out.log.objects.emplace("thing", object);
  for (int k = 0; k < throws; ++k) {
    flight::FlightProblem<double> problem;
    problem.pose = {normal(random), normal(random), 10 * normal(random)};
    problem.twist = {2 * normal(random), 2 + normal(random), 20 * normal(random)};
    problem.gravity = {0, -out.log.gravity};
    problem.drag_k = drag_k;
    std::vector<double> times;
    for (int i = 0; i < 50; ++i) times.push_back(i / kRate);
    const auto poses = flight::fly_through(problem, times, {.tolerances = {1e-12, 1e-13}});
    Throw one;
    one.id = "flight-" + std::to_string(100 + k);
    one.object = "thing";
    auto& mocap = one.mocap.emplace();
    mocap.time = {times.size(), 1, times, {}};
    mocap.pose = {times.size(), 3, {}, {kSigmaP, kSigmaP, kSigmaQ}};
    for (const auto& pose : poses)
      for (const double x :
           {pose.x + noise * kSigmaP * normal(random), pose.z + noise * kSigmaP * normal(random),
            pose.theta + noise * kSigmaQ * normal(random)})
        mocap.pose.data.push_back(x);
    out.log.throws.push_back(one);
    const auto& v = problem.twist;
    out.truth.push_back(
        {{problem.pose.x, 0, problem.pose.z}, {v.vx, 0, v.vz}, {{}, {problem.pose.theta, -v.omega, 0}}});
  }
  return out;
}

/// Σ (residual/sigma)² over the fitted samples.
inline double chi2_of(const std::vector<Vec3<double>>& residuals, std::size_t fitted,
                      const Vec3<double>& sigma) {
  double out = 0;
  for (std::size_t i = 0; i < fitted; ++i)
    for (std::size_t a = 0; a < 3; ++a) out += std::pow(residuals[i][a] / sigma[a], 2);
  return out;
}

}  // namespace unhand::experiment
