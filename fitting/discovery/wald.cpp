#include "fitting/discovery/wald.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "dynamics/dense_solve.hpp"
#include "experiment/campaign_effects.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using dynamics::pseudo_solve;
using experiment::without_object;

namespace {

/// The covariance of some unknowns of a fit where `given` others are what they are.
Eigen::MatrixXd conditional(const Eigen::MatrixXd& all, const std::vector<Eigen::Index>& of,
                            const std::vector<Eigen::Index>& given) {
  Eigen::MatrixXd out = all(of, of);
  const Eigen::MatrixXd among = all(given, given), with = all(given, of);
  for (Eigen::Index k = 0; k < out.cols(); ++k)
    out.col(k) -= with.transpose() * pseudo_solve(among, with.col(k));
  return out;
}

/// How an effect's sizes are tested.
enum class By {
  fitted_shape,  ///< with its shape as it was fitted; the scatter's degrees of freedom
  intervals,     ///< by their own, whatever the shape is
};

/// P-value of Wald's test of an effect's sizes against neutral, for every shape of its grid. `ends`: sizes
/// that are neutral at an end of their range cannot go beyond it.
double absence(const FitResult& fit, const dynamics::Effect& effect, bool ends, By by) {
  const auto width = static_cast<Eigen::Index>(fit.campaign.size());
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> all(fit.covariance.data(), width, width);
  std::vector<Eigen::Index> sizes, shapes;
  std::vector<double> away;
  std::vector<int> at_end;
  double tried = 1;
  for (const auto& p : effect.parameters) {
    if (p.is_shape()) tried *= static_cast<double>(p.grid.size());
    for (Eigen::Index k = 0; k < width; ++k) {
      const FittedUnknown& u = fit.campaign[static_cast<std::size_t>(k)];
      if (without_object(u.unknown.name) != effect.full_name(p)) continue;
      if (p.is_shape()) {
        if (all(k, k) > 0 && by == By::fitted_shape) shapes.push_back(k);  // one that was not fitted has none
        continue;
      }
      sizes.push_back(k);
      away.push_back(u.value - p.neutral);
      at_end.push_back(ends && !(p.neutral > p.low && p.neutral < p.high) ? 1 : 0);
    }
  }
  const Eigen::MatrixXd C = conditional(all, sizes, shapes);
  if (!C.allFinite()) return 1;
  double least = std::numeric_limits<double>::infinity(), each = 1;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const FittedUnknown& u = fit.campaign[static_cast<std::size_t>(sizes[i])];
    const double known = by == By::intervals ? u.interval_freedom() : u.degrees_of_freedom,
                 n = std::max(1.0, known - static_cast<double>(shapes.size()));
    const auto k = static_cast<Eigen::Index>(i);
    least = std::min(least, n);
    if (C(k, k) > 0)
      each = std::min(each, hotelling_bar_tail(away[i] * away[i] / C(k, k), 1 - at_end[i], at_end[i], n));
  }
  if (sizes.size() < 2) return std::min(1.0, tried * each);
  const int bounded = std::accumulate(at_end.begin(), at_end.end(), 0),
            free = static_cast<int>(sizes.size()) - bounded;
  const Eigen::Map<const Eigen::VectorXd> d(away.data(), static_cast<Eigen::Index>(away.size()));
  const double joint = hotelling_bar_tail(d.dot(pseudo_solve(C, d)), free, bounded, least);
  return std::min(1.0, 2 * tried * std::min(joint, static_cast<double>(sizes.size()) * each));
}

}  // namespace

double wald_p_value(const FitResult& fit, const dynamics::Effect& effect) {
  return absence(fit, effect, true, By::fitted_shape);
}

bool is_told_from_none(const FitResult& fit, const dynamics::Effect& effect, double level) {
  return absence(fit, effect, false, By::fitted_shape) <= level ||
         absence(fit, effect, false, By::intervals) <= level;
}

}  // namespace unhand::fitting
