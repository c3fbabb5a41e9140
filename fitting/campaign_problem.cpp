#include "fitting/campaign_problem.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/median.hpp"
#include "experiment/compare.hpp"
#include "experiment/force_sensor.hpp"
#include "experiment/glitches.hpp"
#include "fitting/grasp_scatter.hpp"

namespace unhand::fitting {

using dynamics::Dual;
using dynamics::Effect;
using dynamics::Values;

namespace {

/// "k[jar]" read as "k" by throws of the jar, and by no other.
std::optional<std::string> name_for(const std::string& name, const std::string& object) {
  const std::size_t bracket = name.find('[');
  if (bracket == std::string::npos) return name;
  if (name.compare(bracket + 1, name.size() - bracket - 2, object) != 0) return std::nullopt;
  return name.substr(0, bracket);
}

/// Throws std::invalid_argument for a name that contact::make_contact_model does not know.
void require_contact_model(const std::string& name) {
  const auto names = contact::contact_model_names();
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw std::invalid_argument(datasets::unknown_name(
        fmt::format("there is no contact model '{}' that can be fitted", name), name, names));
}

/// The effects of those ids. Throws std::invalid_argument for one that is unknown, or named twice.
std::vector<Effect> find_effects(const std::vector<std::string>& ids) {
  std::vector<Effect> out;
  std::set<std::string> seen;
  for (const auto& id : ids) {
    out.push_back(find_effect(id));
    if (!seen.insert(id).second)
      throw std::invalid_argument(fmt::format("effects: \"{}\" is named twice", id));
  }
  return out;
}

void validate(const CampaignOptions& options) {
  require_contact_model(options.model);
  if (options.pads && !(*options.pads >= 1 && *options.pads <= 1000))
    throw std::invalid_argument(fmt::format("pads = {} is not in [1, 1000]", *options.pads));
  const double force = options.reference_force.value_or(1);
  if (!(force > 0 && std::isfinite(force)))
    throw std::invalid_argument(fmt::format("reference_force = {} is not in (0, inf) N", force));
}

}  // namespace

Effect find_effect(const std::string& id) {
  std::vector<std::string> ids;
  for (const Effect& effect : experiment::known_effects()) {
    if (effect.id == id) return effect;
    ids.push_back(effect.id);
  }
  throw std::invalid_argument(datasets::unknown_name(fmt::format("effect \"{}\" is unknown", id), id, ids));
}

CampaignProblem::CampaignProblem(const datasets::ThrowLog& logged, const std::string& file,
                                 const CampaignOptions& options)
    : options_(options) {
  validate(options);
  datasets::validate(logged, file);
  datasets::ThrowLog log = logged;
  if (const std::size_t n = experiment::mark_glitches(log); n > 0)
    notes_.push_back(fmt::format(
        "{} frames in which the tracker was elsewhere for once, or held the pose before, were taken out", n));
  const std::vector<Effect> effects = find_effects(options.effects);
  header_ = log;
  header_.throws.clear();
  auto prepared = experiment::prepare_all(log, file, options.threads, options.check_units);
  std::vector<double> grips;
  for (const auto& p : prepared)
    if (p.split == datasets::Split::train && p.normal_force && p.force_fit.grip_force > 0)
      grips.push_back(p.force_fit.grip_force);
  model_ = {options.model, options.pads.value_or(log.gripper ? log.gripper->n_pads : 2),
            options.reference_force.value_or(grips.empty() ? 20.0 : dynamics::median(grips)),
            options.integrator};
  for (const auto& note : experiment::force_notes(log, experiment::force_openings(prepared)))
    notes_.push_back(note.in_words(prepared.size()));
  if (const auto n = std::count_if(
          prepared.begin(), prepared.end(),
          [](const auto& p) { return p.hand_fit.twist_differenced || p.hand_fit.acceleration_differenced; });
      n > 0)
    notes_.push_back(fmt::format(
        "hand/twist or hand/acceleration are difference quotients of the series before them in {} of {} "
        "throws: they tell nothing of their own and are not used; how the hand accelerates is known better "
        "from a robot's controller",
        n, prepared.size()));
  if (!options.predict_only) guess_start(log, prepared, !grips.empty());
  if (const auto scatter = grasp_scatter_across(log, prepared); scatter.is_evident()) {
    scatters_across_ = true;
    notes_.push_back(scatter.in_words());
  }
  if (observe(log, std::move(prepared)) == 0 && !options.predict_only)
    throw std::invalid_argument(
        fmt::format("{}: nothing to fit to: no throw has F/T data, motion capture or a landing among the "
                    "channels asked for",
                    file));
  name_unknowns(effects);
}

void CampaignProblem::guess_start(const datasets::ThrowLog& log,
                                  const std::vector<experiment::PreparedThrow>& prepared, bool pressed) {
  if (!contact::follows_pads(options_.model)) {
    first_guess_ = experiment::estimate_friction(log, prepared, options_.model).parameters;
    return;
  }
  if (!pressed) return;
  try {
    const auto guess = experiment::estimate_friction(log, prepared, options_.model).parameters;
    // Declared or not, a pad's size is known to a factor of two.
    const auto radius = log.gripper ? log.gripper->pad_radius : std::nullopt;
    const double least = radius ? 0.5 * contact::kUniformDisc * *radius : 2e-4,
                 most = radius ? 4 * least : 0.1;
    const bool is_patch = guess.mu > 0.02 && guess.mu < 4 && guess.length > least && guess.length < most;
    if (is_patch)
      first_guess_ = guess;
    else
      notes_.push_back(fmt::format(
          "the pads' wrenches while the force vanishes say mu = {:.3g}, length = {:.3g} m, which is no "
          "patch{}: not used as a start",
          guess.mu, guess.length, radius ? fmt::format(" of the declared radius, {:.3g} m", *radius) : ""));
  } catch (const std::invalid_argument&) {  // too few samples: the default start has to do
  }
}

std::size_t CampaignProblem::observe(const datasets::ThrowLog& log,
                                     std::vector<experiment::PreparedThrow> prepared) {
  if (const int n = experiment::landings_without_sigma(log); n > 0 && options_.observations.landing) {
    const auto noise = experiment::landing_noise(log);
    notes_.push_back(experiment::in_words(noise, n));
    options_.observations.landing_noise = noise;
  }
  std::size_t observations = 0;
  std::map<experiment::Channel, int> dead;
  auto throws = std::make_shared<std::vector<CampaignThrow>>();
  throws->reserve(prepared.size());
  for (std::size_t i = 0; i < prepared.size(); ++i) {
    CampaignThrow t{std::move(prepared[i]), {}, 0, 0};
    t.observed = experiment::observe(log, log.throws[i], t.prepared, options_.observations);
    t.opening = t.prepared.normal_force && std::isfinite(t.prepared.force_fit.opening_start)
                    ? t.prepared.force_fit.opening_start
                    : t.prepared.open_command;
    t.release = t.prepared.measured.detach_time.value_or(NAN);
    observations += t.observed.all.size();
    for (const auto channel : t.observed.dead) ++dead[channel];
    throws->push_back(std::move(t));
  }
  for (const auto& [channel, n] : dead)
    notes_.push_back(fmt::format("{} is dead (always the same) in {} of {} throws: not used there",
                                 to_string(channel), n, throws->size()));
  throws_ = std::move(throws);
  return observations;
}

CampaignProblem CampaignProblem::with(const std::string& model,
                                      const std::vector<std::string>& effects) const {
  require_contact_model(model);
  CampaignProblem out(*this);
  out.options_.model = out.model_.contact_model = model;
  out.options_.effects = effects;
  out.name_unknowns(find_effects(effects));
  return out;
}

void CampaignProblem::name_unknowns(const std::vector<Effect>& effects) {
  campaign_.clear();
  own_ = {{"grasp_angle", "rad", 0, -1, 1, 0.01, 0.05}, {"grasp_offset", "m", 0, -0.02, 0.02, 1e-3, 1e-3}};
  if (scatters_across_) own_.push_back({"grasp_across", "m", 0, -0.02, 0.02, 1e-3, 1e-3});
  const bool follows_pads = contact::follows_pads(options_.model);
  bool all_forces = true, any_force = false;
  std::set<std::string> objects;
  for (const auto& t : *throws_) {
    all_forces = all_forces && t.prepared.normal_force.has_value();
    any_force = any_force || t.prepared.normal_force.has_value();
    objects.insert(t.prepared.object);
  }
  if (follows_pads) {
    const auto& gripper = header_.gripper;
    const double* radius = gripper && gripper->pad_radius ? &*gripper->pad_radius : nullptr;
    const bool guessed = first_guess_.mu != experiment::ModelParameters{}.mu;
    const double length = guessed || !radius ? first_guess_.length : contact::kUniformDisc * *radius;
    // Held to a fifth of what the slipping pads or the declared radius say: a fit of a model that lacks an
    // effect would otherwise run away with them.
    constexpr double kHeld = 0.2;
    std::optional<double> mu_prior, length_prior;
    if (guessed) mu_prior = kHeld * first_guess_.mu;
    if (guessed || radius) length_prior = kHeld * length;
    campaign_.push_back({"mu", "-", first_guess_.mu, 0.01, 5, 0.05, mu_prior});
    campaign_.push_back({"length", "m", length, 1e-4, 0.2, 0.1 * length, length_prior});
    for (const auto& p : contact::law_parameters(options_.model))
      campaign_.push_back({p.name, p.unit, p.start, p.search_low, p.search_high, p.typical, p.prior_sigma});
    for (Unknown& u : campaign_) u.of_law = true;
    own_.push_back({"mu_deviation", "-", 0, -0.5, 0.5, 0.02, 0.03, Unknown::Kind::scatter});
    if (any_force) own_.push_back({"force_deviation", "-", 0, -6, 6, 1, 1, Unknown::Kind::smoothing});
    if (!all_forces) {
      // μ and f₀ enter only as their product: f₀ is known to a factor of two, no better.
      campaign_.push_back({"grip_force", "N", 20, 0.5, 500, 10, 10});
      campaign_.push_back({"dead_time", "s", 0.01, 0, 0.2, 2e-3, {}});
      campaign_.push_back({"opening_time", "s", 0.05, 1e-3, 0.5, 5e-3, {}});
      campaign_.push_back({"shape", "-", 1, 0.3, 4, 0.2, {}});
      own_.push_back({"dead_time_deviation", "s", 0, -0.05, 0.05, 1e-3, 2e-3, Unknown::Kind::scatter});
    }
  } else {
    campaign_.push_back({"delay", "s", first_guess_.delay.centre, 0, 1, 5e-3, {}});
    own_.push_back({"delay_deviation", "s", 0, -0.1, 0.1, 5e-3, 5e-3, Unknown::Kind::scatter});
  }
  for (const Effect& effect : effects)
    for (const auto& p : effect.parameters) {
      const double start = p.is_shape() ? p.grid[p.grid.size() / 2] : p.neutral;
      const auto add = [&](const std::string& suffix) {
        campaign_.push_back({effect.full_name(p) + suffix, p.unit, start, p.low, p.high, p.typical, {}});
      };
      if (effect.per_object)
        for (const auto& object : objects) add("[" + object + "]");
      else
        add("");
    }
  const int width = static_cast<int>(campaign_.size());
  layouts_.clear();
  for (const auto& object : objects) {
    Layout& layout = layouts_[object];
    for (int k = 0; k < width; ++k)
      if (const auto name = name_for(campaign_[static_cast<std::size_t>(k)].name, object)) {
        layout.names.push_back(*name);
        layout.columns.push_back(k);
      }
    for (std::size_t k = 0; k < own_.size(); ++k) {
      layout.names.push_back(own_[k].name);
      layout.columns.push_back(width + static_cast<int>(k));
    }
  }
}

std::vector<double> CampaignProblem::start() const {
  std::vector<double> out;
  for (const auto& u : campaign_) out.push_back(u.start);
  return out;
}

std::vector<double> CampaignProblem::values_of(const Layout& layout, std::span<const double> campaign,
                                               std::span<const double> own) const {
  if (campaign.size() != campaign_.size() || own.size() != own_.size())
    throw std::invalid_argument(
        fmt::format("a throw is predicted with {} unknowns of the campaign and {} of its own, not {} and {}",
                    campaign_.size(), own_.size(), campaign.size(), own.size()));
  std::vector<double> out;
  for (const int column : layout.columns) {
    const auto c = static_cast<std::size_t>(column);
    out.push_back(c < campaign.size() ? campaign[c] : own[c - campaign.size()]);
  }
  return out;
}

experiment::ThrowPrediction<double> CampaignProblem::predict(const experiment::PreparedThrow& prepared,
                                                             const experiment::Observations& observed,
                                                             std::span<const double> campaign,
                                                             std::span<const double> own) const {
  const Layout& read = layout(prepared);
  const auto values = values_of(read, campaign, own);
  return experiment::predict_channels(prepared, observed, model_, Values<double>(read.names, values));
}

void CampaignProblem::visit_release(const experiment::PreparedThrow& prepared,
                                    std::span<const double> campaign, std::span<const double> own,
                                    const experiment::UseOfRelease& use) const {
  const Layout& read = layout(prepared);
  const auto values = values_of(read, campaign, own);
  experiment::visit_release(prepared, model_, Values<double>(read.names, values), use);
}

void CampaignProblem::differentiate(const experiment::PreparedThrow& prepared,
                                    const experiment::Observations& observed,
                                    std::span<const double> campaign, std::span<const double> own,
                                    DerivativesBy derivatives, const UseOfDuals& use) const {
  const Layout& read = layout(prepared);
  const auto values = values_of(read, campaign, own);
  constexpr std::size_t kSize = dynamics::kDualSize;
  std::size_t first =
      derivatives == DerivativesBy::own ? values.size() - own.size() : 0;  // they are the last
  for (; first < values.size(); first += kSize) {
    const std::size_t last = std::min(first + kSize, values.size());
    std::vector<Dual> duals(values.begin(), values.end());
    for (std::size_t k = first; k < last; ++k)
      duals[k] = dynamics::independent(values[k], static_cast<int>(k - first));
    const auto predicted = experiment::predict_channels(
        prepared, observed, model_, Values<Dual>(read.names, std::span<const Dual>(duals)));
    if (!use(predicted, std::span(read.columns).subspan(first, last - first))) return;
  }
}

Linearisation CampaignProblem::linearise(const experiment::PreparedThrow& prepared,
                                         const experiment::Observations& observed,
                                         std::span<const double> campaign, std::span<const double> own,
                                         DerivativesBy derivatives) const {
  const auto& all = observed.all;
  const auto rows = static_cast<Eigen::Index>(all.size());
  Linearisation out;
  out.residual.resize(rows);
  const auto take = [&](const auto& predicted) {
    out.modes = predicted.modes;
    out.detach = dynamics::value_of(predicted.detach.time);
    out.solved = predicted.channels.size() == all.size() && predicted.landed();
    if (!out.solved)
      out.why_not = predicted.release != release::ReleaseOutcome::detached ? in_words(predicted.release)
                                                                           : in_words(predicted.flight);
    for (std::size_t i = 0; out.solved && i < all.size(); ++i)
      out.residual[static_cast<Eigen::Index>(i)] =
          (dynamics::value_of(predicted.channels[i]) - all[i].value) / all[i].sigma;
    return out.solved;
  };
  const auto run = [&] {
    if (derivatives == DerivativesBy::nothing) {
      take(predict(prepared, observed, campaign, own));
      return;
    }
    const auto width = static_cast<int>(campaign.size());
    out.campaign.setZero(rows, width);
    out.own.setZero(rows, static_cast<Eigen::Index>(own.size()));
    const auto read = [&](const auto& predicted, std::span<const int> by) {
      if (!take(predicted)) return false;
      for (std::size_t i = 0; i < all.size(); ++i)
        for (std::size_t k = 0; k < by.size(); ++k) {
          const double d = predicted.channels[i].v[static_cast<int>(k)] / all[i].sigma;
          const auto row = static_cast<Eigen::Index>(i);
          (by[k] < width ? out.campaign(row, by[k]) : out.own(row, by[k] - width)) = d;
        }
      return true;
    };
    differentiate(prepared, observed, campaign, own, derivatives, read);
  };
  try {
    run();
  } catch (const std::invalid_argument& error) {  // a point outside the physics
    out = {};
    out.why_not = error.what();
    return out;
  } catch (const std::runtime_error& error) {  // a flight that is not solved
    out = {};
    out.why_not = error.what();
    return out;
  }
  const bool finite = out.residual.allFinite() && out.campaign.allFinite() && out.own.allFinite();
  if (out.solved && !finite) out.why_not = "a prediction, or a derivative of one, is not finite";
  out.solved = out.solved && finite;
  return out;
}

}  // namespace unhand::fitting
