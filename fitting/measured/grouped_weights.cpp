#include "fitting/measured/grouped_weights.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/median.hpp"

namespace unhand::fitting {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Huber: the factor on a residual whose size is `r` in units of `limit`.
double huber(double r) { return r > 1 ? std::sqrt(1 / r) : 1; }

constexpr double kMostCorrelated = 0.98;  // neighbours of a channel: a hundred samples count as one

/// The residuals of a channel in all groups.
struct Channel {
  std::vector<double> sizes;
  double squares{}, products{};  // of neighbours
  /// Robust, at least 1 [σ].
  double scale() const { return std::max(1.0, 1.4826 * dynamics::median(sizes)); }
  /// By how much the variance of the mean exceeds that of independent noise as declared: the scatter squared,
  /// times (1 + ρ)/(1 − ρ) of neighbours that correlate by ρ.
  double inflation() const {
    const double rho = squares > 0 ? std::clamp(products / squares, 0.0, kMostCorrelated) : 0;
    return scale() * scale() * (1 + rho) / (1 - rho);
  }
};

/// The factor on a row, as a residual.
double factor(double residual, int channel, const GroupedWeights& weights, double limit) {
  if (channel < 0) return weights.prior;
  return huber(std::abs(residual) / (limit * weights.channel_scale[static_cast<std::size_t>(channel)]));
}

}  // namespace

double cost_of(const VectorXd& residual, const Group& group, const GroupedWeights& weights, double limit) {
  double out = 0;
  for (Index i = 0; i < residual.size(); ++i) {
    const int c = group.rows[static_cast<std::size_t>(i)].channel;
    if (c < 0) {
      out += std::pow(weights.prior * residual[i], 2);
      continue;
    }
    const double scale = weights.channel_scale[static_cast<std::size_t>(c)],
                 r = std::abs(residual[i]) / scale;
    out += (r <= limit ? r * r : 2 * limit * r - limit * limit) * scale * scale;
  }
  return out;
}

bool is_quadratic(const VectorXd& residual, const Group& group, const GroupedWeights& weights, double limit) {
  for (Index i = 0; i < residual.size(); ++i)
    if (const int c = group.rows[static_cast<std::size_t>(i)].channel; c >= 0)
      if (!(std::abs(residual[i]) <= limit * weights.channel_scale[static_cast<std::size_t>(c)]))
        return false;
  return true;
}

void weigh_rows(GroupEquations& e, const Group& group, const GroupedWeights& weights, double limit) {
  for (Index i = 0; i < e.residual.size(); ++i) {
    const double w = factor(e.residual[i], group.rows[static_cast<std::size_t>(i)].channel, weights, limit);
    if (w == 1) continue;
    e.residual[i] *= w;
    if (e.shared.size() > 0) e.shared.row(i) *= w;
    if (e.own.size() > 0) e.own.row(i) *= w;
  }
}

GroupedWeights neutral_weights(const GroupedProblem& problem) {
  return {std::vector<double>(problem.channels().size(), 1e6),
          std::vector<double>(problem.groups().size(), 1.0), 1};
}

GroupedWeights learned_weights(const GroupedProblem& problem, const GroupedFit& fit,
                               const GroupedFitOptions& options) {
  GroupedWeights out = neutral_weights(problem);
  std::vector<Channel> channels(problem.channels().size());
  std::vector<double> means;
  for (const std::size_t i : fit.solved_groups()) {
    const GroupFit& g = fit.groups[i];
    std::vector<double> before(channels.size());
    for (Index j = 0; j < g.residual.size(); ++j) {
      const int c = problem.groups()[i].rows[static_cast<std::size_t>(j)].channel;
      if (c < 0) continue;
      Channel& channel = channels[static_cast<std::size_t>(c)];
      channel.sizes.push_back(std::abs(g.residual[j]));
      channel.squares += g.residual[j] * g.residual[j];
      channel.products += g.residual[j] * std::exchange(before[static_cast<std::size_t>(c)], g.residual[j]);
    }
    if (g.n > 0) means.push_back(g.chi2 / g.n);
  }
  double inflated = 0, measured = 0;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    out.channel_scale[c] = channels[c].scale();
    const auto n = static_cast<double>(channels[c].sizes.size());
    if (n > 0) inflated += n * channels[c].inflation(), measured += n;
  }
  if (measured > 0) out.prior = std::sqrt(std::max(1.0, inflated / measured));
  const double limit = options.group_limit * std::max(1.0, dynamics::median(means));
  for (std::size_t i = 0; i < fit.groups.size(); ++i)
    if (const GroupFit& g = fit.groups[i]; g.used && g.n > 0 && g.chi2 / g.n > limit)
      out.group[i] = limit / (g.chi2 / g.n);
  return out;
}

}  // namespace unhand::fitting
