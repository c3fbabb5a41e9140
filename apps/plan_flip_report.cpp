// How `unhand plan flip` tells what it learned.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "apps/figure.hpp"
#include "apps/flip_store.hpp"
#include "apps/plan_flip.hpp"
#include "apps/table.hpp"

namespace unhand::apps {
namespace {

namespace fl = planners::flip;

constexpr double kDegree = std::numbers::pi / 180;
const char* kColours[]{"#762a83", "#0072b2", "#e69f00"};  // of damping: low, middle, high
const int kMarkers[]{7, 5, 9};                            // of pitch: circle, square, triangle
const double kSizes[]{0.5, 0.75, 1.0};                    // of speed

Table table_of(const FlipAnswer& a) {
  Table out{{"iteration", "pitch [deg]", "speed", "damping", "x [m]", "angle [deg]", "error", "hits"}, {}, 1};
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    out.rows.push_back({std::to_string(i + 1), fmt::format("{:.2f}", one.command.pitch / kDegree),
                        fmt::format("{:.4f}", one.command.speed), fmt::format("{:.2f}", one.command.damping),
                        one.mean ? fmt::format("{:.3f}", one.mean->x) : "-",
                        one.mean ? fmt::format("{:.0f}", one.mean->angle / kDegree) : "-",
                        one.mean ? fmt::format("{:.2f}", one.error) : "-",
                        fmt::format("{}/{}", one.hits, a.throws)});
  }
  return out;
}

std::string reached(const fl::LearningPath& path, int hits) {
  const int i = path.reached(hits);
  return i == 0 ? "not" : fmt::format("in iteration {}", i);
}

std::string target_box(const fl::FlipTarget& t) {
  return fmt::format(
      "set object 1 rectangle from {0},{1} to {2},{3} fs solid 0.25 noborder fc rgb '#55aa55' behind\n"
      "set xrange [*<{4}:{5}<*]\nset yrange [*<{1}:{3}<*]\n",
      t.pose.x - t.tolerance_x, (t.pose.angle - t.tolerance_angle) / kDegree, t.pose.x + t.tolerance_x,
      (t.pose.angle + t.tolerance_angle) / kDegree, t.pose.x - 1.2 * t.tolerance_x,
      t.pose.x + 1.2 * t.tolerance_x);
}

/// Landings of every iteration around the target.
void draw_path(const FlipAnswer& a, const std::filesystem::path& folder) {
  Figure figure{"path", 12, 9, {}, ""};
  DataBlock known{"known before", {"x [m]", "angle [deg]"}, {}, {}},
      means{"means by iteration", {"x [m]", "angle [deg]", "iteration"}, {}, {}},
      throws{"throws", {"x [m]", "angle [deg]", "iteration"}, {}, {}};
  for (const auto& one : a.known) known.rows.push_back({one.landing.x, one.landing.angle / kDegree});
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    const double k = static_cast<double>(i + 1);
    if (one.mean) means.rows.push_back({one.mean->x, one.mean->angle / kDegree, k});
    for (const auto& t : one.trials)
      if (t.outcome == fl::FlipOutcome::landed)
        throws.rows.push_back({t.landing.x, t.landing.angle / kDegree, k});
  }
  struct Series {
    const DataBlock& block;
    const char* style;
  };
  std::string plots;
  for (const Series& one :
       {Series{known, "using 1:2 with points pt 2 ps 0.8 lc rgb '#888888' title 'known before'"},
        Series{throws, "using 1:2 with points pt 6 ps 0.6 lc rgb '#56b4e9' title 'throws'"},
        Series{means, "using 1:2 with linespoints pt 7 ps 0.7 lc rgb '#0072b2' title 'means'"},
        Series{means, "using 1:2:(sprintf('%d', int($3))) with labels offset 0.9,0.6 notitle"}}) {
    if (one.block.rows.empty()) continue;
    plots += fmt::format("{}DATA index {} {}", plots.empty() ? "plot " : ", ", figure.data.size(), one.style);
    figure.data.push_back(one.block);
  }
  if (figure.data.empty()) return;
  figure.script =
      "set grid\nset key outside top center horizontal samplen 1\nset xlabel 'landing x [m]'\nset ylabel "
      "'angle "
      "from "
      "hanging [deg]'\nset offsets graph 0.05, graph 0.05, graph 0.05, graph 0.05\n" +
      target_box(a.target) + plots + "\n";
  draw(figure, folder);
}

/// The error over the iterations; * two of three throws hit, T all of them.
void draw_progress(const FlipAnswer& a, const std::filesystem::path& folder) {
  Figure figure{"progress", 10, 7, {}, ""};
  DataBlock errors{"normalised error", {"iteration", "error"}, {}, {}};
  if (std::isfinite(a.path.initial)) errors.rows.push_back({0, a.path.initial});
  std::string marks;
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    if (!std::isfinite(one.error)) continue;
    const int k = static_cast<int>(i) + 1;
    errors.rows.push_back({static_cast<double>(k), one.error});
    const std::string mark = k == a.path.reached(a.throws)                 ? "T"
                             : k == a.path.reached((2 * a.throws + 2) / 3) ? "*"
                                                                           : "";
    if (!mark.empty()) marks += fmt::format("set label '{}' at {},{} offset 0.4,0.6\n", mark, k, one.error);
  }
  if (errors.rows.empty()) return;
  figure.data = {errors};
  figure.script = fmt::format(
      "set grid\nset key off\nset xtics 1\nset yrange [0:*]\nset xrange [-0.3:{}]\nset xlabel "
      "'iteration'\nset ylabel 'normalised error [-]'\n{}plot DATA index 0 using 1:2 with linespoints pt 7 "
      "lc "
      "rgb '#0072b2'\n",
      static_cast<double>(a.path.iterations.size()) + 0.3, marks);
  draw(figure, folder);
}

/// Landing poses of the population: marker the pitch, size the speed, colour the damping.
void draw_population(const FlipAnswer& a, const std::filesystem::path& folder) {
  std::set<double> values[3];
  for (const auto& t : a.population->trials)
    for (std::size_t p = 0; p < 3; ++p) values[p].insert(t.command.array()[p]);
  const auto level = [&](const fl::FlipTrial& t, std::size_t p) {
    return static_cast<std::size_t>(std::distance(values[p].begin(), values[p].find(t.command.array()[p])));
  };
  Figure figure{"population", 15, 10, {}, ""};
  std::string plots;
  for (std::size_t pitch = 0; pitch < 3; ++pitch)
    for (std::size_t speed = 0; speed < 3; ++speed)
      for (std::size_t damping = 0; damping < 3; ++damping) {
        DataBlock block{fmt::format("pitch {}, speed {}, damping {}", pitch, speed, damping),
                        {"x [m]", "angle [deg]"},
                        {},
                        {}};
        for (const auto& t : a.population->trials)
          if (t.outcome == fl::FlipOutcome::landed && level(t, 0) == pitch && level(t, 1) == speed &&
              level(t, 2) == damping)
            block.rows.push_back({t.landing.x, t.landing.angle / kDegree});
        if (block.rows.empty()) continue;
        plots += fmt::format("{}DATA index {} using 1:2 with points pt {} ps {} lc rgb '{}' notitle",
                             plots.empty() ? "plot " : ", ", figure.data.size(), kMarkers[pitch],
                             kSizes[speed], kColours[damping]);
        figure.data.push_back(block);
      }
  if (figure.data.empty()) return;
  const char* names[]{"low", "middle", "high"};
  const auto key = [&](const char* what, std::size_t i, int marker, double size, const char* colour) {
    plots += fmt::format(", NaN with points pt {} ps {} lc rgb '{}' title '{} {}'", marker, size, colour,
                         what, names[i]);
  };
  for (std::size_t i = 0; i < 3; ++i) key("pitch", i, kMarkers[i], 0.8, "#444444");
  for (std::size_t i = 0; i < 3; ++i) key("speed", i, 7, kSizes[i], "#444444");
  for (std::size_t i = 0; i < 3; ++i) key("damping", i, 7, 0.8, kColours[i]);
  figure.script =
      "set grid\nset key outside right\nset xlabel 'landing x [m]'\nset ylabel 'angle from hanging "
      "[deg]'\nset ytics 90\n" +
      target_box(a.target) + plots + "\n";
  draw(figure, folder);
}

}  // namespace

std::string text_of(const FlipAnswer& a) {
  return fmt::format(
      "{}\n{}: target {:.2f} m, {:.0f} degrees; error {:.2f} before, {:.2f} after one iteration, {:.2f} at "
      "least; {} of {} throws within the tolerances {}, all {}{}\n",
      table_of(a).text(), a.learner, a.target.pose.x, a.target.pose.angle / kDegree, a.path.initial,
      a.path.first(), a.path.minimum(), (2 * a.throws + 2) / 3, a.throws,
      reached(a.path, (2 * a.throws + 2) / 3), reached(a.path, a.throws),
      a.path.gave_up ? "; the learner had no command left to try" : "");
}

Json json_of(const FlipAnswer& a) {
  Json out = json_head("plan-flip");
  out["learner"] = a.learner;
  out["target"] = {{"x_m", a.target.pose.x},
                   {"angle_rad", a.target.pose.angle},
                   {"tolerance_x_m", a.target.tolerance_x},
                   {"tolerance_angle_rad", a.target.tolerance_angle}};
  out["com_offset_m"] = a.bar.com_offset;
  out["initial_error"] = number(a.path.initial);
  out["first_error"] = number(a.path.first());
  out["minimum_error"] = number(a.path.minimum());
  out["iterations_to_two_thirds"] = a.path.reached((2 * a.throws + 2) / 3);
  out["iterations_to_all"] = a.path.reached(a.throws);
  out["gave_up"] = a.path.gave_up;
  out["iterations"] = Json::array();
  for (const auto& one : a.path.iterations) {
    Json trials = Json::array();
    for (const auto& t : one.trials) trials.push_back(json_of(t));
    Json mean;
    if (one.mean) mean = {{"x_m", one.mean->x}, {"angle_rad", one.mean->angle}};
    out["iterations"].push_back(
        {{"error", number(one.error)}, {"hits", one.hits}, {"mean", mean}, {"trials", trials}});
  }
  if (a.population) {
    out["population"] = Json::array();
    for (const auto& t : a.population->trials) out["population"].push_back(json_of(t));
  }
  if (!a.card.empty()) out["card"] = Json::parse(a.card);
  return out;
}

void write_report(const FlipAnswer& a, const std::filesystem::path& folder) {
  draw_path(a, folder);
  draw_progress(a, folder);
  if (a.population) draw_population(a, folder);
  write_text(folder / "path.md", table_of(a).markdown());
  write_text(folder / "flip.json", json_text(json_of(a)));
  if (!a.card.empty()) write_text(folder / "card.json", a.card);
}

}  // namespace unhand::apps
