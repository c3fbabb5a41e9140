#include "fitting/before_release.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "dynamics/dense_solve.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::definite_inverse, dynamics::definite_solve;

BeforeRelease before_release(const CampaignProblem& problem, const CampaignThrow& thrown,
                             const FitResult& fit, DerivativesBy derivatives) {
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
  constexpr int kSteps = 60;  // where samples count linearly (Huber's), steps shrink by a factor only
  for (int step = 0; step < kSteps; ++step) {
    auto l = problem.linearise(thrown.prepared, held, campaign, out.own, derivatives);
    if (!l.solved) return unknown;
    weigh(l, held, thrown, Weighting{});
    const auto width = static_cast<Eigen::Index>(campaign.size());
    const Eigen::MatrixXd G = throw_gram(l.own, campaign_columns(l), out.own, fit.own_spread);
    out.covariance = definite_inverse(G.topLeftCorner(n, n));
    const Eigen::MatrixXd step_of = -definite_solve(G.topLeftCorner(n, n), G.topRightCorner(n, width + 1));
    out.response = step_of.leftCols(width);
    const Eigen::VectorXd d = step_of.col(width);
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
