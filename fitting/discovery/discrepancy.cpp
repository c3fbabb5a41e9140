#include "fitting/discovery/discrepancy.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/campaign_effects.hpp"
#include "fitting/discovery/jackknife.hpp"
#include "fitting/distributions.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::eliminated, dynamics::gram;
using experiment::Channel;

namespace {

enum Block { kWrench, kHeld, kFlight, kLanding, kBlocks };

Block block_of(Channel channel, Phase phase) {
  if (phase == Phase::landing) return kLanding;
  if (phase == Phase::flight) return kFlight;
  return is_tracked(channel) ? kHeld : kWrench;
}

/// One throw: all of its samples, and without each block; its own unknowns eliminated.
struct ThrowShare {
  Equations whole;
  std::array<Equations, kBlocks> without;
};

ThrowShare share_of(const CampaignProblem& problem, std::size_t index, const FitResult& fit,
                    const std::vector<double>& campaign, const Weighting& weighting) {
  const CampaignThrow& thrown = problem.throws()[index];
  const ThrowFit& fitted = fit.throws[index];
  const auto n = static_cast<Eigen::Index>(fitted.own.size());
  const Equations none = no_equations(static_cast<Eigen::Index>(campaign.size()));
  ThrowShare out{none, {none, none, none, none}};
  Linearisation l = problem.linearise(thrown, campaign, fitted.own, DerivativesBy::all);
  if (!l.solved) return out;
  weigh(l, thrown.observed, thrown, weighting);
  const Eigen::MatrixXd columns = campaign_columns(l);
  const Eigen::MatrixXd all = throw_gram(l.own, columns, fitted.own, fit.own_spread);
  std::array<std::vector<Eigen::Index>, kBlocks> rows;
  for (Eigen::Index i = 0; i < l.residual.size(); ++i) {
    const auto& o = thrown.observed.all[static_cast<std::size_t>(i)];
    rows[block_of(o.channel, phase_of(o, thrown.opening, thrown.release_or(l.detach)))].push_back(i);
  }
  out.whole = fitted.weight * eliminated(all, n);
  for (std::size_t b = 0; b < kBlocks; ++b) {
    Eigen::MatrixXd block(static_cast<Eigen::Index>(rows[b].size()), n + columns.cols());
    block.leftCols(n) = l.own(rows[b], Eigen::all);
    block.rightCols(columns.cols()) = columns(rows[b], Eigen::all);
    out.without[b] = fitted.weight * eliminated(all - gram(block), n);
  }
  return out;
}

/// Fewer conditions than these, by what they say of an unknown, cannot say how far they agree on it.
constexpr double kFewestConditions = 2.5;
/// By how many σ a block has to differ [-]: the largest of four is about that by chance.
constexpr double kFar = 1.5;

/// To the sizes of objects of which too few conditions speak: by as much more than noise as those of the same
/// parameter of other objects.
void lend(const CampaignProblem& problem, const Eigen::VectorXd& conditions, const Eigen::VectorXd& noise,
          Eigen::VectorXd& variance) {
  std::map<std::string, double> inflated;  // by parameter
  const auto parameter = [&](Eigen::Index k) {
    return experiment::without_object(problem.campaign()[static_cast<std::size_t>(k)].name);
  };
  for (Eigen::Index k = 0; k < noise.size(); ++k)
    if (conditions[k] >= kFewestConditions && noise[k] > 0)
      inflated[parameter(k)] = std::max(inflated[parameter(k)], variance[k] / noise[k]);
  for (Eigen::Index k = 0; k < noise.size(); ++k)
    if (!(conditions[k] >= kFewestConditions))
      if (const auto by = inflated.find(parameter(k)); by != inflated.end())
        variance[k] = std::max(variance[k], by->second * noise[k]);
}

/// What all throws say of the campaign's unknowns, together and in parts.
struct Sums {
  Equations all;
  std::array<Equations, kBlocks> without;       ///< a block of channels
  std::map<std::string, Equations> conditions;  ///< each one's part
};

/// What is known of the unknowns without any throw: those that are held, and priors.
Equations prior_equations(const FitResult& fit) {
  const auto campaign = fit.values();
  const auto width = static_cast<Eigen::Index>(campaign.size());
  Equations out = no_equations(width);
  for (Eigen::Index k = 0; k < width; ++k) {
    const auto& fitted = fit.campaign[static_cast<std::size_t>(k)];
    const Unknown& u = fitted.unknown;
    if (!(fitted.sigma > 1e-9 * u.scale)) out(k, k) = 1e30 / (u.scale * u.scale);  // held
    if (!u.prior_sigma) continue;
    out(k, k) += 1 / (*u.prior_sigma * *u.prior_sigma);
    out(k, width) = (campaign[static_cast<std::size_t>(k)] - u.start) / (*u.prior_sigma * *u.prior_sigma);
  }
  return out;
}

Sums sums_of(const CampaignProblem& problem, const FitResult& fit, int threads) {
  const auto campaign = fit.values();
  Weighting weighting;
  std::copy(fit.group_weight.begin(), fit.group_weight.end(), weighting.group.begin());
  std::vector<ThrowShare> shares(fit.throws.size());
  dynamics::parallel_for(fit.throws.size(), threads, [&](std::size_t i) {
    if (fit.throws[i].used) shares[i] = share_of(problem, i, fit, campaign, weighting);
  });
  const Equations prior = prior_equations(fit);
  Sums out{prior, {prior, prior, prior, prior}, {}};
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (!fit.throws[i].used) continue;
    out.all += shares[i].whole;
    for (std::size_t b = 0; b < kBlocks; ++b) out.without[b] += shares[i].without[b];
    const auto& prepared = problem.throws()[i].prepared;
    const auto [at, first] = out.conditions.try_emplace(prepared.experiment(), shares[i].whole);
    if (!first) at->second += shares[i].whole;
  }
  return out;
}

/// Noise, and how far the conditions disagree beyond it.
Eigen::VectorXd between_conditions(const CampaignProblem& problem, const Sums& sums,
                                   const LinearAnswer& whole) {
  const Eigen::VectorXd noise = whole.covariance.diagonal();
  Eigen::VectorXd out = noise;
  if (sums.conditions.size() < 3) return out;
  const Jackknife by = jackknife(sums.conditions, sums.all, whole);
  for (Eigen::Index k = 0; k < out.size(); ++k) {
    const double n = by.groups[k];
    if (!(n >= kFewestConditions)) continue;  // few that speak of it cannot disagree
    const double t = student_factor(n - 1) / kNormal95;
    out[k] += std::max(0.0, (n - 1) / n * t * t * by.excess[k]);
  }
  lend(problem, by.groups, noise, out);
  return out;
}

/// How far a block of sensors disagrees with the rest beyond `variance`, of which `whole` has the noise.
Eigen::VectorXd between_blocks(const Sums& sums, const LinearAnswer& whole, const Eigen::VectorXd& variance) {
  const Eigen::VectorXd noise = whole.covariance.diagonal();
  Eigen::VectorXd out = Eigen::VectorXd::Zero(noise.size());
  for (const Equations& rest : sums.without) {
    const LinearAnswer of(rest);
    for (Eigen::Index k = 0; k < noise.size(); ++k) {
      const double inflated = variance[k] / std::max(noise[k], 1e-300), step = of.step[k] - whole.step[k];
      const double expected = std::max(0.0, of.covariance(k, k) - noise[k]) * inflated;
      // Ten times as uncertain without the block: the rest has no say of its own.
      if (!(rest(k, k) > 0) || of.covariance(k, k) > 100 * noise[k]) continue;
      if (step * step > kFar * kFar * expected) out[k] = std::max(out[k], step * step - expected);
    }
  }
  return out;
}

/// Widens the unknowns' sigmas to these variances, of which `blocks` is the part of sensors that disagree.
void widen(FitResult& fit, const Eigen::VectorXd& variance, const Eigen::VectorXd& blocks) {
  std::vector<double> factor(fit.campaign.size(), 1.0);
  for (Eigen::Index k = 0; k < variance.size(); ++k) {
    auto& u = fit.campaign[static_cast<std::size_t>(k)];
    if (!(u.sigma > 0) || !(variance[k] > u.sigma * u.sigma)) continue;
    factor[static_cast<std::size_t>(k)] = std::sqrt(variance[k]) / u.sigma;
    u.sigma = std::sqrt(variance[k]);
    // Of declared noise, or widened by t above; but how much sensors disagree is known from few of them.
    u.allows_for_few = blocks[k] <= 0.5 * variance[k];
  }
  for (std::size_t j = 0; j < factor.size(); ++j)
    for (std::size_t k = 0; k < factor.size(); ++k)
      fit.covariance[j * factor.size() + k] *= factor[j] * factor[k];
}

}  // namespace

void count_discrepancy(const CampaignProblem& problem, FitResult& fit, int threads) {
  const Sums sums = sums_of(problem, fit, threads);
  const LinearAnswer whole(sums.all);  // its step: what the solver has not gone yet
  const Eigen::VectorXd conditions = between_conditions(problem, sums, whole),
                        blocks = between_blocks(sums, whole, conditions);
  widen(fit, conditions + blocks, blocks);
}

}  // namespace unhand::fitting
