#include "fitting/gradient_cost.hpp"

#include <algorithm>
#include <ctime>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::fitting {

namespace {

/// Adds the time that `work` takes.
template <class Work>
auto timed(double& seconds, Work&& work) {
  const std::clock_t begin = std::clock();
  auto out = work();
  seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return out;
}

}  // namespace

GradientCost gradient_cost(const CampaignProblem& problem, const FitResult& fit) {
  GradientCost out;
  const auto campaign = fit.values();
  const auto width = campaign.size();
  std::vector<double> deviations;
  for (std::size_t i = 0; i < fit.throws.size(); ++i) {
    if (!fit.throws[i].used) continue;
    const CampaignThrow& thrown = problem.throws()[i];
    const auto& own = fit.throws[i].own;
    out.unknowns = static_cast<int>(width + own.size());
    timed(out.plain, [&] { return problem.linearise(thrown, campaign, own, DerivativesBy::nothing); });
    const auto exact =
        timed(out.exact, [&] { return problem.linearise(thrown, campaign, own, DerivativesBy::all); });
    for (std::size_t k = 0; k < width + own.size(); ++k) {
      auto c = campaign;
      auto o = own;
      double& x = k < width ? c[k] : o[k - width];
      const Unknown& u = k < width ? problem.campaign()[k] : problem.own()[k - width];
      // At a bound the difference has one side.
      const double step = 1e-3 * u.scale, low = std::max(x - step, u.low), high = std::min(x + step, u.high);
      x = high;
      const auto above =
          timed(out.central, [&] { return problem.linearise(thrown, c, o, DerivativesBy::nothing); });
      x = low;
      const auto below =
          timed(out.central, [&] { return problem.linearise(thrown, c, o, DerivativesBy::nothing); });
      if (!exact.solved || !above.solved || !below.solved) continue;
      const Eigen::VectorXd slope = k < width ? exact.campaign.col(static_cast<Eigen::Index>(k))
                                              : exact.own.col(static_cast<Eigen::Index>(k - width));
      const double size = slope.cwiseAbs().maxCoeff();
      if (size > 0)
        deviations.push_back(
            ((above.residual - below.residual) / (high - low) - slope).cwiseAbs().maxCoeff() / size);
    }
  }
  if (!deviations.empty()) out.deviation = dynamics::median(deviations);
  return out;
}

}  // namespace unhand::fitting
