#include "apps/release_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "contact/disc_friction.hpp"

namespace unhand::apps {
namespace {

constexpr double kDegrees = 57.29577951308232, kMillimetres = 1000, kMilliseconds = 1000;

/// The modes' colours, after the palette of Okabe and Ito; in grey they differ by their lightness.
struct ModeLook {
  const char *mode, *colour;
};
constexpr ModeLook kModes[] = {{"stick", "#f0f0f0"},  {"pivot", "#a6dbf5"}, {"slip", "#e69f00"},
                               {"slide", "#d55e00"},  {"brake", "#00553d"}, {"carried", "#dddddd"},
                               {"elastic", "#8e4585"}};

const char* colour_of(const std::string& mode) {
  for (const ModeLook& look : kModes)
    if (mode == look.mode) return look.colour;
  return "#777777";
}

std::string line_style(const std::string& model) {
  const Style style = style_of(model);
  return fmt::format("with lines linecolor rgb '{}' linewidth 1.6 dashtype {}", style.colour, style.dash);
}

std::vector<KeyEntry> key_of(const std::vector<ReleaseTrace>& traces) {
  std::vector<KeyEntry> out;
  for (const auto& trace : traces) out.push_back({line_style(trace.model), trace.model});
  return out;
}

/// One block per trace with the columns that `row` makes of an instant.
template <class Row>
std::vector<DataBlock> blocks(const std::vector<ReleaseTrace>& traces,
                              const std::vector<std::string>& columns, Row row) {
  std::vector<DataBlock> out;
  for (const auto& trace : traces) {
    out.push_back({trace.model, columns, {}, {}});
    for (const auto& r : trace.rows) out.back().rows.push_back(row(trace, r));
  }
  return out;
}

/// "plot DATA index 0 using 1:2 STYLE, ..." of every trace.
std::string plot_all(const std::vector<ReleaseTrace>& traces, const char* columns, std::size_t first = 0) {
  std::string out;
  for (std::size_t i = 0; i < traces.size(); ++i)
    out += fmt::format("{}DATA index {} using {} {}", i > 0 ? ", \\\n     " : "", first + i, columns,
                       line_style(traces[i].model));
  return out;
}

/// Above the whole of a figure: which throw it shows.
std::string throw_title(const std::string& thrown, const Figure& figure) {
  if (thrown.empty()) return "";
  return fmt::format("set label 99 'throw {}' at screen 0.5,{:.4f} center\n", plain(thrown),
                     1 - 0.4 / figure.height);
}

/// On the figures' clock [ms].
double milliseconds(const ReleaseTrace& trace, double t) {
  return kMilliseconds * (t - trace.open_command.value_or(0));
}

std::string time_label(const ReleaseTrace& trace) {
  return trace.open_command ? "time from the command to open [ms]" : "time [ms]";
}

/// A line at the command to open.
std::string command_mark(const ReleaseTrace& trace) {
  const bool shown = trace.open_command && trace.rows.front().time <= *trace.open_command;
  return shown ? "set arrow 97 from 0, graph 0 to 0, graph 1 nohead back linecolor rgb '#808080' dashtype 3\n"
               : "";
}

}  // namespace

ReleaseTrace trace_of(const release::ReleaseProblem<double>& problem,
                      const release::ReleaseResult<double>& result, const contact::Patch<double>& patch,
                      int samples) {
  if (result.outcome != release::ReleaseOutcome::detached || result.trajectory.empty())
    throw std::invalid_argument("trace_of: the release is not detached, or was not recorded");
  ReleaseTrace out;
  out.model = problem.contact.name();
  auto events = release::mode_events(problem, result);
  const auto first = release::sample_release(problem, result, problem.start);
  events.insert(events.begin(), {problem.start, "start", std::string(first.mode)});
  for (std::size_t i = 0; i < events.size(); ++i) {
    const double end = i + 1 < events.size() ? events[i + 1].time : result.detach.time;
    if (end - events[i].time < 1e-9) continue;
    // The sense of a pivot or a slide is not told apart.
    const std::string mode = events[i].mode.substr(0, events[i].mode.find_first_of("+- "));
    if (!out.modes.empty() && out.modes.back().mode == mode)
      out.modes.back().end = end;
    else
      out.modes.push_back({mode, events[i].time, end});
  }
  // From a little before anything happens: of a long log, the release would be a sliver.
  constexpr double kBefore = 0.03;  // [s]
  const double first_change = events.size() > 1 ? events[1].time : result.detach.time,
               begin = std::max(problem.start, first_change - kBefore), end = result.detach.time;
  for (auto& mode : out.modes) mode.begin = std::max(mode.begin, begin);
  double angle = 0;
  for (int i = 0; i < samples; ++i) {
    // Not the very end, where the limits vanish.
    const double t = begin + (end - begin) * (1 - 1e-9) * i / (samples - 1);
    const auto s = release::sample_release(problem, result, t);
    if (i == 0) angle = s.relative.angle;
    const double f = patch.f_max(s.normal_force), tau = patch.tau_max(s.normal_force);
    out.rows.push_back({t, s.normal_force, f > 0 ? std::hypot(s.wrench.fx, s.wrench.fz) / f : 0,
                        tau > 0 ? s.wrench.tau / tau : 0, norm(s.relative.slip), s.relative.spin,
                        s.relative.angle - angle});
  }
  return out;
}

Figure mode_figure(const std::vector<ReleaseTrace>& traces) {
  const auto n = static_cast<double>(traces.size());
  Figure figure{"modes", 17, 0, {}, {}};
  figure.data = blocks({traces.front()}, {time_label(traces.front()), "normal force of a pad [N]"},
                       [](const ReleaseTrace& trace, const TraceRow& r) {
                         return std::vector<double>{milliseconds(trace, r.time), r.normal_force};
                       });
  double begin = traces.front().rows.front().time, end = begin;
  std::vector<std::string> seen;
  for (std::size_t i = 0; i < traces.size(); ++i) {
    DataBlock block{traces[i].model + ", modes", {"from [ms]", "to [ms]", "line", "mode"}, {}, {}};
    for (const auto& span : traces[i].modes) {
      block.rows.push_back(
          {milliseconds(traces[i], span.begin), milliseconds(traces[i], span.end), static_cast<double>(i)});
      block.labels.push_back(span.mode);
      end = std::max(end, span.end);
      if (std::find(seen.begin(), seen.end(), span.mode) == seen.end()) seen.push_back(span.mode);
    }
    figure.data.push_back(std::move(block));
  }
  DataBlock pressed{"measured", figure.data.front().columns, {}, {}};
  for (const auto& [t, force] : traces.front().pressed)
    if (t >= begin && t <= end) pressed.rows.push_back({milliseconds(traces.front(), t), force});
  std::vector<std::string> names;
  std::string ribbons;
  for (std::size_t i = 0; i < traces.size(); ++i) {
    names.push_back(traces[i].model);
    for (const auto& mode : seen)
      ribbons += fmt::format(
          "{}DATA index {} using (strcol(4) eq '{}' ? 0.5*($1+$2) : NaN):3:(0.5*($2-$1)):(0.38) with "
          "boxxyerror "
          "fillcolor rgb '{}' linecolor rgb '#404040' linewidth 0.6",
          ribbons.empty() ? "" : ", \\\n     ", i + 1, mode, colour_of(mode));
  }
  std::vector<KeyEntry> key;
  const char *measured_style = "with points pointtype 7 pointsize 0.4 linecolor rgb '#a8a8a8'",
             *force_style = "with lines linecolor rgb '#000000' linewidth 1.1";
  std::string force = fmt::format("DATA index 0 using 1:2 {}\n", force_style);
  if (!pressed.rows.empty()) {
    key = {{measured_style, "measured"}, {force_style, "smoothed"}};
    force = fmt::format("DATA index {} using 1:2 {}, ", figure.data.size(), measured_style) + force;
    figure.data.push_back(std::move(pressed));
  }
  for (const auto& mode : seen)
    key.push_back(
        {fmt::format("with boxes fillstyle solid 1 border rgb '#404040' fillcolor rgb '{}'", colour_of(mode)),
         mode});
  constexpr int columns = 3;
  const double left = 4.2, low = 2.0 + key_height(key.size(), columns), ribbon = low + 0.9 * n;
  figure.height = ribbon + 5.2;
  std::string& s = figure.script;
  s = fmt::format("set multiplot\nunset key\nset xrange [{:.6g}:{:.6g}]\n",
                  milliseconds(traces.front(), begin), milliseconds(traces.front(), end));
  s += throw_title(traces.front().thrown, figure);
  s += place(figure, {left, figure.width - 0.5, ribbon + 0.3, figure.height - 0.9});
  s += command_mark(traces.front()) +
       "set ylabel 'normal force of a pad [N]'\nset yrange [0:*]; set format x ''\nplot " + force;
  s += "unset label 99\n" + place(figure, {left, figure.width - 0.5, low, ribbon});
  s += fmt::format(
      "set format x '%h'; unset ylabel; set xlabel '{}'\nset yrange [{}:-0.5]\nset ytics ({}) scale "
      "0\n"
      "set style fill solid 1 border rgb '#404040'\nunset grid\nplot {}\n",
      time_label(traces.front()), n - 0.5, named_tics(names), ribbons);
  s += "unset label 99\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

Figure wrench_figure(const std::vector<ReleaseTrace>& traces) {
  Figure figure{"wrench", 13, 12.5, {}, {}};
  figure.data = blocks(traces, {"|f|/f_max", "|tau|/tau_max"}, [](const ReleaseTrace&, const TraceRow& r) {
    return std::vector<double>{r.force, std::abs(r.torque)};
  });
  DataBlock ellipse{"ellipse", {"|f|/f_max", "|tau|/tau_max"}, {}, {}}, disc = ellipse;
  disc.title = "exact disc";
  constexpr int kSteps = 200;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 0.5 * M_PI * i / kSteps;
    ellipse.rows.push_back({std::cos(angle), std::sin(angle)});
    const auto d = contact::disc_friction(std::tan(0.5 * M_PI * (kSteps - i) / kSteps * (1 - 1e-9)));
    disc.rows.push_back({d.force, d.torque / contact::kUniformDisc});
  }
  figure.data.push_back(std::move(ellipse));
  figure.data.push_back(std::move(disc));
  DataBlock starts{"at the start", {"|f|/f_max", "|tau|/tau_max"}, {}, {}};
  for (const auto& trace : traces)
    starts.rows.push_back({trace.rows.front().force, std::abs(trace.rows.front().torque)});
  figure.data.push_back(std::move(starts));
  auto key = key_of(traces);
  const char *ellipse_style = "with lines linecolor rgb '#808080' linewidth 1",
             *disc_style = "with lines linecolor rgb '#d4d4d4' linewidth 5",  // a band to run along
                 *box_style = "with lines linecolor rgb '#a0a0a0' linewidth 1 dashtype 5",
             *start_style = "with points pointtype 6 linecolor rgb '#000000' linewidth 1.2";
  key.push_back({ellipse_style, "ellipse"});
  key.push_back({disc_style, "exact disc"});
  key.push_back({box_style, "separate limits"});
  key.push_back({start_style, "at the start"});
  constexpr int columns = 2;
  std::string& s = figure.script;
  s = "set multiplot\nunset key\nset xrange [0:1.12]; set yrange [0:1.12]\n"
      "set xlabel 'force on the pads over its limit, |f|/f_{max}'\n"
      "set ylabel 'torque over its limit, |{/Symbol t}|/{/Symbol t}_{max}'\n"
      "set arrow from 0,1 to 1,1 nohead linecolor rgb '#a0a0a0' linewidth 1 dashtype 5\n"
      "set arrow from 1,0 to 1,1 nohead linecolor rgb '#a0a0a0' linewidth 1 dashtype 5\n";
  s += throw_title(traces.front().thrown, figure);
  s += place(figure, {1.9, figure.width - 0.5, 1.8 + key_height(key.size(), columns), figure.height - 0.9});
  s += fmt::format(
      "plot DATA index {} using 1:2 {}, \\\n     DATA index {} using 1:2 {}, \\\n     {}, \\\n     "
      "DATA index {} using 1:2 {}\n",
      traces.size() + 1, disc_style, traces.size(), ellipse_style, plot_all(traces, "1:2"), traces.size() + 2,
      start_style);
  s += "unset label 99\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

Figure pivot_figure(const std::vector<ReleaseTrace>& traces) {
  Figure figure{"pivot", 17, 9, {}, {}};
  figure.data =
      blocks(traces, {time_label(traces.front()), "angle against the hand [deg]", "relative spin [deg/s]"},
             [](const ReleaseTrace& trace, const TraceRow& r) {
               return std::vector<double>{milliseconds(trace, r.time), r.pivot * kDegrees, r.spin * kDegrees};
             });
  const auto key = key_of(traces);
  constexpr int columns = 3;
  const double bottom = 1.8 + key_height(key.size(), columns), top = figure.height - 0.9,
               middle = 0.5 * figure.width;
  const auto& rows = traces.front().rows;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset xlabel '{}'\nset xrange [{:.6g}:{:.6g}]\n"
      "set xzeroaxis linetype 1 linecolor rgb '#808080' linewidth 0.6\n"
      "set ylabel 'angle against the hand [deg]'\n",
      time_label(traces.front()), milliseconds(traces.front(), rows.front().time),
      milliseconds(traces.front(), rows.back().time));
  s += command_mark(traces.front());
  s += throw_title(traces.front().thrown, figure);
  s += place(figure, {1.9, middle - 0.2, bottom, top}) + "plot " + plot_all(traces, "1:2") + "\n";
  s += "unset label 99\nset ylabel 'spin against the hand [deg/s]'\n";
  s += place(figure, {middle + 2.1, figure.width - 0.5, bottom, top}) + "plot " + plot_all(traces, "1:3") +
       "\n";
  s += "unset label 99\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

Figure phase_figure(const std::vector<ReleaseTrace>& traces, double length) {
  Figure figure{"phase", 13, 11, {}, {}};
  figure.data = blocks(traces, {"L omega_r [mm/s]", "slip speed of the patch [mm/s]"},
                       [&](const ReleaseTrace&, const TraceRow& r) {
                         return std::vector<double>{kMillimetres * length * r.spin, kMillimetres * r.slip};
                       });
  DataBlock ends{"where they part", {"L omega_r [mm/s]", "slip speed [mm/s]"}, {}, {}};
  for (const auto& trace : traces)
    ends.rows.push_back(
        {kMillimetres * length * trace.rows.back().spin, kMillimetres * trace.rows.back().slip});
  figure.data.push_back(std::move(ends));
  auto key = key_of(traces);
  const char* ends_style = "with points pointtype 6 linecolor rgb '#000000' linewidth 1.2";
  key.push_back({ends_style, "where they part"});
  constexpr int columns = 2;
  std::string& s = figure.script;
  s = "set multiplot\nunset key\nset yrange [0:*]\n"
      "set xlabel 'relative spin, L {/Symbol w}_r [mm/s]'\nset ylabel 'slip of the patch, |v_r| [mm/s]'\n";
  s += throw_title(traces.front().thrown, figure);
  s += place(figure, {1.9, figure.width - 0.6, 1.8 + key_height(key.size(), columns), figure.height - 0.9});
  s += fmt::format("plot {}, \\\n     DATA index {} using 1:2 {}\n", plot_all(traces, "1:2"), traces.size(),
                   ends_style);
  s += "unset label 99\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

Figure flight_figure(const FlightOverlay& overlay) {
  Figure figure{"flight", 17, 9, {}, {}};
  DataBlock block{overlay.model,
                  {"time since the predicted detach [s]", "x predicted [m]", "z predicted [m]",
                   "theta predicted [deg]", "x measured [m]", "z measured [m]", "theta measured [deg]",
                   "predicted - measured x [mm]", "z [mm]", "theta [deg]"},
                  {},
                  {}};
  for (std::size_t i = 0; i < overlay.time.size(); ++i) {
    const auto &p = overlay.predicted[i], &m = overlay.measured[i];
    block.rows.push_back({overlay.time[i], p.x, p.z, p.theta * kDegrees, m.x, m.z, m.theta * kDegrees,
                          kMillimetres * (p.x - m.x), kMillimetres * (p.z - m.z),
                          kDegrees * (p.theta - m.theta)});
  }
  figure.data.push_back(std::move(block));
  double left = HUGE_VAL, right = -HUGE_VAL;
  for (std::size_t i = 0; i < overlay.time.size(); ++i)
    for (const double x : {overlay.predicted[i].x, overlay.measured[i].x})
      left = std::min(left, x), right = std::max(right, x);
  const std::string path =
      fmt::format("with lines linecolor rgb '{}' linewidth 1.8", style_of(overlay.model).colour);
  const std::vector<KeyEntry> key{
      {path, overlay.model},
      {"with points pointtype 6 linecolor rgb '#808080'", "motion capture"},
      {"with points pointtype 7 linecolor rgb '#009e73'", "residual x [mm]"},
      {"with points pointtype 4 linecolor rgb '#606060'", "residual z [mm]"},
      {"with points pointtype 2 linecolor rgb '#cc79a7'", "residual theta [deg]"}};
  constexpr int columns = 3;
  const double bottom = 1.8 + key_height(key.size(), columns), top = figure.height - 0.9, middle = 8.6;
  std::string& s = figure.script;
  s = fmt::format(
      "set multiplot\nunset key\nset title 'path{}' offset 0,-0.5\nset xlabel 'x [m]'; set ylabel 'z [m]'\n"
      "set xtics {:.6g}\n",
      overlay.thrown.empty() ? "" : " of throw " + plain(overlay.thrown), tic_step(1.5 * (right - left)));
  s += place(figure, {1.9, middle, bottom, top});
  s += "plot DATA index 0 using 5:6 every 3 with points pointtype 6 linecolor rgb '#808080', \\\n"
       "     DATA index 0 using 2:3 " +
       path + "\n";
  s += fmt::format("set xtics {:.6g}\n", tic_step(overlay.time.back() - overlay.time.front()));
  s +=
      "set title 'predicted - measured' offset 0,-0.5\nset xlabel 'time since the predicted detach [s]'; set "
      "ylabel 'mm, deg' offset "
      "1,0\n"
      "set xzeroaxis linetype 1 linecolor rgb '#808080' linewidth 0.6\n";
  s += place(figure, {middle + 1.9, figure.width - 0.5, bottom, top});
  s += "plot DATA index 0 using 1:8 with points pointtype 7 pointsize 0.45 linecolor rgb '#009e73', \\\n"
       "     DATA index 0 using 1:9 with points pointtype 4 pointsize 0.45 linecolor rgb '#606060', \\\n"
       "     DATA index 0 using 1:10 with points pointtype 2 pointsize 0.45 linecolor rgb '#cc79a7'\n";
  s += "unset label 99\n" + key_strip(figure, key, columns) + "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
