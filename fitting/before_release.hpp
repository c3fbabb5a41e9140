// What is known of a throw before it is thrown. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// The throw's own unknowns o from its samples before the gripper opens alone and from the learned spread:
/// the least of Σ r² + Σ (o_k/σ_k)² with the campaign's unknowns c as fitted. Nothing of the outcome enters.
struct BeforeRelease {
  std::vector<double> own;     ///< o
  Eigen::MatrixXd covariance;  ///< H⁻¹, H = JᵒᵀJᵒ + Λ
  Eigen::MatrixXd response;    ///< do/dc = −H⁻¹ JᵒᵀJᶜ, of DerivativesBy::all; else zero
};
/// `derivatives`: all or own.
BeforeRelease before_release(const CampaignProblem& problem, const CampaignThrow& thrown,
                             const FitResult& fit, DerivativesBy derivatives);

}  // namespace unhand::fitting
