#include "fitting/normal_equations.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"

namespace unhand::fitting {

using dynamics::definite_inverse, dynamics::eliminated, dynamics::gram, dynamics::Spectrum,
    dynamics::spectrum_of;

int part_of(const experiment::Observation& o, const CampaignThrow& thrown, double detach) {
  const double release = thrown.release_or(detach);
  const Phase phase = phase_of(o, thrown.opening, release);
  if (phase < Phase::release) return static_cast<int>(phase);
  if (phase > Phase::release) return static_cast<int>(phase) + kQuarters - 1;
  const double share = (o.time - thrown.opening) / (release - thrown.opening);
  return static_cast<int>(phase) + std::clamp(static_cast<int>(kQuarters * share), 0, kQuarters - 1);
}

Phase phase_of_part(int part) {
  const int release = static_cast<int>(Phase::release);
  return static_cast<Phase>(part <= release ? part : std::max(release, part - kQuarters + 1));
}

void weigh(Linearisation& l, const experiment::Observations& observed, const CampaignThrow& thrown,
           const Weighting& weighting) {
  for (Eigen::Index i = 0; i < l.residual.size(); ++i) {
    const auto& o = observed.all[static_cast<std::size_t>(i)];
    double slope = weighting.group[group_of(part_of(o, thrown, l.detach), o.channel)];
    double r = slope * l.residual[i];
    const double size = std::abs(r), limit = weighting.sample_limit;
    if (size > limit) {
      const double bent = std::sqrt(2 * limit * size - limit * limit);
      slope *= limit / bent;
      r = std::copysign(bent, r);
    }
    l.residual[i] = r;
    if (slope == 1) continue;
    if (l.campaign.rows() > 0) l.campaign.row(i) *= slope;
    if (l.own.rows() > 0) l.own.row(i) *= slope;
  }
}

Eigen::MatrixXd throw_gram(const Eigen::MatrixXd& own_columns, const Eigen::MatrixXd& columns,
                           const std::vector<double>& own, const std::vector<double>& own_sigma) {
  const auto n = static_cast<Eigen::Index>(own.size());
  Eigen::MatrixXd all(columns.rows(), n + columns.cols());
  all.leftCols(n) = own_columns;
  all.rightCols(columns.cols()) = columns;
  Eigen::MatrixXd out = gram(all);
  const Eigen::Index r = out.cols() - 1;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double precision = 1 / (own_sigma[i] * own_sigma[i]);
    out(k, k) += precision;
    out(k, r) += precision * own[i], out(r, k) = out(k, r);
    out(r, r) += precision * own[i] * own[i];
  }
  return out;
}

Eigen::MatrixXd campaign_columns(const Linearisation& l) {
  Eigen::MatrixXd out(l.residual.size(), l.campaign.cols() + 1);
  out.leftCols(l.campaign.cols()) = l.campaign;
  out.rightCols(1) = l.residual;
  return out;
}

NormalEquations normal_equations(const CampaignProblem& problem, const std::vector<std::size_t>& used,
                                 const std::vector<Linearisation>& linearised,
                                 const std::vector<std::vector<double>>& own,
                                 const std::vector<double>& own_sigma, const Weighting& weighting,
                                 int threads) {
  NormalEquations out;
  const auto width = static_cast<Eigen::Index>(problem.campaign().size());
  out.information.setZero(width, width);
  out.throws.resize(used.size());
  dynamics::parallel_for(used.size(), threads, [&](std::size_t i) {
    const CampaignThrow& thrown = problem.throws()[used[i]];
    const std::vector<double>& values = own[i];
    Linearisation l = linearised[i];
    ThrowEquations& part = out.throws[i];
    part.modes = l.modes;
    part.detach = l.detach;
    part.gradient.setZero(width);
    part.own_variance.setZero(static_cast<Eigen::Index>(values.size()));
    part.information.setZero(width, width);
    if (!l.solved) {
      part.weight = 0;
      part.residual.setZero(static_cast<Eigen::Index>(thrown.observed.all.size()));
      return;
    }
    part.residual = l.residual;
    weigh(l, thrown.observed, thrown, weighting);
    part.chi2 = l.residual.squaredNorm();
    double cost = part.chi2;  // with the priors of its own unknowns, as the solver's loss has it
    for (std::size_t k = 0; k < values.size(); ++k) cost += std::pow(values[k] / own_sigma[k], 2);
    part.weight = cost > weighting.throw_limit ? std::sqrt(weighting.throw_limit / cost) : 1.0;
    const auto n = static_cast<Eigen::Index>(values.size());
    const Eigen::MatrixXd all = throw_gram(l.own, campaign_columns(l), values, own_sigma);
    const Eigen::MatrixXd rest = part.weight * eliminated(all, n);
    part.information = rest.topLeftCorner(width, width);
    part.gradient = rest.col(width).head(width);
    part.own_variance = definite_inverse(all.topLeftCorner(n, n)).diagonal();
  });
  for (const auto& part : out.throws)
    out.information += part.information;  // in the throws' order, whatever the threads did
  return out;
}

ScatterCovariance scatter_covariance(const NormalEquations& equations, const Eigen::MatrixXd& prior) {
  std::vector<Cluster> throws;
  for (const ThrowEquations& part : equations.throws)
    if (part.weight > 0) throws.push_back({part.information, part.gradient});
  return scatter_covariance(throws, equations.information, prior);
}

ScatterCovariance scatter_covariance(const NormalEquations& equations, const std::vector<std::string>& set,
                                     const Eigen::MatrixXd& prior) {
  std::map<std::string, Cluster> sets;
  for (std::size_t i = 0; i < equations.throws.size(); ++i) {
    const ThrowEquations& part = equations.throws[i];
    if (!(part.weight > 0)) continue;
    const auto [at, first] = sets.try_emplace(set[i], Cluster{part.information, part.gradient});
    if (first) continue;
    at->second.information += part.information;
    at->second.gradient += part.gradient;
  }
  std::vector<Cluster> clusters;
  for (auto& [name, cluster] : sets) clusters.push_back(std::move(cluster));
  ScatterCovariance out = borrowing_scatter(clusters, equations.information, prior);
  const Eigen::VectorXd most = scatter_covariance(equations, prior).degrees_of_freedom;
  for (Eigen::Index k = 0; k < prior.rows(); ++k) {
    const double variance = out.covariance(k, k), excess = variance - out.noise(k, k);
    double& freedom = out.degrees_of_freedom[k];
    if (!(variance > 0) || !std::isfinite(variance)) continue;  // nothing is known of it
    freedom *= std::pow(variance / std::max(excess, 1e-3 * variance), 2);
    freedom = std::min(freedom, std::max(1.0, most[k]));
  }
  return out;
}

Eigen::MatrixXd guarded_inverse(const Eigen::MatrixXd& information, const std::vector<double>& scale) {
  const Eigen::Index n = information.rows();
  Eigen::VectorXd s(n);
  for (Eigen::Index i = 0; i < n; ++i) s[i] = scale[static_cast<std::size_t>(i)];
  const Spectrum spectrum = spectrum_of(s.asDiagonal() * information * s.asDiagonal());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const double none = 1e-14 * std::max(1e-300, spectrum.values.cwiseAbs().maxCoeff());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::VectorXd v = s.asDiagonal() * spectrum.vectors.col(k);
    if (spectrum.values[k] > none) {
      out += v * v.transpose() / spectrum.values[k];
      continue;
    }
    for (Eigen::Index i = 0; i < n; ++i)
      if (std::abs(spectrum.vectors(i, k)) > 1e-3) out(i, i) = HUGE_VAL;
  }
  return out;
}

}  // namespace unhand::fitting
