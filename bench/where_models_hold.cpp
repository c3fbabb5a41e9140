// Where each reduced model lands within 1 cm and 5 degrees of the distributed patch that it reduces:
//   build/release/bench/where_models_hold OUT_DIRECTORY [RINGS]
// A map over lever/patch radius, inertia ratio I/(m a²) and opening time; a table on stdout, the map as a
// figure with its data and script in the directory. Synthetic: every throw is made here.
#include <fmt/core.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "apps/figure.hpp"
#include "apps/table.hpp"
#include "bench/reduced_models.hpp"
#include "dynamics/parallel.hpp"

namespace {

using namespace unhand;

constexpr double kRadius = 0.01, kMu = 0.5, kMass = 0.2, kOpens = 0.03;
const contact::Patch<double> kPatch{kMu, kRadius};

struct Row {
  const char *name, *title;
};
constexpr Row kRows[] = {{"limit_surface_disc", "exact disc"},
                         {"limit_surface", "ellipsoid"},
                         {"sliding_pivot", "sliding pivot"},
                         {"limit_surface_naive", "ellipsoid, sign law at 1 ms"},
                         {"gripper_delay", "carried, best delay in hindsight"}};
constexpr int kModels = static_cast<int>(std::size(kRows));

const std::vector<double> kLevers{0, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 14, 16};  // in radii
const std::vector<double> kOpenings{0.003, 0.005, 0.008, 0.013, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.3};  // s
const std::vector<double> kInertias{2, 12, 72};  // in m a²

struct Cell {
  double lever{}, opening{}, inertia{};
  double miss[kModels]{};  ///< see bench::misses_by
};

/// A hand that launches for 30 ms and then brakes, opening as it does; its grip holds 1.5 times what it must
/// at first.
void fill(Cell& cell, int rings) {
  const double end = kOpens + cell.opening + 0.01;
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{kOpens, {6, 6, 0}}, {end, {-10, -10, 0}}});
  const dynamics::RigidBody<double> body{kMass, cell.inertia * kMass * kRadius * kRadius};
  const release::Grasp<double> grasp{cell.lever * kRadius, 0.3};
  const auto state = hand.at({0, kOpens}, 0);
  const auto demand = contact::sticking_wrench<double>(
      {body, {0, -9.81}, state.pose, state.twist, state.acceleration, 0, nullptr},
      {{grasp.com_offset, 0}, grasp.angle, {}, 0});
  const double grip =
      1.5 * std::hypot(demand.fx, demand.fz, demand.tau / kPatch.length()) / kPatch.f_max(1.0);
  const contact::ProfileNormalForce force(
      contact::OpeningProfile<double>{kOpens, grip, 0.0, cell.opening, 1.0});
  const bench::Throw thrown{hand, force, body, grasp};
  const auto truth = with_points(thrown, {kMu, kRadius, crosscheck::disc_points(rings)});
  if (!truth) throw std::runtime_error("where_models_hold: the patch did not land");
  contact::ContactParameters<double> parameters;
  parameters.patch = kPatch;
  const auto miss = [&](const std::optional<bench::Landed>& landed) {
    return landed ? std::max(misses_by(*landed, *truth), 1e-3) : 1e3;
  };
  for (int m = 0; m < 3; ++m) cell.miss[m] = miss(with_model(thrown, kRows[m].name, parameters));
  cell.miss[3] = miss(naively(thrown, kPatch, 1e-3));
  cell.miss[4] = 1e3;
  for (int k = 0; k <= 100; ++k)
    cell.miss[4] = std::min(cell.miss[4], miss(carried(thrown, kOpens + cell.opening * k / 100)));
}

/// Tics without their labels.
std::string bare(const std::string& tics) {
  std::string out;
  bool inside = false;
  for (const char c : tics) {
    if (c == '\'') {
      inside = !inside;
      out += c;
    } else if (!inside) {
      out += c;
    }
  }
  return out;
}

apps::Figure figure(const std::vector<Cell>& cells) {
  apps::Figure out{"where-models-hold", 17, 21.6, {}, {}};
  const int columns = static_cast<int>(kInertias.size());
  for (int m = 0; m < kModels; ++m)
    for (const double inertia : kInertias) {
      apps::DataBlock block{
          fmt::format("{}, I/(m a^2) = {}", kRows[m].name, inertia),
          {"lever index", "opening index", "log10 of the error in units of 1 cm and 5 degrees"},
          {},
          {}};
      for (std::size_t j = 0; j < kOpenings.size(); ++j)
        for (std::size_t i = 0; i < kLevers.size(); ++i)
          for (const Cell& cell : cells)
            if (cell.inertia == inertia && cell.lever == kLevers[i] && cell.opening == kOpenings[j])
              block.rows.push_back(
                  {static_cast<double>(i), static_cast<double>(j), std::log10(cell.miss[m])});
      out.data.push_back(block);
    }
  std::string& s = out.script;
  s += "set multiplot\nunset key\nunset grid\nunset colorbox\nset cbrange [-2:2]\n";
  s += "set border 15 linewidth 0.7\nset tics out scale 0.4\n";
  // light where the model holds, dark where it does not, with the step at 1 (log 0): readable in grey
  s += "set palette defined (-2 '#f7fbff', -1 '#c6dbef', 0 '#85bcdb', 0 '#d55e00', 1 '#8c2d04', 2 "
       "'#2b0a00')\n";
  std::string xtics, ytics;
  for (std::size_t i = 0; i < kLevers.size(); ++i)
    if (i % 2 == 0) xtics += fmt::format("{}'{}' {}", xtics.empty() ? "" : ", ", kLevers[i], i);
  for (std::size_t j = 0; j < kOpenings.size(); ++j)
    if (j % 2 == 0) ytics += fmt::format("{}'{}' {}", ytics.empty() ? "" : ", ", 1e3 * kOpenings[j], j);
  const double width = 4.6, height = 2.95, left = 1.8, bottom = 2.85;
  for (int m = 0; m < kModels; ++m)
    for (int k = 0; k < columns; ++k) {
      const double x = left + k * (width + 0.35), y = bottom + (kModels - 1 - m) * (height + 0.8);
      s += apps::place(out, {x, x + width, y, y + height});
      const bool lowest = m == kModels - 1, first = k == 0;
      s += fmt::format("set xtics ({})\nset ytics ({})\n", lowest ? xtics : bare(xtics),
                       first ? ytics : bare(ytics));
      s += lowest ? "set format x '%g'\nset xlabel 'lever / patch radius' offset 0,0.4\n"
                  : "set format x ''\nunset xlabel\n";
      s += first ? "set format y '%g'\nset ylabel 'opening [ms]'\n" : "set format y ''\nunset ylabel\n";
      s += first ? fmt::format("set label 1 '{}' at graph 0, graph 1.1 left\n", kRows[m].title)
                 : "unset label 1\n";
      if (m > 0)
        s += "unset label 2\n";
      else
        s += fmt::format("set label 2 'I/(m a^2) = {}' at graph 1, graph 1.1 right\n",
                         kInertias[static_cast<std::size_t>(k)]);
      s += fmt::format("plot [-0.5:{}] [-0.5:{}] DATA index {} using 1:2:3 with image\n",
                       static_cast<double>(kLevers.size()) - 0.5, static_cast<double>(kOpenings.size()) - 0.5,
                       m * columns + k);
    }
  // the colour bar, drawn as an image so that its step is in the right place
  s += apps::place(out, {left + 1.5, out.width - 2, 1.05, 1.35});
  s += "set samples 400,2\nset isosamples 400,2\nunset ytics\nunset ylabel\nunset label 1\nunset label "
       "2\nset format x '%g'\n"
       "set xtics ('0.01' -2, '0.1' -1, '1' 0, '10' 1, '100' 2)\n"
       "set xlabel 'landing error in units of 1 cm and 5°, whichever is larger' offset 0,0.4\n"
       "plot [-2:2] [0:1] '++' using 1:2:1 with image\n"
       "unset multiplot\n";
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: where_models_hold OUT_DIRECTORY [RINGS]\n");
    return 2;
  }
  const std::filesystem::path out = argv[1];
  const int rings = argc > 2 ? std::atoi(argv[2]) : 6;
  std::vector<Cell> cells;
  for (const double inertia : kInertias)
    for (const double opening : kOpenings)
      for (const double lever : kLevers) cells.push_back({lever, opening, inertia, {}});
  dynamics::parallel_for(cells.size(), 0, [&](std::size_t i) { fill(cells[i], rings); });

  apps::Table table{{"model", "within 1 cm and 5 deg", "median error", "90 %", "worst", "worst at lever/a",
                     "opening [ms]", "I/(m a2)"},
                    {},
                    1};
  for (int m = 0; m < kModels; ++m) {
    std::vector<double> all;
    const Cell* worst = &cells[0];
    for (const Cell& cell : cells) {
      all.push_back(cell.miss[m]);
      if (cell.miss[m] > worst->miss[m]) worst = &cell;
    }
    std::sort(all.begin(), all.end());
    const auto within = std::count_if(all.begin(), all.end(), [](double e) { return e < 1; });
    table.rows.push_back(
        {kRows[m].title,
         fmt::format("{:.0f} %", 100 * static_cast<double>(within) / static_cast<double>(all.size())),
         fmt::format("{:.3f}", all[all.size() / 2]), fmt::format("{:.3f}", all[all.size() * 9 / 10]),
         fmt::format("{:.2f}", all.back()), fmt::format("{}", worst->lever),
         fmt::format("{}", 1e3 * worst->opening), fmt::format("{}", worst->inertia)});
  }
  std::filesystem::create_directories(out);
  draw(figure(cells), out, "synthetic throws, bench/where_models_hold");
  fmt::print("{} throws, {} points; errors in units of 1 cm and 5 degrees, whichever is larger\n\n{}\n{}",
             cells.size(), 3 * rings * rings, table.text(), (out / "where-models-hold.png").string() + "\n");
}
