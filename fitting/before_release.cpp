#include "fitting/before_release.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

BeforeRelease before_release(const CampaignProblem& problem, const CampaignThrow& thrown,
                             const FitResult& fit) {
  const auto n = static_cast<Eigen::Index>(problem.own().size());
  const auto campaign = fit.values();
  Eigen::VectorXd precision(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double spread = fit.own_spread[static_cast<std::size_t>(k)];
    precision[k] = 1 / (spread * spread);
  }
  const Eigen::MatrixXd prior = precision.cwiseInverse().asDiagonal();
  BeforeRelease out{std::vector<double>(problem.own().size(), 0.0), prior,
                    Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(campaign.size()))};
  experiment::Observations held;
  for (const auto& o : thrown.observed.all)
    if (phase_of(o, thrown.opening, HUGE_VAL) == Phase::grasped) held.all.push_back(o);
  if (held.all.empty()) return out;
  const BeforeRelease unknown = out;
  constexpr int kSteps = 4;
  for (int step = 0; step < kSteps; ++step) {
    auto l = problem.linearise(thrown.prepared, held, campaign, out.own, true);
    if (!l.solved) return unknown;
    weigh(l, held, thrown, Weighting{});
    Eigen::MatrixXd H = l.own.transpose() * l.own;
    H.diagonal() += precision;
    const Eigen::LDLT<Eigen::MatrixXd> solver(H);
    out.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
    out.response = -solver.solve(l.own.transpose() * l.campaign);
    const Eigen::Map<const Eigen::VectorXd> own(out.own.data(), n);
    const Eigen::VectorXd d = -solver.solve(l.own.transpose() * l.residual + precision.cwiseProduct(own));
    if (!d.allFinite()) return unknown;
    double change = 0;
    for (Eigen::Index k = 0; k < n; ++k)
      change = std::max(change, std::abs(d[k]) / problem.own()[static_cast<std::size_t>(k)].scale);
    if (change < 1e-3 || step + 1 == kSteps) break;
    for (std::size_t k = 0; k < out.own.size(); ++k)
      out.own[k] = std::clamp(out.own[k] + d[static_cast<Eigen::Index>(k)], problem.own()[k].low,
                              problem.own()[k].high);
  }
  return out;
}

}  // namespace unhand::fitting
