#include "fitting/slips/slip_surface.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <numbers>
#include <set>
#include <stdexcept>

#include "contact/convex_quartic.hpp"
#include "dynamics/dense_solve.hpp"
#include "dynamics/median.hpp"
#include "fitting/slips/slip_surface_solver.hpp"

namespace unhand::fitting {

using dynamics::spectrum_of;

namespace {

constexpr double least_spread = 1e-3;  // of the mean square of the directions along any axis

SurfaceFit refused(SurfaceOutcome outcome, const std::string& reason) {
  SurfaceFit out;
  out.outcome = outcome;
  out.reason = reason;
  return out;
}

/// Fit and noise in turn.
template <class Terms>
bool solve_ellipsoid(const std::vector<SlipSample>& samples,
                     std::array<double, static_cast<std::size_t>(Terms::parameters)>& p, SurfaceNoise& noise,
                     int& iterations) {
  for (int turn = 0; turn < 30; ++turn) {
    ceres::Problem problem;
    add_samples<Terms>(problem, samples, noise, p.data());
    const Solved solved = solve(problem, 200);
    iterations += solved.iterations;
    if (!solved.usable) return false;
    const SurfaceNoise next = noise_of<Terms>(samples, p.data());
    const bool still = settled(noise, next);
    noise = next;
    if (still) break;
  }
  return true;
}

/// Enough slips, and directions in all three dimensions?
SurfaceFit check(const SlipSamples& slips, SurfaceModel model) {
  std::set<int> used;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const SlipSample& s : slips.samples) {
    used.insert(s.slip);
    const Eigen::Vector3d u(s.direction[0], s.direction[1], s.direction[2]);
    spread += u * u.transpose();
  }
  const int least = least_slips(model);
  if (static_cast<int>(used.size()) < least)
    return refused(SurfaceOutcome::too_few_slips,
                   fmt::format("surface '{}': {} slips with motion under force, {} needs {}", slips.surface,
                               used.size(), to_string(model), least));
  const Eigen::Vector3d values = spectrum_of(spread / static_cast<double>(slips.samples.size())).values;
  if (values[1] < least_spread || values[0] < least_spread)
    return refused(SurfaceOutcome::directions_do_not_span,
                   fmt::format("surface '{}': all twists are in one {}: they do not determine a surface",
                               slips.surface, values[1] < least_spread ? "direction" : "plane"));
  SurfaceFit out;
  out.outcome = SurfaceOutcome::fitted;
  return out;
}

std::vector<double> quartic_of(const std::array<double, 15>& c, double force) {
  const double scale = 1 / (force * force * force * force);
  std::vector<double> out;
  for (const double one : c) out.push_back(one * scale);
  return out;
}

/// Convex, and zero at no wrench but zero.
bool is_quartic(const std::vector<double>& coefficients) {
  std::array<double, 15> c{};
  std::copy(coefficients.begin(), coefficients.end(), c.begin());
  try {
    contact::ConvexQuartic{c};
  } catch (const std::invalid_argument&) {
    return false;
  }
  return true;
}

}  // namespace

std::string to_string(SurfaceModel model) {
  constexpr const char* kNames[] = {"ellipsoid", "ellipsoid_full", "convex_quartic"};
  return kNames[static_cast<int>(model)];
}

SurfaceModel surface_model(const std::string& name) {
  for (const SurfaceModel model : surface_models)
    if (to_string(model) == name) return model;
  throw std::invalid_argument(fmt::format(
      "surface model '{}' is unknown; there are ellipsoid, ellipsoid_full, convex_quartic", name));
}

std::string to_string(SurfaceOutcome outcome) {
  constexpr const char* kNames[] = {"fitted", "too few slips", "directions do not span", "not converged"};
  return kNames[static_cast<int>(outcome)];
}

int least_slips(SurfaceModel model) {
  return model == SurfaceModel::convex_quartic ? 15 : model == SurfaceModel::ellipsoid_full ? 6 : 5;
}

SurfaceFit fit_surface(const SlipSamples& slips, SurfaceModel model) {
  if (!(slips.characteristic_length > 0))
    throw std::invalid_argument(
        fmt::format("characteristic_length: {} is not > 0", slips.characteristic_length));
  SurfaceFit out = check(slips, model);
  if (!out.fitted()) return out;

  std::vector<double> sizes;
  for (const SlipSample& s : slips.samples)
    sizes.push_back(std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]));
  const double force = dynamics::median(sizes);
  std::vector<SlipSample> samples = slips.samples;
  for (SlipSample& s : samples)
    for (double& w : s.wrench) w /= force;

  out.surface.model = model;
  out.surface.characteristic_length = slips.characteristic_length;
  std::vector<double>& c = out.surface.coefficients;
  const auto failed = [&] {
    return refused(SurfaceOutcome::not_converged, fmt::format("surface '{}': the fit of {} did not converge",
                                                              slips.surface, to_string(model)));
  };
  SurfaceNoise noise;
  std::array<double, 3> axis{};
  if (!solve_ellipsoid<AxisTerms>(samples, axis, noise, out.iterations)) return failed();
  const double unit = 1 / (force * force);
  if (model == SurfaceModel::ellipsoid) {
    c = {unit * std::exp(2 * axis[0]), 0, 0, unit * std::exp(2 * axis[1]), 0, unit * std::exp(2 * axis[2])};
  } else {
    std::array<double, 6> full{std::exp(axis[0]), 0, 0, std::exp(axis[1]), 0, std::exp(axis[2])};
    if (!solve_ellipsoid<FullTerms>(samples, full, noise, out.iterations)) return failed();
    if (model == SurfaceModel::ellipsoid_full) {
      const Eigen::Matrix3d b{{full[0], full[1], full[2]}, {0, full[3], full[4]}, {0, 0, full[5]}};
      const Eigen::Matrix3d a = unit * b.transpose() * b;
      c = {a(0, 0), a(0, 1), a(0, 2), a(1, 1), a(1, 2), a(2, 2)};
    } else {
      const QuarticSolution solution = solve_quartic(samples, full, noise);
      out.iterations += solution.iterations;
      if (!solution.usable) return failed();
      noise = solution.noise;
      c = quartic_of(quartic_coefficients(solution.p.data()), force);
      if (!is_quartic(c)) return failed();  // slips that no surface has may flatten it without end
    }
  }
  out.sigma_direction = noise.direction;
  out.sigma_level = noise.level;
  return out;
}

double SlipSurface::gauge(const std::array<double, 3>& w) const {
  if (model == SurfaceModel::convex_quartic) {
    const auto value = quartic_value(coefficients, w);
    return std::sqrt(std::sqrt(value.h));
  }
  const Eigen::Vector3d x(w[0], w[1], w[2]);
  return std::sqrt(x.dot(symmetric(coefficients) * x));
}

std::array<double, 3> SlipSurface::normal(const std::array<double, 3>& w) const {
  Eigen::Vector3d g;
  if (model == SurfaceModel::convex_quartic) {
    const auto value = quartic_value(coefficients, w);
    g = {value.gradient[0], value.gradient[1], value.gradient[2]};
  } else {
    g = symmetric(coefficients) * Eigen::Vector3d(w[0], w[1], w[2]);
  }
  g /= g.norm();
  return {g[0], g[1], g[2]};
}

SlipSurface::Extremes SlipSurface::extremes() const {
  Extremes out{1e300, 0, characteristic_length / gauge({0, 0, 1})};
  constexpr int directions = 720;
  for (int k = 0; k < directions; ++k) {
    const double phi = std::numbers::pi * k / directions;
    const double force = 1 / gauge({std::cos(phi), std::sin(phi), 0});
    out.least_force = std::min(out.least_force, force);
    out.largest_force = std::max(out.largest_force, force);
  }
  return out;
}

double direction_error(const SlipSurface& surface, const SlipSample& sample) {
  const auto n = surface.normal(sample.wrench);
  const Eigen::Vector3d a(n[0], n[1], n[2]), b(sample.direction[0], sample.direction[1], sample.direction[2]);
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace unhand::fitting
