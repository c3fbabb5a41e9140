// One step forward of the loop: which candidate explains most, and whether that convinces.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "contact/registry.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/pads_give.hpp"
#include "fitting/discovery/selection.hpp"
#include "fitting/discovery/wald.hpp"
#include "fitting/discovery/where_acts.hpp"
#include "fitting/distributions.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

namespace {

void rank(std::vector<Ranked>& ranking, int step, const Footprints& f, const std::vector<Score>& all) {
  const auto last = static_cast<Eigen::Index>(f.residual());
  const Score* best = nullptr;
  for (const auto& s : all)
    if (!best || s.gain > best->gain) best = &s;
  for (const auto& s : all) {
    const Candidate& c = f.candidates[s.candidate];
    auto found = std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == c.id; });
    if (found == ranking.end()) found = ranking.insert(ranking.end(), Ranked{c.id, -1});
    if (s.gain <= found->gain) continue;
    found->gain = s.gain;
    found->step = step;
    found->visible = s.visible;
    // What the best candidate leaves sets the scale of what is not noise.
    const double scale = std::max(1.0, (f.gram(last, last) - best->gain) / std::max(1.0, f.samples));
    const auto bounded = std::count_if(c.sides.begin(), c.sides.end(), [](int side) { return side != 0; });
    const auto grid = std::count_if(f.candidates.begin(), f.candidates.end(),
                                    [&](const Candidate& other) { return other.id == c.id; });
    found->p_value = std::min(
        1.0, static_cast<double>(grid) *
                 chi_bar_tail(s.gain / scale, static_cast<int>(c.sides.size()) - static_cast<int>(bounded),
                              static_cast<int>(bounded)));
    found->correlation_with_best = between(f, f.candidates[best->candidate], best->step, c);
  }
  std::sort(ranking.begin(), ranking.end(), [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
}

Ranked& named(std::vector<Ranked>& ranking, const std::string& id) {
  return *std::find_if(ranking.begin(), ranking.end(), [&](const Ranked& r) { return r.id == id; });
}

/// The p-value if the fit's covariance were known.
double wald_as_known(FitResult fit, const dynamics::Effect& effect) {
  for (auto& u : fit.campaign) u.degrees_of_freedom = kCertain;
  return wald_p_value(fit, effect);
}

/// Whether Wald's test rejects an effect's absence: at the level shared among the candidates if the
/// covariance were known, and at the level itself as far as it is. Three degrees of freedom reach no shared
/// level below twenty sigma; there Bayes' criterion and the held-out throws answer for how many are tried.
bool is_significant(const FitResult& fit, const dynamics::Effect& effect, double p_value, double level,
                    double candidates) {
  return p_value <= level && wald_as_known(fit, effect) <= level / candidates;
}

/// Of a candidate's shapes the one with the largest gain; null where it is none.
const Score* best_score_of(const Footprints& f, const std::vector<Score>& all, const std::string& id) {
  const Score* out = nullptr;
  for (const Score& score : all)
    if (f.candidates[score.candidate].id == id && (!out || score.gain > out->gain)) out = &score;
  return out;
}

/// A stage with an effect, and with another one beside it that acts through it.
struct OpenedPair {
  Stage first, both;
};

/// Fits both to either half of the throws; nothing where one has no answer there.
std::optional<OpenedPair> fit_pair(const Stage& stage, const Candidate& through, const Score& score,
                                   const std::string& id, const DiscoverOptions& options) {
  OpenedPair out{extended(stage, through, score, false, options), {stage.problem, {}, {}, {}}};
  if (!out.first.is_fitted() || !solve_held_out(out.first, options)) return std::nullopt;
  const Footprints f = footprints(out.first.problem, out.first.fit, {id}, {}, options.fit.threads);
  const std::vector<Score> all = scores(f);
  const Score* beside = best_score_of(f, all, id);
  if (!beside || !beside->visible) return std::nullopt;
  out.both = extended(out.first, f.candidates[beside->candidate], *beside, false, options);
  if (!out.both.is_fitted() || !solve_held_out(out.both, options)) return std::nullopt;
  return out;
}

/// A refit of one candidate against the stage that it would extend, with evidence on the train throws.
struct TriedEffect {
  const Score* score{};
  Stage next;
  double delta_bic{};
  Improvement held_out;
};

bool is_likelier(const TriedEffect& one, const TriedEffect& other) {
  return one.next.bic() < other.next.bic();
}

class ForwardStep {
 public:
  ForwardStep(const Stage& stage, const DiscoverOptions& options, Discovery& out)
      : stage_(stage),
        options_(options),
        out_(out),
        f_(footprints_of(stage, options)),
        all_(scores(f_)),
        noise_(!leaves_misfit(stage, options)) {}

  std::optional<Stage> run() {
    if (all_.empty()) return std::nullopt;
    if (out_.ranking.empty()) out_.silent = silent_ids(f_);
    rank(out_.ranking, this_step(), f_, all_);
    std::sort(all_.begin(), all_.end(), [](const Score& a, const Score& b) { return a.gain > b.gain; });
    for (const Score& score : all_)
      if (static_cast<int>(tried_.size()) < options_.refits && score.gain >= kImitation * all_.front().gain)
        consider(score);
    // Rigid pads that fit badly in the grasp are bent so far that their give's footprint may be lost among
    // the others; and a law whose pads cannot give hides what they do there.
    const bool off = grasp_is_off();
    for (const Score& score : all_)
      if (off && id_of(score) == kPads) consider(score);
    // Laws are alternatives to each other: where one convinces, all are tried. And where nothing convinced,
    // another law may still be the better one.
    if (!best() || is_law(id_of(*best()->score)) ||
        (off && !contact::can_give(stage_.problem.options().model)))
      for (const Score& score : all_)
        if (is_law(id_of(score))) consider(score);
    // A law has no size that could be told from none, and half a per cent of the held-out misfit is enough
    // for it: it is no answer where an effect is likelier that was not sure enough, or too small to matter.
    std::sort(small_.begin(), small_.end(), is_likelier);
    if (best() && is_law(id_of(*best()->score))) {
      const bool refused_leads = refused_ && (small_.empty() || is_likelier(*refused_, small_.front()));
      if (refused_leads ? is_likelier(*refused_, *best())
                        : !small_.empty() && is_likelier(small_.front(), *best())) {
        convincing_.clear();  // predictions decide
        if (refused_leads && solve_held_out(refused_->next, options_))
          small_.insert(small_.begin(), std::move(*refused_));
      }
    }
    refit_rivals();
    if (auto opened = open_pair(best() ? best()->next : stage_)) return opened;
    if (TriedEffect* found = best()) {
      const WithCriterion rivals = with_criterion(convincing_);
      const std::string why = found->held_out.where;
      return accept(std::move(*found), why, rivals);
    }
    return weigh_small();
  }

 private:
  using WithCriterion = std::vector<std::pair<const Score*, double>>;  // Bayes' criterion of the refit

  static WithCriterion with_criterion(std::span<const TriedEffect> tried) {
    WithCriterion out;
    for (const TriedEffect& one : tried) out.emplace_back(one.score, one.next.bic());
    return out;
  }

  int this_step() const { return 1 + static_cast<int>(out_.effects.size()); }
  const std::string& id_of(const Score& score) const { return f_.candidates[score.candidate].id; }
  double between_footprints(const Score& a, const Score& b) const {
    return between(f_, f_.candidates[a.candidate], a.step, f_.candidates[b.candidate]);
  }

  /// The likeliest of those that matter to a channel, or null.
  TriedEffect* best() {
    const auto found = std::min_element(convincing_.begin(), convincing_.end(), is_likelier);
    return found == convincing_.end() ? nullptr : &*found;
  }

  /// What explains nearly as much as the best one may have ended in another minimum of what all share (the
  /// friction, the pads' give), to which the base was bent: once more from where the best one ended.
  void refit_rivals() {
    constexpr double kNearly = 0.9;  // of its evidence
    const TriedEffect* leader = best();
    if (!leader || is_law(id_of(*leader->score))) return;
    const FitResult& led = leader->next.fit;
    for (TriedEffect& rival : convincing_) {
      if (&rival == leader || is_law(id_of(*rival.score))) continue;
      if (!(rival.delta_bic <= kNearly * leader->delta_bic)) continue;
      const CampaignProblem& problem = rival.next.problem;
      std::vector<double> start = carried(led, problem);
      for (std::size_t k = 0; k < start.size(); ++k)
        if (problem.campaign()[k].name.starts_with(id_of(*rival.score) + "."))
          start[k] = rival.next.fit.campaign[k].value;
      Stage again{problem, {}, {}, rival.next.ids};
      if (!solve_train(again, options_, std::move(start)) ||
          !(again.bic() - rival.next.bic() <= kLikelierBic))
        continue;
      if (!solve_held_out(again, options_)) continue;
      rival.next = std::move(again);
      rival.delta_bic = rival.next.bic() - stage_.bic();
      rival.held_out = improvement(stage_, rival.next, out_.before.held_out, options_);
      named(out_.ranking, id_of(*rival.score)).delta_bic = rival.delta_bic;
    }
  }

  /// Under the base model: it is no other name for anything.
  bool is_silent(const std::string& id) const {
    return std::find(out_.silent.begin(), out_.silent.end(), id) != out_.silent.end();
  }

  /// Acts through what is neither declared nor in the model: a wind where no drag is.
  bool acts_through_nothing(const std::string& id) const {
    if (is_law(id) || !is_silent(id)) return false;
    const std::string through = find_effect(id).acts_through;
    const auto& in_model = stage_.problem.options().effects;
    return !through.empty() && std::find(in_model.begin(), in_model.end(), through) == in_model.end();
  }

  /// Where most of what `so_far`, the best of this step, leaves is in flights: what another effect acts
  /// through (a drag, for a wind), if both together explain more. The other one follows in the next step.
  std::optional<Stage> open_pair(const Stage& so_far) {
    double in_flights = 0, elsewhere = 0;
    for (const ChannelMisfit& m : so_far.fit.misfit)
      if (is_misfit(m, options_)) (in_air(m.phase) ? in_flights : elsewhere) += m.chi2 - m.n;
    if (!(in_flights > elsewhere)) return std::nullopt;
    for (const std::string& id : out_.silent) {
      if (!acts_through_nothing(id)) continue;
      const Score* through = best_score_of(f_, all_, find_effect(id).acts_through);
      if (!through || !through->visible) continue;
      auto pair = fit_pair(stage_, f_.candidates[through->candidate], *through, id, options_);
      const auto tried = static_cast<double>(f_.candidates.size());
      if (!pair || !(pair->both.bic() - so_far.bic() <= kDeltaBic)) continue;
      if (!are_told(pair->both, {id, id_of(*through)}, tried * tried)) continue;
      const Improvement gain = improvement(stage_, pair->both, out_.before.held_out, options_);
      if (!(gain.matters >= 1)) continue;
      TriedEffect first{through, std::move(pair->first), 0, gain};
      first.delta_bic = first.next.bic() - stage_.bic();
      Ranked& ranked = named(out_.ranking, id_of(*through));
      ranked.refit_step = this_step(), ranked.delta_bic = first.delta_bic, ranked.held_out_gain = gain.fall;
      return accept(std::move(first), fmt::format("{}, together with {}", gain.where, id), {});
    }
    return std::nullopt;
  }

  bool are_told(const Stage& stage, const std::vector<std::string>& ids, double tried) const {
    return std::all_of(ids.begin(), ids.end(), [&](const std::string& id) {
      const dynamics::Effect effect = find_effect(id);
      return is_significant(stage.fit, effect, wald_p_value(stage.fit, effect), options_.family_wise_level,
                            tried);
    });
  }

  bool in_reach(const Score& score) const {
    const auto columns = static_cast<double>(f_.candidates[score.candidate].columns.size());
    return !noise_ || kFirstOrder * score.gain >= columns * std::log(f_.samples) - kDeltaBic;
  }

  std::optional<TriedEffect> try_out(const Score& score) {
    const Candidate& candidate = f_.candidates[score.candidate];
    const bool leads = &score == &all_.front() || candidate.id == kPads;
    TriedEffect trial{&score, extended(stage_, candidate, score, leads, options_), 0, {}};
    Ranked& ranked = named(out_.ranking, candidate.id);
    if (!trial.next.is_fitted()) {
      if (!ranked.refit_step) ranked.fate = Fate::no_fit;
      return std::nullopt;
    }
    trial.delta_bic = trial.next.bic() - stage_.bic();
    const bool law = is_law(candidate.id);
    ranked.refit_step = this_step();
    ranked.delta_bic = trial.delta_bic;
    ranked.held_out_gain.reset();
    ranked.fate = Fate::not_significant;
    if (!law) {
      const dynamics::Effect effect = find_effect(candidate.id);
      if (!is_significant(trial.next.fit, effect, wald_p_value(trial.next.fit, effect),
                          options_.family_wise_level, static_cast<double>(f_.candidates.size()))) {
        if (!refused_ || trial.next.bic() < refused_->next.bic()) refused_ = std::move(trial);
        return std::nullopt;
      }
    }
    if (!(trial.delta_bic <= kDeltaBic)) return std::nullopt;
    if (!solve_held_out(trial.next, options_)) {
      ranked.fate = Fate::no_fit;
      return std::nullopt;
    }
    trial.held_out =
        law ? law_improvement(stage_.held_out, trial.next.held_out, out_.before.held_out, options_)
            : improvement(stage_, trial.next, out_.before.held_out, options_);
    ranked.held_out_gain = trial.held_out.fall;
    return trial;
  }

  void consider(const Score& score) {
    if (!score.visible || acts_through_nothing(id_of(score)) || !in_reach(score) ||
        !tried_.insert(id_of(score)).second)
      return;
    auto trial = try_out(score);
    if (!trial) return;
    const bool law = is_law(id_of(score));
    const bool matters =
        trial->held_out.matters >= 1 || (law && trial->held_out.fall > 0 && has_left_base_law());
    named(out_.ranking, id_of(score)).fate = matters ? Fate::outdone : Fate::too_small;
    if (!matters && law) return;
    (matters ? convincing_ : small_).push_back(std::move(*trial));
  }

  /// The law that was asked about has gone already: of the others the likelier one stays.
  bool has_left_base_law() const { return stage_.problem.options().model != options_.campaign.model; }

  bool grasp_is_off() const {
    const auto& misfit = stage_.fit.misfit;
    return std::any_of(misfit.begin(), misfit.end(), [&](const ChannelMisfit& m) {
      return m.phase == Phase::grasped && is_misfit(m, options_);
    });
  }

  /// What matters to no channel may matter to one beside pads that give, which slow slips show more of; or to
  /// a prediction, where all of a throw's errors add up. Beside a misfit that stays, nobody knows whose
  /// errors those are. The likeliest of these is accepted; of several that matter to nothing, the likeliest
  /// is told.
  std::optional<Stage> weigh_small() {
    std::optional<SmallEffect> told;
    for (std::size_t k = 0; k < small_.size(); ++k) {
      TriedEffect& trial = small_[k];
      const WithCriterion rivals =
          with_criterion(std::span(small_).subspan(k));  // those before predict nothing
      if (auto beside = beside_give(trial, rivals)) return beside;
      const SmallEffect small =
          small_effect(stage_, trial.next, id_of(*trial.score), out_.before.held_out, options_);
      if (left_by_answer(trial.next, out_, options_).empty() && predicts_better(stage_, trial.next, options_))
        return accept(std::move(trial), predicted_in_words(small), rivals);
      if (!told) told = small;
    }
    if (told && (!out_.small || told->delta_bic < out_.small->delta_bic)) out_.small = told;
    return std::nullopt;
  }

  /// An effect on the pads with a give along that there is no evidence for without it, against that give
  /// alone.
  std::optional<Stage> beside_give(TriedEffect trial, const WithCriterion& rivals) {
    const std::string& id = id_of(*trial.score);
    if (gives_along(stage_) || !acts_on_pads(id)) return std::nullopt;
    fit_give_along(trial.next, options_);
    if (!gives_along(trial.next)) return std::nullopt;
    const Stage& less = without(trial.next, {id}, options_);
    if (!less.solved()) return std::nullopt;
    trial.held_out = improvement(less, trial.next, out_.before.held_out, options_);
    if (trial.held_out.matters < 1) return std::nullopt;
    const std::string why = trial.held_out.where;
    return accept(std::move(trial), why, rivals);
  }

  Stage accept(TriedEffect trial, const std::string& why, const WithCriterion& rivals) {
    AcceptedEffect accepted;
    accepted.id = id_of(*trial.score);
    accepted.delta_bic = trial.delta_bic;
    accepted.why = why;
    accepted.phase = trial.held_out.phase;
    if (is_law(accepted.id))
      for (const Score& score : all_)
        if (is_law(id_of(score)) && id_of(score) != accepted.id) {
          const double r = between_footprints(*trial.score, score);
          if (r >= options_.equivalent) accepted.equivalent.push_back({id_of(score), r});
        }
    for (const auto& [score, bic] : rivals)
      if (score != trial.score && !is_law(id_of(*score)) && !is_silent(id_of(*score)) &&
          bic < trial.next.bic() - kDeltaBic)
        accepted.add_other_name(id_of(*score), between_footprints(*trial.score, *score));
    const bool base_law = accepted.id == std::string(kLaw) + options_.campaign.model;  // no effect
    if (is_law(accepted.id)) {  // it takes the place of a former one
      for (const AcceptedEffect& former : out_.effects)
        if (is_law(former.id)) accepted.why = fmt::format("{} by {}; then {}", former.why, former.id, why);
      std::erase_if(out_.effects, [](const AcceptedEffect& e) { return is_law(e.id); });
      std::erase_if(trial.next.ids,
                    [&](const std::string& id) { return is_law(id) && (base_law || id != accepted.id); });
    }
    if (!base_law) out_.effects.push_back(std::move(accepted));
    return std::move(trial.next);
  }

  const Stage& stage_;
  const DiscoverOptions& options_;
  Discovery& out_;
  const Footprints& f_;
  std::vector<Score> all_;
  bool noise_;  // nothing but that is left
  std::set<std::string> tried_;
  std::vector<TriedEffect> convincing_, small_;  // what matters to a channel, and what does not
  std::optional<TriedEffect> refused_;  // the likeliest of those that are not told from none surely enough
};

}  // namespace

std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out) {
  return ForwardStep(stage, options, out).run();
}

}  // namespace unhand::fitting
