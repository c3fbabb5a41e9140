// unhand plan flip: learn to throw a bar so that it lands where and how it should, on a simulated robot.
#include "apps/plan_flip.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <numbers>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/figure.hpp"
#include "apps/flip_store.hpp"
#include "apps/numbers.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "datasets/log_error.hpp"
#include "datasets/sku.hpp"
#include "fitting/card.hpp"
#include "planners/flip/release_learner.hpp"

namespace unhand::apps {
namespace {

namespace fl = planners::flip;

struct PlanFlipOptions {
  int threads{1};
  std::string target, learner{"m4"}, robot{"panda-flip"}, sku, card, json, report;
  std::uint64_t seed{1};
  int iterations{5}, throws{3}, repeats{5};
  double com_offset{-1};
  /// Model 3 is about a shift; without one named, it is the paper's.
  bool paper_shift() const { return learner == "m3" && sku.empty() && com_offset < 0; }
};

/// From 12 to 18 cm [LiuDaCostaBillard2025].
constexpr double kPaperShift = 0.06;

fl::FlipTarget target_of(const std::string& text) {
  const auto [x, degrees] = numbers<2>("--target", text, ',');
  return {{x, degrees * kDegree}};
}

/// The bar that is thrown.
fl::Bar bar_of(const PlanFlipOptions& o, const fl::FlipRobot& robot) {
  fl::Bar out = robot.bar;
  if (!o.sku.empty()) {
    const datasets::Sku sku = read_throwable_sku(o.sku);
    if (sku.drag_k.value_or(0) > 0)
      tell("note: drag_k_per_m = {:g} of {} is passed over: throw-flip flies without drag\n", *sku.drag_k,
           o.sku);
    out = {sku.mass, *sku.inertia, sku.com_offset};
    if (const std::string why = fl::complaint_of(out); !why.empty())
      throw datasets::LogError(o.sku, "object", why);
  }
  if (o.com_offset >= 0) out.com_offset = o.com_offset;
  if (o.paper_shift()) out.com_offset += kPaperShift;
  return out;
}

/// Why the robot as declared lands the library's bar with none of its commands.
std::string why_none_lands(const fl::HandLibrary& library) {
  const fl::FlipRobot& robot = library.robot();
  const planners::ReleaseCard card = fl::prior_card(robot, robot.pads.law);
  const double offset = library.bar().com_offset;
  double least = std::numeric_limits<double>::infinity(), most = 0;  // way through the pads [m]
  std::size_t free = 0;
  for (std::size_t i = 0; i < library.commands().size(); ++i) {
    const auto release = fl::predicted_release(library.hand(i), card, library.bar());
    if (!release) continue;
    ++free;
    const auto& [x, z, angle, vx, vz, omega] = release->detach;
    const double slip = std::hypot(x - offset * std::cos(angle) - release->hand[0],
                                   z - offset * std::sin(angle) - release->hand[1]);
    least = std::min(least, slip), most = std::max(most, slip);
  }
  if (free == 0)
    return fmt::format("it is not free within window_s = {:g} s after the brake's start",
                       robot.motion.window);
  return fmt::format(
      "{} of {} let it go within window_s = {:g} s after the brake's start, but it never comes down to "
      "height 0; before, it slips {:.2g} to {:.2g} m through the pads, whose friction is {:.3g} N at most "
      "against its weight of {:.3g} N",
      free, library.commands().size(), robot.motion.window, least, most,
      robot.pads.count * robot.pads.mu * robot.gripper.grip_force,
      -planners::kGravity.z() * library.bar().mass);
}

/// Refuses a target beyond whatever a robot of this kind could reach, and says on stderr where it is
/// doubtful.
void check_reach(const fl::FlipTarget& target, const fl::HandLibrary& library) {
  constexpr double most = std::numeric_limits<double>::infinity(), beyond_x = 0.3,
                   beyond_angle = 90 * kDegree;
  fl::FlipPose low{most, most}, high{-most, -most}, nearest;
  double error = most;
  for (const auto& one : fl::declared_landings(library)) {
    if (!one) continue;
    low = {std::min(low.x, one->x), std::min(low.angle, one->angle)};
    high = {std::max(high.x, one->x), std::max(high.angle, one->angle)};
    if (const double e = fl::normalized_error(*one, target); e < error) error = e, nearest = *one;
  }
  const auto& [x, angle] = target.pose;
  if (error == most)
    throw Unanswered(fmt::format("{}: as declared it lands this bar with none of its commands: {}",
                                 library.robot().name, why_none_lands(library)));
  if (!(x >= low.x - beyond_x && x <= high.x + beyond_x && angle >= low.angle - beyond_angle &&
        angle <= high.angle + beyond_angle))
    throw WrongUsage(fmt::format(
        "--target: {:g} m, {:g} degrees; accepted: {:.2f} to {:.2f} m and {:.0f} to {:.0f} degrees (the "
        "robot "
        "as declared lands this bar at {:.2f} to {:.2f} m and {:.0f} to {:.0f} degrees)",
        x, angle / kDegree, low.x - beyond_x, high.x + beyond_x, (low.angle - beyond_angle) / kDegree,
        (high.angle + beyond_angle) / kDegree, low.x, high.x, low.angle / kDegree, high.angle / kDegree));
  if (error > std::numbers::sqrt2)
    tell(
        "unhand: note: out of reach of the robot as declared; nearest to the target it lands this bar at "
        "{:.2f} m, {:.0f} degrees\n",
        nearest.x, nearest.angle / kDegree);
}

/// The learner, and what it knows: throws of this bar ("support"), or of the old one ("population").
std::unique_ptr<fl::FlipLearner> learner_of(const PlanFlipOptions& o, const fl::FlipRobot& robot,
                                            std::optional<fl::HandLibrary>& library,
                                            const fl::Thrower& thrower, FlipAnswer& answer) {
  const fl::CommandRange& range = robot.motion.range;
  const double shift = answer.bar.com_offset - robot.bar.com_offset;
  if (o.learner == "m3") {
    answer.known_throws = static_cast<int>(answer.population->trials.size());
    answer.known = fl::transferred(answer.population->data, shift);
    return std::make_unique<fl::TransferLearner>(answer.population->data, shift, answer.target, range);
  }
  // Models 1 and 2 begin anew with a new bar; model 4 takes what it learned of the old one along.
  if (o.learner != "m4") answer.known_bar = answer.bar;
  const fl::Gathered support =
      fl::gather(thrower, "support", fl::support_simplex(range), o.throws, answer.known_bar);
  answer.known_throws = static_cast<int>(support.trials.size());
  if (support.data.size() < (o.learner == "m4" ? 1u : 3u))
    throw Unanswered("too few of the support throws landed");
  if (o.learner != "m4") {
    answer.known = support.data;
    return std::make_unique<fl::ConeLearner>(
        o.learner == "m1" ? fl::ForwardModel::landing : fl::ForwardModel::detach, support.data, answer.target,
        range);
  }
  answer.known = fl::transferred(support.data, shift);
  fl::HandLibrary old(robot, robot.bar, 2);
  const planners::ReleaseCard prior =
      o.card.empty() ? fl::prior_card(robot)
                     : planners::release_card(read_card(o.card), o.card, fl::prior_card(robot));
  if (!prior.effects.empty())
    throw datasets::CardError(
        o.card, "/effects",
        fmt::format("throw-flips take cards without effects on friction; this one has {}",
                    fmt::join(prior.effects, ", ")));
  const fl::ReleaseFit fit = fl::fit_release(old, prior, support.data);
  auto learned = fl::model_card_of(fit, old, support.data, o.robot);
  learned.library_version = UNHAND_VERSION;
  answer.card = datasets::to_json(learned);
  library.emplace(robot, answer.bar);
  return std::make_unique<fl::ReleaseLearner>(*library, fit, fl::left_over(old, fit.card, support.data),
                                              fl::scatter_of(support.trials, robot.bar.com_offset),
                                              answer.target, o.throws);
}

void run(const PlanFlipOptions& o) {
  if (!o.card.empty() && o.learner != "m4") throw WrongUsage("--card: only --learner m4 begins from a card");
  if (!o.report.empty()) require_gnuplot();
  require_outputs({{o.report, Wanted::directory}, {o.json}}, {o.sku, o.card, o.robot});
  FlipAnswer answer;
  answer.learner = o.learner;
  answer.throws = o.throws;
  answer.target = target_of(o.target);
  const fl::FlipRobot robot = fl::read_flip_robot(o.robot);
  answer.bar = bar_of(o, robot);
  answer.declared_bar = answer.known_bar = robot.bar;
  answer.paper_shift = o.paper_shift();
  const fl::FlipPlant plant(robot, o.seed);
  check_reach(answer.target, {robot, answer.bar, 5});
  std::optional<FlipStore> store;
  fl::Thrower thrower = fl::thrower_of(plant, o.seed);
  if (!o.report.empty()) {
    Json settings{{"target", {answer.target.pose.x, answer.target.pose.angle}},
                  {"learner", o.learner},
                  {"robot", fitting::checksum_of(o.robot).value_or(o.robot)},
                  {"seed", o.seed},
                  {"throws", o.throws},
                  {"repeats", o.repeats},
                  {"bar", bar_json(answer.bar)},
                  {"card", o.card.empty() ? "" : fitting::checksum_of(o.card).value_or("")}};
    store.emplace(o.report, settings);
    thrower = store->over(std::move(thrower));
  }
  std::optional<Progress> progress(std::in_place, "plan flip", 0);
  if (!o.report.empty() || o.learner == "m3")
    answer.population =
        fl::gather(thrower, "population", fl::population_grid(robot.motion.range), o.repeats, robot.bar);
  std::optional<fl::HandLibrary> library;
  const auto learner = learner_of(o, robot, library, thrower, answer);
  answer.path = fl::learn(*learner, answer.target, answer.known, answer.bar, thrower,
                          {o.iterations, o.throws, !(answer.known_bar == answer.bar)});
  progress.reset();
  Outputs outputs{{o.sku, o.card, o.robot}};
  if (!o.report.empty()) write_report(answer, outputs.directory(o.report));
  if (!o.json.empty()) outputs.json(o.json, flip_json(answer));
  outputs.commit();
  fmt::print("{}", text_of(answer));
  if (store && store->recalled() > 0)
    fmt::print("{} throws recalled, {} thrown now\n", store->recalled(), store->thrown());
}

}  // namespace

Command plan_flip_command(Parser& plan) {
  auto o = std::make_shared<PlanFlipOptions>();
  Parser& parser = plan.subcommand(
      "flip", "Learn to throw a bar so that it lands at a place and an angle, on a simulated robot");
  parser.footer(
      "Example: unhand plan flip --target 1.2,180 --learner m4 --robot robot.toml --seed 7 "
      "--report out/flip\n"
      "A run that was killed goes on where it was when it is given the same --report: throws that lie there "
      "are\n"
      "recalled; tables and figures of an earlier run are replaced.");
  parser
      .option("--target", o->target, "Landing place [m] and angle from hanging [deg], not wrapped: X,DEGREES")
      .required();
  parser
      .option(
          "--learner", o->learner,
          "m1: landing linear in the command; m2: detach state linear; m3: m2 with throws of the old bar; "
          "m4: release physics and what is left over")
      .one_of({"m1", "m2", "m3", "m4"})
      .with_default();
  parser.option("--robot", o->robot, "The robot as it is declared: panda-flip, or a TOML file")
      .with_default();
  parser.option("--seed", o->seed, "Which robot: each seed draws its own hidden numbers").with_default();
  parser
      .option("--com-offset", o->com_offset,
              "Throw a bar with its centre of mass there [m]; m3 and m4 know throws of the robot file's. Not "
              "given, m3 moves it by 0.06, as the paper does")
      .range(0, 1);
  parser.file("--sku", o->sku, "Throw this object: mass, inertia and centre of mass of an SKU file");
  parser.file("--card", o->card, "Model card to begin from (m4)");
  parser.option("--iterations", o->iterations, "Commands to try").range(1, 1000).with_default();
  parser.option("--throws", o->throws, "Of each command").range(1, 100).with_default();
  parser.option("--repeats", o->repeats, "Of each of the 27 commands of the population")
      .range(1, 100)
      .with_default();
  parser.file("--json", o->json, "Write the numbers here");
  add_one_thread(parser, o->threads);
  parser.file("--report", o->report, "Keep every throw here, and write table and figures");
  return {&parser, [o] { run(*o); }};
}

}  // namespace unhand::apps
