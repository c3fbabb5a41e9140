#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fitting/clock.hpp"
#include "fitting/slips/law_score.hpp"
#include "fitting/slips/level_dependence.hpp"
#include "fitting/slips/surface_discovery.hpp"
#include "fitting/slips/wrench_bias.hpp"

namespace unhand::fitting {
namespace {

constexpr double kNoNoise = std::numeric_limits<double>::quiet_NaN();  // is declared, to compare with

std::string id_of(SurfaceModel model) { return "contact.law:" + to_string(model); }

using Scores = std::vector<std::vector<SurfaceScore>>;  // by surface, then model; the base is the first

/// All laws on one set of wrenches, which of them is believed, and what there is to tell of that.
struct Choice {
  Scores scores;
  std::vector<LawScore> laws;
  std::size_t best{};  ///< of laws; 0 is the base
  std::vector<SurfaceEvidence> evidence;
  std::vector<Ranked> ranking;
  std::vector<std::pair<std::string, std::string>> skipped;
  int slips{};  ///< predicted
};

/// Every law of `models` beside the first one. Writes what was left out, and the evidence by surface.
std::vector<LawScore> score_laws(const std::vector<SlipSamples>& surfaces,
                                 const std::vector<SurfaceModel>& models, const Scores& scores, Choice& out) {
  std::vector<LawScore> laws(models.size());
  for (std::size_t k = 0; k < laws.size(); ++k) laws[k].model = models[k];
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const SurfaceScore& base = scores[i].front();
    for (const auto& score : scores[i])
      if (!score.scored())
        out.skipped.push_back({surfaces[i].surface + ", " + to_string(score.model), score.reason});
    if (!base.scored()) continue;
    out.slips += static_cast<int>(surfaces[i].slips.size());
    for (std::size_t k = 0; k < laws.size(); ++k)
      if (scores[i][k].scored()) out.evidence.push_back(laws[k].add(surfaces[i], base, scores[i][k]));
  }
  for (LawScore& law : laws) law.average();
  return laws;
}

/// The base over the surfaces on which model `k` was scored, too: what that model is to be held against.
LawScore base_beside(std::size_t k, const std::vector<SlipSamples>& surfaces, const Scores& scores) {
  LawScore base;
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    if (scores[i].front().scored() && scores[i][k].scored())
      base.model = scores[i].front().model, base.add(surfaces[i], scores[i].front(), scores[i].front());
  base.average();
  return base;
}

bool larger_gain(const Ranked& a, const Ranked& b) { return a.gain > b.gain; }

/// Which law is believed, the base (0) where none convinces. Writes the ranking.
std::size_t believed(const std::vector<LawScore>& laws, const SurfaceDiscoveryOptions& options,
                     std::vector<Ranked>& ranking) {
  const double rate = options.family_wise_level / std::max<double>(1, static_cast<double>(laws.size()) - 1);
  std::size_t best = 0;
  for (std::size_t k = 1; k < laws.size(); ++k) {
    const LawScore& law = laws[k];
    const double gain = law.base_error - law.error;
    Ranked r{id_of(law.model), std::max(0.0, law.gain.t() * law.gain.t())};
    r.p_value = law.gain.p(), r.refit_step = 1, r.held_out_gain = gain, r.delta_bic = law.gain.delta_bic();
    const bool significant = law.gain.p() < rate;
    const bool convinces = significant && gain > options.matters * law.base_error && gain > law.null_gain;
    r.fate = convinces ? Fate::outdone : significant ? Fate::too_small : Fate::not_significant;
    ranking.push_back(r);
    // Ellipsoids come first: a richer law has to be better by a twentieth.
    if (convinces &&
        (best == 0 || law.error / law.base_error < 0.95 * laws[best].error / laws[best].base_error))
      best = k;
  }
  std::sort(ranking.begin(), ranking.end(), larger_gain);
  for (auto& r : ranking) r.correlation_with_best = r.id == id_of(laws[best].model) ? 1 : 0;
  return best;
}

/// What a law does on data that the fitted ellipsoid made.
Evidence null_control(const LawScore& law) {
  const bool gains = law.null_gain > 0;
  return {id_of(law.model),
          fmt::format("Null control: on data simulated from the fitted {} with its own residuals as noise, "
                      "the same law {} {:.2f} degrees; {}",
                      to_string(SurfaceModel::ellipsoid), gains ? "gains" : "loses", std::abs(law.null_gain),
                      gains ? "that much of what it gains on the measurement may be due to noise alone"
                            : "what it gains on the measurement is not flexibility"),
          gains};
}

/// A wrench that is off by a constant, under one law, and what the same law does without it.
struct BiasTrial {
  WrenchBias whole;
  LawScore with, without;
  Ranked ranked{kWrenchBias};
  bool convinces{};
};

BiasTrial try_bias(const std::vector<SlipSamples>& surfaces, std::size_t k, const Scores& scores,
                   const SurfaceDiscoveryOptions& options) {
  BiasTrial out;
  std::vector<SlipSamples> scored;
  std::vector<const SurfaceScore*> plain;
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    if (scores[i].front().scored() && scores[i][k].scored())
      scored.push_back(surfaces[i]), plain.push_back(&scores[i][k]);
  const SurfaceModel model = scores.front()[k].model;
  out.with.model = out.without.model = model;
  out.whole = fit_wrench_bias(scored, model);
  if (!out.whole.solved) {
    out.ranked.fate = Fate::no_fit;
    return out;
  }
  out.ranked.fate = Fate::not_significant;
  out.ranked.p_value = out.whole.p_value;
  if (!(out.whole.p_value < options.family_wise_level)) return out;
  const auto biased = score_with_bias(scored, model, out.whole, options.comparison);
  if (biased.empty()) return out;
  for (std::size_t i = 0; i < scored.size(); ++i) {
    out.with.add(without_bias(scored[i], out.whole.value), *plain[i], biased[i]);
    out.without.add(scored[i], *plain[i], *plain[i]);
  }
  out.with.average(), out.without.average();
  const double gain = out.with.base_error - out.with.error;
  out.ranked.gain = std::max(0.0, out.with.gain.t() * out.with.gain.t());
  out.ranked.p_value = out.with.gain.p();
  out.ranked.held_out_gain = gain, out.ranked.delta_bic = out.with.gain.delta_bic();
  const bool significant = out.with.gain.p() < options.family_wise_level;
  const bool spoils_level = out.with.level > out.without.level;  // which the sensor's own zero would not
  out.convinces = significant && gain > options.matters * out.with.base_error && !spoils_level;
  if (significant) out.ranked.fate = out.convinces ? Fate::outdone : Fate::too_small;
  return out;
}

/// Writes that `law` is accepted, with what speaks for it and against it.
void accept_law(const LawScore& law, bool controlled, SurfaceDiscovery& out) {
  const std::string id = id_of(law.model);
  AcceptedEffect effect;
  effect.id = id;
  effect.p_value = law.gain.p();
  effect.delta_bic = law.gain.delta_bic();
  effect.test_error_ratio = law.error / law.base_error;
  effect.parameters.push_back({"gain", "deg", law.gain.mean(), law.gain.error(), law.gain.n - 1});
  effect.why = fmt::format(
      "mean angle between predicted and measured direction of sliding falls from {:.2f} to {:.2f} degrees, "
      "on {} of {} surfaces",
      law.base_error, law.error, law.better, law.compared);
  MeasuredDiscovery& answer = out.answer;
  answer.effects.push_back(std::move(effect));
  if (controlled) answer.evidence.push_back(null_control(law));
  answer.separating.push_back(
      {id,
       "a shape of the limit surface and a pressure that is not the same everywhere: pushes with the weight "
       "moved, or wrenches at a fixed normal force over all directions"});
  for (const auto& e : out.evidence)
    if (e.law == law.model && e.gain_deg < 2 * e.gain_sigma)
      answer.evidence.push_back(
          {id,
           fmt::format("On {} it gains only {:.2f} ± {:.2f} degrees", e.surface, e.gain_deg, e.gain_sigma),
           true});
}

/// Writes that friction depends on speed, or says what else the levels depend on.
void judge_levels(const LevelAnswer& levels, MeasuredDiscovery& answer) {
  if (!levels.found.empty() && !answer.first.any) answer.first = {true, 0, "level", kNoNoise};
  for (const LevelDependence& one : levels.found) {
    if (const std::string id = level_effect(one.by); !id.empty()) {
      AcceptedEffect effect;
      effect.id = id;
      effect.p_value = one.gain.p();
      effect.delta_bic = one.gain.delta_bic();
      effect.test_error_ratio = one.after / one.before;
      effect.parameters = one.parameters;
      effect.why = fmt::format(
          "the mean error of the level, of forces in units of the limit surface's, falls from {:.3g} to "
          "{:.3g}",
          one.before, one.after);
      answer.effects.push_back(std::move(effect));
      answer.separating.push_back({id, "the same pushes at other speeds"});
      continue;
    }
    const auto most = std::max_element(
        one.parameters.begin(), one.parameters.end(),
        [](const Parameter& a, const Parameter& b) { return std::abs(a.value) < std::abs(b.value); });
    if (most == one.parameters.end()) continue;
    const std::size_t bracket = most->name.find('[') + 1;
    const std::string surface = most->name.substr(bracket, most->name.size() - 1 - bracket);
    const std::string what =
        one.by == LevelBy::order
            ? fmt::format(
                  "forces change with the order of the slips in the log, by {:+.1f} ± {:.1f} % from the "
                  "first to the last of {}: wear, warming, or a sensor that drifts",
                  100 * most->value, 100 * most->sigma, surface)
            : fmt::format(
                  "forces are {:.1f} ± {:.1f} % larger one way than the other on {}, which they are on no "
                  "limit surface",
                  100 * most->value, 100 * most->sigma, surface);
    const std::string text =
        fmt::format("{} (mean error of the level {:.3g}, with it {:.3g})", what, one.before, one.after);
    if (answer.unexplained) {
      answer.unexplained->description += "; and " + text;
      continue;
    }
    answer.unexplained = MeasuredUnexplained{answer.phase, "level", kNoNoise, text};
  }
}

Choice choose_law(const std::vector<SlipSamples>& surfaces, const SurfaceDiscoveryOptions& options) {
  std::vector<SurfaceModel> models{options.base};
  for (const SurfaceModel model : surface_models)
    if (model != options.base && !options.is_forgotten(id_of(model))) models.push_back(model);
  Choice choice;
  choice.scores = compare_surfaces(surfaces, models, options.comparison);
  choice.laws = score_laws(surfaces, models, choice.scores, choice);
  choice.best = believed(choice.laws, options, choice.ranking);
  return choice;
}

/// Which law it is shows when the bias is gone: where that is another one, the bias beside it takes the place
/// of the one before if less is left.
Choice choose_again(const std::vector<SlipSamples>& surfaces, const Choice& measured,
                    const SurfaceDiscoveryOptions& options, BiasTrial& bias) {
  Choice unbiased = choose_law(without_bias(surfaces, bias.whole.value), options);
  if (unbiased.best == measured.best) return unbiased;
  const std::size_t law = unbiased.best;
  BiasTrial again = try_bias(surfaces, law, measured.scores, options);
  if (again.convinces && again.with.error < bias.with.error) {
    bias = std::move(again);
    unbiased = choose_law(without_bias(surfaces, bias.whole.value), options);
    unbiased.best = law;
  } else {
    unbiased.best = measured.best;
  }
  return unbiased;
}

/// Writes that the wrenches are off by a constant.
void accept_bias(const BiasTrial& bias, MeasuredDiscovery& answer) {
  AcceptedEffect effect;
  effect.id = kWrenchBias;
  effect.p_value = bias.with.gain.p();
  effect.delta_bic = bias.with.gain.delta_bic();
  effect.test_error_ratio = bias.with.error / bias.without.error;
  const char* names[] = {"fx", "fy", "tau"};
  for (Eigen::Index j = 0; j < 3; ++j) {
    const double variance = std::max(0.0, bias.whole.covariance(j, j));
    effect.parameters.push_back(
        {names[j], j < 2 ? "N" : "N m", bias.whole.value[j], std::sqrt(variance), bias.with.gain.n - 1});
  }
  effect.why = fmt::format(
      "a limit surface is symmetric, and without this constant the wrenches are, too: mean angle between "
      "predicted and measured direction of sliding falls from {:.2f} to {:.2f} degrees, on {} of {} surfaces",
      bias.without.error, bias.with.error, bias.with.better, bias.with.compared);
  answer.effects.push_back(std::move(effect));
  answer.separating.push_back({kWrenchBias, "what the sensor reads before and after it touches anything"});
}

/// Writes what the residuals of neighbouring wrenches have in common, under the base and under `law`.
void judge_residuals(const LawScore& law, const LawScore& base, double unexplained,
                     MeasuredDiscovery& answer) {
  const auto is_common = [&](const Paired& left) { return left.mean() > unexplained && left.t() > 3; };
  answer.evidence.push_back(
      {"",
       fmt::format("Residual directions of neighbouring wrenches of different slips correlate by {:.3f} ± "
                   "{:.3f} ({:.3f} ± {:.3f} before)",
                   law.left.mean(), law.left.error(), base.left.mean(), base.left.error()),
       is_common(law.left)});
  // A law or a bias that was accepted lowers the error of directions.
  answer.first = {is_common(base.left) || !answer.effects.empty(), 0, "direction", kNoNoise};
  if (is_common(law.left))
    answer.unexplained = MeasuredUnexplained{
        answer.phase, "direction", kNoNoise,
        fmt::format(
            "pushes that know nothing of each other err the same way where their wrenches are alike "
            "(correlation {:.2f} ± {:.2f}): the surface has features that the law has not (on three feet "
            "a limit surface has flat facets and edges, which no smooth law follows), or wrench and twist "
            "are not of one patch at one time: late, turned, about another point, on another scale",
            law.left.mean(), law.left.error()),
        law.left.mean()};
}

}  // namespace

SurfaceDiscovery discover_surfaces(const datasets::SlipLog& log, const SurfaceDiscoveryOptions& options) {
  datasets::validate(log);
  std::vector<SlipSamples> surfaces;
  for (const auto& [name, surface] : log.surfaces) surfaces.push_back(slip_samples(name, surface));
  return discover_surfaces(surfaces, options);
}

SurfaceDiscovery discover_surfaces(const std::vector<SlipSamples>& surfaces,
                                   const SurfaceDiscoveryOptions& options) {
  const auto begin = Clock::now();
  SurfaceDiscovery out;
  MeasuredDiscovery& answer = out.answer;
  answer.kind = "slips";
  answer.model = to_string(options.base);
  answer.phase = "release";
  const Choice measured = choose_law(surfaces, options);
  answer.skipped = measured.skipped, answer.ranking = measured.ranking;
  if (measured.laws.front().compared == 0) {
    answer.verdict = Verdict::not_answered;
    answer.message = answer.skipped.empty() ? "no surface" : answer.skipped.front().second;
    answer.seconds = seconds_since(begin);
    return out;
  }
  BiasTrial bias;
  if (!options.is_forgotten(kWrenchBias)) bias = try_bias(surfaces, measured.best, measured.scores, options);
  Choice choice = bias.convinces ? choose_again(surfaces, measured, options, bias) : measured;
  answer.ranking = std::move(choice.ranking);
  out.evidence = std::move(choice.evidence);
  answer.train = answer.test = choice.slips;
  if (!options.is_forgotten(kWrenchBias)) {
    answer.ranking.push_back(bias.ranked);
    std::stable_sort(answer.ranking.begin(), answer.ranking.end(), larger_gain);
  }
  const LawScore& law = choice.laws[choice.best];
  const LawScore& final = bias.convinces ? bias.with : law;
  const LawScore base = base_beside(choice.best, surfaces, measured.scores);
  std::vector<SlipSamples> logged, slips;  // as they were measured; without the bias
  std::vector<SlipSurface> of_base, of_law;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const auto &before = measured.scores[i].front(), &after = choice.scores[i][choice.best];
    if (!before.scored() || !after.scored()) continue;
    logged.push_back(surfaces[i]);
    slips.push_back(bias.convinces ? without_bias(surfaces[i], bias.whole.value) : surfaces[i]);
    of_base.push_back(before.fit.surface), of_law.push_back(after.fit.surface);
  }
  const LevelAnswer levels = level_dependence(slips, of_law, options);
  answer.before_train = base.errors(base.train), answer.after_train = final.errors(final.train);
  if (!levels.found.empty()) answer.after_train.back().second = levels.after_train;
  answer.before_test = {{"direction_mae_deg", base.error}};
  answer.after_test = {{"direction_mae_deg", final.error}};
  if (levels.before > 0) {
    answer.before_test.emplace_back("level_mae", level_error(logged, of_base, options.comparison.folds));
    answer.after_test.emplace_back("level_mae", levels.after);
  }
  answer.ranking.insert(answer.ranking.end(), levels.ranking.begin(), levels.ranking.end());
  std::stable_sort(answer.ranking.begin(), answer.ranking.end(), larger_gain);
  if (bias.convinces) accept_bias(bias, answer);
  if (choice.best > 0) accept_law(law, options.comparison.null_draws > 0, out);
  judge_residuals(final, base, options.unexplained, answer);
  judge_levels(levels, answer);
  tell_fates(answer.effects, {}, {}, answer.ranking);
  answer.misfit.push_back(
      {"direction", static_cast<int>(base.gain.n), base.train, base.error, final.train, final.error});
  answer.verdict = !answer.effects.empty() ? Verdict::effect_found
                   : answer.unexplained    ? Verdict::unexplained
                                           : Verdict::no_missing_effect;
  answer.seconds = seconds_since(begin);
  return out;
}

}  // namespace unhand::fitting
