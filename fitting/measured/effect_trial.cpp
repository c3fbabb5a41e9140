#include "fitting/measured/effect_trial.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/dense_solve.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using datasets::Split;
using dynamics::pseudo_solve;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double Wald::delta_bic(const GroupedFit& fit) const {
  return static_cast<double>(parameters) * std::log(std::max(2, fit.used)) - statistic;
}

double Wald::p_value(const GroupedFit& fit) const {
  const auto p = static_cast<double>(parameters), n = static_cast<double>(fit.used);
  if (!(n > 2)) return 1;
  const double one = p * each;
  // So few groups say nothing of all parameters together.
  if (!(n > p + 1)) return std::min(1.0, one);
  const double all = hotelling_bar_tail(statistic, static_cast<int>(parameters) - bounded, bounded, n - 1);
  return parameters < 2 ? all : std::min(1.0, 2 * std::min(all, one));
}

Wald wald_of(const VectorXd& away, const MatrixXd& covariance, const VectorXd& freedom,
             const std::vector<int>& sides) {
  Wald out{away.dot(pseudo_solve(covariance, away)), away.size()};
  for (Index j = 0; j < away.size(); ++j) {
    const bool bounded = sides[static_cast<std::size_t>(j)] != 0;
    out.bounded += bounded ? 1 : 0;
    if (covariance(j, j) > 0)
      out.each = std::min(out.each, hotelling_bar_tail(away[j] * away[j] / covariance(j, j), bounded ? 0 : 1,
                                                       bounded ? 1 : 0, freedom[j]));
  }
  return out;
}

Wald wald_of(const GroupedFit& fit, const std::string& id) {
  std::vector<Index> at;
  std::vector<double> away;
  std::vector<int> sides;
  for (std::size_t k = 0; k < fit.shared.size(); ++k)
    if (const SharedParameter& p = fit.shared[k]; p.effect == id && !p.shape) {
      at.push_back(static_cast<Index>(k));
      away.push_back(fit.values[at.back()] - p.neutral);
      sides.push_back(side_of(p.neutral, p.low, p.high));
    }
  const Eigen::Map<const VectorXd> d(away.data(), static_cast<Index>(away.size()));
  return wald_of(d, fit.covariance(at, at), fit.freedom(at), sides);
}

namespace {

constexpr double kCarries = 0.1;    // of the fall, by a channel that is asked for its share
constexpr std::size_t kFewest = 3;  // groups that can say how much they scatter

/// Of one group: its χ² before and after, and, by what the effect changes in its residual r,
/// g = r_before − r_after, g·r_before and g·g; all times the group's weight.
struct Along {
  double was{}, is{}, samples{};
  double residual{}, change{};
};
Along along(const Group& group, const GroupFit& before, const GroupFit& after, double weight) {
  Along out{weight * before.chi2, weight * after.chi2, weight * before.n, 0, 0};
  for (Index j = 0; j < before.residual.size(); ++j) {
    if (group.rows[static_cast<std::size_t>(j)].channel == kPriorChannel) continue;
    const double change = before.residual[j] - after.residual[j];
    out.residual += weight * change * before.residual[j];
    out.change += weight * change * change;
  }
  return out;
}

/// The slope Σ g·r / Σ g·g of groups, and its variance: the jackknife over them.
struct Slope {
  double value{}, change{}, variance{}, groups{};
  bool known{};  ///< the variance
};
Slope slope_of(const std::vector<Along>& groups) {
  Along all;
  for (const Along& g : groups) all.residual += g.residual, all.change += g.change;
  Slope out;
  out.change = all.change, out.groups = static_cast<double>(groups.size());
  if (!(all.change > 0)) return out;
  out.value = all.residual / all.change;
  if (groups.size() < kFewest) return out;
  double mean = 0, square = 0;
  for (const Along& g : groups) {
    const double rest = all.change - g.change;
    if (!(rest > 1e-9 * all.change)) return out;  // one group has all there is to see
    const double without = (all.residual - g.residual) / rest;
    mean += without / out.groups, square += without * without;
  }
  out.variance = (out.groups - 1) / out.groups * std::max(square - out.groups * mean * mean, 0.0);
  out.known = true;
  return out;
}

/// That χ² of groups which no fit has seen falls by chance. The slope is 1 where they show an effect as the
/// train groups do and 0 where there is none, and χ² falls where it exceeds a half. Where only noise is
/// `left` with the effect, nothing but noise can have made it fall, at a slope of 0. Where a misfit is left,
/// what causes that lends some of itself to any name, and the slope has to be more than a half. It scatters
/// by no less than the noise of the samples. Groups that show an effect by different amounts are no doubt of
/// it: a paired test of their χ² would take them for that, of the largest effect as of the smallest. Where
/// fewer than kFewest are held out, the train groups say how much slopes scatter: of less change, or of fewer
/// groups, by as much more.
double p_of_slope(const Slope& held_out, const Slope& train, double left) {
  constexpr double kFalls = 0.5, kNoise = 1.2;
  if (!(held_out.change > 0) || !(held_out.value > kFalls)) return 1;
  const bool few = held_out.groups < kFewest;
  const Slope& scatter = few ? train : held_out;
  if (!scatter.known) return 1;
  const double more = few ? std::max(train.change / held_out.change, train.groups / held_out.groups) : 1;
  const double variance = std::max(more * scatter.variance, 1 / held_out.change),
               beyond = held_out.value - (left < kNoise ? 0 : kFalls);
  return 0.5 * f_tail(beyond * beyond / variance, 1, scatter.groups - 1);
}

/// Of the groups that both fits could be made of.
std::vector<Along> all_along(const GroupedProblem& problem, const GroupedFit& before,
                             const GroupedFit& after) {
  std::vector<Along> out;
  for (std::size_t i = 0; i < before.groups.size(); ++i) {
    const GroupFit &b = before.groups[i], &a = after.groups[i];
    if (b.used && b.solved && a.used && a.solved)
      out.push_back(along(problem.groups()[i], b, a, before.weights.group[i]));
  }
  return out;
}

HeldOutFall held_out(const GroupedProblem& problem, const GroupedFit& before, const GroupedFit& after,
                     const Slope& train) {
  const auto groups = all_along(problem, before, after);
  double was = 0, is = 0, samples = 0;
  for (const Along& g : groups) was += g.was, is += g.is, samples += g.samples;
  HeldOutFall out;
  if (!(samples > 0)) return out;
  out.was = was / samples, out.is = is / samples;
  if (!(out.was > out.is)) return out;
  out.p = p_of_slope(slope_of(groups), train, out.is);
  // One wild group must not veto what all others show.
  const auto b = misfit(problem, before, &before.weights), a = misfit(problem, after, &before.weights);
  double falls = 0;
  for (std::size_t c = 0; c < b.size(); ++c) falls += std::max(0.0, b[c].chi2 - a[c].chi2);
  for (std::size_t c = 0; c < b.size(); ++c) {
    const double excess = b[c].chi2_per_sample() - 1, fall = b[c].chi2_per_sample() - a[c].chi2_per_sample();
    // A channel near its noise, where hardly anything falls, has no misfit that it could be a share of.
    if (b[c].chi2 - a[c].chi2 < kCarries * falls) continue;
    if (b[c].n > 0 && fall > 0) out.share = std::max(out.share, excess > fall ? fall / excess : 1);
  }
  return out;
}

}  // namespace

GroupedFit fit_without(const GroupedProblem& problem, const GroupedFit& fit, const std::string& id,
                       const GroupedFitOptions& options) {
  std::vector<SharedParameter> shared;
  std::vector<double> values;
  for (std::size_t k = 0; k < fit.shared.size(); ++k)
    if (fit.shared[k].effect != id)
      shared.push_back(fit.shared[k]), values.push_back(fit.values[static_cast<Index>(k)]);
  return fit_groups(problem, Split::train, shared,
                    Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())), options,
                    &fit);
}

HeldOutFall held_out_fall(const GroupedProblem& problem, const GroupedFit& before,
                          const GroupedFit& before_test, const GroupedFit& after,
                          const GroupedFit& after_test) {
  return held_out(problem, before_test, after_test, slope_of(all_along(problem, before, after)));
}

EffectTrial try_effect(const GroupedProblem& problem, const GroupedFit& fit, const GroupedFit& test,
                       const Candidate& candidate, const VectorXd& step, const dynamics::Effect& effect,
                       const GroupedFitOptions& options) {
  auto shared = fit.shared;
  std::vector<double> values(fit.values.data(), fit.values.data() + fit.values.size());
  for (auto& p : shared_parameters(effect, objects_of(problem))) {
    double start = p.neutral;
    if (const auto at = candidate.shape.find(p.name); at != candidate.shape.end()) start = at->second;
    for (std::size_t j = 0; j < candidate.parameters.size(); ++j)
      if (candidate.parameters[j] == p.name) start += step[static_cast<Index>(j)];
    values.push_back(std::clamp(start, p.low, p.high));
    shared.push_back(std::move(p));
  }
  EffectTrial out{effect.id, {}, {}, 1, 0, {}};
  out.fit =
      fit_groups(problem, Split::train, shared,
                 Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())), options, &fit);
  if (!out.fit.solved) return out;
  out.test = fit_own(problem, Split::test, out.fit, options, &test);
  const Wald wald = wald_of(out.fit, effect.id);
  out.p = wald.p_value(out.fit);
  out.delta_bic = wald.delta_bic(out.fit);
  if (out.test.solved) out.held = held_out_fall(problem, fit, test, out.fit, out.test);
  return out;
}

}  // namespace unhand::fitting
