// unhand plan flip: learn to throw a bar so that it lands where and how it should, on a simulated robot.
#include "apps/plan_flip.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <memory>
#include <numbers>

#include "apps/figure.hpp"
#include "apps/flip_store.hpp"
#include "apps/plan.hpp"
#include "datasets/log_error.hpp"
#include "fitting/card.hpp"
#include "planners/flip/release_learner.hpp"

namespace unhand::apps {
namespace {

namespace fl = planners::flip;
namespace fs = std::filesystem;

struct Options {
  std::string target, learner{"m4"}, robot{"panda-flip"}, card, json, report;
  std::uint64_t seed{1};
  int iterations{5}, throws{3}, repeats{5};
  double com_offset{-1};
};

fl::FlipTarget target_of(const std::string& text) {
  double x = 0, angle = 0;
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, x);
  if (first.ec != std::errc{} || first.ptr == end || *first.ptr != ',')
    throw WrongUsage(fmt::format("--target: '{}' is not X,DEGREES", text));
  const auto second = std::from_chars(first.ptr + 1, end, angle);
  if (second.ec != std::errc{} || second.ptr != end || !std::isfinite(x) || !std::isfinite(angle))
    throw WrongUsage(fmt::format("--target: '{}' is not X,DEGREES", text));
  return {{x, angle * std::numbers::pi / 180}};
}

/// The learner, and what it knows: throws of this bar ("support"), or of the old one ("population").
std::unique_ptr<fl::FlipLearner> learner_of(const Options& o, const fl::FlipRobot& robot,
                                            std::optional<fl::HandLibrary>& library,
                                            const fl::Thrower& thrower, FlipAnswer& answer) {
  const fl::CommandRange& range = robot.motion.range;
  if (o.learner == "m3") {
    const double shift = answer.bar.com_offset - robot.bar.com_offset;
    answer.known = fl::transferred(answer.population->data, shift);
    return std::make_unique<fl::TransferLearner>(answer.population->data, shift, answer.target, range);
  }
  // Models 1 and 2 begin anew with a new bar; model 4 takes what it learned of the old one along.
  const bool anew = o.learner != "m4";
  const fl::Gathered support =
      fl::gather(thrower, "support", fl::support_simplex(range), o.throws, anew ? answer.bar : robot.bar);
  if (support.data.size() < (anew ? 3u : 1u)) throw Unanswered("too few of the support throws landed");
  if (anew) {
    answer.known = support.data;
    return std::make_unique<fl::ConeLearner>(
        o.learner == "m1" ? fl::ForwardModel::landing : fl::ForwardModel::detach, support.data, answer.target,
        range);
  }
  answer.known = fl::transferred(support.data, answer.bar.com_offset - robot.bar.com_offset);
  fl::HandLibrary old(robot, robot.bar, 2);
  const planners::ReleaseCard prior =
      o.card.empty()
          ? fl::prior_card(robot)
          : planners::release_card(datasets::read_model_card(o.card), o.card, fl::prior_card(robot));
  const fl::ReleaseFit fit = fl::fit_release(old, prior, support.data);
  answer.card = datasets::to_json(fl::model_card_of(fit, o.robot));
  library.emplace(robot, answer.bar);
  return std::make_unique<fl::ReleaseLearner>(*library, fit.card, fl::left_over(old, fit.card, support.data),
                                              fl::scatter_of(support.trials, robot.bar.com_offset),
                                              answer.target, o.throws);
}

void run(const Options& o) {
  if (!o.report.empty()) {
    require_gnuplot();
    require_writable_directory(o.report);
  }
  require_writable(o.json);
  FlipAnswer answer;
  answer.learner = o.learner;
  answer.throws = o.throws;
  answer.target = target_of(o.target);
  const fl::FlipRobot robot = fl::read_flip_robot(o.robot);
  answer.bar = robot.bar;
  if (o.com_offset >= 0) answer.bar.com_offset = o.com_offset;
  if (o.learner == "m3" && o.com_offset < 0)
    throw WrongUsage("--learner m3 transfers to a bar with another centre of mass: --com-offset is missing");
  const fl::FlipPlant plant(robot, o.seed);
  std::optional<FlipStore> store;
  fl::Thrower thrower = fl::thrower_of(plant, o.seed);
  if (!o.report.empty()) {
    Json settings{{"target", {answer.target.pose.x, answer.target.pose.angle}},
                  {"learner", o.learner},
                  {"robot", fitting::checksum_of(o.robot).value_or(o.robot)},
                  {"seed", o.seed},
                  {"throws", o.throws},
                  {"repeats", o.repeats},
                  {"com_offset_m", answer.bar.com_offset},
                  {"card", o.card.empty() ? "" : fitting::checksum_of(o.card).value_or("")}};
    store.emplace(o.report, settings);
    thrower = store->over(std::move(thrower));
  }
  if (!o.report.empty() || o.learner == "m3")
    answer.population =
        fl::gather(thrower, "population", fl::population_grid(robot.motion.range), o.repeats, robot.bar);
  std::optional<fl::HandLibrary> library;
  const auto learner = learner_of(o, robot, library, thrower, answer);
  answer.path =
      fl::learn(*learner, answer.target, answer.known, answer.bar, thrower, {o.iterations, o.throws, false});
  fmt::print("{}", text_of(answer));
  if (store && store->recalled() > 0)
    fmt::print("{} throws recalled, {} thrown now\n", store->recalled(), store->thrown());
  Outputs outputs;
  if (!o.report.empty()) write_report(answer, outputs.directory(o.report));
  if (!o.json.empty()) outputs.json(o.json, json_of(answer));
  outputs.commit();
}

}  // namespace

Command plan_flip_command(Parser& plan) {
  auto o = std::make_shared<Options>();
  Parser& parser = plan.subcommand(
      "flip", "Learn to throw a bar so that it lands at a place and an angle, on a simulated robot");
  parser.footer(
      "Example: unhand plan flip --target 1.2,180 --learner m4 --robot robot.toml --seed 7 "
      "--report out/flip\n"
      "A run that was killed goes on where it was when it is given the same --report.");
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
              "Throw a bar with its centre of mass there [m]; m3 and m4 know throws of the robot file's")
      .range(0, 1);
  parser.option("--card", o->card, "Model card to begin from (m4)");
  parser.option("--iterations", o->iterations, "Commands to try").range(1, 1000).with_default();
  parser.option("--throws", o->throws, "Of each command").range(1, 100).with_default();
  parser.option("--repeats", o->repeats, "Of each of the 27 commands of the population")
      .range(1, 100)
      .with_default();
  parser.option("--json", o->json, "Write the numbers here");
  parser.option("--report", o->report, "Keep every throw here, and write table and figures");
  return {&parser, [o] { run(*o); }};
}

}  // namespace unhand::apps
