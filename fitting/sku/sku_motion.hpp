// An object of an SKU file in a throwing motion. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "experiment/throw_prediction.hpp"
#include "fitting/sku/sku_inputs.hpp"
#include "fitting/sku/sku_validation.hpp"

namespace unhand::fitting {

/// A motion with the object in the hand, and what is uncertain about it.
struct SkuMotion {
  experiment::PreparedThrow prepared;
  ThrowInputs inputs;

  experiment::ThrowPrediction<double> predict(const std::vector<double>& values) const;
  bool held(const std::vector<double>& values) const;
  /// ∂(landing x, θ)/∂(inputs), or nothing where the throw has no landing.
  std::optional<Eigen::MatrixXd> slopes() const;
};

/// The motions to try: one of each condition of the request's log, or the reference throw. Throws
/// std::invalid_argument where there is none.
std::vector<SkuMotion> motions_of(const datasets::Sku& sku, const datasets::ModelCard& card,
                                  const std::string& card_file, const SkuRequest& request);

/// The nominal throw, and the landing's scatter to first order.
ThrowCandidate candidate_of(const SkuMotion& motion);

/// The least grip force of a profile that holds the object; nothing if a thousand newton do not.
std::optional<double> needed_grip(const SkuMotion& motion);

}  // namespace unhand::fitting
