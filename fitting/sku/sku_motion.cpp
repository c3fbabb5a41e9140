#include "fitting/sku/sku_motion.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"
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

std::vector<SkuMotion> motions_of(const datasets::Sku& sku, const datasets::ModelCard& card,
                                  const std::string& file, const SkuRequest& request) {
  const auto object = datasets::to_object(sku);
  std::vector<SkuMotion> out;
  const auto add = [&](experiment::PreparedThrow prepared) {
    prepared.object = sku.name;
    auto inputs = throw_inputs(sku, card, file, prepared, request.assumed);
    out.push_back({std::move(prepared), std::move(inputs)});
  };
  if (request.log == nullptr) {
    add(experiment::reference_throw(sku.name, object));
    return out;
  }
  std::vector<std::string> seen;
  for (const auto& one : request.log->throws) {
    if (request.condition && one.condition != *request.condition) continue;
    if (std::find(seen.begin(), seen.end(), one.condition) != seen.end()) continue;
    seen.push_back(one.condition);
    add(experiment::with_object(*request.log, one, request.log_file, object));
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
