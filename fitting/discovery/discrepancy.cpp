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
#include "fitting/distributions.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::eliminated, dynamics::gram, dynamics::pseudo_inverse;
using experiment::Channel;

namespace {

enum Block { kWrench, kHeld, kFlight, kLanding, kBlocks };

Block block_of(Channel channel, Phase phase) {
  if (phase == Phase::landing) return kLanding;
  if (phase == Phase::flight) return kFlight;
  return channel == Channel::mocap_x || channel == Channel::mocap_z || channel == Channel::mocap_theta
             ? kHeld
             : kWrench;
}

/// Information and, in the last column, gradient of the campaign's unknowns.
using Equations = Eigen::MatrixXd;

Equations no_equations(Eigen::Index width) { return Equations::Zero(width + 1, width + 1); }

/// The covariance that equations leave, and the step that they ask for.
struct Answer {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd step;
  explicit Answer(const Equations& e) {
    const Eigen::Index width = e.cols() - 1;
    covariance = pseudo_inverse(e.topLeftCorner(width, width));
    step = covariance * e.col(width).head(width);
  }
};

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

}  // namespace

void count_discrepancy(const CampaignProblem& problem, FitResult& fit, int threads) {
  const auto campaign = fit.values();
  const auto width = static_cast<Eigen::Index>(campaign.size());
  Weighting weighting;
  std::copy(fit.group_weight.begin(), fit.group_weight.end(), weighting.group.begin());
  std::vector<ThrowShare> shares(fit.throws.size());
  dynamics::parallel_for(fit.throws.size(), threads, [&](std::size_t i) {
    if (fit.throws[i].used) shares[i] = share_of(problem, i, fit, campaign, weighting);
  });
  Equations all = no_equations(width);
  for (Eigen::Index k = 0; k < width; ++k) {
    const Unknown& u = fit.campaign[static_cast<std::size_t>(k)].unknown;
    if (!(fit.campaign[static_cast<std::size_t>(k)].sigma > 1e-9 * u.scale))
      all(k, k) = 1e30 / (u.scale * u.scale);  // held
    if (!u.prior_sigma) continue;
    all(k, k) += 1 / (*u.prior_sigma * *u.prior_sigma);
    all(k, width) = (campaign[static_cast<std::size_t>(k)] - u.start) / (*u.prior_sigma * *u.prior_sigma);
  }
  std::array<Equations, kBlocks> without{all, all, all, all};
  std::map<std::string, Equations> conditions;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (!fit.throws[i].used) continue;
    all += shares[i].whole;
    for (std::size_t b = 0; b < kBlocks; ++b) without[b] += shares[i].without[b];
    const auto& prepared = problem.throws()[i].prepared;
    const auto [at, first] = conditions.try_emplace(prepared.experiment(), shares[i].whole);
    if (!first) at->second += shares[i].whole;
  }
  const Answer whole(all);  // its step: what the solver has not gone yet
  const Eigen::VectorXd noise = whole.covariance.diagonal();

  Eigen::VectorXd variance = noise;
  std::vector<bool> allows_for_few(static_cast<std::size_t>(width), false);
  const auto count = static_cast<double>(conditions.size());
  if (count >= 3) {
    Eigen::VectorXd jackknife = Eigen::VectorXd::Zero(width);
    for (const auto& [name, of] : conditions) jackknife += (Answer(all - of).step - whole.step).cwiseAbs2();
    const double t = student_factor(count - 1) / kNormal95;
    jackknife *= (count - 1) / count * t * t;
    for (Eigen::Index k = 0; k < width; ++k)
      if (jackknife[k] > variance[k])
        variance[k] = jackknife[k], allows_for_few[static_cast<std::size_t>(k)] = true;
  }
  Eigen::VectorXd excess = Eigen::VectorXd::Zero(width);
  for (const Equations& rest : without) {
    const Answer of(rest);
    for (Eigen::Index k = 0; k < width; ++k) {
      const double inflated = variance[k] / std::max(noise[k], 1e-300), step = of.step[k] - whole.step[k];
      const double expected = std::max(0.0, of.covariance(k, k) - noise[k]) * inflated;
      // Ten times as uncertain without the block: the rest has no say of its own.
      if (!(rest(k, k) > 0) || of.covariance(k, k) > 100 * noise[k]) continue;
      excess[k] = std::max(excess[k], step * step - expected);
    }
  }
  variance += excess;

  std::vector<double> factor(static_cast<std::size_t>(width), 1.0);
  for (Eigen::Index k = 0; k < width; ++k) {
    auto& u = fit.campaign[static_cast<std::size_t>(k)];
    if (!(u.sigma > 0) || !(variance[k] > u.sigma * u.sigma)) continue;
    factor[static_cast<std::size_t>(k)] = std::sqrt(variance[k]) / u.sigma;
    u.sigma = std::sqrt(variance[k]);
    u.allows_for_few = allows_for_few[static_cast<std::size_t>(k)];
  }
  for (std::size_t j = 0; j < factor.size(); ++j)
    for (std::size_t k = 0; k < factor.size(); ++k)
      fit.covariance[j * factor.size() + k] *= factor[j] * factor[k];
}

}  // namespace unhand::fitting
