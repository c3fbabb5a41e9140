// The Gauss-Newton matrix of a campaign with the throws' own unknowns eliminated. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fitting/distributions.hpp"
#include "fitting/fit.hpp"
#include "fitting/scatter_covariance.hpp"

namespace unhand::fitting {

using experiment::kChannelCount;

/// Where a sample weighs: its channel, and its phase; of the release one of four quarters by time, since laws
/// part company as the normal force falls.
inline constexpr int kQuarters = 4, kPartCount = kPhaseCount + kQuarters - 1;
int part_of(const experiment::Observation& observation, const CampaignThrow& thrown, double detach);
Phase phase_of_part(int part);
inline std::size_t group_of(int part, experiment::Channel channel) {
  return static_cast<std::size_t>(part * kChannelCount + static_cast<int>(channel));
}

/// What a residual counts for.
struct Weighting {
  double sample_limit{5};  ///< Huber's loss on every sample: beyond it a residual counts linearly [σ]
  double throw_limit{};    ///< Huber's loss on the χ² of a throw [-]
  /// Factors on the residuals of a group, <= 1: where the model fails, its failure must not bend the rest.
  std::array<double, kPartCount * kChannelCount> group;
  Weighting() { group.fill(1.0); }
};

/// Weighs samples of a throw, all or some, with their derivatives.
void weigh(Linearisation& l, const experiment::Observations& observed, const CampaignThrow& thrown,
           const Weighting& weighting);

/// Inner products of one throw's columns: those of its own unknowns first, whose priors (0, sigma) count as
/// measurements, then `columns`, the last of which is the residual. `own`: the unknowns' values.
Eigen::MatrixXd throw_gram(const Eigen::MatrixXd& own_columns, const Eigen::MatrixXd& columns,
                           const std::vector<double>& own, const std::vector<double>& own_sigma);
/// The columns of a linearisation besides its own unknowns: the campaign's, then the residual.
Eigen::MatrixXd campaign_columns(const Linearisation& l);

/// One throw's part.
struct ThrowEquations {
  double chi2{};                 ///< Σ r², robust
  double weight{1};              ///< Huber's, of the whole throw
  double detach{};               ///< [s], predicted
  Eigen::VectorXd residual;      ///< not robust
  Eigen::VectorXd own_variance;  ///< of the throw's own unknowns, given the campaign's
  Eigen::VectorXd gradient;      ///< for the campaign's unknowns, own eliminated
  Eigen::MatrixXd information;   ///< its part of NormalEquations::information
  std::vector<int> modes;
};

struct NormalEquations {
  Eigen::MatrixXd information;  ///< Σ weight (JᶜᵀJᶜ − JᶜᵀJᵒ(JᵒᵀJᵒ + Λ)⁻¹JᵒᵀJᶜ), SI units
  std::vector<ThrowEquations> throws;
};

/// Of the throws listed in `used`, from their linearisations (not weighted) and the values of their own
/// unknowns there; own_sigma is the spread of these.
NormalEquations normal_equations(const CampaignProblem& problem, const std::vector<std::size_t>& used,
                                 const std::vector<Linearisation>& linearised,
                                 const std::vector<std::vector<double>>& own,
                                 const std::vector<double>& own_sigma, const Weighting& weighting,
                                 int threads);

/// Over its throws.
ScatterCovariance scatter_covariance(const NormalEquations& equations, const Eigen::MatrixXd& prior);
/// Over sets of its throws: `set[i]` is that of throw i. What few sets tell borrows the scatter of the rest
/// (borrowing_scatter). Degrees of freedom ν count for what exceeds the noise: of a variance V = noise + e
/// there are ν (V/e)², but no more than the throws have, from which the noise was learned.
ScatterCovariance scatter_covariance(const NormalEquations& equations, const std::vector<std::string>& set,
                                     const Eigen::MatrixXd& prior);

/// The inverse in units of `scale`, with +infinity on the diagonal of what is not determined.
Eigen::MatrixXd guarded_inverse(const Eigen::MatrixXd& information, const std::vector<double>& scale);

}  // namespace unhand::fitting
