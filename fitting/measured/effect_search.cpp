#include "fitting/measured/effect_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/grouped_footprints.hpp"

namespace unhand::fitting {

using datasets::Split;
using dynamics::congruent, dynamics::pseudo_inverse;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Footprints that correlate by this much need not be fitted both: the data cannot prefer one.
constexpr double kSame = 0.9999;
/// Bayes' criteria that are no further apart cannot tell two effects from each other.
constexpr double kAlike = 10;
/// The share of the most evident one's evidence from which on held-out groups choose.
constexpr double kComparable = 0.5;
/// χ² per sample above which rivals are followed, and the factor by which one has to lower it.
constexpr double kMisfit = 1.2, kBetter = 0.9;
/// χ² per sample, twice the noise in size, above which accepted effects are exchanged for others: that takes
/// as many fits as all steps before.
constexpr double kFarOff = 4;
/// A fit gains what the footprint promises, within this factor.
constexpr double kPromised = 3;
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

double left(const GroupedFit& fit) {
  return fit.samples > 0 ? fit.chi2 / static_cast<double>(fit.samples) : 0;
}

void accept(const EffectTrial& trial, EffectSearch& to) {
  AcceptedEffect effect;
  effect.id = trial.id;
  effect.delta_bic = trial.delta_bic;
  effect.test_error_ratio = std::sqrt(trial.held.is / trial.held.was);
  effect.why = fmt::format("chi2 per sample falls from {:.4g} to {:.4g} (p {:.1g})", trial.held.was,
                           trial.held.is, trial.held.p);
  to.effects.push_back(std::move(effect));
  to.final = trial.fit;
  to.final_test = trial.test;
}

std::vector<Index> indices(const std::vector<std::size_t>& from) {
  std::vector<Index> out;
  for (const std::size_t k : from) out.push_back(static_cast<Index>(k));
  return out;
}

std::vector<std::size_t> all_of(std::size_t n) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < n; ++i) out.push_back(i);
  return out;
}

Ranked& entry_of(std::vector<Ranked>& ranking, const std::string& id) {
  const auto found =
      std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == id; });
  if (found != ranking.end()) return *found;
  ranking.push_back({id, -1});
  return ranking.back();
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

/// A shape parameter that ends at the border of its range: it would like to be another effect, as a decay
/// without end is a constant.
bool shape_is_open(const GroupedFit& fit, const std::string& id) {
  for (std::size_t k = 0; k < fit.shared.size(); ++k) {
    const SharedParameter& p = fit.shared[k];
    const double value = fit.values[static_cast<Index>(k)], inside = std::min(value - p.low, p.high - value);
    if (p.effect == id && p.shape && !(inside > std::max(2 * fit.sigma(k), 1e-3 * (p.high - p.low))))
      return true;
  }
  return false;
}

class Search {
 public:
  Search(const GroupedProblem& problem, const EffectSearchOptions& options, EffectSearch& out)
      : problem_(problem), options_(options), out_(out) {
    for (auto& effect : problem.effects())
      if (std::find(options.forget.begin(), options.forget.end(), effect.id) == options.forget.end())
        catalogue_.push_back(std::move(effect));
  }

  /// One step: false if nothing convinces. `refits`: candidates fitted in full; `only`: of these ids, if any.
  bool forward(int refits, const std::vector<std::string>& only = {}) {
    auto effects = inactive();
    if (!only.empty())
      std::erase_if(effects,
                    [&](const auto& e) { return std::find(only.begin(), only.end(), e.id) == only.end(); });
    if (effects.empty()) return false;
    const auto f = grouped_footprints(problem_, out_.final, effects, options_.fit);
    const auto scored = first_order(f);
    if (scored.empty()) return false;
    compare_with_best(f.total, scored);
    const double level = options_.family_wise_level / static_cast<double>(scored.size());
    kept_at_ = std::max(kept_at_, level);
    return accept_best(evident(f.total, leaders(f.total, scored, level, refits), effects, level),
                       silent(f.total, effects));
  }

  /// As far as forward() goes. A step may not have known which of two effects it was: both are as evident,
  /// and what the other one makes room for (a wind acts through the drag) may be needed before held-out
  /// groups show it. Where a misfit is left, the others are followed too, and taken where all groups are
  /// explained the better for it.
  void follow() {
    climb();
    const auto rivals = std::move(rivals_);
    for (const Rival& rival : rivals) {
      if (!(left(out_.final_test) > kMisfit)) return;
      if (static_cast<int>(rival.answer.effects.size()) >= options_.most_effects) continue;
      if (!rival.opens.empty() && is_accepted(rival.answer.effects.back().id)) continue;  // asked since then
      try_instead(rival.answer, rival.shown_from, [&](const EffectSearch& first) {
        return (rival.opens.empty() ? climbed_from_one() : opened(rival)) && leaves_less(first, kBetter);
      });
    }
  }

  /// What groups show most alike is evident, and need not be what explains most: three numbers of a drift
  /// stand in for a drag and a bias until the bias is found. Where a large misfit is left, every accepted
  /// effect that no other one needs is exchanged for the candidate that takes most in its place, if all
  /// groups are explained the better for it.
  void exchange() {
    for (std::size_t i = 0; i < out_.effects.size(); ++i)
      if (left(out_.final_test) > kFarOff && !is_needed(out_.effects[i].id) && exchanged(i)) climb();
  }

  /// The effect that was accepted first may have taken the place of two, and what came after it fits around
  /// it: no exchange of one for one finds them. Where a large misfit is left, the search begins once more
  /// with each of the others that held-out groups confirmed in the first step, and the answer is taken that
  /// explains all groups the better with as many parameters, or no worse with fewer.
  void begin_otherwise() {
    const auto openings = std::move(openings_);
    for (const Rival& opening : openings) {
      if (!(left(out_.final_test) > kFarOff)) return;
      try_instead(opening.answer, opening.shown_from, [&](const EffectSearch& first) {
        climb();
        exchange();
        backward();
        const std::size_t has = out_.final.shared.size(), had = first.final.shared.size();
        return has <= had && leaves_less(first, has < had ? 1 : kBetter);
      });
    }
  }

  /// A shape that was told from its range's border when its effect was accepted may be open once others
  /// stand beside it: the effect is another one then. It makes room for what the search finds in its place,
  /// unless that explains the groups worse by a tenth.
  void leave_no_shape_open() {
    for (std::size_t i = out_.effects.size(); i-- > 0;) {
      const std::string id = out_.effects[i].id;
      if (!shape_is_open(out_.final, id) || is_needed(id)) continue;
      auto less = without(i);
      if (!less) continue;
      try_instead(*less, shown_from_, [&](const EffectSearch& first) {
        climb();
        return leaves_less(first, 1 / kBetter);
      });
    }
  }

  void backward() {
    for (bool removed = true; removed && out_.effects.size() > 1;) {
      removed = false;
      for (std::size_t i = 0; i < out_.effects.size() && !removed; ++i) {
        const std::string id = out_.effects[i].id;
        if (is_needed(id)) continue;
        if (wald_of(out_.final, id).p_value(out_.final) < kept_at_) continue;
        auto less = without(i);
        if (!less) continue;
        out_ = std::move(*less);
        removed = true;
      }
    }
  }

  /// Values, other names and how they hold up in halves of the groups.
  void describe() {
    if (out_.effects.empty()) return;
    const auto f = grouped_footprints(problem_, out_.final, inactive(), options_.fit);
    for (std::size_t i = 0; i < out_.effects.size(); ++i) {
      AcceptedEffect& accepted = out_.effects[i];
      const Wald wald = wald_of(out_.final, accepted.id);
      accepted.p_value = wald.p_value(out_.final);
      accepted.delta_bic = wald.delta_bic(out_.final);
      VectorXd contribution = VectorXd::Zero(static_cast<Index>(f.total.fitted));
      for (std::size_t k = 0; k < out_.final.shared.size(); ++k) {
        const auto& p = out_.final.shared[k];
        if (p.effect != accepted.id) continue;
        const double value = out_.final.values[static_cast<Index>(k)];
        accepted.parameters.push_back({p.short_name, p.unit, value, out_.final.sigma(k)});
        if (!p.shape) contribution[static_cast<Index>(k)] = value - p.neutral;
      }
      for (const Candidate& candidate : f.total.candidates) {
        const auto shown = shown_from_.find(candidate.id);
        if (shown == shown_from_.end() || shown->second > i) continue;  // it needs what was found later
        if (!problem_.may_act(candidate.id, accepted_without(accepted.id))) continue;
        const Candidate own = unspoken(f.total, accepted.id, candidate);
        if (own.columns.empty()) continue;
        const double r = correlation(f.total, contribution, own);
        if (r < options_.equivalent) continue;
        accepted.add_other_name(candidate.id, r);
      }
    }
    halves(f);
  }

 private:
  /// A candidate to first order: the χ² that it would take away, at which sizes, and Wald's p-value of them.
  struct Scored {
    std::size_t candidate;
    double gain, p;
    std::vector<double> step;
  };

  /// The candidates that some channel shows, largest gain first; takes them into the ranking.
  std::vector<Scored> first_order(const GroupedFootprints& f) {
    std::vector<Scored> out;
    for (auto& s : scores(f.total)) {
      const Candidate& c = f.total.candidates[s.candidate];
      if (!s.visible) {  // nothing for it to act through yet: a wind before there is a drag
        if (Ranked& r = entry_of(out_.ranking, c.id); r.gain < 0) r.gain = 0, r.visible = false;
        continue;
      }
      shown_from_.try_emplace(c.id, out_.effects.size());
      Scored one{s.candidate, s.gain, 1, std::move(s.step)};
      judge(f, c, one);
      Ranked& r = entry_of(out_.ranking, c.id);
      if (one.gain > r.gain) {
        r.gain = one.gain, r.p_value = one.p, r.visible = true;
        r.step = this_step();
      }
      out.push_back(std::move(one));
    }
    std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) { return a.gain > b.gain; });
    return out;
  }

  /// Its p-value, by the scatter between groups; one that wants to where there are no values gains nothing.
  void judge(const GroupedFootprints& f, const Candidate& c, Scored& one) const {
    std::vector<std::size_t> inside;  // parameters that do not want to where there are none
    std::vector<int> sides;
    for (std::size_t j = 0; j < c.columns.size(); ++j)
      if (c.sides[j] == 0 || one.step[j] != 0) inside.push_back(c.columns[j]), sides.push_back(c.sides[j]);
    if (inside.empty()) return;
    auto columns = indices(all_of(f.total.fitted));
    const auto own = indices(inside);
    columns.insert(columns.end(), own.begin(), own.end());
    const LinearStep step = linear_step(f.parts, all_of(f.parts.size()), columns);
    const auto p = static_cast<Index>(own.size());
    const VectorXd x = step.value.tail(p);
    const MatrixXd covariance = step.covariance.bottomRightCorner(p, p);
    one.p = wald_of(x, covariance).p_value(out_.final);
    for (Index j = 0; j < p; ++j)
      if (sides[static_cast<std::size_t>(j)] * x[j] < 0) one.gain = 0, one.p = 1;
  }

  /// Into the ranking: how like the footprint of the best candidate the others' are.
  void compare_with_best(const Footprints& f, const std::vector<Scored>& scored) {
    const Scored& best = scored.front();
    for (const Scored& s : scored) {
      const Candidate& c = f.candidates[s.candidate];
      Ranked& r = entry_of(out_.ranking, c.id);
      if (r.gain == s.gain && best.gain > 0)
        r.correlation_with_best = between(f, f.candidates[best.candidate], best.step, c);
    }
  }

  /// At most `refits` that may be evident at `level`: of candidates with the same footprint, the one that the
  /// catalogue lists first.
  std::vector<Scored> leaders(const Footprints& f, const std::vector<Scored>& scored, double level,
                              int refits) const {
    std::vector<Scored> out;
    for (const Scored& s : scored) {
      if (!(s.p < 10 * level) || !(s.gain > 0)) continue;  // the full fit decides; this is to first order
      const Candidate& c = f.candidates[s.candidate];
      const auto same = std::find_if(out.begin(), out.end(), [&](const Scored& leader) {
        const Candidate& l = f.candidates[leader.candidate];
        return l.id == c.id || !(between(f, l, leader.step, c) < kSame);
      });
      if (same == out.end()) {
        if (static_cast<int>(out.size()) < refits) out.push_back(s);
      } else if (order_of(c.id) < order_of(f.candidates[same->candidate].id) && s.gain > 0.9 * same->gain) {
        *same = s;
      }
    }
    return out;
  }

  /// Of `effects`, those that no channel shows yet.
  std::vector<dynamics::Effect> silent(const Footprints& f,
                                       const std::vector<dynamics::Effect>& effects) const {
    const auto ids = silent_ids(f);
    std::vector<dynamics::Effect> out;
    for (const auto& effect : effects)
      if (std::find(ids.begin(), ids.end(), effect.id) != ids.end()) out.push_back(effect);
    return out;
  }

  /// Those that a fit in full finds evident on train groups, the most evident one first.
  std::vector<EffectTrial> evident(const Footprints& f, const std::vector<Scored>& leaders,
                                   const std::vector<dynamics::Effect>& effects, double level) {
    std::vector<EffectTrial> out;
    for (const Scored& s : leaders) {
      const Candidate& c = f.candidates[s.candidate];
      const auto effect =
          std::find_if(effects.begin(), effects.end(), [&](const auto& e) { return e.id == c.id; });
      const Eigen::Map<const VectorXd> step(s.step.data(), static_cast<Index>(s.step.size()));
      auto trial = try_effect(problem_, out_.final, out_.final_test, c, step, *effect, options_.fit);
      Ranked& r = entry_of(out_.ranking, c.id);
      r.refit_step = this_step(), r.delta_bic = trial.delta_bic, r.held_out_gain = trial.held.fall();
      if (!trial.fit.solved || !(trial.p < level) || shape_is_open(trial.fit, c.id)) continue;
      if (is_pinned(trial.fit) || !problem_.may_be(trial.fit)) continue;
      out.push_back(std::move(trial));
    }
    std::sort(out.begin(), out.end(),
              [](const EffectTrial& a, const EffectTrial& b) { return a.delta_bic < b.delta_bic; });
    return out;
  }

  bool matters(const HeldOutFall& held) const { return held.share > options_.matters; }
  bool is_confirmed(const HeldOutFall& held) const { return matters(held) && held.p < 0.05; }

  /// The most evident one that held-out groups confirm, unless another one that they confirm, with at least
  /// half its evidence, explains them better by a tenth and the train groups no worse. Kept as its rivals are
  /// others as evident, and those through which others act that no channel shows yet. False if there is none.
  bool accept_best(const std::vector<EffectTrial>& trials, const std::vector<dynamics::Effect>& silent) {
    auto best = trials.end();
    double most = 0;  // evidence
    for (auto trial = trials.begin(); trial != trials.end(); ++trial) {
      if (!is_confirmed(trial->held)) continue;
      if (best == trials.end())
        best = trial, most = trial->delta_bic;
      else if (trial->delta_bic < kComparable * most && trial->held.is < kBetter * best->held.is &&
               left(trial->fit) <= left(best->fit))
        best = trial;
    }
    for (auto trial = trials.begin(); trial != trials.end(); ++trial) {
      if (trial == best) continue;
      const bool alike =
          best != trials.end() && matters(trial->held) && trial->delta_bic < best->delta_bic + kAlike;
      const auto opens =
          left(trial->test) > kMisfit ? shown_beside(*trial, silent) : std::vector<std::string>{};
      if (alike) rivals_.push_back(rival_with(*trial, {}));
      if (out_.effects.empty() && is_confirmed(trial->held)) openings_.push_back(rival_with(*trial, {}));
      if (!opens.empty()) rivals_.push_back(rival_with(*trial, opens));
    }
    if (best == trials.end()) return false;
    accept(*best, out_);
    return true;
  }

  /// The answer without accepted effect i; nothing where that has no fit.
  std::optional<EffectSearch> without(std::size_t i) const {
    EffectSearch less = out_;
    less.effects.erase(less.effects.begin() + static_cast<std::ptrdiff_t>(i));
    less.final = fit_without(problem_, out_.final, out_.effects[i].id, options_.fit);
    if (!less.final.solved) return {};
    less.final_test = fit_own(problem_, Split::test, less.final, options_.fit, &out_.final_test);
    if (!less.final_test.solved) return {};
    return less;
  }

  /// Whether accepted effect i was exchanged for another one; the new one is the last.
  bool exchanged(std::size_t i) {
    const std::string id = out_.effects[i].id;
    auto less = without(i);
    if (!less) return false;
    return try_instead(*less, shown_from_, [&](const EffectSearch& first) {
      auto effects = inactive();
      std::erase_if(effects, [&](const auto& e) { return e.id == id; });
      const auto f = grouped_footprints(problem_, out_.final, effects, options_.fit);
      const auto scored = first_order(f);
      // To first order; where less than a third of what goes with the old one comes back, no fit will tell
      // more.
      const double lost = out_.final.chi2 - first.final.chi2;
      if (scored.empty() || !(scored.front().gain > 0 && kPromised * scored.front().gain > lost))
        return false;
      const auto trials = evident(f.total, {scored.front()}, effects,
                                  options_.family_wise_level / static_cast<double>(scored.size()));
      if (trials.empty() || !is_confirmed(trials.front().held)) return false;
      accept(trials.front(), out_);
      return leaves_less(first, kBetter);
    });
  }

  /// Puts another answer in the place of the present one; `stands` searches on from it and says, given the
  /// former answer, whether it stays. Else the former one is restored.
  template <typename Stands>
  bool try_instead(EffectSearch answer, std::map<std::string, std::size_t> shown_from, const Stands& stands) {
    EffectSearch first = std::exchange(out_, std::move(answer));
    std::swap(shown_from_, shown_from);
    if (stands(std::as_const(first))) return true;
    out_ = std::move(first);
    shown_from_ = std::move(shown_from);
    return false;
  }

  /// Whether all groups, held out or not, have less than `times` of the misfit that the former answer left.
  bool leaves_less(const EffectSearch& former, double times) const {
    return left(out_.final_test) < times * left(former.final_test) &&
           left(out_.final) < times * left(former.final);
  }

  /// An answer with another effect in the place of the accepted one. `opens`: ids of effects that act through
  /// it, of which one has to be found beside it; the held-out groups need not have shown it alone.
  struct Rival {
    EffectSearch answer;
    std::map<std::string, std::size_t> shown_from;
    std::vector<std::string> opens;
    GroupedFit before, before_test;  ///< without it
  };
  Rival rival_with(const EffectTrial& trial, const std::vector<std::string>& opens) const {
    Rival out{out_, shown_from_, opens, out_.final, out_.final_test};
    accept(trial, out.answer);
    return out;
  }

  /// The ids of those of `silent` that a channel shows once the trial's effect is there. Few groups tell:
  /// nothing acts through most effects, and the derivatives by what is silent are then zero in all groups.
  std::vector<std::string> shown_beside(const EffectTrial& trial,
                                        const std::vector<dynamics::Effect>& silent) const {
    std::vector<std::string> out;
    if (silent.empty()) return out;
    const auto f = grouped_footprints(problem_, asked_of_few(problem_, trial.fit), silent, options_.fit);
    const auto still = silent_ids(f.total);
    for (const auto& effect : silent)
      if (std::find(still.begin(), still.end(), effect.id) == still.end()) out.push_back(effect.id);
    return out;
  }

  bool is_accepted(const std::string& id) const {
    return std::any_of(out_.effects.begin(), out_.effects.end(), [&](const auto& e) { return e.id == id; });
  }

  /// From the answer of a rival on: one that acts through its last effect, whether held-out groups confirm
  /// the two together, and what else there is.
  bool opened(const Rival& rival) {
    const std::string id = out_.effects.back().id;
    if (!forward(options_.refits, rival.opens)) return false;
    const HeldOutFall both =
        held_out_fall(problem_, rival.before, rival.before_test, out_.final, out_.final_test);
    if (!is_confirmed(both) || !(wald_of(out_.final, id).p_value(out_.final) < kept_at_)) return false;
    AcceptedEffect& first = out_.effects[out_.effects.size() - 2];
    first.test_error_ratio = std::sqrt(both.is / both.was);
    first.why = fmt::format("with {} chi2 per sample falls from {:.4g} to {:.4g} (p {:.1g})",
                            out_.effects.back().id, both.was, both.is, both.p);
    climb();
    return true;
  }

  /// From the answer of a rival on, by what it makes room for; it stands without.
  bool climbed_from_one() {
    if (forward(1)) climb();
    return true;
  }
  void climb() {
    while (static_cast<int>(out_.effects.size()) < options_.most_effects && forward(options_.refits)) {
    }
  }
  int this_step() const { return 1 + static_cast<int>(out_.effects.size()); }
  std::size_t order_of(const std::string& id) const {
    for (std::size_t k = 0; k < catalogue_.size(); ++k)
      if (catalogue_[k].id == id) return k;
    return catalogue_.size();
  }
  /// A candidate without the parameters of which what the other accepted effects do leaves (almost) nothing:
  /// a wind along the vertical beside a scale. What is left of those is rounding, which is like anything.
  /// Without any, where that holds of all of them together.
  Candidate unspoken(const Footprints& f, const std::string& accepted, const Candidate& candidate) const {
    constexpr double kNothing = 1e-2;
    std::vector<Index> others;
    for (std::size_t k = 0; k < f.fitted; ++k)
      if (out_.final.shared[k].effect != accepted) others.push_back(static_cast<Index>(k));
    if (others.empty()) return candidate;
    const auto own = indices(candidate.columns);
    const VectorXd whole = f.gram(own, own).diagonal(),
                   rest = whole -
                          congruent(MatrixXd(f.gram(own, others)), pseudo_inverse(f.gram(others, others)))
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
  std::vector<dynamics::Effect> inactive() const {
    std::vector<dynamics::Effect> out;
    for (const auto& effect : catalogue_)
      if (std::none_of(out_.effects.begin(), out_.effects.end(),
                       [&](const auto& e) { return e.id == effect.id; }) &&
          problem_.may_act(effect.id, accepted_without({})))
        out.push_back(effect);
    return out;
  }
  std::vector<std::string> accepted_without(const std::string& id) const {
    std::vector<std::string> out;
    for (const auto& effect : out_.effects)
      if (effect.id != id) out.push_back(effect.id);
    return out;
  }
  /// Whether another accepted effect is nothing without this one.
  bool is_needed(const std::string& id) const {
    const auto others = accepted_without(id);
    return std::any_of(others.begin(), others.end(),
                       [&](const std::string& other) { return !problem_.may_act(other, others); });
  }
  /// Into the answer: what the sizes would be by the groups below and above the middle of each covariate.
  void halves(const GroupedFootprints& f) {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < out_.final.groups.size(); ++i)
      if (out_.final.groups[i].used && out_.final.groups[i].solved) used.push_back(i);
    const std::vector<Index> columns = indices(all_of(f.total.fitted));
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
      const LinearStep a = linear_step(f.parts, low, columns), b = linear_step(f.parts, high, columns);
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
  std::map<std::string, std::size_t> shown_from_;  ///< after how many effects one first had a footprint
  double kept_at_{};             ///< the loosest level of any step: what was accepted at it is kept at it
  std::vector<Rival> rivals_;    ///< of what was accepted
  std::vector<Rival> openings_;  ///< of what was accepted first, with less evidence
};

std::string why_not(const GroupedProblem& problem, Split split) {
  const char* name = split == Split::test ? "test" : "train";
  for (const auto& group : problem.groups())
    if (group.split == split) return fmt::format("no throw of split '{}' could be fitted", name);
  return fmt::format(
      "no throw has the split '{}', of {}: effects are found on train, and judged on test. Where a log "
      "declares none, every fifth is held out, condition by condition: record five or more, or declare the "
      "split in the log",
      name, problem.groups().size());
}

}  // namespace

EffectSearch search_effects(const GroupedProblem& problem, const EffectSearchOptions& options) {
  EffectSearch out;
  out.base = fit_groups(problem, Split::train, {}, VectorXd(), options.fit);
  out.base_test = fit_own(problem, Split::test, out.base, options.fit);
  if (!out.base.solved || !out.base_test.solved) {
    out.message = why_not(problem, out.base.solved ? Split::test : Split::train);
    return out;
  }
  out.solved = true;
  out.final = out.base;
  out.final_test = out.base_test;
  Search search(problem, options, out);
  search.follow();
  search.exchange();
  search.backward();
  search.begin_otherwise();
  search.leave_no_shape_open();
  search.describe();
  std::sort(out.ranking.begin(), out.ranking.end(),
            [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  return out;
}

}  // namespace unhand::fitting
