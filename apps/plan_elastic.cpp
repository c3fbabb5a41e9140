// unhand plan elastic: throws of an arm whose last joint is a spring behind clutches.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apps/command.hpp"
#include "apps/elastic_answer.hpp"
#include "apps/elastic_trajectory.hpp"
#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "planners/elastic/throw_refinement.hpp"
#include "planners/elastic/throw_table.hpp"

namespace unhand::apps {
namespace {

namespace el = planners::elastic;

struct PlanElasticOptions {
  int threads{1};
  std::string arm{"bsa3"}, json, report;
  int starts{10}, intervals{16}, nodes{9}, checks{161};
  double longest{0}, elevation{45}, target_x{0}, target_z{-0.5}, half_table{0.4}, box{0.5};
  unsigned seed{1};
};

/// The pose from which targets are thrown at [rad]: lowered, elbow and wrist back.
const el::Links<double> kReadyPose{0.2, -1.0, -0.5};

struct Fastest {
  el::Drive drive;
  el::ConfirmedBasins basins;
};

/// What [DarkoD46] reports of its arm.
constexpr const char* kOnHardware =
    "as reported on hardware [DarkoD46] 4.3: 4.1 m/s with BRK -> SEA and motors of 4.5 rad/s, on an arm "
    "whose lengths and masses are not published\n";

double speed_of(const el::TipState<double>& tip) { return std::hypot(tip.vx, tip.vz); }

std::vector<std::vector<double>> history(const el::ClutchedArm& arm, const el::Replay& run) {
  std::vector<std::vector<double>> rows;
  for (const el::ReplaySample& s : run.samples)
    rows.push_back({s.t, speed_of(el::tip_of<double>(arm, s.at.tail<3>(), s.rate.tail<3>())),
                    s.at[0] - s.at[1], s.rate[0], s.rate[2], s.rate[3], s.rate[4], s.torque[0], s.torque[1],
                    s.torque[2], 0.5 * arm.last.stiffness * std::pow(s.at[0] - s.at[1], 2)});
  return rows;
}
const std::vector<std::string> kHistoryColumns{
    "time [s]",    "tip speed [m/s]", "deflection [rad]", "motor speed [rad/s]",
    "qd1 [rad/s]", "qd2 [rad/s]",     "qd3 [rad/s]",      "tau1 [N m]",
    "tau2 [N m]",  "tau_m [N m]",     "spring energy [J]"};

Json use_json(const el::UsedShares& use) {
  return {{"angle", use.angle},
          {"speed", use.speed},
          {"acceleration", use.acceleration},
          {"torque", use.torque},
          {"brake", use.brake},
          {"motor_speed", use.motor_speed},
          {"motor_torque", use.motor_torque},
          {"deflection", use.deflection}};
}

/// None where no drive has a throw.
std::vector<Figure> speed_figures(const el::ClutchedArm& arm, const std::vector<Fastest>& all) {
  Figure figure{"speed", 17, 12, {}, ""};
  const char* style[]{"lines lw 2 lc rgb '#0072b2' dt 1", "lines lw 2 lc rgb '#d55e00' dt 2",
                      "lines lw 2 lc rgb '#555555' dt 4"};
  std::string speed, deflection;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& found = all[i].basins.found;
    if (found.empty()) continue;
    figure.data.push_back(
        {el::to_string(all[i].drive), kHistoryColumns, history(arm, found.front().best.run), {}});
    const auto index = figure.data.size() - 1;
    speed += fmt::format("{}DATA index {} using 1:2 with {} title '{}'", index ? ", " : "plot ", index,
                         style[i], plain(el::to_string(all[i].drive)));
    deflection +=
        fmt::format("{}DATA index {} using 1:3 with {} notitle", index ? ", " : "plot ", index, style[i]);
  }
  if (figure.data.empty()) return {};
  figure.script =
      "set multiplot layout 2,1\nset lmargin 10\nset rmargin 3\nset key left top\nset xlabel 'time [s]'\nset "
      "ylabel 'tip speed "
      "[m/s]'\n" +
      speed + "\nset ylabel 'spring deflection [rad]'\n" + deflection + "\nunset multiplot\n";
  return {figure};
}

/// None where no throw of a dense check lands.
std::vector<Figure> check_figures(const std::vector<el::TableCheck>& checks) {
  Figure figure{"table",
                17,
                11,
                {{"dense check", {"distance [m]", "miss [mm]", "largest share of a limit [-]"}, {}, {}}},
                ""};
  for (const auto& c : checks)
    if (c.lands) figure.data[0].rows.push_back({c.distance, 1e3 * c.miss, c.limit_use});
  if (figure.data[0].rows.empty()) return {};
  figure.script =
      "set multiplot layout 2,1\nset lmargin 10\nset rmargin 3\nunset key\nset xlabel 'distance of the "
      "target [m]'\nset ylabel "
      "'miss [mm]'\n"
      "plot DATA using 1:2 with lines lw 2 lc rgb '#0072b2'\nset ylabel 'largest share of a limit'\nset "
      "yrange [0:*]\n"
      "plot DATA using 1:3 with lines lw 2 lc rgb '#d55e00', 1 with lines lw 1 dt 2 lc rgb '#000000'\nunset "
      "multiplot\n";
  return {figure};
}

el::ThrowProgramOptions program_options(const PlanElasticOptions& o) {
  el::ThrowProgramOptions out;
  out.intervals = o.intervals;
  out.seed = o.seed;
  return out;
}

Json basin_json(const el::ConfirmedBasin& basin) {
  const auto& [best, starts] = basin;
  const el::Replay& run = best.run;
  return {{"starts", starts},
          {"speed_m_s", best.plan.speed()},
          {"intervals", 2 * best.intervals},
          {"confirmed", best.confirmed},
          {"resimulated_speed_m_s", speed_of(run.release)},
          {"spring_stop", run.spring_stop},
          {"duration_s", best.plan.duration()},
          {"limits", use_json(run.use)},
          {"energy_J",
           {{"motors", run.motor_work},
            {"damping", run.damping},
            {"friction", run.friction},
            {"impacts", run.impacts},
            {"gain", run.gain},
            {"unexplained", run.unexplained()}}}};
}

std::string resimulated(const el::Replay& run) {
  return run.spring_stop ? "spring at its stop" : fmt::format("{:.3f}", speed_of(run.release));
}

/// The fastest throw of each drive, and the drives of which no throw is confirmed by its run.
struct FastestAnswer {
  ElasticAnswer answer;
  std::vector<std::string> without;
};
FastestAnswer fastest(const el::ClutchedArm& arm, const PlanElasticOptions& o, Json json) {
  el::ThrowTask task;
  task.longest = o.longest > 0 ? o.longest : 0.6;
  task.elevation = o.elevation * M_PI / 180;
  std::vector<Fastest> all;
  FastestAnswer found;
  ElasticAnswer& out = found.answer;
  out.table = {{"drive", "basin", "starts", "tip speed [m/s]", "re-simulated", "duration [s]", "limits used",
                "intervals"},
               {},
               2};
  out.table_file = "speeds.md";
  out.trajectories = trajectory_header("drive,basin");
  double longest = 0;
  json["drives"] = Json::object();
  for (const el::Drive drive : {el::Drive::clutched, el::Drive::series, el::Drive::rigid}) {
    task.drive = drive;
    const std::string name = el::to_string(drive);
    const el::Basins basins = el::find_basins(arm, task, program_options(o), o.starts);
    all.push_back({drive, el::confirm_basins(arm, task, basins, program_options(o))});
    const el::ConfirmedBasins& confirmed = all.back().basins;
    longest = std::max(longest, confirmed.longest);
    Json& j = json["drives"][name] = {{"failed_starts", basins.failed}, {"basins", Json::array()}};
    for (std::size_t k = 0; k < confirmed.found.size(); ++k) {
      const auto& [best, starts] = confirmed.found[k];
      out.table.rows.push_back(
          {k == 0 ? name : "", fmt::to_string(k + 1), fmt::to_string(starts),
           fmt::format("{:.3f}", best.plan.speed()), resimulated(best.run),
           fmt::format("{:.3f}", best.plan.duration()), fmt::format("{:.1f} %", 100 * best.run.use.largest()),
           fmt::to_string(2 * best.intervals) + (best.confirmed ? "" : ", not confirmed")});
      j["basins"].push_back(basin_json(confirmed.found[k]));
      out.trajectories += trajectory_rows(fmt::format("{},{}", name, k + 1), arm, best.run);
    }
    if (std::none_of(confirmed.found.begin(), confirmed.found.end(),
                     [](const el::ConfirmedBasin& basin) { return basin.best.confirmed; }))
      found.without.push_back(confirmed.found.empty() ? name + " (none was found)" : name);
  }
  json["longest_solve_s"] = longest;
  out.notes = fmt::format("longest solve {:.2f} s of CPU time, {} random starts each\n", longest, o.starts) +
              (o.arm == PlanElasticOptions().arm ? kOnHardware : "");
  out.figures = speed_figures(arm, all);
  out.json = std::move(json);
  return found;
}

/// Why there is no table: the target without a throw, and to which there are some.
std::string out_of_reach(const el::ClutchedArm& arm, const el::ThrowTask& task, const PlanElasticOptions& o,
                         double distance) {
  std::string out =
      fmt::format("--target {:g}: no throw was found to a target at {:g} m", o.target_x, distance);
  if (std::abs(distance - o.target_x) > 1e-9)
    out += fmt::format(", a node of the table (--half-table {:g})", o.half_table);
  out += fmt::format(", {:g} m {} the shoulder; ", std::abs(o.target_z), o.target_z < 0 ? "below" : "above");
  const auto reach = el::find_reach(arm, task, program_options(o), std::min(o.starts, 3));
  if (!reach) return out + "nor to any other at this height";
  out += fmt::format("at this height a coarse search found throws to targets from {:.2f} to {:.2f} m",
                     std::ceil(100 * reach->nearest - 1e-6) / 100,
                     std::floor(100 * reach->farthest + 1e-6) / 100);
  if (reach->nearest <= distance && distance <= reach->farthest)
    out += ", so that more --starts or another --seed may find one here, too";
  return out;
}

/// What a table's interpolated throws do between its nodes.
struct DenseCheck {
  std::vector<el::TableCheck> each;
  int lost{}, hits{}, beyond{};  ///< do not land, land in the box, land but are beyond a limit
  double worst{}, use{};         ///< miss [m], and share of a limit
};
DenseCheck check(const el::ClutchedArm& arm, const el::ThrowTable& table, const PlanElasticOptions& o) {
  DenseCheck out;
  out.each = el::check_table(arm, table, o.checks);
  for (const el::TableCheck& c : out.each) {
    out.lost += !c.lands;
    out.hits += c.lands && std::abs(c.miss) <= o.box / 2;
    out.beyond += c.lands && c.limit_use > 1;
    out.worst = std::max(out.worst, std::abs(c.miss));
    out.use = std::max(out.use, c.limit_use);
  }
  return out;
}

/// A table of throws to targets, and in how many of its nodes no run confirms the throw.
struct TargetAnswer {
  ElasticAnswer answer;
  int nodes{}, missed{};
};
TargetAnswer to_target(const el::ClutchedArm& arm, const PlanElasticOptions& o, Json json) {
  el::ThrowTask task;
  task.longest = o.longest > 0 ? o.longest : 1.0;
  task.start = kReadyPose;
  task.target = el::Target{o.target_x, o.target_z};
  std::vector<double> distances;
  for (int k = 0; k < o.nodes; ++k)
    distances.push_back(o.target_x - o.half_table + 2 * o.half_table * k / (o.nodes - 1));
  el::ThrowTable solved;
  try {
    solved = el::make_table(arm, task, distances, program_options(o), o.starts);
  } catch (const el::OutOfReach& error) {
    throw Unanswered(out_of_reach(arm, task, o, error.distance));
  }
  const el::ConfirmedTable confirmed = el::confirm_table(arm, task, std::move(solved), program_options(o));
  const el::ThrowTable& table = confirmed.table;
  TargetAnswer out{{}, o.nodes, 0};
  out.answer.table = {{"target [m]", "tip speed [m/s]", "re-simulated", "duration [s]", "solve [s]",
                       "miss, re-simulated [mm]", "limits used", "intervals"},
                      {},
                      1};
  out.answer.table_file = "table.md";
  out.answer.trajectories = trajectory_header("target_m");
  json["nodes"] = Json::array();
  for (std::size_t k = 0; k < distances.size(); ++k) {
    const el::ElasticThrow& one = table.throws[k];
    const auto& [run, miss, fine] = confirmed.nodes[k];
    out.missed += !fine;
    out.answer.table.rows.push_back(
        {fmt::format("{:.2f}", distances[k]), fmt::format("{:.3f}", one.speed()), resimulated(run),
         fmt::format("{:.3f}", one.duration()), fmt::format("{:.2f}", one.program.seconds),
         miss ? with_sign(1e3 * *miss, 2) : "-", fmt::format("{:.1f} %", 100 * run.use.largest()),
         fmt::to_string(2 * confirmed.intervals) + (fine ? "" : ", not confirmed")});
    json["nodes"].push_back({{"target_m", distances[k]},
                             {"speed_m_s", one.speed()},
                             {"resimulated_speed_m_s", speed_of(run.release)},
                             {"duration_s", one.duration()},
                             {"solve_s", one.program.seconds},
                             {"intervals", 2 * confirmed.intervals},
                             {"confirmed", fine},
                             {"resimulated_miss_m", number(miss)},
                             {"spring_stop", run.spring_stop},
                             {"limits", use_json(run.use)}});
    out.answer.trajectories += trajectory_rows(fmt::format("{:.6g}", distances[k]), arm, run);
  }
  const DenseCheck dense = check(arm, table, o);
  json["check"] = {{"targets", dense.each.size()},
                   {"lost", dense.lost},
                   {"hits", dense.hits},
                   {"worst_miss_m", dense.worst},
                   {"largest_limit_use", dense.use}};
  std::string& notes = out.answer.notes = fmt::format(
      "interpolated between the nodes at {} targets: {} land in the box of {:g} m, worst miss {:.2f} mm, "
      "limits used at most {:.1f} %\n",
      dense.each.size(), dense.hits, o.box, 1e3 * dense.worst, 100 * dense.use);
  if (dense.beyond > 0)
    notes +=
        fmt::format("{} of these throws are beyond a limit of the arm: they cannot be made\n", dense.beyond);
  if (out.missed > 0)
    notes += fmt::format("{} of {} nodes are not confirmed by their runs\n", out.missed, out.nodes);
  out.answer.figures = check_figures(dense.each);
  out.answer.json = std::move(json);
  return out;
}

void run(const PlanElasticOptions& o, const Parser& parser) {
  if (o.target_x > 0)
    refuse_options(parser, {"--elevation"}, "of the fastest throw; a target has the direction that it needs");
  else
    refuse_options(parser, {"--height", "--box", "--half-table", "--nodes", "--checks"},
                   "of a table of throws to a target: give --target, too");
  if (o.longest > 0 && o.longest < 0.1)
    throw WrongUsage(fmt::format("--longest: {:g} s; accepted: 0, or 0.1 to 10 s", o.longest));
  if (!o.report.empty()) require_gnuplot();
  require_outputs({{o.report, Wanted::directory}, {o.json}}, {o.arm});
  const el::ClutchedArm arm = el::read_clutched_arm(o.arm);
  Json json = json_head("plan-elastic");
  json["arm"] = arm.chain.name;
  const auto give_all = [&](const ElasticAnswer& answer) {
    give(answer, "plan elastic", o.arm, o.json, o.report);
  };
  constexpr const char* kRemedy = "more --intervals, or a shorter --longest, may confirm some";
  if (!(o.target_x > 0)) {
    const FastestAnswer found = fastest(arm, o, std::move(json));
    give_all(found.answer);
    if (!found.without.empty())
      throw Unanswered(fmt::format("no throw of {} is confirmed by its run: none of these is to be made; {}",
                                   fmt::join(found.without, ", "), kRemedy));
    return;
  }
  const TargetAnswer found = to_target(arm, o, std::move(json));
  give_all(found.answer);
  if (found.missed == found.nodes)
    throw Unanswered(fmt::format(
        "no node of the table is confirmed by its run: none of these throws is to be made; {}", kRemedy));
}

}  // namespace

Command plan_elastic_command(Parser& plan) {
  auto o = std::make_shared<PlanElasticOptions>();
  Parser& parser = plan.subcommand(
      "elastic",
      "Optimal throws of an arm with a clutched spring: the fastest, or a table of throws to targets");
  parser.footer(
      "Exit code 1: no throw of a drive, or of the table, is confirmed by its run.\n"
      "Example: unhand plan elastic --target 2.2 --report out/elastic");
  parser.option("--arm", o->arm, "bsa3, or a TOML file: an arm with a clutched last joint").with_default();
  parser
      .option("--target", o->target_x,
              "Distance of the target box [m]; none: the fastest throw of each drive")
      .range(0.1, 20.0);
  parser.option("--height", o->target_z, "Height of the box against the shoulder [m]").with_default();
  parser.option("--box", o->box, "Length of the box along the throw [m]").positive().with_default();
  parser.option("--half-table", o->half_table, "The table covers the target -+ this [m]")
      .positive()
      .with_default();
  parser.option("--nodes", o->nodes, "Nodes of the table").range(4, 1000).with_default();
  parser.option("--checks", o->checks, "Targets of the dense check").range(2, 100000).with_default();
  parser.option("--starts", o->starts, "Random starts").range(1, 1000).with_default();
  parser.option("--intervals", o->intervals, "Collocation intervals per phase").range(2, 500).with_default();
  parser.option("--longest", o->longest, "Longest motion [s]; 0: 0.6 for the fastest throw, 1 to a target")
      .range(0.0, 10.0);
  parser.option("--elevation", o->elevation, "Direction of the fastest throw [deg]")
      .range(-89.0, 89.0)
      .with_default();
  parser.option("--seed", o->seed, "Seed of the random starts").with_default();
  parser.file("--json", o->json, "Write the numbers here");
  add_one_thread(parser, o->threads);
  parser.file("--report", o->report, "Write table, figure, trajectories and numbers into this directory");
  return {&parser, [o, &parser] { run(*o, parser); }};
}

}  // namespace unhand::apps
