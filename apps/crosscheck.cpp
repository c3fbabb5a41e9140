// unhand crosscheck: another engine on the throws of a log, beside the library's models.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/compare.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "apps/table.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "contact/gripper_delay.hpp"
#include "contact/registry.hpp"
#include "crosscheck/bullet_release.hpp"
#include "crosscheck/distributed_patch.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/friction_estimate.hpp"
#include "flight/fly.hpp"

namespace unhand::apps {
namespace {

using crosscheck::BulletFriction;
using crosscheck::BulletPads;
using experiment::kDegrees;
using experiment::Prediction;

struct CrosscheckOptions {
  std::string log, engine{"bullet"}, card, json;
  std::vector<std::string> models{"limit_surface_disc", "limit_surface", "sliding_pivot"};
  std::vector<double> steps;
  BulletPads pads{BulletPads::pins};
  BulletFriction friction{BulletFriction::along};
  int rings{3};
  int threads{0};
};

/// The engine's answers at one setting, throw by throw; for cvode one model's.
struct Setting {
  std::string words;
  std::string model;  ///< of cvode; otherwise the engine's answers are held against every model
  Json json;
  std::vector<Prediction> throws;
};

using Throws = std::vector<experiment::PreparedThrow>;

/// Lets the pads of throws without a measured normal force open as a card says; how many there are.
int tell_force(const datasets::ModelCard& card, const std::string& file, Throws& throws) {
  contact::OpeningProfile<double> opening;
  const auto value = [&](const char* name) {
    const auto found = card.parameters.find(name);
    if (found == card.parameters.end())
      throw datasets::CardError(
          file, fmt::format("/parameters/{}", name),
          "is missing: throws without a measured normal force (ft/normal_force) take it. Only the card of a "
          "fit to such throws (`unhand fit`) tells how the pads open");
    return found->second.value;
  };
  int out = 0;
  for (auto& one : throws) {
    if (one.normal_force) continue;
    if (out++ == 0)
      opening = {0, value("grip_force"), value("dead_time"), value("opening_time"), value("shape")};
    opening.open_command = one.open_command;
    one.told_force.emplace(opening);
  }
  return out;
}

experiment::ModelParameters parameters_of(const CrosscheckOptions& options, const datasets::ThrowLog& log,
                                          Throws& prepared, std::string& from) {
  if (!options.card.empty()) {
    const UsableCard card = read_usable_card(options.card);
    experiment::ModelParameters out = card.parameters;
    if (!card.card.effects.empty())
      throw datasets::CardError(options.card, "/effects", "other engines have none of them: not accepted");
    if (!contact::follows_pads(card.card.model))
      throw datasets::CardError(options.card, "/model", fmt::format("'{}' has no friction", card.card.model));
    if (card.fitted) {
      const auto value = [&](const char* name) {
        const auto found = card.card.parameters.find(name);
        if (found == card.card.parameters.end())
          throw datasets::CardError(options.card, fmt::format("/parameters/{}", name), "is missing");
        return found->second.value;
      };
      out.mu = value("mu"), out.length = value("length");
      if (card.card.parameters.contains("pads"))
        out.pads = static_cast<int>(value("pads"));
      else if (log.gripper)
        out.pads = log.gripper->n_pads;
      for (const auto& own : contact::law_parameters(card.card.model))
        if (card.card.parameters.contains(own.name)) out.law_values[own.name] = value(own.name.c_str());
    }
    const auto& models = options.models;
    const std::string& law = card.card.model;
    if (!out.law_values.empty() && std::find(models.begin(), models.end(), law) == models.end())
      for (const auto& [name, unused] : out.law_values)
        tell("unhand: {} of {} is of {}, which is none of --models\n", name, options.card, law);
    if (const int told = tell_force(card.card, options.card, prepared); told > 0)
      tell("unhand: {} of {} throws have no normal force: there the pads open as the card says\n", told,
           prepared.size());
    from = options.card;
    return out;
  }
  const auto estimate = estimated(log, prepared, options.models.front());
  from = fmt::format("estimated for {}", options.models.front());
  return estimate.parameters;
}

template <class Predict>
std::vector<Prediction> all(const Throws& throws, int threads, Progress& progress, Predict&& one) {
  std::vector<Prediction> out(throws.size());
  dynamics::parallel_for(throws.size(), threads, [&](std::size_t i) {
    out[i] = one(throws[i]);
    progress.step();
  });
  return out;
}

/// Runs an engine on the release of a throw and flies on from there.
template <class Engine>
Prediction from_engine(const experiment::PreparedThrow& thrown, const experiment::ModelParameters& parameters,
                       Engine&& engine) {
  const auto unused = experiment::contact_model_for(thrown, "limit_surface", parameters);
  const auto result = engine(experiment::release_problem(thrown, *unused));
  Prediction out;
  out.release = result.outcome;
  out.detach = result.detach;
  if (out.release != release::ReleaseOutcome::detached) return out;
  const auto flown = flight::fly<double>(
      {out.detach.pose, out.detach.twist, thrown.gravity, thrown.drag_k, thrown.landing_height, {}, 30});
  out.flight = flown.outcome;
  out.landing = flown.landing;
  return out;
}

/// Without the law's own parameters that a model has not.
experiment::ModelParameters parameters_of(const std::string& model, const experiment::ModelParameters& all) {
  experiment::ModelParameters out = all;
  out.law_values.clear();
  for (const auto& [own, value] : contact::given_law_parameters(model, all.law_values))
    out.law_values[own.name] = value;
  return out;
}

std::vector<Setting> run_engine(const CrosscheckOptions& options, const Throws& throws,
                                const experiment::ModelParameters& p) {
  std::vector<Setting> out;
  const contact::Patch<double> patch{p.mu, 1.5 * p.length, 2.0 / 3,
                                     p.pads};  // a uniform disc of the same limits
  if (options.engine == "cvode") {
    Progress progress("cvode", throws.size() * options.models.size());
    for (const auto& model : options.models) {
      dynamics::IntegratorOptions integrator;
      integrator.tolerances = {1e-10, 1e-12};
      integrator.method = dynamics::Method::cvode;
      out.push_back(
          {"CVODE, tolerance 1e-10", model, Json{{"rtol", 1e-10}, {"atol", 1e-12}},
           all(throws, options.threads, progress, [&, own = parameters_of(model, p)](const auto& one) {
             return experiment::predict(one, model, own, integrator);
           })});
    }
    return out;
  }
  auto steps = options.steps;
  if (steps.empty()) steps = options.engine == "bullet" ? std::vector{1e-3, 1e-4} : std::vector{4e-5};
  Progress progress(options.engine, throws.size() * steps.size());
  for (const double step : steps) {
    Setting setting;
    setting.json = {{"step_s", step}};
    if (options.engine == "bullet") {
      setting.words = fmt::format("Bullet, step {:g} ms, pads {}, friction rows {}", 1e3 * step,
                                  to_string(options.pads), to_string(options.friction));
      setting.json["pads"] = to_string(options.pads);
      setting.json["friction_rows"] = to_string(options.friction);
    } else {
      setting.words =
          fmt::format("patch of {} points, step {:g} ms", 3 * options.rings * options.rings, 1e3 * step);
    }
    if (options.engine == "patch" || options.pads == BulletPads::pins) setting.json["rings"] = options.rings;
    const crosscheck::DistributedPatch points{patch.mu, patch.radius, crosscheck::disc_points(options.rings),
                                              patch.pads};
    setting.throws = all(throws, options.threads, progress, [&](const auto& one) {
      return from_engine(one, p, [&](const release::ReleaseProblem<double>& problem) {
        if (options.engine == "patch") {
          crosscheck::PatchOptions patch_options;
          patch_options.step = step;
          const auto r = crosscheck::simulate_distributed_patch(problem, points, patch_options);
          return crosscheck::BulletResult{r.outcome, r.detach, {}, 0};
        }
        return crosscheck::simulate_in_bullet(problem, patch,
                                              {step, options.pads, options.rings, 50, options.friction});
      });
    });
    out.push_back(std::move(setting));
  }
  return out;
}

/// Engine minus reference, in the units of kQuantities; over the throws that both bring to a landing.
struct Differences {
  std::vector<double> of[experiment::kQuantityCount];
  void add(const std::optional<double> (&difference)[experiment::kQuantityCount]) {
    for (int q = 0; q < experiment::kQuantityCount; ++q)
      if (difference[q]) of[q].push_back(*difference[q]);
  }
  double worst(int q) const {
    double out = 0;
    for (const double d : of[q]) out = std::max(out, std::abs(d));
    return out;
  }
};

Differences against_model(const std::vector<Prediction>& engine, const std::vector<Prediction>& model) {
  Differences out;
  for (std::size_t i = 0; i < engine.size(); ++i) {
    const auto &a = engine[i], &b = model[i];
    if (!a.landed() || !b.landed()) continue;
    out.add({a.detach.twist.vx - b.detach.twist.vx, (a.detach.twist.omega - b.detach.twist.omega) * kDegrees,
             a.landing.pose.x - b.landing.pose.x, (a.landing.pose.theta - b.landing.pose.theta) * kDegrees});
  }
  return out;
}

Differences against_measured(const std::vector<Prediction>& engine, const Throws& throws) {
  Differences out;
  for (std::size_t i = 0; i < engine.size(); ++i)
    if (engine[i].landed()) out.add(experiment::judge(throws[i], engine[i]).error);
  return out;
}

Json differences_json(const Differences& differences) {
  Json out = Json::object();
  for (int q = 0; q < experiment::kQuantityCount; ++q) {
    const auto s = experiment::statistics_of(differences.of[q]);
    Json& one = out[experiment::kQuantities[q].key] = statistics_json(s);
    one["max"] = s.n > 0 ? Json(differences.worst(q)) : Json(nullptr);
  }
  return out;
}

void add_row(Table& table, const std::string& title, const Differences& differences, bool worst) {
  std::vector<std::string> row{title};
  for (int q = 0; q < experiment::kQuantityCount; ++q) {
    const auto s = experiment::statistics_of(differences.of[q]);
    const auto number = [](double x) {
      return x < 1e-3 ? fmt::format("{:.1e}", x) : fmt::format("{:.4f}", x);
    };
    row.push_back(s.n == 0 ? "-" : number(s.mae));
    if (worst) row.push_back(s.n == 0 ? "-" : number(differences.worst(q)));
  }
  table.rows.push_back(row);
}

Json throws_json(const Setting& setting, const Throws& throws) {
  Json out = Json::array();
  for (std::size_t i = 0; i < throws.size(); ++i) {
    const auto& p = setting.throws[i];
    Json one{{"id", throws[i].id}, {"landed", p.landed()}};
    if (p.landed()) {
      one["detach_vx_m_s"] = p.detach.twist.vx, one["detach_vz_m_s"] = p.detach.twist.vz;
      one["detach_omega_deg_s"] = p.detach.twist.omega * kDegrees;
      one["landing_x_m"] = p.landing.pose.x, one["landing_theta_deg"] = p.landing.pose.theta * kDegrees;
    }
    out.push_back(one);
  }
  return out;
}

/// Refuses what the engine or the models do not have.
void require_usable(const CrosscheckOptions& options, const Parser& parser) {
  if (options.engine == "cvode")
    refuse_options(parser, {"--steps", "--pads", "--friction", "--rings"}, "cvode integrates the models");
  if (options.engine == "patch")
    refuse_options(parser, {"--pads", "--friction"}, "of bullet; patch has points with bristles");
  if (options.engine == "bullet" && options.pads != BulletPads::pins)
    refuse_options(parser, {"--rings"}, "of --pads pins and of patch, whose pads are points");
  require_outputs({{options.json}}, {options.log, options.card});
  const auto known = contact::pad_law_names();
  for (const auto& model : options.models)
    if (!contact::follows_pads(model))
      throw WrongUsage(
          fmt::format("--models: {} has no pads that let go, which the other engine could simulate: it "
                      "carries the object rigidly until it is free",
                      model));
  for (const auto& model : options.models)
    if (std::find(known.begin(), known.end(), model) == known.end())
      throw WrongUsage(
          datasets::unknown_name(fmt::format("--models: there is no model '{}'", model), model, known));
  if (options.engine == "bullet" && !crosscheck::has_bullet())
    throw Unanswered("built without Bullet (Debian package libbullet-dev)");
}

/// By model, the throws in their order.
using ModelPredictions = std::map<std::string, std::vector<Prediction>>;

/// At a tolerance that is none of the differences.
ModelPredictions predictions_of(const CrosscheckOptions& options, const Throws& throws,
                                const experiment::ModelParameters& parameters) {
  dynamics::IntegratorOptions tight;
  tight.tolerances = {1e-9, 1e-11};
  ModelPredictions out;
  Progress progress("models", throws.size() * options.models.size());
  for (const auto& model : options.models)
    out[model] =
        all(throws, options.threads, progress, [&, own = parameters_of(model, parameters)](const auto& one) {
          return experiment::predict(one, model, own, tight);
        });
  return out;
}

/// One setting of the engine beside the models and what was measured.
struct SettingReport {
  Json json;
  std::string text;
  bool any{};  ///< throw that it brings to a landing
};

SettingReport report_of(const Setting& setting, const ModelPredictions& models, const Throws& throws) {
  const bool same_model = !setting.model.empty();  // by another integrator: the worst differences matter
  Table table{{same_model ? "CVODE - own steppers" : "engine - model"}, {}, 1};
  for (const auto& quantity : experiment::kQuantities) {
    table.header.push_back(quantity.title);
    if (same_model) table.header.push_back("worst");
  }
  SettingReport out{{{"setting", setting.json}, {"models", Json::object()}}, {}, false};
  for (const auto& [name, predictions] : models) {
    if (same_model && name != setting.model) continue;
    const auto differences = against_model(setting.throws, predictions);
    out.any = out.any || !differences.of[0].empty();
    Json& json = out.json["models"][name] = differences_json(differences);
    if (same_model) {
      int other = 0;
      for (std::size_t i = 0; i < throws.size(); ++i)
        other += setting.throws[i].events != predictions[i].events;
      json["other_number_of_events"] = other;
    }
    add_row(table, name, differences, same_model);
  }
  const auto measured = against_measured(setting.throws, throws);
  out.json["measured"] = differences_json(measured);
  add_row(table, "measured", measured, same_model);
  out.json["throws"] = throws_json(setting, throws);
  out.text = fmt::format("\n{}{}\n{}", setting.words, same_model ? ", " + setting.model : "", table.text());
  return out;
}

void check(const CrosscheckOptions& options, const Parser& parser) {
  require_usable(options, parser);
  auto log = read_throws(options.log);
  if (options.card.empty()) leave_out_forceless(log);
  auto throws = experiment::prepare_all(log, options.log, options.threads, false);
  std::string from;
  const auto parameters = parameters_of(options, log, throws, from);
  const auto models = predictions_of(options, throws, parameters);
  const auto settings = run_engine(options, throws, parameters);

  Json json = json_head("crosscheck");
  json["log"] = options.log;
  json["engine"] = options.engine;
  json["parameters"] = {
      {"mu", parameters.mu}, {"length_m", parameters.length}, {"pads", parameters.pads}, {"from", from}};
  for (const auto& [name, value] : parameters.law_values) json["parameters"][name] = value;
  json["settings"] = Json::array();
  std::string text;
  bool any = false;
  for (const auto& setting : settings) {
    const SettingReport one = report_of(setting, models, throws);
    any = any || one.any;
    json["settings"].push_back(one.json);
    text += one.text;
  }
  if (!any) throw Unanswered(fmt::format("{}: {} brings no throw to a landing", options.log, options.engine));
  Outputs outputs{{options.log, options.card}};
  if (!options.json.empty()) outputs.json(options.json, json);
  outputs.commit();
  fmt::print("{}: {}\n{} throws; mean absolute differences; mu {:.4f}, length {:.3f} mm, {} pads ({})\n{}",
             options.log, origin_text(log), throws.size(), parameters.mu, 1e3 * parameters.length,
             parameters.pads, from, text);
}

}  // namespace

Command crosscheck_command(Parser& root) {
  auto options = std::make_shared<CrosscheckOptions>();
  Parser& parser = root.subcommand("crosscheck", "Another engine on a log's throws, beside the models");
  parser.option("LOG", options->log, "A throw log").required();
  parser
      .option(
          "--engine", options->engine,
          "bullet: rigid bodies in double-precision Bullet; cvode: the same models, integrated by SUNDIALS; "
          "patch: points with bristles")
      .one_of({"bullet", "cvode", "patch"})
      .with_default();
  parser.option("--models", options->models, "Models to hold it against, separated by commas")
      .with_commas()
      .with_default();
  parser.file(
      "--card", options->card,
      "Friction from a model card, and how the pads open where the log has no normal force; without it,\n"
      "friction is estimated from the log for the first model");
  parser.option("--steps", options->steps, "Steps of bullet or patch [s], separated by commas")
      .with_commas()
      .range(1e-6, 1e-3);
  parser.choice<BulletPads>(
      "--pads", options->pads,
      {{"pins", BulletPads::pins}, {"point", BulletPads::point}, {"cylinder", BulletPads::cylinder}},
      "Bullet: how the pads touch");
  parser.choice<BulletFriction>("--friction", options->friction,
                                {{"along", BulletFriction::along},
                                 {"across", BulletFriction::across},
                                 {"fixed", BulletFriction::fixed}},
                                "Bullet: its friction rows at a contact");
  parser.option("--rings", options->rings, "Rings of points of a pad: 3 n^2 points")
      .range(1, 10)
      .with_default();
  parser.file("--json", options->json, "Write every throw and the differences as JSON");
  add_threads(parser, options->threads);
  parser.footer(
      "All get the same hand, normal force and friction, so that differences are the engine's.\n"
      "Example:\n  unhand crosscheck campaign.h5 --engine bullet --steps 1e-3,1e-4 --json bullet.json");
  return {&parser, [options, &parser] { check(*options, parser); }};
}

}  // namespace unhand::apps
