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

/// Fewer conditions than these, by what they say of an unknown, cannot say how far they agree on it.
constexpr double kFewestConditions = 2.5;
/// By how many σ a block has to differ [-].
constexpr double kFar = 1.5;

/// What leaving out each condition does to every unknown.
struct Jackknife {
  Eigen::VectorXd conditions;  ///< that speak of it: (Σ h)²/Σ h² by their shares h of what is known
  Eigen::VectorXd excess;      ///< Σ δ², less what noise alone makes of it
};

Jackknife jackknife(const std::map<std::string, Equations>& conditions, const Equations& all,
                    const Answer& whole) {
  const Eigen::VectorXd noise = whole.covariance.diagonal();
  const Eigen::Index width = noise.size();
  Jackknife out{Eigen::VectorXd::Zero(width), Eigen::VectorXd::Zero(width)};
  Eigen::VectorXd shares = out.excess, squares = out.excess;
  for (const auto& [name, of] : conditions) {
    const Answer rest(all - of);
    for (Eigen::Index k = 0; k < width; ++k) {
      const double without = rest.covariance(k, k), step = rest.step[k] - whole.step[k];
      constexpr double kAlone = 1e4;  // what is hardly known without it is its own
      const bool alone = !(without > noise[k] * (1 - 1e-9)) || without > kAlone * noise[k];
      const double share = alone ? 1 : std::clamp(1 - noise[k] / without, 0.0, 1.0);
      shares[k] += share, squares[k] += share * share;
      if (!alone) out.excess[k] += step * step - (without - noise[k]);
    }
  }
  for (Eigen::Index k = 0; k < width; ++k)
    if (squares[k] > 0) out.conditions[k] = shares[k] * shares[k] / squares[k];
  return out;
}

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
  const auto count = static_cast<double>(conditions.size());
  if (count >= 3) {
    const Jackknife by = jackknife(conditions, all, whole);
    for (Eigen::Index k = 0; k < width; ++k) {
      if (!(by.conditions[k] >= kFewestConditions)) continue;  // few that speak of it cannot disagree
      const double t = student_factor(by.conditions[k] - 1) / kNormal95,
                   spread = (by.conditions[k] - 1) / by.conditions[k] * t * t * by.excess[k];
      variance[k] += std::max(0.0, spread);
    }
    lend(problem, by.conditions, noise, variance);
  }
  Eigen::VectorXd excess = Eigen::VectorXd::Zero(width);
  for (const Equations& rest : without) {
    const Answer of(rest);
    for (Eigen::Index k = 0; k < width; ++k) {
      const double inflated = variance[k] / std::max(noise[k], 1e-300), step = of.step[k] - whole.step[k];
      const double expected = std::max(0.0, of.covariance(k, k) - noise[k]) * inflated;
      // Ten times as uncertain without the block: the rest has no say of its own.
      if (!(rest(k, k) > 0) || of.covariance(k, k) > 100 * noise[k]) continue;
      // The largest of four is about one sigma and a half of chance.
      if (step * step > kFar * kFar * expected) excess[k] = std::max(excess[k], step * step - expected);
    }
  }
  variance += excess;

  std::vector<double> factor(static_cast<std::size_t>(width), 1.0);
  for (Eigen::Index k = 0; k < width; ++k) {
    auto& u = fit.campaign[static_cast<std::size_t>(k)];
    if (!(u.sigma > 0) || !(variance[k] > u.sigma * u.sigma)) continue;
    factor[static_cast<std::size_t>(k)] = std::sqrt(variance[k]) / u.sigma;
    u.sigma = std::sqrt(variance[k]);
    // Of declared noise, or widened by t above; but how much sensors disagree is known from few of them.
    u.allows_for_few = excess[k] <= 0.5 * variance[k];
  }
  for (std::size_t j = 0; j < factor.size(); ++j)
    for (std::size_t k = 0; k < factor.size(); ++k)
      fit.covariance[j * factor.size() + k] *= factor[j] * factor[k];
}

}  // namespace unhand::fitting
