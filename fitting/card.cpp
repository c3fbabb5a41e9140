#include "fitting/card.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "experiment/campaign_effects.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using datasets::CardError;
using datasets::CardRange;
using datasets::ModelCard;

namespace {

/// What a model without effects may have on its card.
struct BaseParameter {
  const char *name, *unit;
  double low, high;
  bool of_pads;  ///< of models that follow the pads; otherwise of gripper_delay
};
constexpr BaseParameter kBase[] = {{"mu", "-", 0, contact::kMostMu, true},
                                   {"length", "m", 1e-9, contact::kUniformDisc, true},
                                   {"pads", "-", 1, 1000, true},
                                   {"reference_force", "N", 1e-9, 1e6, true},
                                   {"grip_force", "N", 1e-9, 1e6, true},
                                   {"dead_time", "s", 0, 10, true},
                                   {"opening_time", "s", 1e-9, 10, true},
                                   {"shape", "-", 1e-3, 100, true},
                                   {"delay", "s", 0, 10, false}};

/// How far beyond a range a condition may lie for other reasons than a share of its ends.
struct ConditionScatter {
  const char *condition, *spread;  ///< the card's own spread that acts like it; null: none
  bool relative;                   ///< the spread is a share of the condition
  double least;                    ///< in the condition's unit
};
constexpr ConditionScatter kScatter[] = {{"grip_force", "mu_deviation", true, 0},
                                         {"com_offset", "grasp_offset", false, 1e-3},
                                         {"opening_time", "dead_time_deviation", false, 0},
                                         {"dead_time", "dead_time_deviation", false, 1e-3},
                                         {"shape", nullptr, false, 0.1},
                                         {"release_speed", nullptr, false, 0.02},
                                         {"detach_speed", nullptr, false, 0.02},
                                         {"release_omega", nullptr, false, 0.05},
                                         {"detach_omega", nullptr, false, 0.05}};

std::string why_taken(const std::string& name, const std::string& model) {
  const auto& opening = kOpeningParameters;
  if (std::find(opening.begin(), opening.end(), name) == opening.end())
    return fmt::format("is missing: these throws with {} take it", model);
  return fmt::format(
      "is missing: throws without a measured normal force (ft/normal_force) with {} take it. "
      "Give the card of a fit to such throws (`unhand fit`), or measure the force behind a pad",
      model);
}

double margin_of(const ModelCard& card, const std::string& condition, const CardRange& range) {
  constexpr double kSigmas = 3;
  const double largest = std::max(std::abs(range.low), std::abs(range.high));
  double out = kRangeMargin * largest;
  for (const auto& scatter : kScatter) {
    if (condition != scatter.condition) continue;
    out = std::max(out, scatter.least);
    if (!scatter.spread) continue;
    if (const auto own = card.own_spreads.find(scatter.spread); own != card.own_spreads.end())
      out = std::max(out, kSigmas * own->second.sigma * (scatter.relative ? largest : 1));
  }
  return out;
}

std::string in_words(const Condition& is, const CardRange& range) {
  const std::string unit = dynamics::after_number(is.unit);
  const auto low = fmt::format("{:.4g}", range.low), high = fmt::format("{:.4g}", range.high);
  return low == high
             ? fmt::format("{} is {:.4g}{}; the card was fitted at {}{} alone", is.name, is.value, unit, low,
                           unit)
             : fmt::format("{} is {:.4g}{}, outside [{}, {}]{}", is.name, is.value, unit, low, high, unit);
}

void widen(std::map<std::string, CardRange>& range, const experiment::PreparedThrow& prepared, Share share) {
  if (!takes(share, prepared.split)) return;
  for (const auto& [name, unit, value] : conditions_of(prepared)) {
    auto& r = range.try_emplace(name, CardRange{value, value, unit}).first->second;
    r.low = std::min(r.low, value);
    r.high = std::max(r.high, value);
  }
}

/// For predictions: what leaves no trace in a log adds nothing to them.
double variance_of(const FittedUnknown& u) { return std::isfinite(u.sigma) ? u.sigma * u.sigma : 0; }

}  // namespace

std::vector<Condition> conditions_of(const experiment::PreparedThrow& one) {
  std::vector<Condition> out{{"mass", "kg", one.body.mass}, {"com_offset", "m", one.grasp.com_offset}};
  if (one.open_command >= one.hand.begin() && one.open_command <= one.hand.end()) {
    const auto hand = one.hand.at(dynamics::Window{one.hand.begin(), one.hand.end()}, one.open_command).twist;
    out.push_back({"release_speed", "m/s", std::hypot(hand.vx, hand.vz)});
    out.push_back({"release_omega", "rad/s", hand.omega});
  }
  if (one.normal_force) {
    out.push_back({"grip_force", "N", one.force_fit.grip_force});
    const double opening = one.force_fit.release_time - one.force_fit.opening_start;
    if (std::isfinite(opening)) {
      out.push_back({"opening_time", "s", opening});
      out.push_back({"shape", "-", one.force_fit.shape});
      if (const double dead = one.force_fit.opening_start - one.open_command; dead > 0)  // a command is known
        out.push_back({"dead_time", "s", dead});
    }
  }
  if (const auto& twist = one.measured.detach_twist) {
    out.push_back({"detach_speed", "m/s", std::hypot(twist->vx, twist->vz)});
    out.push_back({"detach_omega", "rad/s", twist->omega});
  }
  return out;
}

std::map<std::string, CardRange> valid_range_of(const std::vector<experiment::PreparedThrow>& throws) {
  std::map<std::string, CardRange> out;
  for (const auto& one : throws) widen(out, one, Share::train);
  return out;
}

std::map<std::string, CardRange> valid_range_of(const CampaignProblem& problem, Share share) {
  std::map<std::string, CardRange> out;
  for (const auto& one : problem.throws()) widen(out, one.prepared, share);
  return out;
}

std::vector<UntriedCondition> outside_range(const ModelCard& card,
                                            const experiment::PreparedThrow& prepared) {
  return outside_range(card, conditions_of(prepared));
}

std::vector<UntriedCondition> outside_range(const ModelCard& card, const std::vector<Condition>& conditions) {
  std::vector<UntriedCondition> out;
  for (const Condition& is : conditions) {
    const auto range = card.valid_range.find(is.name);
    if (range == card.valid_range.end()) continue;
    if (range->second.unit != is.unit) {
      out.push_back({is.name, fmt::format("{}: the card's valid range is in '{}', not in '{}'", is.name,
                                          range->second.unit, is.unit)});
      continue;
    }
    const double margin = margin_of(card, is.name, range->second);
    if (is.value >= range->second.low - margin && is.value <= range->second.high + margin) continue;
    out.push_back({is.name, in_words(is, range->second)});
  }
  return out;
}

std::optional<UntriedCondition> untried_surface(const ModelCard& card, const std::string& surface) {
  const auto& known = card.log.surfaces;
  if (!card.parameters.contains("mu") || std::find(known.begin(), known.end(), surface) != known.end())
    return {};
  return UntriedCondition{
      "surface",
      known.empty() ? fmt::format("surface '{}': the card does not name those that it was fitted on", surface)
                    : fmt::format("surface '{}' is none of those that the card was fitted on: {}", surface,
                                  fmt::join(known, ", "))};
}

std::vector<std::string> reasons_of(const std::vector<UntriedCondition>& untried) {
  std::vector<std::string> out;
  for (const auto& one : untried) out.push_back(one.reason);
  return out;
}

std::optional<std::string> checksum_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325u;
  std::array<char, 65536> block{};
  while (in.read(block.data(), block.size()), in.gcount() > 0)
    for (std::streamsize i = 0; i < in.gcount(); ++i)
      hash = (hash ^ static_cast<unsigned char>(block[static_cast<std::size_t>(i)])) * 0x100000001b3u;
  if (!in.eof()) return {};
  return fmt::format("fnv1a64:{:016x}", hash);
}

std::map<std::string, datasets::CardStatistics> errors_of(const experiment::ModelComparison& model,
                                                          datasets::Split split) {
  std::map<std::string, datasets::CardStatistics> out;
  for (int q = 0; q < experiment::kQuantityCount; ++q)
    if (const auto s = model.statistics(q, split); s.n > 0)
      out[experiment::kQuantities[q].key] = {s.n, s.mae, s.std, s.bias};
  return out;
}

ModelCard card_of(const CampaignProblem& problem, const FitResult& fit) {
  require_fit_of(problem, fit);
  ModelCard card;
  card.library_version = datasets::library_version();
  card.model = problem.options().model;
  card.effects = problem.options().effects;
  auto& covariance = card.covariance.emplace();
  const std::size_t n = fit.campaign.size();
  std::vector<std::size_t> known;  // what leaves no trace in the log has no sigma
  for (std::size_t k = 0; k < n; ++k) {
    const FittedUnknown& u = fit.campaign[k];
    auto& one = card.parameters[u.unknown.name] = {
        u.value, {}, u.unknown.unit, is_determined(fit, k), u.interval_freedom(), u.profile};
    if (!std::isfinite(fit.covariance[k * n + k])) continue;
    one.sigma = u.sigma;
    if (fit.covariance[k * n + k] == 0) continue;  // fixed
    known.push_back(k);
    covariance.names.push_back(u.unknown.name);
  }
  for (const std::size_t k : known)
    for (const std::size_t j : known) covariance.matrix.push_back(fit.covariance[k * n + j]);
  if (contact::follows_pads(card.model)) {
    card.parameters["pads"] = {static_cast<double>(problem.model().pads), {}, "-"};
    card.parameters["reference_force"] = {problem.model().reference_force, {}, "N"};
  }
  for (std::size_t k = 0; k < fit.own_spread.size(); ++k)
    card.own_spreads[problem.own()[k].name] = {fit.own_spread[k], problem.own()[k].unit};
  card.split = fit.share == Share::train ? "train" : fit.share == Share::test ? "test" : "all";
  card.valid_range = valid_range_of(problem, fit.share);
  return card;
}

bool is_fitted(const ModelCard& card) {
  return !card.effects.empty() || !card.own_spreads.empty() || card.covariance.has_value();
}

void require_parameter(const std::string& file, const std::string& name, const datasets::CardParameter& p,
                       const std::string& unit, double low, double high) {
  const std::string path = "/parameters/" + name;
  if (p.unit != unit) throw CardError(file, path + "/unit", fmt::format("is '{}', not '{}'", p.unit, unit));
  if (!(p.value >= low && p.value <= high))
    throw CardError(file, path + "/value", fmt::format("{} is not in [{}, {}] {}", p.value, low, high, unit));
}

CampaignOptions options_of(const ModelCard& card, const std::string& file) {
  const auto models = contact::contact_model_names();
  if (std::find(models.begin(), models.end(), card.model) == models.end())
    throw CardError(
        file, "/model",
        datasets::unknown_name(fmt::format("'{}' is no model of releases", card.model), card.model, models));
  std::vector<dynamics::Effect> effects;
  for (std::size_t i = 0; i < card.effects.size(); ++i) {
    try {
      effects.push_back(find_effect(card.effects[i]));
    } catch (const std::invalid_argument& error) {
      throw CardError(file, fmt::format("/effects/{}", i), error.what());
    }
  }
  const bool follows_pads = contact::follows_pads(card.model);
  CampaignOptions out;
  out.model = card.model;
  out.effects = card.effects;
  out.predict_only = true;
  for (const auto& [name, parameter] : card.parameters) {
    const auto base = std::find_if(
        std::begin(kBase), std::end(kBase),
        [&, &key = name](const BaseParameter& b) { return b.of_pads == follows_pads && key == b.name; });
    bool known = base != std::end(kBase);
    if (known) require_parameter(file, name, parameter, base->unit, base->low, base->high);
    for (const auto& p : contact::law_parameters(card.model))
      if (name == p.name) {
        require_parameter(file, name, parameter, p.unit, p.low, p.high);
        known = true;
      }
    for (const auto& effect : effects)
      for (const auto& p : effect.parameters)
        if (experiment::without_object(name) == effect.full_name(p)) {
          require_parameter(file, name, parameter, p.unit, p.low, p.high);
          known = true;
        }
    if (!known)
      throw CardError(file, "/parameters/" + name,
                      fmt::format("is no parameter of {} or of the card's effects", card.model));
  }
  if (const auto pads = card.parameters.find("pads"); pads != card.parameters.end()) {
    if (pads->second.value != std::floor(pads->second.value))
      throw CardError(file, "/parameters/pads/value",
                      fmt::format("{} is not a whole number", pads->second.value));
    out.pads = static_cast<int>(pads->second.value);
  }
  if (const auto force = card.parameters.find("reference_force"); force != card.parameters.end())
    out.reference_force = force->second.value;
  else
    for (const auto& effect : effects)
      if (effect.needs.reference_force)
        throw CardError(file, "/parameters/reference_force",
                        fmt::format("is missing: {} divides the normal force by it [N]", effect.id));
  return out;
}

FitResult fit_of(const ModelCard& card, const CampaignProblem& problem, const std::string& file) {
  FitResult out;
  for (const auto& u : problem.campaign()) {
    const auto found = card.parameters.find(u.name);
    if (found == card.parameters.end())
      throw CardError(file, "/parameters/" + u.name, why_taken(u.name, card.model));
    const auto& p = found->second;
    const double sigma = p.sigma.value_or(p.determined ? 0 : HUGE_VAL);
    out.campaign.push_back({u, p.value, sigma, p.determined ? sigma : HUGE_VAL, false,
                            p.degrees_of_freedom.value_or(kCertain), p.interval95});
  }
  const datasets::CardCovariance told = card.covariance.value_or(datasets::CardCovariance{});
  for (const FittedUnknown& a : out.campaign)
    for (const FittedUnknown& b : out.campaign)
      out.covariance.push_back(
          told.of(a.unknown.name, b.unknown.name).value_or(&a == &b ? variance_of(a) : 0));
  for (const auto& u : problem.own()) {
    const auto spread = card.own_spreads.find(u.name);
    const double sigma =
        spread == card.own_spreads.end() ? u.prior_sigma.value_or(u.scale) : spread->second.sigma;
    if (spread != card.own_spreads.end() && spread->second.unit != u.unit)
      throw CardError(file, "/own_spreads/" + u.name + "/unit",
                      fmt::format("is '{}', not '{}'", spread->second.unit, u.unit));
    out.own_spread.push_back(std::max(sigma, 1e-9 * u.scale));
  }
  out.outcome = FitOutcome::converged;
  out.message = "from a card";
  return out;
}

}  // namespace unhand::fitting
