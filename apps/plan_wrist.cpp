// unhand plan wrist: what a spring in the wrist adds to a throw, against its stiffness.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "apps/command.hpp"
#include "apps/elastic_answer.hpp"
#include "apps/elastic_trajectory.hpp"
#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "apps/tell.hpp"
#include "planners/elastic/throw_refinement.hpp"
#include "planners/elastic/throw_table.hpp"

namespace unhand::apps {
namespace {

namespace el = planners::elastic;

struct PlanWristOptions {
  int threads{1};
  std::string arm{"vsa_wrist"}, json, report;
  double softest{0.5}, stiffest{64}, longest{1.0}, elevation{45};
  int stiffnesses{8}, starts{4}, intervals{8};
  unsigned seed{1};
};

/// The fastest confirmed throw with one stiffness. Its speed is the run's, not the plan's.
struct Point {
  double stiffness{}, speed{};
  el::ConfirmedThrow best;
};

el::ThrowTask task_of(const PlanWristOptions& o, el::Drive drive) {
  el::ThrowTask task;
  task.drive = drive;
  task.longest = o.longest;
  task.elevation = o.elevation * M_PI / 180;
  return task;
}

/// Takes the plan, refined, if its run confirms it and is faster.
void consider(const el::ClutchedArm& arm, const el::ThrowTask& task, const el::ElasticThrow& plan,
              const el::ThrowProgramOptions& program, Point& out) {
  if (!plan.solved()) return;
  el::ConfirmedThrow one = el::confirm(arm, task, plan, program);
  const double speed = std::hypot(one.run.release.vx, one.run.release.vz);
  if (!one.confirmed || speed <= out.speed) return;
  out.speed = speed;
  out.best = std::move(one);
}

/// From random starts.
Point solve(const el::ClutchedArm& arm, const PlanWristOptions& o, el::Drive drive) {
  Point out;
  out.stiffness = arm.last.stiffness;
  el::ThrowProgramOptions program;
  program.intervals = o.intervals;
  program.seed = o.seed;
  const el::ThrowTask task = task_of(o, drive);
  for (const el::Basin& basin : el::find_basins(arm, task, program, o.starts).found)
    consider(arm, task, basin.best, program, out);
  return out;
}

/// From the solution with a neighbouring stiffness: random starts miss what a neighbour has found.
void follow(el::ClutchedArm arm, const PlanWristOptions& o, const Point& from, Point& to) {
  if (from.speed == 0) return;
  arm.last.stiffness = to.stiffness;
  el::ThrowProgramOptions program;
  program.intervals = from.best.intervals;
  program.near = &from.best.plan;
  const el::ThrowTask task = task_of(o, el::Drive::passive);
  consider(arm, task, el::plan_throw(arm, task, program), program, to);
}

double most_stored(const Point& p) {
  double out = 0;
  for (const el::ReplaySample& s : p.best.run.samples)
    out = std::max(out, 0.5 * p.stiffness * std::pow(s.at[0] - s.at[1], 2));
  return out;
}

Figure gain_figure(const std::vector<Point>& points, const Point& rigid) {
  Figure figure{
      "gain",
      15,
      9,
      {{"spring", {"stiffness [N m/rad]", "tip speed [m/s]", "gain over rigid [-]", "stored [J]"}, {}, {}}},
      ""};
  for (const Point& p : points)
    figure.data[0].rows.push_back({p.stiffness, p.speed, p.speed / rigid.speed, most_stored(p)});
  figure.script = fmt::format(
      "set grid\nset logscale x 2\nset key right bottom\nset xlabel 'stiffness of the wrist [N m/rad]'\nset "
      "ylabel 'tip speed at the release "
      "[m/s]'\nset yrange [0:*]\nplot DATA using 1:2 with linespoints pt 7 lw 2 lc rgb '#0072b2' title "
      "'elastic wrist', {} with "
      "lines lw 2 dt 2 lc rgb '#555555' title 'rigid wrist'\n",
      rigid.speed);
  return figure;
}

/// The fastest throws with springs, softest first; from random starts, then from each other. Tells of those
/// with which none was found, which are left out.
std::vector<Point> by_stiffness(el::ClutchedArm arm, const PlanWristOptions& o) {
  std::vector<Point> out;
  for (int k = 0; k < o.stiffnesses; ++k) {
    arm.last.stiffness =
        o.softest * std::pow(o.stiffest / o.softest, static_cast<double>(k) / (o.stiffnesses - 1));
    out.push_back(solve(arm, o, el::Drive::passive));
  }
  for (std::size_t k = out.size() - 1; k > 0; --k) follow(arm, o, out[k], out[k - 1]);
  for (std::size_t k = 1; k < out.size(); ++k) follow(arm, o, out[k - 1], out[k]);
  for (const Point& p : out)
    if (p.speed == 0) tell("{:.2f} N m/rad: no throw was found that its run confirms\n", p.stiffness);
  std::erase_if(out, [](const Point& p) { return p.speed == 0; });
  return out;
}

Table table_of(const std::vector<Point>& points, const Point& rigid) {
  Table out{{"stiffness [N m/rad]", "tip speed [m/s]", "planned", "gain", "stored [J]", "motors [J]",
             "unexplained [J]", "limits used", "intervals"},
            {},
            1};
  const auto row = [&](const std::string& name, const Point& p, double stored) {
    const el::Replay& run = p.best.run;
    out.rows.push_back(
        {name, fmt::format("{:.3f}", p.speed), fmt::format("{:.3f}", p.best.plan.speed()),
         fmt::format("{:.2f}", p.speed / rigid.speed), fmt::format("{:.2f}", stored),
         fmt::format("{:.2f}", run.motor_work), fmt::format("{:.0e}", std::abs(run.unexplained())),
         fmt::format("{:.1f} %", 100 * run.use.largest()), fmt::to_string(2 * p.best.intervals)});
  };
  row("rigid", rigid, 0);
  for (const Point& p : points) row(fmt::format("{:.2f}", p.stiffness), p, most_stored(p));
  return out;
}

Json json_of(const std::vector<Point>& points, const Point& rigid) {
  Json out = json_head("plan-wrist");
  out["rigid_m_s"] = rigid.speed;
  out["spring"] = Json::array();
  for (const Point& p : points) {
    const el::Replay& run = p.best.run;
    out["spring"].push_back({{"stiffness_n_m_rad", p.stiffness},
                             {"speed_m_s", p.speed},
                             {"planned_m_s", p.best.plan.speed()},
                             {"gain", p.speed / rigid.speed},
                             {"intervals", 2 * p.best.intervals},
                             {"largest_limit_use", run.use.largest()},
                             {"stored_J", most_stored(p)},
                             {"motors_J", run.motor_work},
                             {"damping_J", run.damping},
                             {"friction_J", run.friction},
                             {"unexplained_J", run.unexplained()}});
  }
  return out;
}

void run(const PlanWristOptions& o) {
  if (!o.report.empty()) require_gnuplot();
  require_outputs({{o.report, Wanted::directory}, {o.json}}, {o.arm});
  if (!(o.softest < o.stiffest)) throw WrongUsage("--softest must be below --stiffest");
  const el::ClutchedArm arm = el::read_clutched_arm(o.arm);
  const Point rigid = solve(arm, o, el::Drive::locked);
  if (rigid.speed == 0) throw Unanswered("no throw with the wrist locked was found that its run confirms");
  const std::vector<Point> points = by_stiffness(arm, o);
  if (points.empty()) throw Unanswered("no throw with the spring was found that its run confirms");

  ElasticAnswer answer;
  answer.table = table_of(points, rigid);
  answer.table_file = "gain.md";
  const Point& best = *std::max_element(points.begin(), points.end(),
                                        [](const Point& a, const Point& b) { return a.speed < b.speed; });
  answer.notes =
      fmt::format("best stiffness {:.2f} N m/rad: {:.2f} m/s, {:.2f} times the rigid wrist's {:.2f} m/s\n",
                  best.stiffness, best.speed, best.speed / rigid.speed, rigid.speed);
  answer.trajectories = trajectory_header("stiffness_n_m_rad") + trajectory_rows("inf", arm, rigid.best.run);
  for (const Point& p : points)
    answer.trajectories += trajectory_rows(fmt::format("{:.9g}", p.stiffness), arm, p.best.run);
  answer.figures = {gain_figure(points, rigid)};
  answer.json = json_of(points, rigid);
  give(answer, "plan wrist", o.arm, o.json, o.report);
}

}  // namespace

Command plan_wrist_command(Parser& plan) {
  auto o = std::make_shared<PlanWristOptions>();
  Parser& parser =
      plan.subcommand("wrist", "What an elastic wrist adds to the speed of a throw, against its stiffness");
  parser.footer("Example: unhand plan wrist --report out/wrist");
  parser.option("--arm", o->arm, "vsa_wrist, or a TOML file: an arm with an elastic last joint")
      .with_default();
  parser.option("--softest", o->softest, "[N m/rad]").positive().with_default();
  parser.option("--stiffest", o->stiffest, "[N m/rad]").positive().with_default();
  parser.option("--stiffnesses", o->stiffnesses, "How many").range(2, 1000).with_default();
  parser.option("--starts", o->starts, "Random starts of each").range(1, 1000).with_default();
  parser.option("--intervals", o->intervals, "Half the collocation intervals").range(2, 500).with_default();
  parser.option("--longest", o->longest, "Longest motion [s]").range(0.1, 10.0).with_default();
  parser.option("--elevation", o->elevation, "Direction of the throw [deg]")
      .range(-89.0, 89.0)
      .with_default();
  parser.option("--seed", o->seed, "Seed of the random starts").with_default();
  parser.file("--json", o->json, "Write the numbers here");
  add_one_thread(parser, o->threads);
  parser.file("--report", o->report, "Write table, figure, trajectories and numbers into this directory");
  return {&parser, [o] { run(*o); }};
}

}  // namespace unhand::apps
