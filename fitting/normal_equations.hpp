// The Gauss-Newton matrix of a campaign with the throws' own unknowns eliminated. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/campaign_problem.hpp"

namespace unhand::fitting {

/// Huber's loss on every sample: beyond `limit` σ a residual counts as sqrt(2 limit |r| − limit²), with its
/// derivatives.
void robustify(Linearisation& l, double limit);

/// One throw's part.
struct ThrowEquations {
  double chi2{};                ///< Σ r², robust
  double weight{1};             ///< Huber's, of the whole throw
  double detach{};              ///< [s], predicted
  Eigen::VectorXd residual;     ///< not robust
  Eigen::VectorXd own_variance; ///< of the throw's own unknowns, given the campaign's
  Eigen::VectorXd gradient;     ///< for the campaign's unknowns, own eliminated
  std::vector<int> modes;
};

struct NormalEquations {
  Eigen::MatrixXd information;  ///< Σ weight (JᶜᵀJᶜ − JᶜᵀJᵒ(JᵒᵀJᵒ + Λ)⁻¹JᵒᵀJᶜ), SI units
  std::vector<ThrowEquations> throws;
};

/// At the campaign's values and the throws' own (in units of own_scale), for the throws listed in `used`.
NormalEquations normal_equations(const CampaignProblem& problem, const std::vector<std::size_t>& used,
                                 const std::vector<double>& campaign, const std::vector<std::vector<double>>& own,
                                 const std::vector<double>& own_scale, const std::vector<double>& own_sigma,
                                 double sample_limit, double throw_limit, int threads);

/// H⁻¹ G H⁻¹ from the scatter of the throws' gradients, nowhere below H⁻¹; H = information + prior.
Eigen::MatrixXd scatter_covariance(const NormalEquations& equations, const Eigen::MatrixXd& prior);

/// The inverse in units of `scale`, with +infinity on the diagonal of what is not determined.
Eigen::MatrixXd guarded_inverse(const Eigen::MatrixXd& information, const std::vector<double>& scale);

}  // namespace unhand::fitting
