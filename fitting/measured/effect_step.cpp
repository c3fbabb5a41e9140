#include "fitting/measured/effect_step.hpp"

#include <algorithm>
#include <numeric>

#include "fitting/measured/grouped_footprints.hpp"

namespace unhand::fitting {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Footprints that correlate by this much need not be fitted both: the data cannot prefer one.
constexpr double kSame = 0.9999;
/// Groups of each object that are asked whether one effect makes room for another: one would show it, the
/// others are for one that lies still.
constexpr int kAsked = 3;

/// The fit with no more groups used than tell what acts at all.
GroupedFit asked_of_few(const GroupedProblem& problem, GroupedFit fit) {
  std::map<std::string, int> asked;  // by object
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    GroupFit& group = fit.groups[i];
    group.used = group.used && group.solved && ++asked[problem.groups()[i].object] <= kAsked;
  }
  return fit;
}

/// A parameter that ends at the end of its range, where that is not neutral: it wants to be what it cannot
/// be.
bool is_pinned(const GroupedFit& fit) {
  for (std::size_t k = 0; k < fit.shared.size(); ++k) {
    const SharedParameter& p = fit.shared[k];
    const double value = fit.values[static_cast<Index>(k)], near = 1e-6 * (p.high - p.low);
    if (p.shape) continue;
    if ((value < p.low + near && p.low != p.neutral) || (value > p.high - near && p.high != p.neutral))
      return true;
  }
  return false;
}

/// Whether a candidate that is nothing without an accepted effect, as the anisotropy of a drag is, leaves
/// that one told: each of its sizes at most so many times less surely than before. Else what tells the
/// candidate is not what it shapes along directions that groups move in, but a guess along others.
bool keeps_what_it_shapes(const GroupedProblem& problem, const EffectAnswer& answer,
                          const EffectTrial& trial) {
  constexpr double kLessSure = 10;
  for (std::size_t k = 0; k < answer.train.shared.size(); ++k) {
    const SharedParameter& p = answer.train.shared[k];
    if (p.shape || problem.may_act(trial.id, answer.ids_without(p.effect))) continue;
    if (!(trial.fit.sigma(k) < kLessSure * answer.train.sigma(k))) return false;
  }
  return true;
}

/// A candidate to first order: the χ² that it would take away, at which sizes, and Wald's p-value of them.
struct Scored {
  const Candidate* candidate;
  double gain, p;
  std::vector<double> step;
};

/// Wald's p-value, by the scatter between groups; one that wants to where there are no values gains nothing.
void judge(const GroupedFootprints& f, const GroupedFit& fit, Scored& one) {
  const Candidate& c = *one.candidate;
  std::vector<std::size_t> columns(f.total.fitted), inside;  // parameters that do not want to where none are
  std::vector<int> sides;
  for (std::size_t j = 0; j < c.columns.size(); ++j)
    if (c.sides[j] == 0 || one.step[j] != 0) inside.push_back(c.columns[j]), sides.push_back(c.sides[j]);
  if (inside.empty()) return;
  std::vector<std::size_t> groups(f.parts.size());
  std::iota(groups.begin(), groups.end(), std::size_t{0});
  std::iota(columns.begin(), columns.end(), std::size_t{0});
  columns.insert(columns.end(), inside.begin(), inside.end());
  const LinearStep step = linear_step(f.parts, groups, indices(columns));
  const auto p = static_cast<Index>(inside.size());
  const VectorXd x = step.value.tail(p);
  const MatrixXd covariance = step.covariance.bottomRightCorner(p, p);
  one.p = wald_of(x, covariance, step.freedom.tail(p), sides).p_value(fit);
  for (Index j = 0; j < p; ++j)
    if (sides[static_cast<std::size_t>(j)] * x[j] < 0) one.gain = 0, one.p = 1;
}

/// The candidates that some channel shows, largest gain first; takes them into the ranking, with how like the
/// footprint of the best one theirs are.
std::vector<Scored> first_order(const GroupedFootprints& f, EffectAnswer& answer) {
  std::vector<Scored> out;
  for (auto& s : scores(f.total)) {
    const Candidate& c = f.total.candidates[s.candidate];
    if (!s.visible) {  // nothing for it to act through yet: a wind before there is a drag
      if (Ranked& r = answer.ranked(c.id); r.gain < 0) r.gain = 0, r.visible = false;
      continue;
    }
    answer.shown_from.try_emplace(c.id, answer.effects.size());
    Scored one{&c, s.gain, 1, std::move(s.step)};
    judge(f, answer.train, one);
    Ranked& r = answer.ranked(c.id);
    if (one.gain > r.gain) {
      r.gain = one.gain, r.p_value = one.p, r.visible = true;
      r.step = answer.step();
    }
    out.push_back(std::move(one));
  }
  std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) { return a.gain > b.gain; });
  for (const Scored& s : out)
    if (Ranked& r = answer.ranked(s.candidate->id); r.gain == s.gain && out.front().gain > 0)
      r.correlation_with_best = between(f.total, *out.front().candidate, out.front().step, *s.candidate);
  return out;
}

/// At most `refits` that may be evident at `level`: of candidates with the same footprint, the one that
/// `effects` lists first.
std::vector<Scored> leaders(const Footprints& f, const std::vector<Scored>& scored,
                            const std::vector<dynamics::Effect>& effects, double level, int refits) {
  const auto place_of = [&](const Scored& s) {
    return std::find_if(effects.begin(), effects.end(),
                        [&](const auto& e) { return e.id == s.candidate->id; });
  };
  std::vector<Scored> out;
  for (const Scored& s : scored) {
    if (!(s.p < 10 * level) || !(s.gain > 0)) continue;  // the full fit decides; this is to first order
    const auto same = std::find_if(out.begin(), out.end(), [&](const Scored& leader) {
      return leader.candidate->id == s.candidate->id ||
             !(between(f, *leader.candidate, leader.step, *s.candidate) < kSame);
    });
    if (same == out.end()) {
      if (static_cast<int>(out.size()) < refits) out.push_back(s);
    } else if (place_of(s) < place_of(*same) && s.gain > 0.9 * same->gain) {
      *same = s;
    }
  }
  return out;
}

std::vector<dynamics::Effect> silent_among(const std::vector<dynamics::Effect>& effects,
                                           const Footprints& f) {
  const auto ids = silent_ids(f);
  std::vector<dynamics::Effect> out;
  for (const auto& effect : effects)
    if (std::find(ids.begin(), ids.end(), effect.id) != ids.end()) out.push_back(effect);
  return out;
}

}  // namespace

EvidentEffects evident_effects(const GroupedProblem& problem, const std::vector<dynamics::Effect>& effects,
                               const EffectSearchOptions& options, EffectAnswer& answer) {
  EvidentEffects out;
  if (effects.empty()) return out;
  const auto f = grouped_footprints(problem, answer.train, effects, options.fit);
  const auto scored = first_order(f, answer);
  if (scored.empty()) return out;
  out.silent = silent_among(effects, f.total);
  out.level = options.family_wise_level / static_cast<double>(scored.size());
  for (const Scored& s : leaders(f.total, scored, effects, out.level, options.refits)) {
    const std::string& id = s.candidate->id;
    const auto effect =
        std::find_if(effects.begin(), effects.end(), [&](const auto& e) { return e.id == id; });
    const Eigen::Map<const VectorXd> step(s.step.data(), static_cast<Index>(s.step.size()));
    auto trial = try_effect(problem, answer.train, answer.test, *s.candidate, step, *effect, options.fit);
    Ranked& r = answer.ranked(id);
    r.refit_step = answer.step(), r.delta_bic = trial.delta_bic, r.held_out_gain = trial.held.fall();
    r.fate = Fate::no_fit;
    if (!trial.fit.solved || is_pinned(trial.fit) || !problem.may_be(trial.fit)) continue;
    r.fate = Fate::not_significant;
    if (!(trial.p < out.level) || shape_is_open(trial.fit, id)) continue;
    if (!keeps_what_it_shapes(problem, answer, trial)) continue;
    r.fate = Fate::outdone;
    out.trials.push_back(std::move(trial));
  }
  std::sort(out.trials.begin(), out.trials.end(),
            [](const EffectTrial& a, const EffectTrial& b) { return a.delta_bic < b.delta_bic; });
  return out;
}

std::vector<std::string> shown_beside(const GroupedProblem& problem, const EffectTrial& trial,
                                      const std::vector<dynamics::Effect>& silent,
                                      const EffectSearchOptions& options) {
  std::vector<std::string> out;
  if (silent.empty()) return out;
  // Few groups tell: nothing acts through most effects, and the derivatives by what is silent are then zero
  // in all groups.
  const auto f = grouped_footprints(problem, asked_of_few(problem, trial.fit), silent, options.fit);
  const auto still = silent_ids(f.total);
  for (const auto& effect : silent)
    if (std::find(still.begin(), still.end(), effect.id) == still.end()) out.push_back(effect.id);
  return out;
}

}  // namespace unhand::fitting
