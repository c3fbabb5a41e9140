// The figures of `unhand compare` on releases.
#include "apps/compare_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unhand::apps {
namespace {

using datasets::Split;
using experiment::Comparison;
using experiment::ModelComparison;
using experiment::ThrownCondition;

constexpr int landing_x = 2, landing_theta = 3;

/// Held-out throws where there are any.
bool any_test(const Comparison& comparison) {
  for (const auto& model : comparison.models)
    for (const auto& one : model.throws)
      if (one.split == Split::test) return true;
  return false;
}

std::string point_style(const std::string& model) {
  const Style style = style_of(model);
  return fmt::format("with points pointtype {} linecolor rgb '{}' linewidth 1", style.marker, style.colour);
}

using Points = std::vector<std::vector<double>>;

/// Half the width and height of an area about zero.
struct Extent {
  double x{}, theta{};
  void include(const Points& points) {
    for (const auto& p : points) {
      x = std::max(x, std::abs(p[0]));
      theta = std::max(theta, std::abs(p[1]));
    }
  }
  Extent padded() const { return {x > 0 ? 1.08 * x : 1, theta > 0 ? 1.08 * theta : 1}; }
};

/// One model's landing errors: x [cm], theta [deg].
struct Cloud {
  std::string model;
  Points points;
  double radius{};  ///< that 95 % stay within, in shares of the figure
};

/// The widest first, so that narrow ones lie on top.
std::vector<Cloud> clouds_of(const Comparison& comparison, bool test_only) {
  std::vector<Cloud> out;
  Extent all;
  for (const auto& model : comparison.models) {
    Cloud cloud{model.model, {}, 0};
    for (const auto& one : model.throws)
      if ((!test_only || one.split == Split::test) && one.error[landing_x] && one.error[landing_theta])
        cloud.points.push_back({100 * *one.error[landing_x], *one.error[landing_theta]});
    all.include(cloud.points);
    if (!cloud.points.empty()) out.push_back(std::move(cloud));
  }
  all = all.padded();
  for (Cloud& cloud : out) {
    std::vector<double> radii;
    for (const auto& p : cloud.points) radii.push_back(std::hypot(p[0] / all.x, p[1] / all.theta));
    std::sort(radii.begin(), radii.end());
    cloud.radius = radii[(radii.size() - 1) * 95 / 100];
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.radius > b.radius; });
  return out;
}

/// Where the clouds fall into two groups, the first of the narrower ones; 0 if they do not differ that much.
std::size_t first_narrow(const std::vector<Cloud>& clouds) {
  constexpr double apart = 2.5;
  std::size_t first = 0;
  double widest = apart;
  for (std::size_t i = 1; i < clouds.size(); ++i) {
    const double ratio = clouds[i - 1].radius / std::max(clouds[i].radius, 1e-12);
    if (ratio <= widest) continue;
    widest = ratio;
    first = i;
  }
  return first;
}

std::string scatter(const std::vector<Cloud>& clouds, const Extent& e, const std::string& title) {
  std::string out =
      fmt::format("set xrange [{:.6g}:{:.6g}]; set yrange [{:.6g}:{:.6g}]\n", -e.x, e.x, -e.theta, e.theta);
  out += fmt::format("set title '{}' offset 0,-0.5\nplot ", title);
  for (std::size_t i = 0; i < clouds.size(); ++i)
    out += fmt::format("{}DATA index {} using 1:2 {}", i > 0 ? ", \\\n     " : "", i,
                       point_style(clouds[i].model));
  return out + "\n";
}

/// The conditions, that with the largest landing error of `model` first.
std::vector<ThrownCondition> sorted_conditions(const Comparison& comparison, const ModelComparison& model) {
  std::vector<std::pair<double, ThrownCondition>> order;
  for (const auto& condition : comparison.conditions)
    order.emplace_back(model.of_condition(landing_x, condition).mae, condition);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<ThrownCondition> out;
  for (const auto& entry : order) out.push_back(entry.second);
  return out;
}

/// Rows: the line in the figure, MAE of landing x [cm] and theta [deg].
DataBlock condition_block(const ModelComparison& model, const std::vector<ThrownCondition>& conditions,
                          double dodge) {
  DataBlock out{model.model, {"line", "MAE landing x [cm]", "MAE landing theta [deg]", "condition"}, {}, {}};
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    const auto x = model.of_condition(landing_x, conditions[i]);
    const auto theta = model.of_condition(landing_theta, conditions[i]);
    if (x.n == 0 || theta.n == 0) continue;
    out.rows.push_back({static_cast<double>(i) + dodge, 100 * x.mae, theta.mae});
    out.labels.push_back(conditions[i].label + (conditions[i].held_out ? " (held out)" : ""));
  }
  return out;
}

constexpr const char* floor_style = "linecolor rgb '#404040' linewidth 1.2 dashtype 2";

/// What the panel of a column shows: all models, and the floor.
std::vector<double> panel_values(const Figure& figure, int column, std::optional<double> floor) {
  std::vector<double> values;
  for (const auto& block : figure.data)
    for (const auto& row : block.rows) values.push_back(row[static_cast<std::size_t>(column) - 1]);
  if (floor) values.push_back(*floor);
  return values;
}

/// One panel: all models along column `column` of the data.
std::string condition_panel(const Figure& figure, int column, std::optional<double> floor, Scale scale,
                            const std::string& label) {
  std::string out = value_axis(panel_values(figure, column, floor), scale) +
                    fmt::format("set xlabel '{}'\nunset arrow\n", label);
  if (floor)
    out += fmt::format("set arrow from {0:.6g}, graph 0 to {0:.6g}, graph 1 nohead back {1}\n", *floor,
                       floor_style);
  out += "plot ";
  for (std::size_t i = 0; i < figure.data.size(); ++i)
    out += fmt::format("{}DATA index {} using {}:1 {}", i > 0 ? ", \\\n     " : "", i, column,
                       point_style(figure.data[i].title));
  return out + "\n";
}

/// "'label' 0, 'label' 1, ...": every so many lines; without labels for a panel that shares its neighbour's.
std::string line_tics(const std::vector<std::string>& labels, bool named) {
  constexpr std::size_t most = 64;
  const std::size_t skip = (labels.size() + most - 1) / most;
  std::string out;
  for (std::size_t i = 0; i < labels.size(); i += skip)
    out += fmt::format("{}'{}' {}", i > 0 ? ", " : "", named ? tic_label(labels[i]) : "", i);
  return out;
}

}  // namespace

std::optional<Figure> landing_figure(const Comparison& comparison) {
  const bool test_only = any_test(comparison);
  const auto clouds = clouds_of(comparison, test_only);
  if (clouds.empty()) return {};
  const std::size_t narrow = first_narrow(clouds);
  const bool two = narrow > 0;
  const int columns = two ? 3 : 2;
  Figure figure{"landing_errors", two ? 19.0 : 13.0, 11.5, {}, {}};
  Extent all, zoom;
  std::vector<KeyEntry> key;
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    figure.data.push_back(
        {clouds[i].model, {"landing x error [cm]", "landing theta error [deg]"}, clouds[i].points, {}});
    key.push_back({point_style(clouds[i].model), clouds[i].model});
    all.include(clouds[i].points);
    if (i >= narrow) zoom.include(clouds[i].points);
  }
  all = all.padded();
  zoom = zoom.padded();
  const double bottom = 1.7 + key_height(key.size(), columns), top = figure.height - 1.0;
  const std::string which = test_only ? "test throws" : "all throws";
  std::string& s = figure.script;
  s = "set multiplot\nunset key\nset xlabel 'landing x, predicted - measured [cm]'\n"
      "set ylabel 'landing theta, predicted - measured [deg]' offset 0.5,0\n"
      "set xzeroaxis linetype 1 linecolor rgb '#808080' linewidth 0.6\n"
      "set yzeroaxis linetype 1 linecolor rgb '#808080' linewidth 0.6\n";
  s += place(figure, {1.9, two ? 9.1 : figure.width - 0.5, bottom, top});
  if (two)
    s += fmt::format(
        "set object 1 rectangle from {:.6g},{:.6g} to {:.6g},{:.6g} front fillstyle empty border rgb "
        "'#303030' "
        "linewidth 1 dashtype 2\n",
        -zoom.x, -zoom.theta, zoom.x, zoom.theta);
  s += scatter(clouds, all, (two ? "every model, " : "landing errors, ") + which);
  if (two)
    s += "unset object 1\n" + place(figure, {10.8, figure.width - 0.5, bottom, top}) +
         scatter(clouds, zoom, "the same, magnified about zero");
  s += key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

std::optional<Figure> condition_figure(const Comparison& comparison) {
  const ModelComparison& first = comparison.models.front();
  const auto conditions = sorted_conditions(comparison, first);
  std::vector<std::string> labels;
  bool any_held_out = false;
  for (const auto& condition : conditions) {
    any_held_out = any_held_out || condition.held_out;
    labels.push_back((condition.held_out ? "* " : "") + condition.label);
  }
  Figure figure{"conditions", 19, 0, {}, {}};
  std::vector<KeyEntry> key;
  const double models = static_cast<double>(comparison.models.size());
  for (std::size_t k = 0; k < comparison.models.size(); ++k) {
    const double dodge = models > 1 ? 0.56 * (static_cast<double>(k) / (models - 1) - 0.5) : 0;
    auto block = condition_block(comparison.models[k], conditions, dodge);
    if (block.rows.empty()) continue;
    key.push_back({point_style(block.title), block.title});
    figure.data.push_back(std::move(block));
  }
  if (figure.data.empty()) return {};
  std::optional<double> floor_x = comparison.repetitions.landing_x,
                        floor_theta = comparison.repetitions.landing_theta;
  if (floor_x) *floor_x *= 100;  // cm
  if (floor_x || floor_theta) {
    key.push_back({fmt::format("with lines {}", floor_style), "1 sigma of repetitions"});
  }
  const Scale scale = common_scale({panel_values(figure, 2, floor_x), panel_values(figure, 3, floor_theta)});
  constexpr int columns = 3;
  std::size_t longest = 0;
  for (const auto& label : labels) longest = std::max(longest, label.size());
  const double n = static_cast<double>(conditions.size());
  const double left = std::clamp(0.18 * static_cast<double>(longest) + 0.4, 1.5, 7.0);
  const double bottom = 1.7 + key_height(key.size(), columns);
  figure.height = std::clamp(bottom + 1.0 + 0.5 * n, bottom + 4.0, 34.0);
  const double top = figure.height - 1.0, middle = (left + figure.width) / 2;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\n"
      "set label 1 'mean absolute error of each condition, sorted by landing x of {}{}' at screen 0.5,{:.4f} "
      "center\n"
      "set yrange [{}:-0.7]\nset ytics ({}) scale 0\n",
      plain(first.model), any_held_out ? " (*: held-out throws)" : "", 1 - 0.5 / figure.height, n - 0.3,
      line_tics(labels, true));
  s += place(figure, {left, middle - 0.25, bottom, top}) +
       condition_panel(figure, 2, floor_x, scale, "landing x [cm]");
  s += fmt::format("unset label 1\nset ytics ({})\n", line_tics(labels, false));
  s += place(figure, {middle + 0.25, figure.width - 0.5, bottom, top}) +
       condition_panel(figure, 3, floor_theta, scale, "landing theta [deg]");
  s += key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
