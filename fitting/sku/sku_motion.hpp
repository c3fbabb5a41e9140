// An object of an SKU file in a throwing motion. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "experiment/throw_prediction.hpp"
#include "fitting/sku/sku_inputs.hpp"
#include "fitting/sku/sku_validation.hpp"

namespace unhand::fitting {

/// A motion with the object in the hand, and what is uncertain about it.
struct SkuMotion {
  experiment::PreparedThrow prepared;
  ThrowInputs inputs;
  std::string repeats{};  ///< repeated_motion() of the log's throw; empty without a log

  experiment::ThrowPrediction<double> predict(const std::vector<double>& values) const;
  bool held(const std::vector<double>& values) const;
  /// ∂(landing x, θ)/∂(inputs), or nothing where the throw has no landing.
  std::optional<Eigen::MatrixXd> slopes() const;
};

/// Where each throw of the request's log, with its own hand and force, would bring this object down [m, rad];
/// nothing where the grip does not hold it or it never lands. Empty without a log.
using LoggedLandings = std::vector<std::optional<Eigen::Vector2d>>;
LoggedLandings logged_landings(const datasets::Sku& sku, const datasets::ModelCard& card,
                               const std::string& card_file, const SkuRequest& request);

/// The throws that repeat one motion.
std::string repeated_motion(const datasets::Throw& one);

/// The motions to try: of each condition of the request's log the repetition that lands nearest to their
/// mean, distances in units of the tolerance; or the reference throw. Throws std::invalid_argument where
/// there is none.
std::vector<SkuMotion> motions_of(const datasets::Sku& sku, const datasets::ModelCard& card,
                                  const std::string& card_file, const SkuRequest& request,
                                  const LoggedLandings& landings);

/// The nominal throw, and the landing's scatter to first order.
ThrowCandidate candidate_of(const SkuMotion& motion);

/// The least grip force of a profile that holds the object; nothing if a thousand newton do not.
std::optional<double> needed_grip(const SkuMotion& motion);

}  // namespace unhand::fitting
