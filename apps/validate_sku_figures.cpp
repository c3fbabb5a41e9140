// The figures of `unhand validate-sku`.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/validate_sku.hpp"

namespace unhand::apps {

using experiment::kDegrees;
using fitting::SkuValidation;

namespace {

/// The outline at `sigmas` of the normal distribution of the linear samples [cm, deg].
std::vector<std::vector<double>> ellipse(const SkuValidation& answer, double sigmas) {
  double xx = 0, xt = 0, tt = 0;
  const auto n = static_cast<double>(answer.samples.size());
  for (const auto& s : answer.samples) {
    xx += s.linear_x * s.linear_x / n;
    xt += s.linear_x * s.linear_theta / n;
    tt += s.linear_theta * s.linear_theta / n;
  }
  // Cholesky of the covariance turns a circle into the ellipse.
  const double a = std::sqrt(xx), b = a > 0 ? xt / a : 0, c = std::sqrt(std::max(0.0, tt - b * b));
  std::vector<std::vector<double>> out;
  for (int i = 0; i <= 120; ++i) {
    const double angle = 2 * std::numbers::pi * i / 120, u = sigmas * std::cos(angle),
                 v = sigmas * std::sin(angle);
    out.push_back({100 * a * u, kDegrees * (b * u + c * v)});
  }
  return out;
}

}  // namespace

Figure sku_landing_figure(const SkuQuestion& question, const SkuValidation& answer) {
  const double tx = 100 * question.request.tolerance.x, tt = question.request.tolerance.theta * kDegrees;
  Figure figure{"landings", 16, 11, {}, {}};
  double x = 1.15 * tx, theta = 1.15 * tt;
  DataBlock drawn{"Monte Carlo", {"landing x about the predicted [cm]", "landing theta [deg]"}, {}, {}};
  constexpr std::size_t kMost = 2000;
  for (std::size_t i = 0; i < std::min(kMost, answer.samples.size()); ++i)
    drawn.rows.push_back({100 * answer.samples[i].x, answer.samples[i].theta * kDegrees});
  DataBlock measured{"measured", {"measured - predicted x [cm]", "theta [deg]"}, {}, {}};
  if (answer.measured)
    for (const auto& one : answer.measured->throws)
      measured.rows.push_back({-100 * one.error_x, -one.error_theta * kDegrees});
  for (const auto* block : {&drawn, &measured})
    for (const auto& row : block->rows) {
      x = std::max(x, 1.05 * std::abs(row[0]));
      theta = std::max(theta, 1.05 * std::abs(row[1]));
    }
  DataBlock box{
      "tolerance", {"x [cm]", "theta [deg]"}, {{-tx, -tt}, {tx, -tt}, {tx, tt}, {-tx, tt}, {-tx, -tt}}, {}};
  figure.data = {drawn,
                 {"ellipse of 1 sigma, derivatives", {"x [cm]", "theta [deg]"}, ellipse(answer, 1), {}},
                 {"ellipse of 2 sigma, derivatives", {"x [cm]", "theta [deg]"}, ellipse(answer, 2), {}},
                 box,
                 measured};
  std::vector<KeyEntry> key{
      {"with points pointtype 7 pointsize 0.5 linecolor rgb '#56b4e9'", "Monte Carlo"},
      {"with lines linecolor rgb '#000000' linewidth 1.6", "derivatives, 1 and 2 sigma"},
      {"with lines linecolor rgb '#d55e00' linewidth 1.6 dashtype 2", "tolerance"}};
  if (!measured.rows.empty())
    key.push_back({"with points pointtype 2 linecolor rgb '#000000' linewidth 1.2", "measured - predicted"});
  constexpr int columns = 2;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset title '{}: {:.1f} % within {:.3g} cm, {:.3g} deg{}' offset 0,-0.5\n"
      "set xlabel 'landing x about the predicted [cm]'\nset ylabel 'landing theta about the predicted "
      "[deg]'\n"
      "set xrange [{:.6g}:{:.6g}]; set yrange [{:.6g}:{:.6g}]\n",
      plain(question.sku.name), 100 * answer.within, tx, tt,
      answer.repeats ? fmt::format("; as the log repeats it {:.1f} %", 100 * answer.repeats->within) : "", -x,
      x, -theta, theta);
  s += place(figure, {1.9, figure.width - 0.5, 1.8 + key_height(key.size(), columns), figure.height - 1.0});
  s += "plot DATA index 0 using 1:2 with points pointtype 7 pointsize 0.35 linecolor rgb '#56b4e9', \\\n"
       "     DATA index 1 using 1:2 with lines linecolor rgb '#000000' linewidth 1.6, \\\n"
       "     DATA index 2 using 1:2 with lines linecolor rgb '#000000' linewidth 1.2, \\\n"
       "     DATA index 3 using 1:2 with lines linecolor rgb '#d55e00' linewidth 1.6 dashtype 2";
  if (!measured.rows.empty())
    s += ", \\\n     DATA index 4 using 1:2 with points pointtype 2 linecolor rgb '#000000' linewidth 1.2";
  s += "\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

Figure sku_budget_figure(const SkuQuestion& question, const SkuValidation& answer) {
  constexpr std::size_t kMost = 12;
  const std::size_t n = std::min(kMost, answer.budget.size());
  Figure figure{"budget", 17, 0, {}, {}};
  DataBlock block{"1 sigma of each input",
                  {"line", "landing x [cm]", "landing theta [deg]", "share [%]", "input"},
                  {},
                  {}};
  std::vector<std::string> names;
  for (std::size_t i = 0; i < n; ++i) {
    const auto& line = answer.budget[i];
    block.rows.push_back({static_cast<double>(i), 100 * line.x, line.theta * kDegrees, 100 * line.share});
    block.labels.push_back(line.input.name);
    names.push_back(fmt::format("{} ({}, {:.0f} %%)", line.input.name, to_string(line.input.source),
                                std::round(100 * line.share) + 0.0));  // no "-0"
  }
  figure.data.push_back(std::move(block));
  constexpr double left = 6.6, gap = 0.5;
  figure.height = 2.7 + 0.62 * static_cast<double>(n);
  const double middle = (left + figure.width) / 2, bottom = 1.5, top = figure.height - 1.0;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset style fill solid 0.75 noborder\nset boxwidth 0.6\n"
      "set label 1 '{}: what 1 sigma of each input does to the landing (share of the variance)' at screen "
      "0.5,{:.4f} "
      "center\n"
      "set yrange [{}:-0.7]\nset ytics ({}) scale 0\n",
      plain(question.sku.name), 1 - 0.5 / figure.height, static_cast<double>(n) - 0.3, named_tics(names));
  const auto panel = [&](const char* label, int column, const char* colour) {
    double high = 0;
    for (const auto& row : figure.data.front().rows)
      high = std::max(high, row[static_cast<std::size_t>(column) - 1]);
    const double decade = high > 0 ? std::pow(10, std::floor(std::log10(high))) : 1, tens = high / decade;
    return fmt::format(
        "set xrange [0:*]; set xtics {:.6g}; set xlabel '{}'\n"
        "plot DATA index 0 using (0.5*${}):1:(0.5*${}):(0.3) with boxxyerror linecolor rgb '{}'\n",
        decade * (tens > 5     ? 2
                  : tens > 2.5 ? 1
                               : 0.5),
        label, column, column, colour);
  };
  s += place(figure, {left, middle - gap / 2, bottom, top}) + panel("landing x [cm]", 2, "#0072b2");
  s += fmt::format("unset label 1\nset ytics format ''\nset ytics ({}) scale 0\n",
                   named_tics(std::vector<std::string>(n)));
  s += place(figure, {middle + gap / 2, figure.width - 0.5, bottom, top}) +
       panel("landing theta [deg]", 3, "#e69f00");
  s += "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
