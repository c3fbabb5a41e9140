// How `unhand plan flip` tells what it learned.
#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <iterator>
#include <set>

#include "apps/figure.hpp"
#include "apps/flip_store.hpp"
#include "apps/plan_flip.hpp"
#include "apps/table.hpp"

namespace unhand::apps {
namespace {

namespace fl = planners::flip;

const char* kColours[]{"#440154", "#21918c", "#e69f00"};  // of damping: low, middle, high
const int kMarkers[]{7, 5, 9};                            // of pitch: circle, square, triangle
const double kSizes[]{0.5, 0.75, 1.0};                    // of speed

Table table_of(const FlipAnswer& a) {
  Table out{{"iteration", "pitch [deg]", "speed", "damping", "x [m]", "angle [deg]", "error", "hits"}, {}, 1};
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    out.rows.push_back({std::to_string(i + 1), fixed(true, one.command.pitch / kDegree, 2),
                        fmt::format("{:.4f}", one.command.speed), fmt::format("{:.2f}", one.command.damping),
                        one.mean ? fmt::format("{:.3f}", one.mean->x) : "-",
                        one.mean ? fixed(true, one.mean->angle / kDegree, 0) : "-",
                        one.mean ? fmt::format("{:.2f}", one.error) : "-",
                        fmt::format("{}/{}", one.hits, a.throws)});
  }
  return out;
}

std::string reached(const fl::LearningPath& path, int hits) {
  const int i = path.reached(hits);
  return i == 0 ? "in no iteration" : fmt::format("first in iteration {}", i);
}

std::string target_box(const fl::FlipTarget& t) {
  return fmt::format(
      "set object 1 rectangle from {0},{1} to {2},{3} fs solid 0.25 noborder fc rgb '#55aa55' behind\n"
      "set xrange [*<{4}:{5}<*]\nset yrange [*<{1}:{3}<*]\n",
      t.pose.x - t.tolerance_x, (t.pose.angle - t.tolerance_angle) / kDegree, t.pose.x + t.tolerance_x,
      (t.pose.angle + t.tolerance_angle) / kDegree, t.pose.x - 1.2 * t.tolerance_x,
      t.pose.x + 1.2 * t.tolerance_x);
}

/// "1, 3–6": ascending numbers, three and more in a row as a range.
std::string listed(const std::vector<int>& numbers) {
  std::string out;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t end = i + 1;
    while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
    if (end - i < 3) end = i + 1;
    out += fmt::format("{}{}", out.empty() ? "" : ", ", numbers[i]);
    if (end > i + 1) out += fmt::format("–{}", numbers[end - 1]);
    i = end;
  }
  return out;
}

/// One label for each cluster of means, where numbers would lie on each other: at its first mean.
DataBlock labels_of(const std::vector<std::vector<double>>& means, double reach_x, double reach_angle) {
  DataBlock out{"iterations", {"x [m]", "angle [deg]", "numbers"}, {}, {}};
  std::vector<std::vector<int>> numbers;
  for (const auto& one : means) {
    const auto near = std::find_if(out.rows.begin(), out.rows.end(), [&](const auto& row) {
      return std::abs(row[0] - one[0]) < reach_x && std::abs(row[1] - one[1]) < reach_angle;
    });
    const auto at = static_cast<std::size_t>(near - out.rows.begin());
    if (near == out.rows.end()) {
      out.rows.push_back({one[0], one[1]});
      numbers.emplace_back();
    }
    numbers[at].push_back(static_cast<int>(one[2]));
  }
  for (const auto& cluster : numbers) out.labels.push_back(listed(cluster));
  return out;
}

/// Where a label stands from its point, with its style.
struct Corner {
  int right, up;  ///< 1, or -1: left, down
  const char* style;
};
constexpr Corner kCorners[]{{1, 1, "left offset 0.7,0.7"},
                            {-1, 1, "right offset -0.7,0.7"},
                            {1, -1, "left offset 0.7,-0.7"},
                            {-1, -1, "right offset -0.7,-0.7"}};

/// The labels of each corner: where they cover least of the path through the means, and of other points.
std::vector<DataBlock> placed_labels(const DataBlock& labels, const std::vector<std::vector<double>>& means,
                                     const std::vector<std::vector<double>>& others, double width,
                                     double height) {
  constexpr double kLetter = 0.018, kText = 0.06, kAside = 0.015, kAbove = 0.02;  // of width and height
  constexpr int kAlong = 20;
  std::vector<DataBlock> out(std::size(kCorners), {labels.title, labels.columns, {}, {}});
  for (std::size_t i = 0; i < labels.rows.size(); ++i) {
    const double wide = kLetter * static_cast<double>(labels.labels[i].size());
    const auto covers = [&](const Corner& corner, double x, double angle) {
      const double right = corner.right * (x - labels.rows[i][0]) / width,
                   up = corner.up * (angle - labels.rows[i][1]) / height;
      return right > kAside && right < kAside + wide && up > kAbove && up < kAbove + kText;
    };
    std::size_t best = 0;
    int least = INT_MAX;
    for (std::size_t c = 0; c < out.size(); ++c) {
      int covered = 0;
      for (std::size_t k = 1; k < means.size(); ++k)
        for (int j = 0; j <= kAlong; ++j) {
          const double share = static_cast<double>(j) / kAlong;
          covered += covers(kCorners[c], means[k - 1][0] + share * (means[k][0] - means[k - 1][0]),
                            means[k - 1][1] + share * (means[k][1] - means[k - 1][1]));
        }
      for (const auto& point : others) covered += kAlong * covers(kCorners[c], point[0], point[1]);
      if (covered < least) least = covered, best = c;
    }
    out[best].rows.push_back(labels.rows[i]);
    out[best].labels.push_back(labels.labels[i]);
  }
  return out;
}

/// Landings of every iteration around the target, and those known before that are no farther from it.
void draw_path(const FlipAnswer& a, const std::filesystem::path& folder) {
  Figure figure{"path", 12, 9, {}, ""};
  DataBlock known{"known before", {"x [m]", "angle [deg]"}, {}, {}},
      means{"means by iteration", {"x [m]", "angle [deg]", "iteration"}, {}, {}},
      throws{"throws", {"x [m]", "angle [deg]", "iteration"}, {}, {}};
  double farthest = std::isfinite(a.path.initial) ? std::max(3.0, a.path.initial) : 3.0;
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    const double k = static_cast<double>(i + 1);
    if (!one.mean) continue;
    farthest = std::max(farthest, one.error);
    means.rows.push_back({one.mean->x, one.mean->angle / kDegree, k});
    for (const auto& t : one.trials)
      if (t.outcome == fl::FlipOutcome::landed)
        throws.rows.push_back({t.landing.x, t.landing.angle / kDegree, k});
  }
  for (const auto& one : a.known)
    if (fl::normalized_error(one.landing, a.target) <= farthest)
      known.rows.push_back({one.landing.x, one.landing.angle / kDegree});
  double low[]{a.target.pose.x - a.target.tolerance_x,
               (a.target.pose.angle - a.target.tolerance_angle) / kDegree},
      high[]{a.target.pose.x + a.target.tolerance_x,
             (a.target.pose.angle + a.target.tolerance_angle) / kDegree};
  for (const DataBlock* block : {&known, &means, &throws})
    for (const auto& row : block->rows)
      for (std::size_t k = 0; k < 2; ++k)
        low[k] = std::min(low[k], row[k]), high[k] = std::max(high[k], row[k]);
  const double width = high[0] - low[0], height = high[1] - low[1];
  std::vector<std::vector<double>> others = throws.rows;
  others.insert(others.end(), known.rows.begin(), known.rows.end());
  const auto labels =
      placed_labels(labels_of(means.rows, 0.11 * width, 0.06 * height), means.rows, others, width, height);
  struct Series {
    const DataBlock& block;
    std::string style;
  };
  std::vector<Series> all;
  for (std::size_t c = 0; c < labels.size(); ++c)  // first: they hide nothing but the grid
    all.push_back(
        {labels[c], fmt::format("using 1:2:3 with labels {} font ',8' boxed notitle", kCorners[c].style)});
  all.push_back({known, fmt::format("using 1:2 with points pt 2 ps 0.8 lc rgb '#888888' title '{}'",
                                    a.path.initial_is_seen ? "known before" : "expected")});
  all.push_back({throws, "using 1:2 with points pt 6 ps 0.6 lc rgb '#56b4e9' title 'throws'"});
  all.push_back({means, "using 1:2 with linespoints pt 7 ps 0.7 lc rgb '#0072b2' title 'means'"});
  std::string plots;
  for (const Series& one : all) {
    if (one.block.rows.empty()) continue;
    plots += fmt::format("{}DATA index {} {}", plots.empty() ? "plot " : ", ", figure.data.size(), one.style);
    figure.data.push_back(one.block);
  }
  if (figure.data.empty()) return;
  figure.script =
      "set grid\nset key outside top center horizontal Left reverse samplen 1.5\nset xlabel 'landing x [m]'\n"
      "set style textbox opaque noborder fillcolor rgb '#ffffff' margins 0.4,0.4\n"
      "set ylabel 'angle from hanging [deg]'\nset offsets graph 0.05, graph 0.08, graph 0.08, graph 0.05\n" +
      target_box(a.target) + plots + "\n";
  draw(figure, folder, "simulated by unhand plan flip");
}

/// The error over the iterations; * two of three throws hit, T all of them. An error that was only expected
/// is hollow.
void draw_progress(const FlipAnswer& a, const std::filesystem::path& folder) {
  Figure figure{"progress", 10, 7, {}, ""};
  DataBlock before{"before", {"iteration", "error"}, {}, {}}, errors{"after", {"iteration", "error"}, {}, {}},
      all{"all", {"iteration", "error"}, {}, {}};
  if (std::isfinite(a.path.initial)) before.rows.push_back({0, a.path.initial});
  const int most = (2 * a.throws + 2) / 3;
  std::string marks;
  for (std::size_t i = 0; i < a.path.iterations.size(); ++i) {
    const auto& one = a.path.iterations[i];
    if (!std::isfinite(one.error)) continue;
    const int k = static_cast<int>(i) + 1;
    errors.rows.push_back({static_cast<double>(k), one.error});
    const std::string mark = k == a.path.reached(a.throws) ? "T" : k == a.path.reached(most) ? "*" : "";
    if (!mark.empty()) marks += fmt::format("set label '{}' at {},{} offset 0.4,0.6\n", mark, k, one.error);
  }
  if (errors.rows.empty()) return;
  all.rows = before.rows;
  all.rows.insert(all.rows.end(), errors.rows.begin(), errors.rows.end());
  figure.data = {all, errors};
  std::string plots =
      "plot DATA index 0 with lines lc rgb '#0072b2', DATA index 1 with points pt 7 lc rgb '#0072b2'";
  if (!before.rows.empty()) {
    figure.data.push_back(before);
    plots += fmt::format(", DATA index 2 with points pt {} lc rgb '#0072b2'", a.path.initial_is_seen ? 7 : 6);
  }
  figure.script = fmt::format(
      "set grid\nset key off\nset xtics 1\nset yrange [0:*]\nset offsets 0,0,graph 0.08,0\nset xrange "
      "[-0.3:{}]\nset xlabel 'iteration (0: before; *: {} of {} hit, T: all)'\nset ylabel 'normalised "
      "error "
      "[-]'\n{}{}\n",
      static_cast<double>(a.path.iterations.size()) + 0.3, most, a.throws, marks, plots);
  draw(figure, folder, "simulated by unhand plan flip");
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
  figure.script = fmt::format(
      "set grid\nset key outside right Left reverse\nset xlabel 'landing x [m], centre of mass {:.1f} cm "
      "from the "
      "pads'\nset ylabel 'angle from hanging [deg]'\nset ytics 90\n{}{}\n",
      100 * a.declared_bar.com_offset, target_box(a.target), plots);
  draw(figure, folder, "simulated by unhand plan flip");
}

/// The largest shares of the joints' limits over the path: its commands keep them, their brake may not.
std::string used_limits(const fl::LearningPath& path) {
  fl::ArmUse most;
  for (const auto& one : path.iterations)
    for (const auto& t : one.trials)
      for (double fl::ArmUse::*limit : {&fl::ArmUse::position, &fl::ArmUse::velocity, &fl::ArmUse::torque})
        most.*limit = std::max(most.*limit, t.use.*limit);
  return fmt::format("Limits used at most: position {:.1f} %, speed {:.1f} %, torque {:.1f} %{}\n",
                     100 * most.position, 100 * most.velocity, 100 * most.torque,
                     std::max(most.position, most.velocity) > 1 ? ": the brake goes beyond" : "");
}

/// What was thrown, what was known before, and what came of it.
std::string summary(const FlipAnswer& a) {
  const double own = 100 * a.bar.com_offset, known = 100 * a.known_bar.com_offset;
  std::string out = fmt::format(
      "{}: target {:.2f} m, {:.0f} degrees; a bar with its centre of mass {:.1f} cm from the pads", a.learner,
      a.target.pose.x, a.target.pose.angle / kDegree, own);
  out += a.known_bar == a.bar
             ? fmt::format(", known from {} throws of it", a.known_throws)
             : fmt::format(", known from {} throws of another one ({:.1f} cm{})", a.known_throws, known,
                           a.paper_shift ? "; the paper's shift, as no --com-offset was given" : "");
  const int most = (2 * a.throws + 2) / 3;
  const std::string some =
      most == a.throws ? "" : fmt::format("at least {} of {} {}, ", most, a.throws, reached(a.path, most));
  return out + fmt::format(
                   "\nError {:.2f} before{}, {:.2f} after one iteration, {:.2f} at least; throws within the "
                   "tolerances: {}all {} {}{}\n{}",
                   a.path.initial, a.path.initial_is_seen ? "" : " (expected, not seen)", a.path.first(),
                   a.path.minimum(), some, a.throws, reached(a.path, a.throws),
                   a.path.gave_up ? "; the learner had no command left to try" : "", used_limits(a.path));
}

}  // namespace

std::string text_of(const FlipAnswer& a) { return table_of(a).text() + "\n" + summary(a); }

Json flip_json(const FlipAnswer& a) {
  Json out = json_head("plan-flip");
  out["learner"] = a.learner;
  out["target"] = {{"x_m", a.target.pose.x},
                   {"angle_rad", a.target.pose.angle},
                   {"tolerance_x_m", a.target.tolerance_x},
                   {"tolerance_angle_rad", a.target.tolerance_angle}};
  out["bar"] = bar_json(a.bar);
  out["known_bar"] = bar_json(a.known_bar);
  out["known_throws"] = a.known_throws;
  out["initial_error"] = number(a.path.initial);
  out["initial_error_is_seen"] = a.path.initial_is_seen;
  out["first_error"] = number(a.path.first());
  out["minimum_error"] = number(a.path.minimum());
  const auto reached = [&](int hits) {
    const int iterations = a.path.reached(hits);
    return iterations > 0 ? Json(iterations) : Json(nullptr);
  };
  out["iterations_to_two_thirds"] = reached((2 * a.throws + 2) / 3);
  out["iterations_to_all"] = reached(a.throws);
  out["gave_up"] = a.path.gave_up;
  out["iterations"] = Json::array();
  for (const auto& one : a.path.iterations) {
    Json trials = Json::array();
    for (const auto& t : one.trials) trials.push_back(trial_json(t));
    Json mean;
    if (one.mean) mean = {{"x_m", one.mean->x}, {"angle_rad", one.mean->angle}};
    out["iterations"].push_back(
        {{"error", number(one.error)}, {"hits", one.hits}, {"mean", mean}, {"trials", trials}});
  }
  if (a.population) {
    out["population"] = Json::array();
    for (const auto& t : a.population->trials) out["population"].push_back(trial_json(t));
  }
  if (!a.card.empty()) out["card"] = Json::parse(a.card);
  return out;
}

void write_report(const FlipAnswer& a, const std::filesystem::path& folder) {
  draw_path(a, folder);
  draw_progress(a, folder);
  if (a.population) draw_population(a, folder);
  write_text(folder / "path.md", summary(a) + "\n" + table_of(a).markdown());
  write_text(folder / "flip.json", json_text(flip_json(a)));
  if (!a.card.empty()) write_text(folder / "card.json", a.card);
}

}  // namespace unhand::apps
