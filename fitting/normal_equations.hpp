// The Gauss-Newton matrix of a campaign with the throws' own unknowns eliminated. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fitting/fit.hpp"

namespace unhand::fitting {

using experiment::kChannelCount;

/// What a residual counts for.
struct Weighting {
  double sample_limit{5};  ///< Huber's loss on every sample: beyond it a residual counts linearly [σ]
  double throw_limit{};    ///< Huber's loss on the χ² of a throw [-]
  /// Factors on the residuals of a channel in a phase, <= 1: where the model fails, its failure must not bend
  /// the rest.
  std::array<double, kPhaseCount * kChannelCount> group;
  Weighting() { group.fill(1.0); }
  double& of(Phase phase, experiment::Channel channel) {
    return group[static_cast<std::size_t>(static_cast<int>(phase) * kChannelCount +
                                          static_cast<int>(channel))];
  }
  double of(Phase phase, experiment::Channel channel) const {
    return const_cast<Weighting*>(this)->of(phase, channel);
  }
};

/// Weighs samples of a throw, all or some, with their derivatives.
void weigh(Linearisation& l, const experiment::Observations& observed, const CampaignThrow& thrown,
           const Weighting& weighting);

/// One throw's part.
struct ThrowEquations {
  double chi2{};                 ///< Σ r², robust
  double weight{1};              ///< Huber's, of the whole throw
  double detach{};               ///< [s], predicted
  Eigen::VectorXd residual;      ///< not robust
  Eigen::VectorXd own_variance;  ///< of the throw's own unknowns, given the campaign's
  Eigen::VectorXd gradient;      ///< for the campaign's unknowns, own eliminated
  std::vector<int> modes;
};

struct NormalEquations {
  Eigen::MatrixXd information;  ///< Σ weight (JᶜᵀJᶜ − JᶜᵀJᵒ(JᵒᵀJᵒ + Λ)⁻¹JᵒᵀJᶜ), SI units
  std::vector<ThrowEquations> throws;
};

/// At the campaign's values and the throws' own, for the throws listed in `used`; own_sigma their spread.
NormalEquations normal_equations(const CampaignProblem& problem, const std::vector<std::size_t>& used,
                                 const std::vector<double>& campaign,
                                 const std::vector<std::vector<double>>& own,
                                 const std::vector<double>& own_sigma, const Weighting& weighting,
                                 int threads);

/// H⁻¹ G H⁻¹ from the scatter of the throws' gradients, nowhere below H⁻¹; H = information + prior.
Eigen::MatrixXd scatter_covariance(const NormalEquations& equations, const Eigen::MatrixXd& prior);

/// The inverse in units of `scale`, with +infinity on the diagonal of what is not determined.
Eigen::MatrixXd guarded_inverse(const Eigen::MatrixXd& information, const std::vector<double>& scale);

}  // namespace unhand::fitting
