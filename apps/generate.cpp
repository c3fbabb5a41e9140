// unhand generate: a synthetic campaign.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "apps/command.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/effect.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "experiment/throw_setup.hpp"

namespace unhand::apps {
namespace {

struct GenerateOptions {
  std::string campaign, out, json, truth;
  std::uint64_t seed{1};
  std::vector<std::string> effects, without;
  int threads{0};
};

constexpr const char* kRandomEffect = "random";

experiment::CampaignDesign design_of(const GenerateOptions& options) {
  const auto names = experiment::campaign_names();
  if (std::find(names.begin(), names.end(), options.campaign) == names.end())
    throw WrongUsage(datasets::unknown_name(fmt::format("no campaign is called '{}'", options.campaign),
                                            options.campaign, names));
  auto design = experiment::campaign_design(options.campaign, options.seed);
  for (const std::string& group : options.without) {
    if (group == "ft") design.sensors.ft = false;
    if (group == "wrench") design.sensors.wrench = false;
    if (group == "mocap") design.sensors.mocap = false;
    if (group == "landing") design.sensors.landing = false;
  }
  std::vector<std::string> objects;
  for (const auto& object : design.objects) objects.push_back(object.name);
  try {
    for (const std::string& text : options.effects) {
      if (text == kRandomEffect) {
        design.effects.merge(experiment::random_effect(design, options.seed));
      } else {
        const auto [name, value] = experiment::parse_effect(text);
        if (!design.effects.emplace(name, value).second)
          throw WrongUsage(fmt::format("--effect: {} is given twice", name));
      }
    }
    experiment::validate_effects(design.effects, objects);
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--effect: {}", error.what()));
  }
  return design;
}

std::vector<experiment::SyntheticThrow> simulate(const experiment::CampaignDesign& design,
                                                 const GenerateOptions& options) {
  std::vector<experiment::SyntheticThrow> throws(static_cast<std::size_t>(design.throws()));
  Progress progress("generate", throws.size());
  dynamics::parallel_for(throws.size(), options.threads, [&](std::size_t i) {
    throws[i] = experiment::generate_throw(design, options.seed, static_cast<int>(i));
    progress.step();
  });
  return throws;
}

bool same(datasets::Throw a, datasets::Throw b) {
  for (auto* one : {&a, &b})
    if (one->mocap)
      for (double& v : one->mocap->pose.data)
        if (v != v) v = 0;  // lost samples are NaN, which equals nothing
  return a == b;
}

/// What an effect acts through and no object has here, if it may be that.
std::string missing_carrier(const dynamics::Effect& effect) {
  if (effect.acts_through.empty()) return {};
  for (const auto& carrier : experiment::known_effects())
    if (carrier.id == effect.acts_through) {
      const auto& size = carrier.parameters.front();
      return fmt::format(": it acts through {0}, which no object has here (--effect {0}={1} [{2}])",
                         carrier.id, size.name, size.unit);
    }
  return {};
}

/// Tells of effects without which the log would be the same.
void tell_idle_effects(const experiment::CampaignDesign& design, const GenerateOptions& options,
                       const std::vector<experiment::SyntheticThrow>& throws) {
  for (const auto& effect : experiment::known_effects()) {
    auto without = design;
    if (std::erase_if(without.effects,
                      [&](const auto& one) { return one.first.starts_with(effect.id + "."); }) == 0)
      continue;
    bool idle = experiment::campaign_header(without, options.seed) ==
                experiment::campaign_header(design, options.seed);
    for (std::size_t i = 0; idle && i < throws.size(); ++i)
      idle = same(experiment::generate_throw(without, options.seed, static_cast<int>(i)).record,
                  throws[i].record);
    if (idle) tell("unhand: {} changes nothing in this campaign{}\n", effect.id, missing_carrier(effect));
  }
}

Json pose_json(const dynamics::Pose<double>& p) { return {p.x, p.z, p.theta}; }
Json twist_json(const dynamics::Twist<double>& v) { return {v.vx, v.vz, v.omega}; }

Json patch_json(const contact::Patch<double>& patch) {
  return {{"mu", patch.mu}, {"radius", patch.radius}, {"length", patch.length()}, {"pads", patch.pads}};
}
Json opening_json(const contact::OpeningProfile<double>& opening) {
  return {{"open_command", opening.open_command},
          {"grip_force", opening.grip_force},
          {"dead_time", opening.dead_time},
          {"opening_time", opening.opening_time},
          {"shape", opening.shape}};
}

Json throw_json(const experiment::SyntheticThrow& one) {
  const auto& [record, t] = one;
  Json out;
  out["object"] = record.object;
  out["condition"] = record.condition;
  out["mu"] = t.patch.mu;
  out["grasp_angle"] = t.grasp_angle;
  out["grasp_offset"] = t.grasp_offset;
  out["opening"] = opening_json(t.opening);
  out["hand_at_switch"] = {{"pose", pose_json(t.motion.pose)},
                           {"twist", twist_json(t.motion.twist)},
                           {"acceleration_before", t.motion.before},
                           {"acceleration_after", t.motion.after}};
  out["detach"] = {
      {"time", t.detach_time}, {"pose", pose_json(t.detach_pose)}, {"twist", twist_json(t.detach_twist)}};
  out["slip"] = t.slip;
  out["pivot"] = t.pivot;
  out["landing"] = {{"time", t.landing_time}, {"pose", pose_json(t.landing_pose)}};
  return out;
}

/// What the log does not tell, schema "truth": parameters, effects, and one entry per throw, by id in the
/// log's order. SI units and radians; poses are of the true CoM, [x, z, theta].
Json truth_json(const experiment::CampaignDesign& design, std::uint64_t seed, const std::string& log,
                const std::vector<experiment::SyntheticThrow>& throws) {
  Json out = json_head("truth");
  out["log"] = log;
  out["campaign"] = design.name;
  out["seed"] = seed;
  out["contact_model"] = design.contact_model;
  out["gravity"] = design.gravity;
  out["landing_height"] = design.landing_height;
  out["patch"] = patch_json(design.patch);
  out["opening"] = opening_json(design.opening);
  out["reference_force"] = design.reference_force();
  out["objects"] = Json::object();
  for (const auto& object : design.objects)
    out["objects"][object.name] = {{"mass", object.body.mass},
                                   {"inertia", object.body.inertia},
                                   {"com_offset", object.com_offset},
                                   {"drag_k", object.drag_k}};
  out["effects"] = Json::object();
  for (const auto& [name, value] : design.effects) {
    const auto* parameter = experiment::find_parameter(experiment::without_object(name));
    out["effects"][name] = {{"value", value}, {"unit", parameter->unit}, {"neutral", parameter->neutral}};
  }
  out["throws"] = Json::object();
  for (const auto& one : throws) out["throws"][one.record.id] = throw_json(one);
  return out;
}

void generate(const GenerateOptions& options) {
  const auto design = design_of(options);
  require_outputs({{options.out, Wanted::log}, {options.json}, {options.truth}});
  auto throws = simulate(design, options);
  tell_idle_effects(design, options, throws);
  Outputs outputs;
  if (!options.truth.empty())
    outputs.json(options.truth, truth_json(design, options.seed, options.out, throws));
  auto log = experiment::campaign_header(design, options.seed);
  for (auto& one : throws) log.throws.push_back(std::move(one.record));
  const auto test = std::count_if(log.throws.begin(), log.throws.end(),
                                  [](const auto& one) { return one.split == datasets::Split::test; });
  outputs.log(options.out, log);
  if (!options.json.empty()) {
    Json report = json_head("generate");
    report["campaign"] = options.campaign;
    report["seed"] = options.seed;
    report["log"] = options.out;
    report["throws"] = log.throws.size();
    report["train"] = log.throws.size() - static_cast<std::size_t>(test);
    report["test"] = test;
    report["conditions"] = design.conditions();
    report["contact_model"] = design.contact_model;
    outputs.json(options.json, report);
  }
  outputs.commit();
  fmt::print("{}: {} throws of campaign {} ({} train, {} test; {} conditions), seed {}\n", options.out,
             log.throws.size(), options.campaign, log.throws.size() - static_cast<std::size_t>(test), test,
             design.conditions(), options.seed);
}

std::string footer() {
  std::string out =
      "Examples:\n"
      "  unhand generate batch180 --seed 7 --out campaign.h5\n"
      "  unhand generate random --seed 3 --effect contact.stribeck=1.3 --effect contact.stribeck.v_s=0.01 "
      "\\\n"
      "      --out campaign.h5 --truth truth.json\n"
      "  unhand generate random --seed 4 --effect random --without ft --out campaign.h5 --truth truth.json\n"
      "Effects and their parameters (neutral, range); ID=value sets the first:\n";
  for (const auto& effect : experiment::known_effects()) {
    std::vector<std::string> parameters;
    for (const auto& p : effect.parameters)
      parameters.push_back(fmt::format("{}{} ({}, {} .. {}{})", p.name, effect.per_object ? "[OBJECT]" : "",
                                       p.neutral, p.low, p.high, dynamics::after_number(p.unit)));
    out += fmt::format("  {}: {}\n      {}\n", effect.id, effect.mechanism, fmt::join(parameters, ", "));
  }
  return out;
}

}  // namespace

Command generate_command(Parser& root) {
  auto options = std::make_shared<GenerateOptions>();
  Parser& parser = root.subcommand("generate", "Make the throw log of a synthetic campaign");
  parser
      .option("CAMPAIGN", options->campaign,
              fmt::format("Which campaign: {}", fmt::join(experiment::campaign_names(), ", ")))
      .required();
  parser.file("--out", options->out, "The throw log to write (replaced if it exists)").required();
  parser.option("--seed", options->seed, "Seed of everything random; the same seed gives the same log")
      .with_default();
  parser
      .option(
          "--effect", options->effects,
          "ID=value (sets the effect's first parameter), ID.parameter=value or ID[object]=value: what the "
          "world or the sensors do and the log does not say; 'random': one drawn with the seed. Several with "
          "blanks or commas between, "
          "or repeated")
      .with_commas()
      .assignments();
  parser
      .option("--without", options->without,
              "Leave sensors out: ft, wrench, mocap or landing; several with commas between, or repeated")
      .one_of({"ft", "wrench", "mocap", "landing"})
      .with_commas()
      .one_value_each();
  parser.file("--truth", options->truth,
              "Write the truth (parameters, effects, every throw) as JSON; the log never tells it");
  parser.file("--json", options->json, "Write what was made as JSON");
  add_threads(parser, options->threads);
  parser.footer(footer());
  return {&parser, [options] { generate(*options); }};
}

}  // namespace unhand::apps
