// unhand plan control: throws of unknown objects under adaptive and plain computed torque, in simulation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "apps/command.hpp"
#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "apps/table.hpp"
#include "dynamics/parallel.hpp"
#include "planners/control/throw_study.hpp"

namespace unhand::apps {
namespace {

namespace ct = planners::control;
namespace fs = std::filesystem;

struct PlanControlOptions {
  std::string json, report;
  int seeds{50}, repetitions{4}, threads{0};
  double box{0.2};
};

struct Cell {
  ct::Payload payload;
  ct::ControllerChoice controller;
  std::vector<ct::StudyThrow> throws;
  ct::Dispersion landed;
};

const char* kLook[]{"pt 6 ps 0.6 lc rgb '#0072b2'", "pt 8 ps 0.6 lc rgb '#d55e00'",
                    "pt 2 ps 0.6 lc rgb '#555555'", "pt 4 ps 0.6 lc rgb '#009e73'"};
const char* kLine[]{"lw 2 dt 1 lc rgb '#0072b2'", "lw 2 dt 2 lc rgb '#d55e00'", "lw 2 dt 4 lc rgb '#555555'",
                    "lw 2 dt 3 lc rgb '#009e73'"};

/// Those of [DarkoD46], then its law in the joints.
std::vector<ct::ControllerChoice> compared_controllers() {
  auto out = ct::reported_controllers();
  out.push_back(ct::joint_controller());
  return out;
}

/// A panel for every object, all to one scale about their landings; the last controllers first, so that the
/// adaptive one lies on top.
void draw_landings(const std::vector<Cell>& cells, double box, const fs::path& folder) {
  const std::size_t controllers = compared_controllers().size(), panels = cells.size() / controllers;
  double back = -1, front = 1, side = 1;  // [cm]
  for (const Cell& cell : cells)
    for (const auto& one : cell.throws) {
      if (!one.lands) continue;
      back = std::min(back, 100 * one.miss.x());
      front = std::max(front, 100 * one.miss.x());
      side = std::max(side, 100 * std::abs(one.miss.y()));
    }
  const double margin = 0.04 * (front - back);
  back -= margin, front += margin, side += margin;
  Figure figure{"landings", 17, 0, {}, ""};
  constexpr double left = 1.9, width = 14.6, bottom = 2.5, gap = 0.9;
  const double height = std::clamp(2 * side * width / (front - back), 1.5, 6.0);
  figure.height = bottom + static_cast<double>(panels) * (height + gap);
  std::string script = fmt::format(
      "set multiplot\nset key off\nset clip two\nset ylabel 'across [cm]'\nset xrange [{:.6g}:{:.6g}]\n"
      "set yrange [{:.6g}:{:.6g}]\nset ytics {:.6g}\nset format x ''\n",
      back, front, -side, side, tic_step(2 * side));
  const double edge = 50 * box;
  figure.data.push_back({"box",
                         {"forward [cm]", "across [cm]"},
                         {{-edge, -edge}, {edge, -edge}, {edge, edge}, {-edge, edge}, {-edge, -edge}},
                         {}});
  std::vector<KeyEntry> key;
  for (std::size_t i = 0; i < controllers; ++i)
    key.push_back({fmt::format("with points {}", kLook[i]), cells[i].controller.name});
  for (std::size_t p = 0; p < panels; ++p) {
    std::string points = "plot DATA index 0 using 1:2 with lines lc rgb '#000000' lw 1";
    for (std::size_t c = controllers; c-- > 0;) {
      const Cell& cell = cells[p * controllers + c];
      DataBlock block{
          cell.payload.name + ", " + cell.controller.name, {"forward [cm]", "across [cm]"}, {}, {}};
      for (const auto& one : cell.throws)
        if (one.lands) block.rows.push_back({100 * one.miss.x(), 100 * one.miss.y()});
      points += fmt::format(", DATA index {} using 1:2 with points {}", figure.data.size(), kLook[c]);
      figure.data.push_back(std::move(block));
    }
    const double low = bottom + static_cast<double>(panels - 1 - p) * (height + gap);
    if (p + 1 == panels) script += "set format x '%h'\nset xlabel 'forward [cm]'\n";
    script += place(figure, {left, left + width, low, low + height}) +
              fmt::format("set title '{}, {:.0f} g' offset 0,-0.6\n{}\n",
                          plain(cells[p * controllers].payload.name),
                          1e3 * cells[p * controllers].payload.mass, points);
  }
  figure.script = script + key_strip(figure, key, 2) + "unset multiplot\n";
  draw(figure, folder, "simulated by unhand plan control");
}

void draw_errors(const std::vector<ct::StudyThrow>& recorded,
                 const std::vector<ct::ControllerChoice>& controllers, const fs::path& folder) {
  Figure figure{"errors", 17, 16, {}, ""};
  std::string position, velocity, falls;
  double last = 0;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    DataBlock block{
        controllers[i].name,
        {"time [s]", "position error [cm]", "velocity error [m/s]", "V [J]", "mass estimate [kg]"},
        {},
        {}};
    for (const auto& s : recorded[i].history) {
      last = std::max(last, s.t);
      block.rows.push_back({s.t, 100 * s.position_error, s.velocity_error, s.lyapunov, s.mass_estimate});
    }
    figure.data.push_back(block);
    position += fmt::format("{}DATA index {} using 1:2 with lines {} title '{}'", i ? ", " : "plot ", i,
                            kLine[i], plain(controllers[i].name));
    velocity +=
        fmt::format("{}DATA index {} using 1:3 with lines {} notitle", i ? ", " : "plot ", i, kLine[i]);
  }
  falls = fmt::format("plot DATA index 0 using 1:4 with lines {} notitle", kLine[0]);
  figure.script =
      fmt::format("set multiplot layout 3,1\nset lmargin 10\nset rmargin 3\nset xrange [0:{:.6g}]\n", last) +
      "set key outside top center horizontal samplen 4\nset xlabel 'time "
      "[s]'\nset ylabel 'position "
      "error [cm]'\n" +
      position + "\nset ylabel 'velocity error [m/s]'\n" + velocity +
      "\nset ylabel 'V of the adaptive law [J]'\n" + falls + "\nunset multiplot\n";
  draw(figure, folder, "simulated by unhand plan control");
}

/// Every controller with every object, thrown by the same simulated robots.
std::vector<Cell> throw_all(const PlanControlOptions& o, const ct::StudyOptions& study) {
  std::vector<Cell> out;
  for (const auto& payload : ct::reported_payloads())
    for (const auto& controller : compared_controllers())
      out.push_back({payload, controller, std::vector<ct::StudyThrow>(o.seeds), {}});
  Progress progress("plan control", out.size() * o.seeds);
  dynamics::parallel_for(out.size() * o.seeds, o.threads, [&](std::size_t i) {
    Cell& cell = out[i / o.seeds];
    const std::size_t k = i % o.seeds;
    cell.throws[k] = ct::run_throw(cell.controller, cell.payload, study, k + 1);
    progress.step();
  });
  for (Cell& cell : out) cell.landed = ct::dispersion_of(cell.throws);
  return out;
}

/// The mean error at the release.
double mean_of(const std::vector<ct::StudyThrow>& throws, double ct::StudyThrow::*error) {
  double sum = 0;
  for (const auto& one : throws) sum += one.*error;
  return sum / static_cast<double>(throws.size());
}

Table table_of(const std::vector<Cell>& cells) {
  Table out{
      {"object", "controller", "in the box", "mean miss along, across [mm]", "std along, across [mm]",
       "rms miss [mm]", "error at the release [mm, mm/s]", "speed, acceleration, jerk, torque used [%]"},
      {},
      2};
  for (const Cell& cell : cells) {
    const auto& d = cell.landed;
    const int landed = d.throws - d.lost;
    out.rows.push_back(
        {fmt::format("{}, {:.0f} g", cell.payload.name, 1e3 * cell.payload.mass), cell.controller.name,
         fmt::format("{}/{}", d.hits, d.throws),
         landed > 0 ? fmt::format("{}, {}", with_sign(1e3 * d.mean.x(), 1), with_sign(1e3 * d.mean.y(), 1))
                    : "-",
         fmt::format("{}, {}", fixed(landed > 1, 1e3 * d.std.x(), 1), fixed(landed > 1, 1e3 * d.std.y(), 1)),
         fixed(landed > 0, 1e3 * d.rms, 1),
         fmt::format("{:.1f}, {:.1f}", 1e3 * mean_of(cell.throws, &ct::StudyThrow::release_position_error),
                     1e3 * mean_of(cell.throws, &ct::StudyThrow::release_velocity_error)),
         fmt::format("{:.0f}, {:.0f}, {:.0f}, {:.0f}", 100 * d.use.velocity, 100 * d.use.acceleration,
                     100 * d.use.jerk, 100 * d.use.torque)});
  }
  return out;
}

Json json_of(const std::vector<Cell>& cells, const PlanControlOptions& o) {
  Json out = json_head("plan-control");
  out["seeds"] = o.seeds;
  out["cells"] = Json::array();
  for (const Cell& cell : cells) {
    const auto& d = cell.landed;
    const int landed = d.throws - d.lost;
    out["cells"].push_back(
        {{"object", cell.payload.name},
         {"mass_kg", cell.payload.mass},
         {"controller", cell.controller.name},
         {"throws", d.throws},
         {"hits", d.hits},
         {"lost", d.lost},
         {"mean_m", landed > 0 ? Json{d.mean.x(), d.mean.y()} : Json(nullptr)},
         {"std_m", landed > 1 ? Json{d.std.x(), d.std.y()} : Json(nullptr)},
         {"rms_m", landed > 0 ? Json(d.rms) : Json(nullptr)},
         {"release_position_error_m", mean_of(cell.throws, &ct::StudyThrow::release_position_error)},
         {"release_velocity_error_m_s", mean_of(cell.throws, &ct::StudyThrow::release_velocity_error)},
         {"limits",
          {{"position", d.use.position},
           {"velocity", d.use.velocity},
           {"acceleration", d.use.acceleration},
           {"jerk", d.use.jerk},
           {"torque", d.use.torque}}}});
  }
  return out;
}

void run(const PlanControlOptions& o) {
  if (!o.report.empty()) require_gnuplot();
  require_outputs({{o.report, Wanted::directory}, {o.json}});
  ct::StudyOptions study;
  study.repetitions = o.repetitions;
  study.box = {o.box, o.box};
  const std::vector<Cell> cells = throw_all(o, study);
  const Table table = table_of(cells);
  const Json json = json_of(cells, o);
  Outputs outputs;
  if (!o.report.empty()) {
    const fs::path folder = outputs.directory(o.report);
    draw_landings(cells, o.box, folder);
    std::vector<ct::StudyThrow> recorded;
    const auto controllers = compared_controllers();
    for (const auto& controller : controllers)
      recorded.push_back(ct::run_throw(controller, ct::reported_payloads().back(), study, 1, true));
    draw_errors(recorded, controllers, folder);
    write_text(folder / "landings.md", table.markdown());
    write_text(folder / "control.json", json_text(json));
  }
  if (!o.json.empty()) outputs.json(o.json, json);
  outputs.commit();
  fmt::print("{}\n{} simulated robots each, the same for every controller; {} repetitions before the throw\n",
             table.text(), o.seeds, o.repetitions);
}

}  // namespace

Command plan_control_command(Parser& plan) {
  auto o = std::make_shared<PlanControlOptions>();
  Parser& parser =
      plan.subcommand("control", "Throws of unknown objects under adaptive and plain computed torque");
  parser.footer("Example: unhand plan control --report out/control");
  parser.option("--seeds", o->seeds, "Simulated robots per object and controller")
      .range(1, 100000)
      .with_default();
  parser.option("--repetitions", o->repetitions, "Motions without release before the throw")
      .range(0, 1000)
      .with_default();
  parser.option("--box", o->box, "Side of the box [m]").positive().with_default();
  parser.file("--json", o->json, "Write the numbers here");
  parser.file("--report", o->report, "Write table, figures and numbers into this directory");
  add_threads(parser, o->threads);
  return {&parser, [o] { run(*o); }};
}

}  // namespace unhand::apps
