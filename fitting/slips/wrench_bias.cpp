#include "fitting/slips/wrench_bias.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using Eigen::Index, Eigen::MatrixXd, Eigen::Vector3d, Eigen::Vector4d, Eigen::VectorXd;

namespace {

constexpr int kSteps = 20;
/// Of a sigma: steps below it change nothing that matters.
constexpr double kAtRest = 0.1;
/// Of the mean force: the longest step.
constexpr double kFarthest = 0.3;

/// n(w) − u and gauge(w) − 1, in units of their noise.
Vector4d residual(const SlipSurface& surface, const SurfaceFit& fit, const SlipSample& s,
                  const Vector3d& bias) {
  const std::array<double, 3> w{s.wrench[0] - bias[0], s.wrench[1] - bias[1], s.wrench[2] - bias[2]};
  const auto n = surface.normal(w);
  return {(n[0] - s.direction[0]) / fit.sigma_direction, (n[1] - s.direction[1]) / fit.sigma_direction,
          (n[2] - s.direction[2]) / fit.sigma_direction, (surface.gauge(w) - 1) / fit.sigma_level};
}

/// Gradients of the loss by (f_x, f_y, τ) of each slip, and its curvature, the surface's coefficients
/// eliminated.
struct Profiled {
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
  std::map<int, Vector3d> gradients;  ///< by slip
};

Profiled profiled(const SlipSamples& slips, const SurfaceFit& fit) {
  const SlipSurface& surface = fit.surface;
  double largest = 0;
  for (const double c : surface.coefficients) largest = std::max(largest, std::abs(c));
  std::vector<SlipSurface> up, down;  // in one coefficient each
  for (std::size_t k = 0; k < surface.coefficients.size(); ++k) {
    if (surface.model == SurfaceModel::ellipsoid && surface.coefficients[k] == 0) continue;
    up.push_back(surface), down.push_back(surface);
    up.back().coefficients[k] += 1e-5 * largest;
    down.back().coefficients[k] -= 1e-5 * largest;
  }
  const auto n = static_cast<Index>(up.size());
  MatrixXd curvature = MatrixXd::Zero(n + 3, n + 3);
  std::map<int, VectorXd> gradients;
  for (const SlipSample& s : slips.samples) {
    const double h = 1e-5 * std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]);
    if (!(h > 0)) continue;
    Eigen::Matrix<double, 4, Eigen::Dynamic> J(4, n + 3);
    for (std::size_t k = 0; k < up.size(); ++k)
      J.col(static_cast<Index>(k)) =
          (residual(up[k], fit, s, Vector3d::Zero()) - residual(down[k], fit, s, Vector3d::Zero())) /
          (2e-5 * largest);
    for (Index k = 0; k < 3; ++k) {
      const Vector3d along = h * Vector3d::Unit(k);
      J.col(n + k) = (residual(surface, fit, s, along) - residual(surface, fit, s, -along)) / (2 * h);
    }
    J.col(n + 2) /= slips.characteristic_length;
    // Of 2 √(1 + |r|²) by r: the gradient is 2 ψ r, the second derivative 2 (ψ − ψ³ r rᵀ), ψ = 1/√(1 + |r|²).
    const Vector4d r = residual(surface, fit, s, Vector3d::Zero());
    const Vector3d d = r.head<3>();
    const double direction = 1 / std::sqrt(1 + d.squaredNorm()), level = 1 / std::sqrt(1 + r[3] * r[3]);
    Eigen::Matrix4d second = Vector4d(direction, direction, direction, std::pow(level, 3)).asDiagonal();
    second.topLeftCorner<3, 3>() -= std::pow(direction, 3) * d * d.transpose();
    const Vector4d first(direction * d[0], direction * d[1], direction * d[2], level * r[3]);
    curvature += J.transpose() * second * J;
    auto& gradient = gradients.try_emplace(s.slip, VectorXd::Zero(n + 3)).first->second;
    gradient += J.transpose() * first;
  }
  const MatrixXd by_coefficients =
      dynamics::pseudo_inverse(curvature.topLeftCorner(n, n)) * curvature.topRightCorner(n, 3);
  Profiled out;
  out.curvature = curvature.bottomRightCorner(3, 3) - curvature.bottomLeftCorner(3, n) * by_coefficients;
  for (const auto& [slip, g] : gradients)
    out.gradients[slip] = g.tail(3) - by_coefficients.transpose() * g.head(n);
  return out;
}

/// The next step of the bias, and its covariance by the scatter of the slips' gradients.
struct Step {
  Vector3d value;
  Eigen::Matrix3d covariance;
  double slips{};
};

Step next_step(const std::vector<SlipSamples>& rest, const std::vector<SurfaceFit>& fits) {
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero(), scatter = Eigen::Matrix3d::Zero();
  Vector3d gradient = Vector3d::Zero();
  double slips = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Profiled one = profiled(rest[i], fits[i]);
    curvature += one.curvature;
    for (const auto& [slip, g] : one.gradients) gradient += g, scatter += g * g.transpose(), slips += 1;
  }
  const Eigen::Matrix3d inverse = dynamics::pseudo_inverse(curvature);
  return {-inverse * gradient, inverse * scatter * inverse * (slips / std::max(1.0, slips - 3)), slips};
}

/// Of all samples [N].
double mean_force(const std::vector<SlipSamples>& surfaces) {
  double sum = 0, n = 0;
  for (const SlipSamples& slips : surfaces)
    for (const SlipSample& s : slips.samples) sum += std::hypot(s.wrench[0], s.wrench[1]), n += 1;
  return n > 0 ? sum / n : 0;
}

std::vector<SlipSamples> without_fold(std::vector<SlipSamples> surfaces, int fold, int folds) {
  for (SlipSamples& slips : surfaces)
    std::erase_if(slips.samples, [&](const SlipSample& s) { return s.slip % folds == fold; });
  return surfaces;
}

}  // namespace

SlipSamples without_bias(SlipSamples slips, const Vector3d& bias) {
  const Vector3d b(bias[0], bias[1], bias[2] / slips.characteristic_length);
  for (SlipSample& s : slips.samples)
    for (std::size_t j = 0; j < 3; ++j) s.wrench[j] -= b[static_cast<Index>(j)];
  return slips;
}

std::vector<SlipSamples> without_bias(std::vector<SlipSamples> surfaces, const Vector3d& bias) {
  for (SlipSamples& slips : surfaces) slips = without_bias(std::move(slips), bias);
  return surfaces;
}

WrenchBias fit_wrench_bias(const std::vector<SlipSamples>& surfaces, SurfaceModel model,
                           const Vector3d& start) {
  WrenchBias out;
  out.value = start;
  const double force = mean_force(surfaces);
  Vector3d asked = Vector3d::Zero(), taken = Vector3d::Zero();  // of the last step
  for (int i = 0; i < kSteps; ++i) {
    const auto rest = without_bias(surfaces, out.value);
    out.fits.clear();
    for (const SlipSamples& slips : rest)
      if (out.fits.push_back(fit_surface(slips, model)); !out.fits.back().fitted()) return out;
    const Step step = next_step(rest, out.fits);
    if (!step.value.allFinite() || !step.covariance.allFinite()) return out;
    out.covariance = step.covariance;
    const Eigen::Matrix3d information = dynamics::pseudo_inverse(step.covariance);
    const auto length = [&](const Vector3d& x) { return std::sqrt(std::max(0.0, x.dot(information * x))); };
    if (length(step.value) <= kAtRest) {
      const double size = length(out.value);
      out.p_value = hotelling_bar_tail(size * size, 3, 0, step.slips);
      out.solved = true;
      return out;
    }
    // One that goes back has gone too far: to where the line through the two is zero.
    const bool back = step.value.dot(information * taken) < 0;
    double share = back ? std::min(1.0, length(taken) / (length(asked) + length(step.value))) : 1.0;
    // And none by more than a part of the wrenches.
    if (const double size = step.value.head<2>().norm(); share * size > kFarthest * force)
      share = kFarthest * force / size;
    asked = step.value, taken = share * step.value;
    out.value += taken;
  }
  return out;
}

std::vector<SurfaceScore> score_with_bias(const std::vector<SlipSamples>& surfaces, SurfaceModel model,
                                          const WrenchBias& whole, const SurfaceComparisonOptions& options) {
  std::vector<SurfaceScore> out(surfaces.size());
  std::vector<std::vector<double>> errors(surfaces.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    out[i].model = model, out[i].outcome = SurfaceOutcome::fitted, out[i].fit = whole.fits[i];
    errors[i].resize(surfaces[i].samples.size());
  }
  std::vector<WrenchBias> folds(static_cast<std::size_t>(options.folds));
  dynamics::parallel_for(folds.size(), options.threads, [&](std::size_t k) {
    folds[k] =
        fit_wrench_bias(without_fold(surfaces, static_cast<int>(k), options.folds), model, whole.value);
  });
  for (std::size_t k = 0; k < folds.size(); ++k) {
    if (!folds[k].solved) return {};
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      const SlipSamples rest = without_bias(surfaces[i], folds[k].value);
      for (std::size_t s = 0; s < rest.samples.size(); ++s)
        if (static_cast<std::size_t>(rest.samples[s].slip) % folds.size() == k)
          errors[i][s] = kDegreesPerRadian * direction_error(folds[k].fits[i].surface, rest.samples[s]);
    }
  }
  for (std::size_t i = 0; i < surfaces.size(); ++i) out[i].set_errors(std::move(errors[i]));
  return out;
}

}  // namespace unhand::fitting
