// Footprints: what every effect would do to every channel, with all that is fitted anyway projected out.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "experiment/campaign_effects.hpp"
#include "fitting/fit.hpp"

namespace unhand::fitting {

using experiment::without_object;

/// The candidate "contact.law:MODEL" is another contact law in place of the model's.
inline constexpr std::string_view kLaw = "contact.law:";
/// Whether a candidate is one.
inline bool is_law(const std::string& id) { return id.starts_with(kLaw); }

/// A candidate for what a model lacks. `columns` index the Gram matrix: derivatives, or for one-sided effects
/// and contact laws differences per unit.
struct Candidate {
  std::string id;                       ///< of the effect, or "contact.law:MODEL"
  std::vector<std::string> parameters;  ///< one per column
  std::vector<std::size_t> columns;     ///< of the Gram matrix
  std::map<std::string, double> shape;  ///< the shape parameters' values that this candidate was taken at
  /// Per column, on which side of neutral the parameter may be: 1 above, −1 below, 0 either. A law may only
  /// be gone towards.
  std::vector<int> sides;
};

/// For Candidate::sides, from a parameter's accepted range.
inline int side_of(double neutral, double low, double high) {
  return low >= neutral ? 1 : high <= neutral ? -1 : 0;
}

/// Inner products, over all throws used, of whitened columns: the model's unknowns, the candidates', and last
/// the residual. The throws' own unknowns are projected out of all of them, with their priors.
struct Footprints {
  std::vector<Candidate> candidates;  ///< in no order of merit
  std::size_t fitted{};               ///< the first columns: the unknowns of the model
  Eigen::MatrixXd gram;               ///< inner products [-]
  double samples{};                   ///< that the inner products run over
  /// The column of the residual.
  std::size_t residual() const { return static_cast<std::size_t>(gram.rows()) - 1; }
};

/// The candidates' ids of which no channel shows anything: a wind where no drag is declared. In the order of
/// the candidates.
std::vector<std::string> silent_ids(const Footprints& footprints);

/// At a fit of `problem`. Candidates: every effect of `ids` that the problem does not have, at each value of
/// its shape parameters' grid, and every contact law of `laws`.
Footprints footprints(const CampaignProblem& problem, const FitResult& fit,
                      const std::vector<std::string>& ids, const std::vector<std::string>& laws, int threads);

/// What an effect would take off χ², to first order, with parameters of sizes that there may be.
struct Score {
  std::size_t candidate{};   ///< its place among the candidates
  double gain{};             ///< the χ² that it would take away, to first order
  std::vector<double> step;  ///< its parameters' values at that gain, from neutral
  bool visible{true};        ///< false: no footprint is left once the fitted unknowns are projected out
};
/// One per candidate, in their order.
std::vector<Score> scores(const Footprints& footprints);

/// Coefficients of the columns (the residual's is zero) that make up what is left of a candidate, at a
/// score's sizes, when the fitted unknowns have made up for what they can.
Eigen::VectorXd left_of(const Footprints& footprints, const Score& score);

/// What an effect of the fitted model does: how far its size parameters are from neutral, per unknown of the
/// campaign; zero for all others.
Eigen::VectorXd contribution_of(const FitResult& fit, const dynamics::Effect& effect);

/// Cosine, at most 1, between what `contribution` (coefficients of the fitted columns; the others are
/// projected out) does and the nearest that a candidate can do.
double correlation(const Footprints& footprints, const Eigen::VectorXd& contribution,
                   const Candidate& candidate);

/// The same between two candidates, the first with its parameters at `step` from neutral.
double between(const Footprints& footprints, const Candidate& a, const std::vector<double>& step,
               const Candidate& b);

/// The values of a fit's campaign unknowns where `to` has them too, and its starts for the rest.
std::vector<double> carried(const FitResult& from, const CampaignProblem& to);

}  // namespace unhand::fitting
