#include "fitting/effect_search.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>

#include "experiment/parallel.hpp"
#include "fitting/distributions.hpp"
#include "fitting/footprints.hpp"

namespace unhand::fitting {

using datasets::Split;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<std::string> objects_of(const GroupedProblem& problem) {
  std::set<std::string> out;
  for (const auto& g : problem.groups()) out.insert(g.object);
  return {out.begin(), out.end()};
}

namespace {

/// Footprints that correlate by this much need not be fitted both: the data cannot prefer one.
constexpr double kSame = 0.9999;

std::vector<Index> indices(const std::vector<std::size_t>& from) {
  std::vector<Index> out;
  for (const std::size_t k : from) out.push_back(static_cast<Index>(k));
  return out;
}

/// Candidates with the values at which their footprints are taken; those of one call of equations().
struct Call {
  std::vector<std::string> names;
  std::vector<double> values;
  std::vector<std::size_t> columns;  ///< of the Gram matrix, one per name
};

/// Footprints over the train groups, with every group's own part.
struct GroupedFootprints {
  Footprints total;
  std::vector<MatrixXd> parts;
};

GroupedFootprints footprints_at(const GroupedProblem& problem, const GroupedFit& fit,
                                const std::vector<dynamics::Effect>& effects,
                                const GroupedFitOptions& options) {
  GroupedFootprints out;
  Footprints& f = out.total;
  f.fitted = fit.shared.size();
  std::size_t width = f.fitted;
  std::vector<Call> calls(1);
  calls[0].names = fit.names();
  calls[0].values.assign(fit.values.data(), fit.values.data() + fit.values.size());
  for (std::size_t k = 0; k < f.fitted; ++k) calls[0].columns.push_back(k);
  const auto objects = objects_of(problem);
  for (const auto& effect : effects) {
    const auto parameters = shared_parameters(effect, objects);
    std::vector<double> grid{0};
    const SharedParameter* shape = nullptr;
    for (const auto& p : parameters)
      if (p.shape) shape = &p;
    if (shape)
      for (const auto& p : effect.parameters)
        if (p.is_shape()) grid = p.grid;
    for (const double at : grid) {
      Candidate candidate{effect.id, {}, {}, {}};
      Call own = calls[0];
      own.names.resize(f.fitted), own.values.resize(f.fitted), own.columns.resize(f.fitted);
      Call& call = shape ? own : calls[0];
      if (shape) {
        candidate.shape[shape->name] = at;
        call.names.push_back(shape->name), call.values.push_back(at), call.columns.push_back(SIZE_MAX);
      }
      for (const auto& p : parameters) {
        if (p.shape) continue;
        candidate.parameters.push_back(p.name);
        candidate.columns.push_back(width);
        call.names.push_back(p.name), call.values.push_back(p.neutral), call.columns.push_back(width++);
      }
      f.candidates.push_back(std::move(candidate));
      if (shape) calls.push_back(std::move(own));
    }
  }
  const auto w = static_cast<Index>(width) + 1;
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < fit.groups.size(); ++i)
    if (fit.groups[i].used && fit.groups[i].solved) used.push_back(i);
  out.parts.assign(used.size(), MatrixXd());
  experiment::parallel_for(used.size(), options.threads, [&](std::size_t n) {
    const std::size_t i = used[n];
    MatrixXd columns = MatrixXd::Zero(static_cast<Index>(problem.groups()[i].rows.size()), w);
    bool solved = true;
    for (std::size_t c = 0; c < calls.size() && solved; ++c) {
      const auto e = projected(problem, i, calls[c].names, calls[c].values, fit.groups[i].own, fit.weights,
                               options.sample_limit);
      solved = e.solved;
      if (!solved) break;
      if (c == 0) columns.col(w - 1) = e.columns.col(e.columns.cols() - 1);
      for (std::size_t k = c == 0 ? 0 : f.fitted; k < calls[c].columns.size(); ++k)
        if (calls[c].columns[k] != SIZE_MAX)
          columns.col(static_cast<Index>(calls[c].columns[k])) = e.columns.col(static_cast<Index>(k));
    }
    out.parts[n] =
        solved ? MatrixXd(fit.weights.group[i] * (columns.transpose() * columns)) : MatrixXd::Zero(w, w);
  });
  f.gram = MatrixXd::Zero(w, w);
  for (const auto& part : out.parts) f.gram += part;
  f.samples = static_cast<double>(fit.samples);
  return out;
}

MatrixXd pseudo_inverse(const MatrixXd& A) {
  const VectorXd unit = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = unit.asDiagonal() * A * unit.asDiagonal();
  return unit.asDiagonal() * scaled.completeOrthogonalDecomposition().pseudoInverse() * unit.asDiagonal();
}

/// (θ − neutral)ᵀ V⁻¹ (θ − neutral) against F, over n groups.
double wald_p(double wald, Index parameters, double n) {
  const auto p = static_cast<double>(parameters);
  if (!(n > p + 1)) return 1;
  return f_tail(wald * (n - p) / (p * (n - 1)), p, n - p);
}

/// One linear step of `columns` (others fitted along), in units of the scatter between groups.
struct Step {
  VectorXd value, sigma;
  MatrixXd covariance;
  double wald{};
};
Step linear_step(const std::vector<MatrixXd>& parts, const std::vector<std::size_t>& which,
                 const std::vector<Index>& columns) {
  const auto p = static_cast<Index>(columns.size()), r = parts.front().rows() - 1;
  MatrixXd A = MatrixXd::Zero(p, p), B = A;
  VectorXd b = VectorXd::Zero(p);
  for (const std::size_t n : which) {
    A += parts[n](columns, columns);
    b += parts[n](columns, std::vector<Index>{r});
  }
  const MatrixXd inverse = pseudo_inverse(A);
  Step out;
  out.value = -inverse * b;
  double used = 0;
  for (const std::size_t n : which) {
    const VectorXd score =
        VectorXd(parts[n](columns, std::vector<Index>{r})) + MatrixXd(parts[n](columns, columns)) * out.value;
    B += score * score.transpose();
    used += parts[n](r, r) > 0 ? 1 : 0;
  }
  out.covariance = inverse * B * inverse * (used / std::max(1.0, used - static_cast<double>(p)));
  out.sigma = out.covariance.diagonal().cwiseMax(inverse.diagonal()).cwiseSqrt();
  return out;
}

std::vector<std::size_t> all_of(std::size_t n) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < n; ++i) out.push_back(i);
  return out;
}

/// A fall of the held-out χ², over groups.
struct HeldOut {
  double was{}, is{};  ///< χ² per sample
  double p{1};         ///< one-sided, paired over groups
  double share{};      ///< the largest share of a channel's misfit beyond the noise that goes
  double fall() const { return was - is; }
};
HeldOut held_out(const GroupedProblem& problem, const GroupedFit& before, const GroupedFit& after) {
  double n = 0, sum = 0, squares = 0, was = 0, is = 0, samples = 0;
  for (std::size_t i = 0; i < before.groups.size(); ++i) {
    const GroupFit &b = before.groups[i], &a = after.groups[i];
    if (!(b.used && b.solved && a.used && a.solved)) continue;
    const double w = before.weights.group[i], d = w * (b.chi2 - a.chi2);
    n += 1, sum += d, squares += d * d;
    was += w * b.chi2, is += w * a.chi2, samples += w * b.n;
  }
  HeldOut out;
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

struct Trial {
  std::string id;
  GroupedFit fit, test;
  double p{1}, delta_bic{};
  HeldOut held;
};

/// Wald's statistic of an effect's size parameters in a fit.
double wald_of(const GroupedFit& fit, const std::string& id, Index& count) {
  std::vector<Index> at;
  for (std::size_t k = 0; k < fit.shared.size(); ++k)
    if (fit.shared[k].effect == id && !fit.shared[k].shape) at.push_back(static_cast<Index>(k));
  count = static_cast<Index>(at.size());
  VectorXd d(count);
  for (Index j = 0; j < count; ++j) {
    const auto k = static_cast<std::size_t>(at[static_cast<std::size_t>(j)]);
    d[j] = fit.values[static_cast<Index>(k)] - fit.shared[k].neutral;
  }
  return d.dot(pseudo_inverse(fit.covariance(at, at)) * d);
}

Trial tried(const GroupedProblem& problem, const GroupedFit& fit, const GroupedFit& test,
            const Candidate& candidate, const VectorXd& step, const dynamics::Effect& effect,
            const EffectSearchOptions& options) {
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
  Trial out{effect.id, {}, {}, 1, 0, {}};
  out.fit =
      fit_groups(problem, Split::train, shared,
                 Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())), options.fit);
  if (!out.fit.solved) return out;
  out.test = fit_own(problem, Split::test, out.fit, options.fit);
  Index count = 0;
  const double wald = wald_of(out.fit, effect.id, count);
  out.p = wald_p(wald, count, out.fit.used);
  out.delta_bic = static_cast<double>(count) * std::log(std::max(2, out.fit.used)) - wald;
  if (out.test.solved) out.held = held_out(problem, test, out.test);
  return out;
}

Ranked& entry_of(std::vector<Ranked>& ranking, const std::string& id) {
  const auto found =
      std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == id; });
  if (found != ranking.end()) return *found;
  ranking.push_back({id, -1});
  return ranking.back();
}

class Search {
 public:
  Search(const GroupedProblem& problem, const EffectSearchOptions& options, EffectSearch& out)
      : problem_(problem), options_(options), out_(out) {
    for (auto& effect : problem.effects())
      if (std::find(options.forget.begin(), options.forget.end(), effect.id) == options.forget.end())
        catalogue_.push_back(std::move(effect));
  }

  bool forward() {
    const auto effects = inactive();
    if (effects.empty()) return false;
    const auto f = footprints_at(problem_, out_.final, effects, options_.fit);
    const auto all = scores(f.total);
    struct Scored {
      std::size_t candidate;
      double gain, p;
      VectorXd step;
    };
    std::vector<Scored> scored;
    for (const auto& s : all) {
      const Candidate& c = f.total.candidates[s.candidate];
      std::vector<Index> columns;
      for (std::size_t k = 0; k < f.total.fitted; ++k) columns.push_back(static_cast<Index>(k));
      const auto own = indices(c.columns);
      columns.insert(columns.end(), own.begin(), own.end());
      Scored one{s.candidate, s.gain, 1,
                 Eigen::Map<const VectorXd>(s.step.data(), static_cast<Index>(s.step.size()))};
      if (s.visible) {
        const Step step = linear_step(f.parts, all_of(f.parts.size()), columns);
        const auto p = static_cast<Index>(own.size());
        const VectorXd x = step.value.tail(p);
        one.p =
            wald_p(x.dot(pseudo_inverse(step.covariance.bottomRightCorner(p, p)) * x), p, out_.final.used);
        if (!allowed(c, x)) one.gain = 0, one.p = 1;
      }
      scored.push_back(one);
      Ranked& r = entry_of(out_.ranking, c.id);
      if (one.gain <= r.gain) continue;
      r.gain = one.gain, r.p_value = one.p, r.visible = s.visible;
    }
    std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) { return a.gain > b.gain; });
    for (const auto& s : scored) {
      const Candidate &best = f.total.candidates[scored.front().candidate],
                      &c = f.total.candidates[s.candidate];
      Ranked& r = entry_of(out_.ranking, c.id);
      if (r.gain == s.gain && scored.front().gain > 0)
        r.correlation_with_best =
            between(f.total, best,
                    {scored.front().step.data(), scored.front().step.data() + scored.front().step.size()}, c);
    }
    // Leaders: of candidates with the same footprint, the one that the catalogue lists first.
    const double level = options_.false_discovery_rate / static_cast<double>(scored.size());
    std::vector<Scored> leaders;
    for (const auto& s : scored) {
      if (!(s.p < 10 * level) || !(s.gain > 0)) continue;  // the full fit decides; this is to first order
      const Candidate& c = f.total.candidates[s.candidate];
      bool known = false;
      for (auto& leader : leaders) {
        const Candidate& l = f.total.candidates[leader.candidate];
        if (l.id == c.id) known = true;
        if (known ||
            between(f.total, l, {leader.step.data(), leader.step.data() + leader.step.size()}, c) < kSame)
          continue;
        known = true;
        if (order_of(c.id) < order_of(l.id) && s.gain > 0.9 * leader.gain) leader = s;
        break;
      }
      if (!known && static_cast<int>(leaders.size()) < options_.refits) leaders.push_back(s);
    }
    std::optional<Trial> best;
    for (const auto& s : leaders) {
      const Candidate& c = f.total.candidates[s.candidate];
      const auto effect =
          std::find_if(effects.begin(), effects.end(), [&](const auto& e) { return e.id == c.id; });
      Trial trial = tried(problem_, out_.final, out_.final_test, c, s.step, *effect, options_);
      Ranked& r = entry_of(out_.ranking, c.id);
      r.refitted = true, r.delta_bic = trial.delta_bic, r.held_out_gain = trial.held.fall();
      if (!trial.fit.solved || !(trial.p < level) || !(trial.held.p < 0.05)) continue;
      if (!(trial.held.share > options_.matters)) continue;
      if (!best || trial.delta_bic < best->delta_bic) best = std::move(trial);
    }
    if (!best) return false;
    AcceptedEffect effect;
    effect.id = best->id;
    effect.delta_bic = best->delta_bic;
    effect.test_error_ratio = std::sqrt(best->held.is / best->held.was);
    effect.why = fmt::format("chi2 per sample falls from {:.4g} to {:.4g} (p {:.1g})", best->held.was,
                             best->held.is, best->held.p);
    out_.effects.push_back(std::move(effect));
    out_.final = std::move(best->fit);
    out_.final_test = std::move(best->test);
    return true;
  }

  void backward() {
    for (bool removed = true; removed && out_.effects.size() > 1;) {
      removed = false;
      for (std::size_t i = 0; i < out_.effects.size() && !removed; ++i) {
        Index count = 0;
        const double wald = wald_of(out_.final, out_.effects[i].id, count);
        if (wald_p(wald, count, out_.final.used) <
            options_.false_discovery_rate / static_cast<double>(catalogue_.size()))
          continue;
        const std::string id = out_.effects[i].id;
        std::vector<SharedParameter> shared;
        std::vector<double> values;
        for (std::size_t k = 0; k < out_.final.shared.size(); ++k)
          if (out_.final.shared[k].effect != id)
            shared.push_back(out_.final.shared[k]),
                values.push_back(out_.final.values[static_cast<Index>(k)]);
        out_.final = fit_groups(problem_, Split::train, shared,
                                Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size())),
                                options_.fit);
        out_.final_test = fit_own(problem_, Split::test, out_.final, options_.fit);
        out_.effects.erase(out_.effects.begin() + static_cast<std::ptrdiff_t>(i));
        removed = true;
      }
    }
  }

  /// Values, other names and how they hold up in halves of the groups.
  void describe() {
    if (out_.effects.empty()) return;
    const auto f = footprints_at(problem_, out_.final, inactive(), options_.fit);
    for (AcceptedEffect& accepted : out_.effects) {
      Index count = 0;
      const double wald = wald_of(out_.final, accepted.id, count);
      accepted.p_value = wald_p(wald, count, out_.final.used);
      accepted.delta_bic = static_cast<double>(count) * std::log(std::max(2, out_.final.used)) - wald;
      VectorXd contribution = VectorXd::Zero(static_cast<Index>(f.total.fitted));
      for (std::size_t k = 0; k < out_.final.shared.size(); ++k) {
        const auto& p = out_.final.shared[k];
        if (p.effect != accepted.id) continue;
        const double value = out_.final.values[static_cast<Index>(k)];
        accepted.parameters.push_back({p.short_name, p.unit, value, out_.final.sigma(k)});
        if (!p.shape) contribution[static_cast<Index>(k)] = value - p.neutral;
      }
      for (const Candidate& candidate : f.total.candidates) {
        const double r = correlation(f.total, contribution, candidate);
        if (r < options_.equivalent || is_spoken_for(f.total, accepted.id, candidate)) continue;
        const auto known = std::find_if(accepted.equivalent.begin(), accepted.equivalent.end(),
                                        [&](const auto& e) { return e.first == candidate.id; });
        if (known == accepted.equivalent.end())
          accepted.equivalent.push_back({candidate.id, r});
        else
          known->second = std::max(known->second, r);
      }
    }
    halves(f);
  }

 private:
  std::size_t order_of(const std::string& id) const {
    for (std::size_t k = 0; k < catalogue_.size(); ++k)
      if (catalogue_[k].id == id) return k;
    return catalogue_.size();
  }
  /// What the other accepted effects do already leaves (almost) nothing of the candidate's footprint.
  bool is_spoken_for(const Footprints& f, const std::string& accepted, const Candidate& candidate) const {
    std::vector<Index> others;
    for (std::size_t k = 0; k < f.fitted; ++k)
      if (out_.final.shared[k].effect != accepted) others.push_back(static_cast<Index>(k));
    if (others.empty()) return false;
    const auto own = indices(candidate.columns);
    const MatrixXd cross = f.gram(others, own);
    const MatrixXd left =
        MatrixXd(f.gram(own, own)) - cross.transpose() * pseudo_inverse(f.gram(others, others)) * cross;
    return left.trace() < 1e-2 * f.gram(own, own).trace();
  }
  std::vector<dynamics::Effect> inactive() const {
    std::vector<dynamics::Effect> out;
    for (const auto& effect : catalogue_)
      if (std::none_of(out_.effects.begin(), out_.effects.end(),
                       [&](const auto& e) { return e.id == effect.id; }))
        out.push_back(effect);
    return out;
  }
  /// A parameter that cannot go below (or above) neutral must not want to.
  bool allowed(const Candidate& c, const VectorXd& step) const {
    for (const auto& effect : catalogue_) {
      if (effect.id != c.id) continue;
      for (std::size_t j = 0; j < c.parameters.size(); ++j)
        for (const auto& p : effect.parameters) {
          if (c.parameters[j].substr(0, c.parameters[j].find('[')) != effect.full_name(p)) continue;
          const double x = step[static_cast<Index>(j)];
          if (c.parameters.size() == 1 && ((p.low >= p.neutral && x < 0) || (p.high <= p.neutral && x > 0)))
            return false;
        }
    }
    return true;
  }

  void halves(const GroupedFootprints& f) {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < out_.final.groups.size(); ++i)
      if (out_.final.groups[i].used && out_.final.groups[i].solved) used.push_back(i);
    std::vector<Index> columns;
    for (std::size_t k = 0; k < f.total.fitted; ++k) columns.push_back(static_cast<Index>(k));
    for (std::size_t c = 0; c < problem_.covariates().size(); ++c) {
      std::vector<double> x;
      for (const std::size_t i : used) x.push_back(problem_.groups()[i].covariates[c]);
      auto sorted = x;
      std::sort(sorted.begin(), sorted.end());
      if (sorted.empty() || !(sorted.back() > sorted.front())) continue;
      const double at = sorted[sorted.size() / 2];
      std::vector<std::size_t> low, high;
      for (std::size_t n = 0; n < used.size(); ++n) (x[n] < at ? low : high).push_back(n);
      if (low.size() < 2 * columns.size() + 2 || high.size() < 2 * columns.size() + 2) continue;
      const Step a = linear_step(f.parts, low, columns), b = linear_step(f.parts, high, columns);
      for (std::size_t k = 0; k < f.total.fitted; ++k) {
        const auto j = static_cast<Index>(k);
        if (out_.final.shared[k].shape) continue;
        out_.stability.push_back({out_.final.shared[k].name, problem_.covariates()[c], at,
                                  out_.final.values[j] + a.value[j], a.sigma[j],
                                  out_.final.values[j] + b.value[j], b.sigma[j]});
      }
    }
  }

  const GroupedProblem& problem_;
  const EffectSearchOptions& options_;
  EffectSearch& out_;
  std::vector<dynamics::Effect> catalogue_;
};

}  // namespace

EffectSearch search_effects(const GroupedProblem& problem, const EffectSearchOptions& options) {
  EffectSearch out;
  out.base = fit_groups(problem, Split::train, {}, VectorXd(), options.fit);
  out.base_test = fit_own(problem, Split::test, out.base, options.fit);
  if (!out.base.solved || !out.base_test.solved) {
    out.message = out.base.solved ? "no held-out group could be fitted" : "no train group could be fitted";
    return out;
  }
  out.solved = true;
  out.final = out.base;
  out.final_test = out.base_test;
  Search search(problem, options, out);
  while (static_cast<int>(out.effects.size()) < options.most_effects && search.forward()) {
  }
  search.backward();
  search.describe();
  std::sort(out.ranking.begin(), out.ranking.end(),
            [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  return out;
}

}  // namespace unhand::fitting
