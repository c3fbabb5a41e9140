#include "fitting/discovery/asked_form.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/traces.hpp"
#include "fitting/discovery/where_acts.hpp"

namespace unhand::fitting {

namespace {

/// Whether an accepted effect bends what is seen of flights, wherever it was seen most: a gravity that is
/// tilted acts in the hand as well.
bool bends_flights(const AcceptedEffect& effect) {
  if (effect.id.starts_with("flight.")) return true;
  return in_air(effect.phase) && !is_law(effect.id) && !acts_on_pads(effect.id);
}

/// Whether something is left in the tracked flights of both halves.
bool leaves_flights(const Stage& stage, const DiscoverOptions& options) {
  return std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const ChannelMisfit& m) {
    return m.phase == Phase::flight && is_left(m, options) && is_confirmed(stage.held_out.misfit, m);
  });
}

double beyond_noise(const Rest& rest) { return rest.chi2 - static_cast<double>(rest.degrees_of_freedom); }

/// How much likelier the form makes the flights of one half, 2 log of the likelihoods' ratio, in units of the
/// scatter that the effects leave.
double likelier(const Rest& by_effects, const Rest& by_form) {
  const double n = static_cast<double>(std::max(1L, by_effects.degrees_of_freedom));
  return (by_effects.chi2 - by_form.chi2) / std::max(1.0, by_effects.chi2 / n);
}

/// The unknowns of some effects in a fit.
std::size_t unknowns_of(const FitResult& fit, const std::vector<std::string>& ids) {
  return static_cast<std::size_t>(std::count_if(fit.campaign.begin(), fit.campaign.end(), [&](const auto& u) {
    return std::any_of(ids.begin(), ids.end(),
                       [&](const std::string& id) { return u.unknown.name.starts_with(id + "."); });
  }));
}

Rest left_by(const MissingCandidate& by, const PhaseTraces& in) { return rest_around(in.all, by, in.how); }

/// Tracked flights as some accepted effects leave them, and as they are without these.
class Flights {
 public:
  Flights(const Stage& stage, const Stage& less, const DiscoverOptions& options)
      : train_(traces(less, less.fit, options)),
        held_out_(traces(less, less.held_out, options)),
        effects_(left_by({}, traces(stage, stage.fit, options))),
        effects_held_out_(left_by({}, traces(stage, stage.held_out, options))),
        misfit_(leaves_flights(stage, options)) {}

  /// Of the train throws, without the effects.
  const PhaseTraces& train() const { return train_; }
  /// What the effects leave there.
  const Rest& effects() const { return effects_; }

  /// Whether a form, of so many unknowns more, describes them better than the effects.
  bool outdone_by(const MissingCandidate& by, double more) const {
    const Rest form = left_by(by, train_), form_held_out = left_by(by, held_out_);
    const double bic = more * std::log(static_cast<double>(std::max(2L, form.degrees_of_freedom))) -
                       likelier(effects_, form);
    if (!(bic <= kDeltaBic) || !(likelier(effects_held_out_, form_held_out) > 2 * std::log(kTimesAsLikely)))
      return false;
    // Beside a misfit that a form lowers by little, the effects may be true, and something acts beside them.
    const auto halves = [](const Rest& by_form, const Rest& by_effects) {
      return beyond_noise(by_form) < kOutdone * beyond_noise(by_effects);
    };
    return !misfit_ || (halves(form, effects_) && halves(form_held_out, effects_held_out_));
  }

 private:
  static PhaseTraces traces(const Stage& of, const FitResult& half, const DiscoverOptions& options) {
    return traces_of(of.problem, half, Phase::flight, options.fit.threads);
  }
  PhaseTraces train_, held_out_;
  Rest effects_, effects_held_out_;
  bool misfit_;
};

/// The accepted effects of which `which` holds.
template <class Which>
std::vector<std::string> ids_of(const Discovery& so_far, const Which& which) {
  std::vector<std::string> out;
  for (const AcceptedEffect& effect : so_far.effects)
    if (which(effect)) out.push_back(effect.id);
  return out;
}

/// Accepted effects that give flights an acceleration which these do not have.
std::vector<std::string> without_need(const Stage& stage, const Discovery& so_far,
                                      const DiscoverOptions& options) {
  const auto bending = ids_of(so_far, [](const AcceptedEffect& effect) {
    return bends_flights(effect) ||
           (!is_law(effect.id) && find_effect(effect.id).form != dynamics::AccelerationForm::none);
  });
  if (bending.empty() || !leaves_flights(stage, options)) return {};
  const Stage& less = without(stage, bending, options);
  if (!less.solved() || !Flights(stage, less, options).outdone_by({}, 0)) return {};
  return bending;
}

}  // namespace

AskedForm form_asked_for(const Stage& stage, const Discovery& so_far, const DiscoverOptions& options) {
  AskedForm out;
  out.outdone = without_need(stage, so_far, options);
  const auto accepted = ids_of(so_far, bends_flights);
  if (accepted.empty() || !out.outdone.empty()) return out;
  const Stage& less = without(stage, accepted, options);
  if (!less.solved()) return out;
  const Flights flights(stage, less, options);
  const PhaseTraces& train = flights.train();
  const MissingCandidate candidate = missing_terms(train.all, train.how);
  // They may have no part in the flights, or these may lack no acceleration.
  const double lacked = beyond_noise(left_by({}, train));
  if (!(lacked > 0 && beyond_noise(left_by(candidate, train)) < kOutdone * lacked)) return out;
  std::vector<std::string> outdone = accepted;
  for (const MissingTerm& term : candidate.terms) {
    const auto is_its_own = [&](const std::string& id) {
      return term.form != dynamics::AccelerationForm::none && find_effect(id).form == term.form;
    };
    std::copy_if(accepted.begin(), accepted.end(), std::back_inserter(out.backed), is_its_own);
    out.unlisted |= std::none_of(accepted.begin(), accepted.end(), is_its_own);
    std::erase_if(outdone, is_its_own);
  }
  if (!(beyond_noise(flights.effects()) < kOutdone * lacked)) return out;
  const double more =
      static_cast<double>(candidate.coefficients()) - static_cast<double>(unknowns_of(stage.fit, accepted));
  if (!flights.outdone_by(candidate, more)) return out;
  out.outdone = std::move(outdone);
  out.words = candidate.in_words(train.names());
  return out;
}

}  // namespace unhand::fitting
