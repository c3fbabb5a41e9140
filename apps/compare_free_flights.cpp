// unhand compare on free flights.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "apps/command.hpp"
#include "apps/compare.hpp"
#include "apps/figure.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "experiment/free_flight.hpp"

namespace unhand::apps {
namespace {

using datasets::Split;
using experiment::FreeFlightComparison;
using experiment::FreeFlightOutcome;
using experiment::FreeFlightStatistics;

struct SplitOf {
  const char* name;
  const FreeFlightStatistics FreeFlightComparison::*statistics;
};
constexpr SplitOf kFlightSplits[] = {{"train", &FreeFlightComparison::train},
                                     {"test", &FreeFlightComparison::test}};

Json spread_json(const experiment::Spread& s) {
  if (s.n == 0) return {{"n", 0}, {"mean", nullptr}, {"median", nullptr}, {"std", nullptr}};
  return {{"n", s.n}, {"mean", s.mean}, {"median", s.median}, {"std", s.n > 1 ? Json(s.std) : Json(nullptr)}};
}

std::map<std::string, int> skip_reasons(const FreeFlightComparison& found) {
  std::map<std::string, int> out;
  for (const auto& one : found.each)
    if (one.outcome != FreeFlightOutcome::fitted)
      ++out[fmt::format("{}: {}", to_string(one.outcome), one.reason)];
  return out;
}

Json flights_json(const FreeFlightComparison& found, const CompareRequest& request,
                  const datasets::ThrowLog& log) {
  Json out = json_head("compare");
  out["log"] = request.log;
  out["source"] = log.source;
  out["dimension"] = log.dimension;
  out["gravity_m_s2"] = log.gravity;
  Json& one = out["models"][experiment::kProjectile];
  one["parameters"] = Json::object();
  one["failed"] = found.skipped;
  for (const auto& [name, member] : kFlightSplits) {
    const FreeFlightStatistics& s = found.*member;
    one[name] = {{"n", s.n}, {"trajectory_rms_m", nullptr}};
    if (s.n > 0) one[name]["trajectory_rms_m"] = s.trajectory_rms_m;
    one[name]["end_position_error_m"] = spread_json(s.end_position_error_m);
    one[name]["end_orientation_error_deg"] = spread_json(s.end_orientation_error_deg);
  }
  one["microseconds_per_throw"] = found.microseconds_per_throw;
  return out;
}

Table flights_table(const FreeFlightComparison& found) {
  Table out{{"model", "throws", "n", "trajectory rms [mm]", "end position [mm]", "median",
             "end orientation [deg]", "median", "us/throw"},
            {},
            2};
  for (const auto& [name, member] : kFlightSplits) {
    const FreeFlightStatistics& s = found.*member;
    const auto &p = s.end_position_error_m, &a = s.end_orientation_error_deg;
    out.rows.push_back({experiment::kProjectile, name, fmt::to_string(s.n),
                        fixed(s.n > 0, 1e3 * s.trajectory_rms_m, 3),
                        mean_and_spread(p.n, 1e3 * p.mean, 1e3 * p.std, 2), fixed(p.n > 0, 1e3 * p.median, 2),
                        mean_and_spread(a.n, a.mean, a.std, 2), fixed(a.n > 0, a.median, 2),
                        fmt::format("{:.0f}", found.microseconds_per_throw)});
  }
  return out;
}

Table flight_rows(const FreeFlightComparison& found) {
  Table out{{"throw", "split", "model", "outcome", "samples", "trajectory_rms_m", "end_position_error_m",
             "end_orientation_error_deg"},
            {},
            4};
  for (const auto& one : found.each) {
    const bool fitted = one.outcome == FreeFlightOutcome::fitted;
    out.rows.push_back({one.id, to_string(one.split), experiment::kProjectile, to_string(one.outcome),
                        fmt::to_string(one.whole.times.size()), all_digits(fitted, one.trajectory_rms),
                        all_digits(fitted, one.end_position_error),
                        all_digits(one.end_orientation_error.has_value(),
                                   one.end_orientation_error.value_or(0) * experiment::kDegrees)});
  }
  return out;
}

using Residuals = std::vector<flight::Vec3<double>> experiment::FreeFlightFit::*;

/// Median and 10-90 % of fitted − measured, one axis in bins of normalised time.
DataBlock band(const FreeFlightComparison& found, bool test_only, Residuals residuals, int axis, double scale,
               const std::string& title) {
  constexpr std::size_t bins = 20;
  std::array<std::vector<double>, bins> values;
  for (const auto& one : found.each) {
    if (one.outcome != FreeFlightOutcome::fitted || (test_only && one.split != Split::test)) continue;
    const auto& r = one.whole.*residuals;
    for (std::size_t i = 0; i < r.size(); ++i) {
      const auto bin = static_cast<std::size_t>(one.normalised_time[i] * bins);
      values[std::min(bin, bins - 1)].push_back(-scale * r[i][static_cast<std::size_t>(axis)]);
    }
  }
  DataBlock out{title, {"normalised time", "10 %", "median", "90 %"}, {}, {}};
  for (std::size_t b = 0; b < bins; ++b) {
    if (values[b].empty()) continue;
    std::sort(values[b].begin(), values[b].end());
    out.rows.push_back({(static_cast<double>(b) + 0.5) / bins, quantile(values[b], 0.1),
                        quantile(values[b], 0.5), quantile(values[b], 0.9)});
  }
  return out;
}

/// A row of panels: one kind of residual, by axis.
struct PanelRow {
  Residuals residuals;
  double scale;
  std::string label;  ///< with its unit
  std::vector<std::pair<int, std::string>> axes;
};

/// Planar flights move along x and z and turn about y.
std::vector<PanelRow> panel_rows(bool planar, bool oriented) {
  std::vector<PanelRow> rows{{&experiment::FreeFlightFit::position_residuals, 1e3, "position [mm]", {}}};
  rows[0].axes = planar ? decltype(PanelRow::axes){{0, "x"}, {2, "z"}}
                        : decltype(PanelRow::axes){{0, "x"}, {1, "y"}, {2, "z"}};
  if (!oriented) return rows;
  rows.push_back(
      {&experiment::FreeFlightFit::orientation_residuals, experiment::kDegrees, "orientation [deg]", {}});
  rows[1].axes = {{0, "about body x"}, {1, "about body y"}, {2, "about body z"}};
  if (planar) rows[1].axes = {{1, "about y"}};
  return rows;
}

/// What the fit over the whole flight leaves, over the share of the flight that has passed.
Figure residual_figure(const FreeFlightComparison& found, bool planar) {
  const bool test_only = found.test.n > 0;
  const bool oriented = found.train.end_orientation_error_deg.n + found.test.end_orientation_error_deg.n > 0;
  const auto rows = panel_rows(planar, oriented);
  Figure figure{std::string("residuals_") + experiment::kProjectile, 19, oriented ? 12.5 : 7.5, {}, {}};
  const Style style = style_of(experiment::kProjectile);
  const std::vector<KeyEntry> key{
      {fmt::format("with filledcurves linecolor rgb '{}'", style.colour), "10 - 90 %"},
      {fmt::format("with linespoints linecolor rgb '{}' linewidth 1.4 pointtype {} pointsize 0.4",
                   style.colour, style.marker),
       "median"}};
  const double bottom = 2.1, top = figure.height - 1.7, between = 1.8, left = 1.9, aside = 0.7;
  const double count = static_cast<double>(rows.size());
  const double height = (top - bottom - between * (count - 1)) / count;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset style fill transparent solid 0.3 noborder\nset xrange [0:1]\n"
      "set xtics 0,0.25,1 format '%g'\nset xzeroaxis linetype 1 linecolor rgb '#808080' linewidth 0.6\n"
      "set label 1 'what {} leaves: fitted - measured, {} flights' at screen 0.5,{:.4f} center\n",
      experiment::kProjectile, test_only ? "test" : "all", 1 - 0.5 / figure.height);
  double y = top - height;
  for (const PanelRow& row : rows) {
    double extent = 0;
    const std::size_t first = figure.data.size();
    for (const auto& [axis, name] : row.axes) {
      figure.data.push_back(band(found, test_only, row.residuals, axis, row.scale, row.label + ", " + name));
      for (const auto& values : figure.data.back().rows)
        for (std::size_t j = 1; j < values.size(); ++j) extent = std::max(extent, std::abs(values[j]));
    }
    extent = extent > 0 ? 1.1 * extent : 1;
    s += fmt::format("set yrange [{:.6g}:{:.6g}]\nset xlabel '{}'\n", -extent, extent,
                     &row == &rows.back() ? "share of the flight" : "");
    const double n = static_cast<double>(row.axes.size()),
                 width = (figure.width - 0.5 - left - (n - 1) * aside) / n;
    for (std::size_t k = 0; k < row.axes.size(); ++k) {
      const double x = left + static_cast<double>(k) * (width + aside);
      s += place(figure, {x, x + width, y, y + height});
      s += fmt::format("set title '{}' offset 0,-0.6\nset ylabel '{}'\nset format y '{}'\n",
                       row.axes[k].second, k == 0 ? row.label : "", k == 0 ? "%g" : "");
      s += fmt::format(
          "plot DATA index {0} using 1:2:4 {1}, \\\n     DATA index {0} using 1:3 {2}\nunset label 1\n",
          first + k, key[0].style, key[1].style);
    }
    y -= height + between;
  }
  s += key_strip(figure, key, 2) + "unset multiplot\n";
  return figure;
}

}  // namespace

void compare_flights(const CompareRequest& request, const datasets::ThrowLog& log) {
  if (!request.write_cards.empty())
    throw WrongUsage(
        "--write-cards: models of free flight take no parameters; what they lack goes on the card of `unhand "
        "discover LOG --card FILE`");
  std::optional<Progress> progress(std::in_place, "simulate", 0);
  const FreeFlightComparison found = experiment::compare_free_flights(log, request.threads);
  progress.reset();
  for (const auto& [reason, n] : skip_reasons(found))
    tell("unhand: {}: {} of {} throws: {}\n", experiment::kProjectile, n, found.each.size(), reason);
  if (found.train.n + found.test.n == 0) throw Unanswered("no throw could be fitted");
  std::size_t removed = 0;
  for (const auto& one : found.each) removed += one.whole.removed;
  if (removed > 0)
    tell("unhand: left out {}, in which the tracker was elsewhere for once, or held the pose before\n",
         plural(removed, "frame"));

  const std::string heading = fmt::format(
      "{}: {}\n{} free flights; rms: start fitted to every sample; end errors: start fitted to the first "
      "half, mean ± "
      "standard deviation\n",
      request.log, origin_text(log), log.throws.size());
  const Table table = flights_table(found);
  const Json json = flights_json(found, request, log);
  answer_with(request, heading, table, json, [&](const std::filesystem::path& directory) {
    const Figure figure = residual_figure(found, log.dimension == 2);
    draw(figure, directory, origin_text(log));
    write_text(directory / "report.md",
               fmt::format("# Free flights\n\n{}\n{}\n![What {} leaves]({}.png)\n\n", markdown_text(heading),
                           table.markdown(), experiment::kProjectile, figure.name));
    write_text(directory / "throws.csv", flight_rows(found).csv());
  });
}

}  // namespace unhand::apps
