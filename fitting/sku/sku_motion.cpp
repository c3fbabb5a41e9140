#include "fitting/sku/sku_motion.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/outcome_slopes.hpp"
#include "experiment/reference_throw.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::product;
using Eigen::MatrixXd;

experiment::ThrowPrediction<double> SkuMotion::predict(const std::vector<double>& values) const {
  return experiment::predict_channels(prepared, {}, inputs.model,
                                      dynamics::Values<double>(inputs.names, values));
}

bool SkuMotion::held(const std::vector<double>& values) const {
  return experiment::grip_holds(prepared, inputs.model, dynamics::Values<double>(inputs.names, values));
}

std::optional<MatrixXd> SkuMotion::slopes() const {
  const auto all = experiment::outcome_slopes(prepared, inputs.model, inputs.names, inputs.values);
  if (!all) return {};
  MatrixXd landing(2, all->cols());
  landing << all->row(experiment::kLandingX), all->row(experiment::kLandingTheta);
  return product(landing, inputs.mixing());
}

namespace {

/// `prepared` with the SKU's object in it.
SkuMotion motion_of(experiment::PreparedThrow prepared, const datasets::Sku& sku,
                    const datasets::ModelCard& card, const std::string& file, const SkuRequest& request) {
  prepared.object = sku.name;
  auto inputs = throw_inputs(sku, card, file, prepared, request.assumed);
  return {std::move(prepared), std::move(inputs)};
}

/// Among the throws that repeat the motion of throw `first`, the one that lands nearest to their mean;
/// `first` where none lands.
std::size_t middle_repetition(const std::vector<datasets::Throw>& throws, std::size_t first,
                              const LoggedLandings& landings, const LandingTolerance& tolerance) {
  std::vector<std::size_t> landed;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = first; i < throws.size(); ++i)
    if (landings[i] && repeated_motion(throws[i]) == repeated_motion(throws[first]))
      landed.push_back(i), mean += *landings[i];
  if (landed.empty()) return first;
  mean /= static_cast<double>(landed.size());
  return *std::min_element(landed.begin(), landed.end(), [&](std::size_t a, std::size_t b) {
    const auto away = [&](std::size_t i) {
      const Eigen::Vector2d d = *landings[i] - mean;
      return std::hypot(d[0] / tolerance.x, d[1] / tolerance.theta);
    };
    return away(a) < away(b);
  });
}

}  // namespace

std::string repeated_motion(const datasets::Throw& one) { return one.object + "/" + one.condition; }

LoggedLandings logged_landings(const datasets::Sku& sku, const datasets::ModelCard& card,
                               const std::string& file, const SkuRequest& request) {
  if (request.log == nullptr) return {};
  const auto object = datasets::to_object(sku);
  const auto& throws = request.log->throws;
  LoggedLandings out(throws.size());
  dynamics::parallel_for(throws.size(), request.threads, [&](std::size_t i) {
    const auto motion = motion_of(experiment::with_object(*request.log, throws[i], request.log_file, object),
                                  sku, card, file, request);
    try {
      const auto at = motion.predict(motion.inputs.values);
      if (at.landed() && motion.held(motion.inputs.values))
        out[i] = {at.landing.pose.x, at.landing.pose.theta};
    } catch (const std::invalid_argument&) {  // out of range with this object: no such throw
    }
  });
  return out;
}

std::vector<SkuMotion> motions_of(const datasets::Sku& sku, const datasets::ModelCard& card,
                                  const std::string& file, const SkuRequest& request,
                                  const LoggedLandings& landings) {
  const auto object = datasets::to_object(sku);
  if (request.log == nullptr)
    return {motion_of(experiment::reference_throw(sku.name, object), sku, card, file, request)};
  std::vector<SkuMotion> out;
  std::vector<std::string> seen;
  const auto& throws = request.log->throws;
  for (std::size_t i = 0; i < throws.size(); ++i) {
    if (request.condition && throws[i].condition != *request.condition) continue;
    const std::string motion = repeated_motion(throws[i]);
    if (std::find(seen.begin(), seen.end(), motion) != seen.end()) continue;
    seen.push_back(motion);
    const auto& one = throws[middle_repetition(throws, i, landings, request.tolerance)];
    out.push_back(motion_of(experiment::with_object(*request.log, one, request.log_file, object), sku, card,
                            file, request));
    out.back().repeats = motion;
  }
  if (out.empty())
    throw std::invalid_argument(
        request.condition
            ? fmt::format("validate_sku: {} has no condition '{}'", request.log_file, *request.condition)
            : fmt::format("validate_sku: {} holds no throws", request.log_file));
  return out;
}

ThrowCandidate candidate_of(const SkuMotion& motion) {
  ThrowCandidate out;
  out.condition = motion.prepared.condition;
  out.repeats = motion.repeats;
  const auto nominal = motion.predict(motion.inputs.values);
  out.held = motion.held(motion.inputs.values);
  out.landed = nominal.landed();
  if (!out.landed) return out;
  out.landing_x = nominal.landing.pose.x;
  out.landing_theta = nominal.landing.pose.theta;
  const auto J = motion.slopes();
  out.landed = J.has_value();
  if (!J) return out;
  const MatrixXd C = congruent(*J, motion.inputs.covariance);
  out.linear = {std::sqrt(C(0, 0)), std::sqrt(C(1, 1)), 0, 0};
  return out;
}

std::optional<double> needed_grip(const SkuMotion& motion) {
  const auto at = std::find(motion.inputs.names.begin(), motion.inputs.names.end(), "grip_force");
  if (at == motion.inputs.names.end() || motion.prepared.normal_force) return {};
  auto values = motion.inputs.values;
  double& force = values[static_cast<std::size_t>(at - motion.inputs.names.begin())];
  double low = force, high = 1000;
  force = high;
  if (!motion.held(values)) return {};
  while (high - low > 1e-3 * high) {
    force = 0.5 * (low + high);
    (motion.held(values) ? high : low) = force;
  }
  return high;
}

}  // namespace unhand::fitting
