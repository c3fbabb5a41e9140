#include "apps/compare_slip_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unhand::apps {
namespace {

using fitting::SurfaceScore;

std::string line_style(const std::string& model) {
  const Style style = style_of(model);
  return fmt::format("with lines linecolor rgb '{}' linewidth 1.8 dashtype {}", style.colour, style.dash);
}
std::string point_style(const std::string& model) {
  const Style style = style_of(model);
  return fmt::format("with points linecolor rgb '{}' pointtype {} pointsize 0.8", style.colour, style.marker);
}

/// A section through the origin: two of the three components.
struct Section {
  std::size_t across, up, off;
  const char *across_name, *up_name;    ///< of columns
  const char *across_label, *up_label;  ///< of axes
};
constexpr Section sections[] = {{0, 1, 2, "f_x [N]", "f_y [N]", "f_x [N]", "f_y [N]"},
                                {0, 2, 1, "f_x [N]", "tau/L [N]", "f_x [N]", "{/Symbol t}/L [N]"}};

DataBlock curve(const fitting::SlipSurface& surface, const Section& section) {
  DataBlock out{to_string(surface.model), {section.across_name, section.up_name}, {}, {}};
  constexpr int points = 240;
  for (int k = 0; k <= points; ++k) {
    const double phi = 2 * std::numbers::pi * k / points;
    std::array<double, 3> w{};
    w[section.across] = std::cos(phi);
    w[section.up] = std::sin(phi);
    const double r = 1 / surface.gauge(w);
    out.rows.push_back({r * w[section.across], r * w[section.up]});
  }
  return out;
}

/// The wrenches near the section, and the measured directions as arrows of length `arrow`.
DataBlock near(const fitting::SlipSamples& slips, const Section& section, double arrow) {
  DataBlock out{
      "measured", {section.across_name, section.up_name, "direction, across", "direction, up"}, {}, {}};
  for (const auto& s : slips.samples) {
    const auto& w = s.wrench;
    const double within = std::hypot(w[section.across], w[section.up]);
    if (std::abs(w[section.off]) > std::tan(20 * std::numbers::pi / 180) * within) continue;
    out.rows.push_back({w[section.across], w[section.up], arrow * s.direction[section.across],
                        arrow * s.direction[section.up]});
  }
  return out;
}

}  // namespace

Figure section_figure(const fitting::SlipSamples& slips, const std::vector<SurfaceScore>& scores,
                      const std::string& name) {
  Figure figure{"section_" + name, 19, 11, {}, {}};
  std::vector<double> sizes;
  for (const auto& s : slips.samples) sizes.push_back(std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]));
  const double largest = sizes.empty() ? 1 : *std::max_element(sizes.begin(), sizes.end());
  const double extent = 1.3 * largest, arrow = 0.16 * largest;
  std::vector<KeyEntry> key{{"with points pointtype 7 pointsize 0.4 linecolor rgb '#808080'", "measured"}};
  for (const SurfaceScore& score : scores)
    if (score.fit.fitted()) key.push_back({line_style(to_string(score.model)), to_string(score.model)});
  const double bottom = 1.8 + key_height(key.size(), 2), top = figure.height - 1.2;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset label 1 '{}: limit surface, and wrenches within 20 deg of the section "
      "with their sliding' at screen "
      "0.5,{:.4f} center\nset xrange [{:.6g}:{:.6g}]\nset yrange [{:.6g}:{:.6g}]\nset size ratio -1\n",
      plain(slips.surface), 1 - 0.5 / figure.height, -extent, extent, -extent, extent);
  double left = 1.7;
  for (const Section& section : sections) {
    const std::size_t data = figure.data.size();
    figure.data.push_back(near(slips, section, arrow));
    for (const SurfaceScore& score : scores)
      if (score.fit.fitted()) figure.data.push_back(curve(score.fit.surface, section));
    s += place(figure, {left, left + 7.6, bottom, top});
    s += fmt::format("set xlabel '{}'\nset ylabel '{}'\n", section.across_label, section.up_label);
    s += "plot ";
    if (!figure.data[data].rows.empty())
      s += fmt::format(
          "DATA index {0} using 1:2:3:4 with vectors nohead linecolor rgb '#808080' linewidth 0.8, \\\n     "
          "DATA index {0} using 1:2 {1}, \\\n     ",
          data, key.front().style);
    for (std::size_t i = data + 1; i < figure.data.size(); ++i)
      s += fmt::format("DATA index {} using 1:2 {}, \\\n     ", i, line_style(figure.data[i].title));
    s += "NaN notitle\nunset label 1\n";
    left += 9.2;
  }
  s += "set size noratio\n" + key_strip(figure, key, 2) + "unset multiplot\n";
  return figure;
}

Figure surface_error_figure(const std::vector<fitting::SlipSamples>& surfaces,
                            const std::vector<std::vector<SurfaceScore>>& scores) {
  Figure figure{"direction_errors", 19, 0, {}, {}};
  std::vector<KeyEntry> key;
  double most = 1;
  std::size_t longest = 4;
  const double models = static_cast<double>(scores.front().size());
  for (std::size_t k = 0; k < scores.front().size(); ++k) {
    const std::string model = to_string(scores.front()[k].model);
    const double dodge = models > 1 ? 0.4 * (static_cast<double>(k) / (models - 1) - 0.5) : 0;
    DataBlock block{model, {"line", "cross-validated [deg]", "null control [deg]", "surface"}, {}, {}};
    for (std::size_t i = 0; i < scores.size(); ++i) {
      const SurfaceScore& score = scores[i][k];
      if (!score.scored()) continue;
      block.rows.push_back({static_cast<double>(i) + dodge, score.mean_deg, score.null_control_deg});
      block.labels.push_back(surfaces[i].surface);
      most = std::max({most, score.mean_deg, score.null_control_deg});
    }
    if (block.rows.empty()) continue;
    key.push_back({point_style(model), model});
    figure.data.push_back(std::move(block));
  }
  std::vector<std::string> names;
  for (const auto& one : surfaces) names.push_back(one.surface);
  for (const auto& name : names) longest = std::max(longest, name.size());
  const double n = static_cast<double>(surfaces.size());
  const double left = std::clamp(0.18 * static_cast<double>(longest) + 0.4, 1.5, 7.0);
  const double bottom = 1.7 + key_height(key.size(), 3);
  figure.height = std::clamp(bottom + 1.2 + 0.7 * n, bottom + 4.0, 34.0);
  const double top = figure.height - 1.2, middle = (left + figure.width) / 2;
  std::string& s = figure.script;
  s = fmt::format("set multiplot\nunset key\nset yrange [{}:-0.7]\nset xrange [0:{:.6g}]\nset grid xtics\n",
                  n - 0.3, 1.1 * most);
  const auto panel = [&](double from, double to, const std::string& tics, const char* title, int column) {
    s += place(figure, {from, to, bottom, top});
    s += fmt::format(
        "set ytics ({}) scale 0\nset title '{}' offset 0,-0.5\nset xlabel 'mean direction error "
        "[deg]'\nplot ",
        tics, title);
    for (std::size_t i = 0; i < figure.data.size(); ++i)
      s += fmt::format("{}DATA index {} using {}:1 {}", i > 0 ? ", \\\n     " : "", i, column,
                       point_style(figure.data[i].title));
    s += "\n";
  };
  panel(left, middle - 0.25, named_tics(names), "left-out slips", 2);
  panel(middle + 0.25, figure.width - 0.5, named_tics(std::vector<std::string>(names.size())),
        "null control (from the ellipsoid)", 3);
  s += key_strip(figure, key, 3) + "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
