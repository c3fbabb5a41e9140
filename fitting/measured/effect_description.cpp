#include "fitting/measured/effect_description.hpp"

#include <algorithm>

#include "dynamics/dense_solve.hpp"
#include "fitting/measured/grouped_footprints.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::pseudo_inverse;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// A candidate without the parameters of which what the accepted effects but `accepted` do leaves (almost)
/// nothing: a wind along the vertical beside a scale. What is left of those is rounding, which is like
/// anything. Without any, where that holds of all of them together.
Candidate own_part(const Footprints& f, const GroupedFit& fit, const std::string& accepted,
                   const Candidate& candidate) {
  constexpr double kNothing = 1e-2;
  std::vector<Index> others;
  for (std::size_t k = 0; k < f.fitted; ++k)
    if (fit.shared[k].effect != accepted) others.push_back(static_cast<Index>(k));
  if (others.empty()) return candidate;
  const auto own = indices(candidate.columns);
  const VectorXd whole = f.gram(own, own).diagonal(),
                 rest =
                     whole - congruent(MatrixXd(f.gram(own, others)), pseudo_inverse(f.gram(others, others)))
                                 .diagonal();
  Candidate out{candidate.id, {}, {}, candidate.shape, {}};
  if (rest.sum() < kNothing * whole.sum()) return out;
  for (std::size_t j = 0; j < candidate.columns.size(); ++j) {
    if (const auto k = static_cast<Index>(j); !(rest[k] > kNothing * whole[k])) continue;
    out.parameters.push_back(candidate.parameters[j]);
    out.columns.push_back(candidate.columns[j]);
    out.sides.push_back(candidate.sides[j]);
  }
  return out;
}

}  // namespace

std::vector<AcceptedEffect> described(const GroupedProblem& problem, const EffectAnswer& answer,
                                      const std::vector<dynamics::Effect>& catalogue,
                                      const EffectSearchOptions& options) {
  auto out = answer.effects;
  if (out.empty()) return out;
  const GroupedFit& fit = answer.train;
  const auto f = grouped_footprints(problem, fit, answer.candidates(problem, catalogue), options.fit);
  for (std::size_t i = 0; i < out.size(); ++i) {
    AcceptedEffect& accepted = out[i];
    const Wald wald = wald_of(fit, accepted.id);
    accepted.p_value = wald.p_value(fit);
    accepted.delta_bic = wald.delta_bic(fit);
    VectorXd contribution = VectorXd::Zero(static_cast<Index>(f.total.fitted));
    for (std::size_t k = 0; k < fit.shared.size(); ++k) {
      const SharedParameter& p = fit.shared[k];
      if (p.effect != accepted.id) continue;
      const double value = fit.values[static_cast<Index>(k)];
      accepted.parameters.push_back(
          {p.short_name, p.unit, value, fit.sigma(k), fit.freedom[static_cast<Index>(k)]});
      if (!p.shape) contribution[static_cast<Index>(k)] = value - p.neutral;
    }
    for (const Candidate& candidate : f.total.candidates) {
      const auto shown = answer.shown_from.find(candidate.id);
      if (shown == answer.shown_from.end() || shown->second > i) continue;  // it needs what was found later
      if (!problem.may_act(candidate.id, answer.ids_without(accepted.id))) continue;
      const Candidate own = own_part(f.total, fit, accepted.id, candidate);
      if (own.columns.empty()) continue;
      const double r = correlation(f.total, contribution, own);
      if (r >= options.equivalent) accepted.add_other_name(candidate.id, r);
    }
  }
  return out;
}

std::vector<Stability> stability_of(const GroupedProblem& problem, const EffectAnswer& answer,
                                    const EffectSearchOptions& options) {
  std::vector<Stability> out;
  const GroupedFit& fit = answer.train;
  if (fit.shared.empty()) return out;
  const auto f = grouped_footprints(problem, fit, {}, options.fit);
  const auto used = fit.solved_groups();
  std::vector<Index> columns;
  for (std::size_t k = 0; k < f.total.fitted; ++k) columns.push_back(static_cast<Index>(k));
  for (std::size_t c = 0; c < problem.covariates().size(); ++c) {
    std::vector<double> x;
    for (const std::size_t i : used) x.push_back(problem.groups()[i].covariates[c]);
    auto sorted = x;
    std::sort(sorted.begin(), sorted.end());
    if (sorted.empty() || !(sorted.back() > sorted.front())) continue;
    const double at = sorted[sorted.size() / 2];
    std::vector<std::size_t> low, high;
    for (std::size_t n = 0; n < used.size(); ++n) (x[n] < at ? low : high).push_back(n);
    if (low.size() < 2 * columns.size() + 2 || high.size() < 2 * columns.size() + 2) continue;
    const LinearStep a = linear_step(f.parts, low, columns), b = linear_step(f.parts, high, columns);
    for (std::size_t k = 0; k < f.total.fitted; ++k) {
      const auto j = static_cast<Index>(k);
      if (fit.shared[k].shape) continue;
      // Welch's: of a difference of two that are known unequally well
      const double va = a.sigma[j] * a.sigma[j], vb = b.sigma[j] * b.sigma[j];
      const double freedom = (va + vb) * (va + vb) / (va * va / a.freedom[j] + vb * vb / b.freedom[j]);
      if (!(va + vb < HUGE_VAL)) continue;  // one half does not see it
      out.push_back({fit.shared[k].name, problem.covariates()[c], at, fit.values[j] + a.value[j], a.sigma[j],
                     fit.values[j] + b.value[j], b.sigma[j], freedom});
    }
  }
  return out;
}

}  // namespace unhand::fitting
