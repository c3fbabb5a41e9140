#include "fitting/effect_trial.hpp"

#include <algorithm>
#include <cmath>

#include "fitting/dense_solve.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

using datasets::Split;
using Eigen::Index;
using Eigen::VectorXd;

double Wald::delta_bic(const GroupedFit& fit) const {
  return static_cast<double>(parameters) * std::log(std::max(2, fit.used)) - statistic;
}

double Wald::p_value(const GroupedFit& fit) const {
  const auto p = static_cast<double>(parameters), n = static_cast<double>(fit.used);
  if (!(n > p + 1)) return 1;
  return f_tail(statistic * (n - p) / (p * (n - 1)), p, n - p);
}

Wald wald_of(const GroupedFit& fit, const std::string& id) {
  std::vector<Index> at;
  std::vector<double> away;
  for (std::size_t k = 0; k < fit.shared.size(); ++k)
    if (fit.shared[k].effect == id && !fit.shared[k].shape) {
      at.push_back(static_cast<Index>(k));
      away.push_back(fit.values[at.back()] - fit.shared[k].neutral);
    }
  const Eigen::Map<const VectorXd> d(away.data(), static_cast<Index>(away.size()));
  return {d.dot(pseudo_solve(fit.covariance(at, at), d)), d.size()};
}

namespace {

HeldOutFall held_out(const GroupedProblem& problem, const GroupedFit& before, const GroupedFit& after) {
  double n = 0, sum = 0, squares = 0, was = 0, is = 0, samples = 0;
  for (std::size_t i = 0; i < before.groups.size(); ++i) {
    const GroupFit &b = before.groups[i], &a = after.groups[i];
    if (!(b.used && b.solved && a.used && a.solved)) continue;
    const double w = before.weights.group[i], d = w * (b.chi2 - a.chi2);
    n += 1, sum += d, squares += d * d;
    was += w * b.chi2, is += w * a.chi2, samples += w * b.n;
  }
  HeldOutFall out;
  if (n < 3 || !(samples > 0)) return out;
  out.was = was / samples, out.is = is / samples;
  const double mean = sum / n, variance = (squares - n * mean * mean) / (n - 1);
  if (!(mean > 0)) return out;
  const double t = mean / std::sqrt(std::max(variance, 1e-300) / n);
  out.p = 0.5 * f_tail(t * t, 1, n - 1);
  const auto b = misfit(problem, before), a = misfit(problem, after);
  for (std::size_t c = 0; c < b.size(); ++c) {
    const double excess = b[c].chi2_per_sample() - 1, fall = b[c].chi2_per_sample() - a[c].chi2_per_sample();
    if (b[c].n > 0 && fall > 0) out.share = std::max(out.share, excess > fall ? fall / excess : 1);
  }
  return out;
}

}  // namespace

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
  out.fit = fit_groups(problem, Split::train, shared,
                       Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())), options);
  if (!out.fit.solved) return out;
  out.test = fit_own(problem, Split::test, out.fit, options);
  const Wald wald = wald_of(out.fit, effect.id);
  out.p = wald.p_value(out.fit);
  out.delta_bic = wald.delta_bic(out.fit);
  if (out.test.solved) out.held = held_out(problem, test, out.test);
  return out;
}

}  // namespace unhand::fitting
