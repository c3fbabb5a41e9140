// The least squares behind fit_surface. Private: the one header of this module that names Ceres.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

#include "dynamics/median.hpp"
#include "fitting/slips/slip_samples.hpp"
#include "fitting/slips/slip_surface_terms.hpp"

namespace unhand::fitting {

/// The noise that whitens residuals: of a direction, per component, and of the gauge.
struct SurfaceNoise {
  double direction = 0.2, level = 0.1;
};

/// n(w) − u, or gauge(w) − 1, over the noise.
template <class Terms>
struct DirectionResidual {
  Wrench w, u;
  double sigma;
  template <class T>
  bool operator()(const T* p, T* r) const {
    using std::sqrt;
    const auto value = Terms::at(p, w);
    const auto& g = value.gradient;
    const T size = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    if (!(size > 0.0)) return false;
    for (std::size_t j = 0; j < 3; ++j) r[j] = (g[j] / size - u[j]) / sigma;
    return true;
  }
};
template <class Terms>
struct LevelResidual {
  Wrench w;
  double sigma;
  template <class T>
  bool operator()(const T* p, T* r) const {
    using std::sqrt;
    const T h = Terms::at(p, w).h;
    if (!(h > 0.0)) return false;
    const T root = sqrt(h);
    r[0] = ((Terms::degree == 2 ? root : sqrt(root)) - 1.0) / sigma;
    return true;
  }
};

template <class Terms>
void add_samples(ceres::Problem& problem, const std::vector<SlipSample>& samples, const SurfaceNoise& noise,
                 double* parameters) {
  constexpr int n = Terms::parameters;
  for (const SlipSample& s : samples) {
    using Direction = DirectionResidual<Terms>;
    using Level = LevelResidual<Terms>;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Direction, 3, n>(
                                 new Direction{s.wrench, s.direction, noise.direction}),
                             new ceres::SoftLOneLoss(1.0), parameters);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Level, 1, n>(new Level{s.wrench, noise.level}),
                             new ceres::SoftLOneLoss(1.0), parameters);
  }
}

struct Solved {
  bool usable{};
  int iterations{};
};

inline Solved solve(ceres::Problem& problem, int most_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 1;
  options.max_num_iterations = most_iterations;
  options.function_tolerance = 1e-10;
  options.parameter_tolerance = 1e-10;
  options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {summary.IsSolutionUsable(), static_cast<int>(summary.iterations.size())};
}

/// From the medians of the residuals: 1.1774 σ is the median of two Gauss components' length, 0.6745 σ that
/// of one's.
template <class Terms>
SurfaceNoise noise_of(const std::vector<SlipSample>& samples, const double* p) {
  std::vector<double> direction, level;
  for (const SlipSample& s : samples) {
    double r[3]{};
    DirectionResidual<Terms>{s.wrench, s.direction, 1.0}(p, r);
    direction.push_back(std::hypot(r[0], r[1], r[2]));
    LevelResidual<Terms>{s.wrench, 1.0}(p, r);
    level.push_back(std::abs(r[0]));
  }
  constexpr double floor = 1e-4;
  return {std::max(dynamics::median(direction) / 1.1774, floor),
          std::max(dynamics::median(level) / 0.6745, floor)};
}

/// Whether the noise has settled, so that another turn would change nothing that matters.
inline bool settled(const SurfaceNoise& a, const SurfaceNoise& b) {
  return std::abs(a.direction - b.direction) < 1e-3 * b.direction &&
         std::abs(a.level - b.level) < 1e-3 * b.level;
}

/// By its upper triangle, row by row.
inline Eigen::Matrix3d symmetric(std::span<const double> a) {
  return Eigen::Matrix3d{{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
}

/// Σ_k (a_k · q(w))² with Σ_k adj(A_k) positive semidefinite, near or far from the ellipsoid |Bw|² = 1, B as
/// in FullTerms.
struct QuarticSolution {
  std::array<double, QuarticTerms::parameters> p{};
  SurfaceNoise noise;
  int iterations{};
  bool usable{};
};
QuarticSolution solve_quartic(const std::vector<SlipSample>& samples,
                              const std::array<double, FullTerms::parameters>& ellipsoid, SurfaceNoise noise);

/// The 15 coefficients of such a sum in the order of contact::ConvexQuartic.
std::array<double, 15> quartic_coefficients(const double* p);

}  // namespace unhand::fitting
