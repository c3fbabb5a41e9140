#include "experiment/friction_estimate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "contact/convex_quartic.hpp"
#include "contact/gripper_delay.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "dynamics/median.hpp"

namespace unhand::experiment {

using dynamics::Dual;

namespace {

/// One pad's wrench over its normal force.
struct Sample {
  double fx, fz, tau, weight;
};

std::vector<Sample> slipping_samples(const datasets::ThrowLog& log,
                                     const std::vector<PreparedThrow>& throws) {
  std::vector<Sample> out;
  for (std::size_t i = 0; i < throws.size(); ++i) {
    const PreparedThrow& prepared = throws[i];
    const datasets::Throw& logged = log.throws[i];
    if (prepared.split != datasets::Split::train || !logged.ft || !prepared.normal_force) continue;
    const double release = prepared.normal_force->release_time(), grip = prepared.force_fit.grip_force;
    if (!std::isfinite(release)) continue;
    const double low = 8 * prepared.force_fit.sigma, high = 0.2 * grip;
    for (std::size_t k = 0; k < logged.ft->time.rows; ++k) {
      const double t = logged.ft->time(k);
      if (t < prepared.open_command || t >= release) continue;
      const double f = prepared.normal_force->at({prepared.start, release}, t);
      if (f < low || f > high) continue;
      out.push_back(
          {logged.ft->wrench(k, 0) / f, logged.ft->wrench(k, 1) / f, logged.ft->wrench(k, 2) / f, f / grip});
    }
  }
  return out;
}

/// The sliding pivot's, whose limits of force and torque know nothing of each other.
struct Decoupled {
  template <class S>
  S gauge(const contact::Vec3<S>& w) const {
    using std::abs;
    using std::hypot;
    const S force = hypot(w[0], w[1]), torque = abs(w[2]);
    return force < torque ? torque : force;
  }
};

/// Gauss-Newton on (ln μ, ln L) with weights 1/max(1, |r|/k) and a damped step.
template <class Shape>
void solve(const Shape& shape, const std::vector<Sample>& samples, double& mu, double& length,
           double& scatter) {
  std::vector<double> residuals(samples.size());
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Dual mu_d(mu, 0), length_d(length, 1);
    double H[2][2] = {}, b[2] = {};
    std::vector<Dual> r(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Sample& s = samples[i];
      r[i] = shape.gauge(contact::Vec3<Dual>{s.fx / mu_d, s.fz / mu_d, s.tau / (mu_d * length_d)}) - 1.0;
      residuals[i] = std::abs(r[i].a);
    }
    scatter = 1.4826 * dynamics::median(residuals);
    const double k = 1.345 * std::max(scatter, 1e-9);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double w = samples[i].weight * samples[i].weight / std::max(1.0, std::abs(r[i].a) / k);
      const double J[2] = {mu * r[i].v[0], length * r[i].v[1]};
      for (int p = 0; p < 2; ++p) {
        b[p] -= w * J[p] * r[i].a;
        for (int q = 0; q < 2; ++q) H[p][q] += w * J[p] * J[q];
      }
    }
    for (int p = 0; p < 2; ++p) H[p][p] *= 1 + 1e-9;
    const double det = H[0][0] * H[1][1] - H[0][1] * H[1][0];
    if (!(det > 0)) break;
    const double d0 = std::clamp((b[0] * H[1][1] - b[1] * H[0][1]) / det, -0.5, 0.5);
    const double d1 = std::clamp((b[1] * H[0][0] - b[0] * H[1][0]) / det, -0.5, 0.5);
    mu *= std::exp(d0);
    length *= std::exp(d1);
    if (std::abs(d0) + std::abs(d1) < 1e-10) break;
  }
}

/// The surface of the two on which the samples lie better: real pads follow no rectangle, and the ellipsoid's
/// values serve the sliding pivot better there than those of a rectangle through all samples.
void solve_sliding_pivot(const std::vector<Sample>& samples, double& mu, double& length, double& scatter) {
  double own_mu = mu, own_length = length, own_scatter = 0;
  solve(Decoupled{}, samples, own_mu, own_length, own_scatter);
  solve(contact::Ellipsoid{}, samples, mu, length, scatter);
  if (own_scatter < scatter) mu = own_mu, length = own_length, scatter = own_scatter;
}

void estimate_delay(const std::vector<PreparedThrow>& throws, ModelParameters& parameters) {
  std::vector<double> delays;
  for (const auto& t : throws)
    if (t.split == datasets::Split::train && t.measured.detach_time)
      delays.push_back(*t.measured.detach_time - t.open_command);
  if (delays.empty())
    throw std::invalid_argument(
        "the log shows no detach in any train throw (neither a normal force that ends nor detach_time): "
        "the gripper's delay cannot be estimated; give a card");
  double mean = 0, square = 0;
  for (const double d : delays) mean += d / static_cast<double>(delays.size());
  for (const double d : delays) square += (d - mean) * (d - mean) / static_cast<double>(delays.size());
  mean = std::max(mean, 0.0);
  parameters.delay =
      square > 0 ? contact::DelayDistribution::normal(mean, std::sqrt(square), std::max(0.1, 2 * mean))
                 : contact::DelayDistribution::number(mean);
}

}  // namespace

void require_patch(const FrictionEstimate& estimate, const std::string& model) {
  if (model == contact::kGripperDelay) return;
  constexpr double kMu[2] = {1e-3, 20}, kLength[2] = {1e-5, 0.2};  // -, m
  const auto require = [&](const char* what, double value, const double(&range)[2]) {
    if (value >= range[0] && value <= range[1]) return;
    throw std::invalid_argument(
        fmt::format("the log does not determine the {} for {}: {} F/T samples of slipping pads in its train "
                    "throws would make it {:.3g}, accepted are {:g} to {:g}; give more throws, or a card",
                    what, model, estimate.samples, value, range[0], range[1]));
  };
  require("friction coefficient", estimate.parameters.mu, kMu);
  require("length of the pads [m]", estimate.parameters.length, kLength);
}

FrictionEstimate estimate_friction(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& throws,
                                   const std::string& model) {
  require_release_model(model);
  FrictionEstimate out;
  if (log.gripper) out.parameters.pads = log.gripper->n_pads;
  if (model == contact::kGripperDelay) {
    estimate_delay(throws, out.parameters);
    out.method = "delay: mean of detach minus opening command over the train throws";
    return out;
  }
  const auto samples = slipping_samples(log, throws);
  out.samples = static_cast<int>(samples.size());
  if (samples.size() < 10)
    throw std::invalid_argument(
        fmt::format("the log determines no friction for {}: {} F/T samples with a falling normal "
                    "force in its train throws, at least 10 are needed; give a card",
                    model, samples.size()));
  // Start from the envelope: the largest force and torque ratios that are common.
  std::vector<double> force, torque;
  for (const auto& s : samples) {
    force.push_back(std::hypot(s.fx, s.fz));
    torque.push_back(std::abs(s.tau));
  }
  std::sort(force.begin(), force.end());
  std::sort(torque.begin(), torque.end());
  const std::size_t top = samples.size() * 9 / 10;
  double mu = std::clamp(force[top], 0.05, 3.0), length = std::clamp(torque[top] / mu, 1e-4, 0.1);
  if (model == "limit_surface_disc")
    solve(contact::UniformDisc{}, samples, mu, length, out.scatter);
  else if (model == "limit_surface_quartic")
    solve(contact::ConvexQuartic::closest_to_disc(), samples, mu, length, out.scatter);
  else if (model == "sliding_pivot")
    solve_sliding_pivot(samples, mu, length, out.scatter);
  else
    solve(contact::Ellipsoid{}, samples, mu, length, out.scatter);
  out.parameters.mu = mu;
  out.parameters.length = length;
  out.method =
      "friction: the pad's wrench on the limit surface while the normal force vanishes, train throws";
  return out;
}

}  // namespace unhand::experiment
