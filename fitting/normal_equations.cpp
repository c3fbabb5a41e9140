#include "fitting/normal_equations.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "experiment/parallel.hpp"

namespace unhand::fitting {

void weigh(Linearisation& l, const experiment::Observations& observed, const CampaignThrow& thrown,
           const Weighting& weighting) {
  for (Eigen::Index i = 0; i < l.residual.size(); ++i) {
    const auto& o = observed.all[static_cast<std::size_t>(i)];
    double slope = weighting.of(phase_of(o, thrown.opening, thrown.release_or(l.detach)), o.channel);
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

NormalEquations normal_equations(const CampaignProblem& problem, const std::vector<std::size_t>& used,
                                 const std::vector<double>& campaign,
                                 const std::vector<std::vector<double>>& own,
                                 const std::vector<double>& own_sigma, const Weighting& weighting,
                                 int threads) {
  NormalEquations out;
  const auto width = static_cast<Eigen::Index>(campaign.size());
  out.information.setZero(width, width);
  out.throws.resize(used.size());
  std::vector<Eigen::MatrixXd> parts(used.size());
  experiment::parallel_for(used.size(), threads, [&](std::size_t i) {
    const CampaignThrow& thrown = problem.throws()[used[i]];
    const std::vector<double>& values = own[i];
    Linearisation l = problem.linearise(thrown, campaign, values, true);
    ThrowEquations& part = out.throws[i];
    part.modes = l.modes;
    part.detach = l.detach;
    part.gradient.setZero(width);
    part.own_variance.setZero(static_cast<Eigen::Index>(values.size()));
    parts[i].setZero(width, width);
    if (!l.solved) {
      part.weight = 0;
      part.residual.setZero(static_cast<Eigen::Index>(thrown.observed.all.size()));
      return;
    }
    part.residual = l.residual;
    weigh(l, thrown.observed, thrown, weighting);
    part.chi2 = l.residual.squaredNorm();
    part.weight = part.chi2 > weighting.throw_limit ? std::sqrt(weighting.throw_limit / part.chi2) : 1.0;
    Eigen::MatrixXd Hoo = l.own.transpose() * l.own;
    Eigen::VectorXd go = l.own.transpose() * l.residual;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double precision = 1 / (own_sigma[k] * own_sigma[k]);
      Hoo(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) += precision;
      go[static_cast<Eigen::Index>(k)] += precision * values[k];
    }
    const Eigen::MatrixXd Hco = l.campaign.transpose() * l.own;
    const Eigen::LDLT<Eigen::MatrixXd> solver(Hoo);
    parts[i] = part.weight * (l.campaign.transpose() * l.campaign - Hco * solver.solve(Hco.transpose()));
    part.gradient = part.weight * (l.campaign.transpose() * l.residual - Hco * solver.solve(go));
    part.own_variance = solver.solve(Eigen::MatrixXd::Identity(Hoo.rows(), Hoo.cols())).diagonal();
  });
  for (const auto& part : parts) out.information += part;  // in the throws' order, whatever the threads did
  return out;
}

Eigen::MatrixXd scatter_covariance(const NormalEquations& equations, const Eigen::MatrixXd& prior) {
  const Eigen::Index width = equations.information.rows();
  // In units in which the diagonal is one: parameters differ by orders of magnitude.
  Eigen::MatrixXd H = equations.information + prior;
  Eigen::VectorXd unit = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  H = unit.asDiagonal() * H * unit.asDiagonal();
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(width, width);
  double n = 0;
  for (const auto& part : equations.throws) {
    if (!(part.weight > 0)) continue;
    const Eigen::VectorXd g = unit.asDiagonal() * part.gradient;
    G += g * g.transpose();
    n += 1;
  }
  const double correction = n > static_cast<double>(width) + 1 ? n / (n - static_cast<double>(width)) : 2.0;
  G *= correction;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(H);
  const double floor = 1e-12 * std::max(1e-300, eigen.eigenvalues().maxCoeff());
  const Eigen::VectorXd root = eigen.eigenvalues().cwiseMax(floor).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd whiten = eigen.eigenvectors() * root.asDiagonal();  // whitenᵀ H whiten = 1
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> scatter(whiten.transpose() * G * whiten);
  const Eigen::MatrixXd inflate = whiten * scatter.eigenvectors();
  const Eigen::MatrixXd covariance =
      inflate * scatter.eigenvalues().cwiseMax(1.0).asDiagonal() * inflate.transpose();
  return unit.asDiagonal() * covariance * unit.asDiagonal();
}

Eigen::MatrixXd guarded_inverse(const Eigen::MatrixXd& information, const std::vector<double>& scale) {
  const Eigen::Index n = information.rows();
  Eigen::VectorXd s(n);
  for (Eigen::Index i = 0; i < n; ++i) s[i] = scale[static_cast<std::size_t>(i)];
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(s.asDiagonal() * information * s.asDiagonal());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const double none = 1e-14 * std::max(1e-300, eigen.eigenvalues().cwiseAbs().maxCoeff());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::VectorXd v = s.asDiagonal() * eigen.eigenvectors().col(k);
    if (eigen.eigenvalues()[k] > none) {
      out += v * v.transpose() / eigen.eigenvalues()[k];
      continue;
    }
    for (Eigen::Index i = 0; i < n; ++i)
      if (std::abs(eigen.eigenvectors()(i, k)) > 1e-3) out(i, i) = HUGE_VAL;
  }
  return out;
}

}  // namespace unhand::fitting
