// Slips simulated from a known limit surface.
#pragma once

#include <Eigen/Dense>
#include <random>

#include "contact/convex_quartic.hpp"
#include "fitting/slips/slip_surface.hpp"

namespace unhand::fitting::test {

/// Of an ellipsoid whose semi-axes are 4, 3 and 5.
inline const Eigen::Matrix3d along_axes = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();

inline SlipSurface ellipsoid(const Eigen::Matrix3d& a) {
  return {SurfaceModel::ellipsoid_full, 0.05, {a(0, 0), a(0, 1), a(0, 2), a(1, 1), a(1, 2), a(2, 2)}};
}

inline SlipSurface quartic(const contact::ConvexQuartic& shape, double force) {
  SlipSurface out{SurfaceModel::convex_quartic, 0.05, {}};
  for (const double c : shape.coefficients()) out.coefficients.push_back(c / std::pow(force, 4));
  return out;
}

inline Eigen::Vector3d gauss(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}

/// Wrenches in random directions on the surface, `level` off it along the ray; twists along the normal,
/// `noise` [rad] off it.
inline SlipSamples simulate(const SlipSurface& surface, int n, double noise, double level, unsigned seed) {
  std::mt19937_64 random(seed);
  SlipSamples out{"simulated", surface.characteristic_length, {}, {}};
  for (int k = 0; k < n; ++k) {
    out.slips.push_back("slip-" + std::to_string(k));
    const Eigen::Vector3d ray = gauss(random).normalized();
    const double size = 1 / surface.gauge({ray[0], ray[1], ray[2]});
    const auto normal = surface.normal({ray[0], ray[1], ray[2]});
    const Eigen::Vector3d u =
        (Eigen::Vector3d(normal[0], normal[1], normal[2]) + noise * gauss(random)).normalized();
    const Eigen::Vector3d w = size * (1 + level * gauss(random)[0]) * ray;
    out.samples.push_back({{w[0], w[1], w[2]}, {u[0], u[1], u[2]}, k});
  }
  return out;
}

}  // namespace unhand::fitting::test
