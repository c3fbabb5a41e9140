// unhand plan throw: a motion of the arm that throws an object into a box, whenever exactly it leaves the
// hand.
#include "apps/plan_throw.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <tuple>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/figure.hpp"
#include "apps/numbers.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "contact/friction_effects.hpp"
#include "contact/registry.hpp"
#include "datasets/model_card.hpp"
#include "datasets/sku.hpp"
#include "fitting/card.hpp"
#include "fitting/sku/sku_inputs.hpp"
#include "planners/arm/chain_file.hpp"
#include "planners/arm/panda.hpp"
#include "planners/tube/planar_hand.hpp"
#include "planners/tube/planar_joints.hpp"
#include "planners/tube/robust_throw.hpp"

namespace unhand::apps {
namespace {

using planners::Chain;
using planners::JointVector;

/// Of a gripper alone, and of one with an object that no SKU tells of [kg].
constexpr double kGripperMass = 0.65, kLoadedGripperMass = 0.9;

struct PlanThrowOptions {
  std::string arm{"panda"}, tip, home, target, box{"0.15x0.15"}, card, sku, json, report;
  double acceleration{0}, jerk{0};     // 0: the file gives them
  std::optional<double> gripper_mass;  // nothing: kGripperMass or kLoadedGripperMass
  std::optional<double> drag;          // nothing: the SKU tells it, else 0
  double window{0.1}, gripper{0.15};
  int draws{1000}, samples{3000}, threads{0};
  std::uint64_t seed{1};
  bool planar{false}, plain{false};
};

/// Gives joints the limits that the arm's file does not tell.
void fill_limits(Chain& arm, const PlanThrowOptions& options) {
  for (auto& joint : arm.joints)
    for (const auto& [limit, given, name] :
         {std::tuple<double&, double, const char*>{joint.limits.acceleration, options.acceleration,
                                                   "acceleration"},
          std::tuple<double&, double, const char*>{joint.limits.jerk, options.jerk, "jerk"}}) {
      if (std::isfinite(limit)) continue;
      if (!(given > 0))
        throw WrongUsage(fmt::format(
            "--{0}: joint '{1}' of {2} has no limit of {0}: give one for all joints that have none", name,
            joint.name, options.arm));
      limit = given;
    }
}

/// Where the arm rests before the throw [rad], and who told it.
struct RestPose {
  JointVector<double> q;
  std::string from;
};
RestPose rest_pose_of(const PlanThrowOptions& options, const Chain& arm) {
  if (options.home.empty()) {
    if (options.arm == "panda") return {planners::panda_ready(), "its ready pose"};
    return {planners::rest_pose(arm),
            arm.home.size() > 0 ? "home_rad of its file" : "the middle of its joints' ranges"};
  }
  const auto degrees = numbers("--home", options.home, ',', arm.joints.size());
  RestPose out{JointVector<double>(arm.size()), "--home"};
  for (int i = 0; i < arm.size(); ++i) {
    const auto& [name, origin, link, limits, friction] = arm.joints[static_cast<std::size_t>(i)];
    constexpr double kDegree = std::numbers::pi / 180;
    out.q[i] = degrees[static_cast<std::size_t>(i)] * kDegree;
    if (!(out.q[i] >= limits.lower && out.q[i] <= limits.upper))
      throw WrongUsage(fmt::format("--home: {:g} deg of joint '{}' is not in [{:.4g}, {:.4g}] deg",
                                   degrees[static_cast<std::size_t>(i)], name, limits.lower / kDegree,
                                   limits.upper / kDegree));
  }
  return out;
}

/// The arm with its gripper and, where an SKU tells of it, the object in it.
Chain armed(const PlanThrowOptions& options, const std::optional<datasets::Sku>& sku) {
  Chain arm;
  try {
    arm = planners::read_chain(options.arm, options.tip);
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--{}", error.what()));
  }
  for (const auto& note : arm.notes) tell("note: {}: {}\n", options.arm, note);
  fill_limits(arm, options);
  arm = planners::with_gripper(arm, options.gripper,
                               options.gripper_mass.value_or(sku ? kGripperMass : kLoadedGripperMass));
  if (!sku) return arm;
  const double about_its_axis = 0.1 * *sku->inertia;  // which the arm does not turn in planar throws
  return planners::with_payload(arm,
                                {sku->mass,
                                 {0, 0, sku->com_offset},
                                 planners::symmetric(*sku->inertia, *sku->inertia, about_its_axis, 0, 0, 0)});
}

planners::PlanOptions plan_options(const PlanThrowOptions& options, const Chain& arm,
                                   const JointVector<double>& home, bool planar,
                                   const Eigen::Vector3d& target) {
  planners::PlanOptions out;
  // The tube's landings come down at no more than so much: half as fast again as from above any arm.
  constexpr double kHighest = 1.5, kMargin = 1.5;  // m, -
  const double fall = std::sqrt(2 * out.search.medium.gravity * std::max(0.0, kHighest - target.z()));
  out.search.landing.z_rate_low = std::min(out.search.landing.z_rate_low, -kMargin * fall);
  out.search.window = options.window;
  out.search.samples = options.samples;
  out.search.threads = options.threads;
  out.refine = !options.plain;
  out.home = home;
  if (!planar) return out;
  std::string reason;
  auto held = planners::planar_joints(arm, out.home, target, &reason);
  if (!held)
    throw Unanswered(fmt::format(
        "no_plane: {} cannot throw in the vertical plane of the target: {}; {}", options.arm, reason,
        options.planar ? "plan it without --planar"
                       : "a release as a card says is planar: plan it without --card"));
  out.search.fixed = std::move(*held);
  return out;
}

/// Landings at delays drawn evenly from the window; `aimed`: by a throw that a release in the middle of the
/// window brings to the middle of the box, to first order.
PredictedLandings by_delay(const std::string& name, const ThrowAnswer& a,
                           const planners::JointVector<double>& qdd, const PlanThrowOptions& options,
                           bool aimed = false) {
  const planners::TubeProblem problem{a.chain, a.plan.nominal.state, a.box.middle, a.window, a.medium};
  const auto table = planners::landings_over_window(problem, qdd, 201);
  planners::LandingAt aim{};
  if (const auto& middle = table[table.size() / 2]; aimed && middle.lands) aim = middle;
  std::mt19937_64 random(options.seed);
  std::uniform_int_distribution<std::size_t> delay(0, table.size() - 1);
  PredictedLandings out{name, {}, 0};
  for (int i = 0; i < options.draws; ++i) {
    const auto& at = table[delay(random)];
    if (!at.lands) {
      ++out.drawn.lost;
      continue;
    }
    out.drawn.miss.push_back(at.forward - aim.forward);
    out.across.miss.push_back(at.across - aim.across);
    out.hits += a.box.holds(at.x - aim.x, at.y - aim.y);
  }
  planners::summarise(out.drawn);
  planners::summarise(out.across);
  return out;
}

PredictedLandings by_release(const std::string& name, const planners::JointTrajectory& motion,
                             const ThrowAnswer& a, const planners::ReleaseThrow& release,
                             const PlanThrowOptions& options) {
  const planners::HeldMotion before(release, motion);
  PredictedLandings out{name, planners::draw_landings(release, options.draws, options.seed, &before), 0};
  const planners::ThrowPlane plane(planners::forward_kinematics(release.chain, release.start.q).p,
                                   release.target);
  for (const double miss : out.drawn.miss)
    out.hits += a.box.holds(miss * plane.along.x(), miss * plane.along.y());
  out.across.miss.assign(out.drawn.miss.size(), 0.0);  // the release stays in the plane
  planners::summarise(out.across);
  return out;
}

/// The numbers of the release and where each is from.
std::vector<ThrowAnswer::Number> numbers_of(const planners::ReleaseCard& card,
                                            const planners::HeldObject& object,
                                            const std::optional<datasets::Sku>& sku) {
  std::vector<ThrowAnswer::Number> out;
  const auto say = [](const std::string& value, const std::string& sigma, bool uncertain) {
    return !uncertain || value == sigma ? value : fmt::format("{}; sigma: {}", value, sigma);
  };
  const auto origin = [&](const char* name) {
    const auto found = card.origins.find(name);
    return found == card.origins.end() ? planners::NumberOrigin{} : found->second;
  };
  const auto add = [&](const char* name, const char* unit, double value, std::optional<double> sigma) {
    const auto [from, of_sigma, with, counted_in] = origin(name);
    std::string told = say(to_string(from), to_string(of_sigma), sigma.value_or(0) > 0);
    if (!with.empty()) told += fmt::format(", with {}", fmt::join(with, " and "));
    out.push_back({name, unit, value, sigma, told, counted_in});
  };
  add("mu", "-", card.mu.value, card.mu.sigma);
  add("length", "m", card.length, card.length_sigma);
  for (const auto& [own, value] : contact::given_law_parameters(card.model, card.law_values))
    add(own.name.c_str(), own.unit.c_str(), value, {});
  const auto of_effects = contact::effect_values(card.friction);
  std::size_t k = 0;
  for (const auto& [effect, apply, apply_dual] : contact::friction_effects())
    for (const auto& p : effect.parameters) {
      const double value = *of_effects[k++];
      if (std::find(card.effects.begin(), card.effects.end(), effect.id) != card.effects.end())
        add(effect.full_name(p).c_str(), p.unit.c_str(), value, {});
    }
  add("pads", "-", card.pads, 0);
  add("grip_force", "N", card.grip_force, {});
  add("dead_time", "s", card.dead_time.value, card.dead_time.sigma);
  add("opening_time", "s", card.opening_time.value, card.opening_time.sigma);
  add("shape", "-", card.shape, card.shape_sigma);
  const std::string told = sku ? "SKU" : "assumed";
  const auto teller = [&](std::optional<double> datasets::Sku::*sigma) -> std::string {
    return sku && (*sku).*sigma ? "SKU" : "assumed";
  };
  out.push_back(
      {"mass", "kg", object.mass, object.mass_sigma, say(told, teller(&datasets::Sku::mass_sigma), true)});
  out.push_back({"inertia", "kg m2", object.inertia, object.inertia_sigma,
                 say(told, teller(&datasets::Sku::inertia_sigma), true)});
  const auto& com = object.com_offset;
  std::string of_sigma = teller(&datasets::Sku::com_offset_sigma);
  if (card.grasp_offset > 0) of_sigma += " and card";
  out.push_back(
      {"com_offset", "m", com.value, std::hypot(com.sigma, card.grasp_offset), say(told, of_sigma, true)});
  out.push_back({"grasp_angle", "rad", object.angle, card.grasp_angle,
                 say("assumed", to_string(origin("grasp_angle").sigma), card.grasp_angle > 0)});
  return out;
}

/// The plan made insensitive to what the card leaves open, where that is possible within the limits and
/// brings no fewer draws into the box: the choice does not look at the swing, in which a grip may slip.
void plan_release(ThrowAnswer& a, planners::ReleaseThrow release, const planners::PlanOptions& how,
                  const PlanThrowOptions& options) {
  a.with_release = true;
  a.real = planners::release_landing(release, planners::nominal_draw(release));
  if (!a.real)
    throw Unanswered(fmt::format(
        "the object is not free of the pads within {} s, or never comes down to the target", release.hold));
  a.rigid = planners::rigid_landing(release, release.object.com_offset.value, a.real->detach_time);
  a.spread_before = planners::release_spread(release);
  a.predicted = {by_release("tube acceleration", a.plan.motion, a, release, options)};
  a.needed_force = planners::HeldMotion(release, a.plan.motion).needed_force();
  std::string reason;
  auto robust = planners::plan_robust_throw(release, how.home, &reason);
  if (!robust) {
    tell("unhand: of the motions to the insensitive throw none will do ({}); the tube's is kept\n", reason);
    return;
  }
  release.start = robust->choice.start, release.qdd = robust->choice.qdd;
  auto insensitive = by_release("insensitive motion", robust->motion, a, release, options);
  const auto& tube = a.predicted.front();
  if (insensitive.hits < tube.hits) {
    tell(
        "unhand: the insensitive motion brings {} of {} draws into the box ({} slip in the hand or never "
        "land), the tube's {}: that is kept\n",
        insensitive.hits, options.draws, insensitive.drawn.lost, tube.hits);
    a.predicted.push_back(std::move(insensitive));
    return;
  }
  a.predicted.insert(a.predicted.begin(), std::move(insensitive));
  a.plan.motion = std::move(robust->motion);
  a.plan.limits = robust->limits;
  a.plan.nominal.state = release.start;
  a.of_tube = false;
  a.plan.qdd = release.qdd;
  const planners::TubeProblem rigid{a.chain, release.start, a.box.middle, a.window, a.medium};
  const auto landings = [&](const planners::JointVector<double>& qdd) {
    return planners::landings_over_window(rigid, qdd, planners::kLandingSamples);
  };
  a.plan.landings = landings(release.qdd);
  a.plan.tube_landings.clear();  // of another throw
  a.plan.at_rest = landings(planners::JointVector<double>::Zero(release.chain.size()));
  a.spread_after = planners::release_spread(release);
  a.needed_force = planners::HeldMotion(release, a.plan.motion).needed_force();
}

/// Where the plan is beyond what its card was tried on.
std::vector<std::string> beyond(const datasets::ModelCard& card, const ThrowAnswer& a,
                                const planners::Chain& pads, const planners::HeldObject& object,
                                const std::optional<datasets::Sku>& sku) {
  const auto tip = planners::tip_motion<double>(pads, a.plan.nominal.state.q, a.plan.nominal.state.qd,
                                                JointVector<double>::Zero(pads.size()));
  const planners::ThrowPlane plane(tip.frame.p, a.box.middle);
  const double omega = tip.omega.dot(Eigen::Vector3d(plane.along.y(), -plane.along.x(), 0));
  auto out = fitting::outside_range(card, {{"mass", "kg", object.mass},
                                           {"com_offset", "m", object.com_offset.value},
                                           {"release_speed", "m/s", tip.velocity.norm()},
                                           {"release_omega", "rad/s", omega}});
  if (sku)
    if (const auto surface = fitting::untried_surface(card, sku->surface)) out.push_back(*surface);
  return fitting::reasons_of(out);
}

/// --drag, else the SKU's [1/m].
double drag_of(ThrowAnswer& a, const PlanThrowOptions& options, const std::optional<datasets::Sku>& sku) {
  const std::optional<double> told = sku ? sku->drag_k : std::nullopt;
  a.drag_from = options.drag ? "--drag" : "SKU";
  if (options.drag && told && *options.drag != *told)
    tell("note: --drag {:g} is taken, not drag_k_per_m = {:g} of {}\n", *options.drag, *told, options.sku);
  return options.drag ? *options.drag : told.value_or(0);
}

/// Motions over which the grip does not hold its object.
struct DroppingMotions {
  int count{};
  std::optional<double> least_force;  ///< of one pad, that would hold over the gentlest of them [N]

  /// As planners::PlanOptions::refuse.
  std::string look(const planners::ReleaseThrow& release, const planners::JointTrajectory& motion) {
    const planners::HeldMotion held(release, motion);
    if (held.holds(planners::nominal_draw(release))) return "";
    ++count;
    if (const auto needed = held.needed_force())
      least_force = std::min(*needed, least_force.value_or(*needed));
    return "the grip does not hold the object";
  }
  std::string in_words(const planners::ReleaseCard& card) const {
    std::string out = fmt::format(
        "a grip of {:.4g} N per pad lets the object slip before the gripper opens in {} of the motions "
        "within the limits",
        card.grip_force, count);
    if (least_force)
      out += fmt::format("; the gentlest of them needs at least {:.3g} N per pad", *least_force);
    return out;
  }
};

/// The box that is aimed at.
planners::TargetBox box_of(const PlanThrowOptions& options) {
  const auto target = numbers<3>("--target", options.target, ',');
  constexpr double kFarthest = 1000;  // m
  for (const double one : target)
    if (!(std::abs(one) <= kFarthest))
      throw WrongUsage(fmt::format("--target: {:g} m is not in [{:g}, {:g}] m", one, -kFarthest, kFarthest));
  const auto box = numbers<2>("--box", options.box, 'x');
  if (!(box[0] > 0 && box[1] > 0)) throw WrongUsage(fmt::format("--box: '{}' has no area", options.box));
  return {{target[0], target[1], target[2]}, box[0], box[1]};
}

std::optional<datasets::Sku> sku_of(const PlanThrowOptions& options) {
  if (options.sku.empty()) return {};
  return read_throwable_sku(options.sku);
}

/// What is thrown: the SKU or, without one, the planner's own object; what is not known of it is as uncertain
/// as validate-sku assumes.
planners::HeldObject object_of(const std::optional<datasets::Sku>& sku) {
  const fitting::AssumedTolerances assumed;
  planners::HeldObject out;
  if (!sku) {
    out.com_offset = {0, assumed.com_offset};
    out.mass_sigma = assumed.mass * out.mass, out.inertia_sigma = assumed.inertia * out.inertia;
    return out;
  }
  out.mass = sku->mass, out.inertia = *sku->inertia;
  out.mass_sigma = fitting::mass_sigma_of(*sku), out.inertia_sigma = fitting::inertia_sigma_of(*sku);
  out.com_offset = {sku->com_offset, sku->com_offset_sigma.value_or(assumed.com_offset)};
  return out;
}

void plan_throw(const PlanThrowOptions& options) {
  require_outputs({{options.json}, {options.report, Wanted::directory}},
                  {options.arm, options.card, options.sku});
  if (!options.report.empty()) require_gnuplot();
  ThrowAnswer answer;
  answer.box = box_of(options);
  std::optional<planners::ReleaseCard> card;
  datasets::ModelCard read;
  if (!options.card.empty()) {
    read = read_card(options.card);
    card = planners::release_card(read, options.card);
  }
  const auto given = sku_of(options);
  const planners::HeldObject object = object_of(given);
  if (given) answer.lever = given->com_offset;
  const Chain pads = armed(options, given);
  answer.chain = planners::with_tool(pads, {Eigen::Matrix3d::Identity(), {0, 0, object.com_offset.value}});
  const RestPose rest = rest_pose_of(options, pads);
  auto how = plan_options(options, pads, rest.q, options.planar || card.has_value(), answer.box.middle);
  how.search.medium.drag_k = drag_of(answer, options, given);
  how.search.window = answer.window = std::max(options.window, card ? planners::window_for(*card) : 0.0);
  constexpr double kLongestWindow = 1;  // [s]
  if (answer.window > kLongestWindow && options.window <= kLongestWindow)
    throw Unanswered(fmt::format(
        "{}: the gripper takes up to {:.3g} s to let go (dead time, opening time and what they vary by); a "
        "throw is planned for at most {} s",
        options.card, answer.window, kLongestWindow));
  const auto release_of = [&](const planners::ThrowPlan& plan) {
    planners::ReleaseThrow release{pads, plan.nominal.state, plan.qdd, answer.box.middle};
    release.hold = answer.window + 1e-6;
    release.card = *card;
    release.object = object;
    release.medium = how.search.medium;
    return release;
  };
  DroppingMotions dropping;
  if (card)
    how.refuse = [&](const planners::ThrowPlan& plan) {
      return dropping.look(release_of(plan), plan.motion);
    };
  std::optional<Progress> progress(std::in_place, "plan throw", 0);
  auto result = planners::plan_throw(answer.chain, answer.box, how);
  if (result.outcome == planners::PlanOutcome::no_rest)
    throw Unanswered(fmt::format("{}: {} (this pose is {}; --home gives another)", to_string(result.outcome),
                                 result.reason, rest.from));
  if (!result.plan)
    throw Unanswered(fmt::format("{}: {}", to_string(result.outcome),
                                 dropping.count > 0 ? dropping.in_words(*card) : result.reason));
  if (dropping.count > 0) tell("note: passed over for another: {}\n", dropping.in_words(*card));
  answer.plan = std::move(*result.plan);
  answer.medium = how.search.medium;
  if (card) {
    answer.numbers = numbers_of(*card, object, given);
    answer.passed_over = card->passed_over;
    plan_release(answer, release_of(answer.plan), how, options);
    answer.beyond_card = beyond(read, answer, pads, object, given);
  } else {
    answer.predicted = {
        by_delay("planned", answer, answer.plan.qdd, options),
        by_delay("Tube-CVX", answer, answer.plan.tube.qdd, options),
        by_delay("no acceleration", answer, planners::JointVector<double>::Zero(pads.size()), options, true)};
  }

  progress.reset();
  Outputs outputs{{options.arm, options.card, options.sku}};
  Json json = json_head("plan-throw");
  json["arm"] = options.arm;
  json["card"] = options.card.empty() ? Json(nullptr) : Json(options.card);
  json.update(throw_json(answer));
  if (!options.json.empty()) outputs.json(options.json, json);
  if (!options.report.empty()) write_report(answer, json, outputs.directory(options.report));
  outputs.commit();
  fmt::print("{}", text_of(answer));
}

}  // namespace

Command plan_throw_command(Parser& plan) {
  auto o = std::make_shared<PlanThrowOptions>();
  Parser& parser = plan.subcommand("throw", "Throw into a box, whenever exactly the object leaves the hand");
  parser.option("--target", o->target, "Middle of the box in the base's frame, X,Y,Z [m]").required();
  parser.option("--box", o->box, "Opening of the box along x and y, AxB [m]").with_default();
  parser.option("--arm", o->arm, "panda, a TOML chain or a URDF file").with_default();
  parser.option("--tip", o->tip, "Of a URDF file: the link that carries the gripper, if several links end");
  parser.option(
      "--home", o->home,
      "Rest pose before the throw, one angle for each joint, A,B,... [deg]; else home_rad of a TOML "
      "file, the Panda's ready pose, or the middle of the joints' ranges");
  parser.option("--acceleration", o->acceleration, "Limit of joints that the arm's file gives none [rad/s2]")
      .range(1e-3, 1e6);
  parser.option("--jerk", o->jerk, "The same of the jerk [rad/s3]").range(1e-3, 1e9);
  parser.option("--gripper", o->gripper, "From the flange to the middle of the pads [m]")
      .range(0.0, 1.0)
      .with_default();
  parser
      .option("--gripper-mass", o->gripper_mass, "Gripper [kg], 0.65; without --sku, gripper and object, 0.9")
      .range(0.0, 10.0);
  parser.option("--window", o->window, "The object may leave at any time up to this after the command [s]")
      .range(0.01, 0.5)
      .with_default();
  parser
      .option("--drag", o->drag,
              "Quadratic drag of the flight, k in a = -k |v| v [1/m]; else that of the SKU")
      .range(0.0, 10.0);
  parser.file("--card", o->card, "A model card: the release follows its contact model (planar throws)");
  parser.file("--sku", o->sku, "The object: mass, inertia, drag, offset of its centre of mass from the pads");
  parser.flag("--planar", o->planar,
              "Throw in the vertical plane of the target, with the joints whose axes are normal to it");
  parser.flag("--tube-cvx", o->plain, "Stop at the convex problem, without refinement");
  parser.option("--samples", o->samples, "Configurations searched").range(1, 1000000).with_default();
  parser.option("--draws", o->draws, "Landings drawn").range(1, 1000000).with_default();
  parser.option("--seed", o->seed, "Seed of the draws").with_default();
  parser.file("--json", o->json, "Write the plan as JSON");
  add_threads(parser, o->threads);
  parser.file(
      "--report", o->report,
      "Directory for the tables (Markdown), the plan as JSON, trajectory.csv, landings.csv and figures");
  parser.footer(
      "Without a card, the object leaves at a delay that may be anything in the window. With one, it is\n"
      "let go as the card's contact model says, and the motion is the one whose landings depend least on\n"
      "friction, delay and grasp.\n"
      "Exit code 1 says why there is no plan. Outputs of an earlier run in the same place are replaced. "
      "Example:\n"
      "  unhand plan throw --target 1.3,0,-0.2 --box 0.15x0.15 --report out/throw");
  return {&parser, [o] { plan_throw(*o); }};
}

}  // namespace unhand::apps
