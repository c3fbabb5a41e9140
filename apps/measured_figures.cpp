// The figures of unhand discover on measured logs.
#include <fmt/format.h>

#include <algorithm>

#include "apps/measured_report.hpp"
#include "apps/ranking.hpp"

namespace unhand::apps {

namespace {

NamedCurves profile_curves(const std::string& name, const std::vector<fitting::ResidualProfile>& profile) {
  NamedCurves out{name, {}};
  for (const auto& bin : profile) out.add(bin.channel, {bin.share, bin.rms, bin.mean, bin.n});
  return out;
}

}  // namespace

Figure measured_footprints(const fitting::MeasuredDiscovery& found) {
  std::vector<NamedCurves> all{profile_curves("residual of the base model", found.profile_before)};
  for (const auto& one : found.footprints) all.push_back(profile_curves(one.id, one.profile));
  return footprint_figure(all, "share of the duration");
}

Figure measured_residual_figure(const std::vector<fitting::ResidualProfile>& base,
                                const std::vector<fitting::ResidualProfile>& answer,
                                const std::string& base_name, const std::string& answer_name) {
  const auto channels = profile_curves(base_name, base).channels;
  const auto of_answer = profile_curves(answer_name, answer);
  const int columns = 3, rows = (static_cast<int>(channels.size()) + columns - 1) / columns;
  Figure figure{"residual", 17, 2.2 + 3.9 * rows, {}, {}};
  std::string script = "set multiplot\nset key off\nset xrange [0:1]\nset xtics 0,0.25,1 format '%g'\n";
  int at = 0, index = 0;
  for (const auto& [channel, before] : channels) {
    const double top = add_residuals(figure, channel, "share of the duration", before, of_answer.of(channel));
    const double left = 1.8 + (at % columns) * 5.2, bottom = 2.3 + (rows - 1 - at / columns) * 3.9;
    script += place(figure, {left, left + 4.2, bottom, bottom + 2.5});
    script += fmt::format(
        "set title '{}' offset 0,-0.6\nset logscale y\nset yrange [{}:{:.4g}]\n"
        "{}set ylabel '{}' offset 0.5\n"
        "set arrow 2 from 0,1 to 1,1 nohead linecolor rgb '#b0b0b0'\nset xlabel '{}' offset 0,0.3\n"
        "plot DATA index {} using 1:2 {}, DATA index {} using 1:2 {}\n",
        plain(channel), kResidualFloor, 1.5 * top, residual_tics(top),
        at % columns == 0 ? "rms [{/Symbol s}]" : "",
        at + columns >= static_cast<int>(channels.size()) ? "share of the duration" : "", index, kBefore,
        index + 1, kAfter);
    index += 2;
    ++at;
  }
  script += floor_note(figure) + key_strip(figure, {{kBefore, base_name}, {kAfter, answer_name}}, 2);
  figure.script = script + "unset multiplot\n";
  return figure;
}

Figure missing_acceleration_figure(const fitting::MissingAcceleration& missing) {
  const int panels = static_cast<int>(missing.components.size()), columns = std::min(panels, 3),
            rows = (panels + columns - 1) / columns;
  const double room = 14.9 / columns, height = 5.2;
  Figure figure{"missing", 17, 0.8 + height * rows, {}, {}};
  std::string script = "set multiplot\nset key off\n";
  int at = 0;
  for (const auto& component : missing.components) {
    DataBlock block{component.name(), {missing.against, "acceleration [m/s^2]", "2 sigma [m/s^2]"}, {}, {}};
    for (std::size_t j = 0; j < component.at.size(); ++j)
      block.rows.push_back({component.at[j], component.value[j], 2 * component.sigma[j]});
    figure.data.push_back(std::move(block));
    const auto [first, last] = std::minmax_element(component.at.begin(), component.at.end());
    const double left = 2.0 + room * (at % columns), bottom = 1.6 + height * (rows - 1 - at / columns);
    script += place(figure, {left, left + room - 1.4, bottom, bottom + 3.6});
    script += fmt::format(
        "set title 'along {}' offset 0,-0.6\nset xlabel '{}' offset 0,0.3\nset ylabel '{}' offset 0.5\n"
        "set format y '%.3g'\nset xtics {:.6g}\nplot 0 with lines linecolor rgb '#808080', "
        "DATA index {} using 1:2:3 with yerrorlines pointtype 7 pointsize 0.6 linecolor rgb '#0072b2'\n",
        plain(component.name()), missing.against, at % columns == 0 ? "a [m/s^2], with 2 {/Symbol s}" : "",
        component.at.empty() ? 1 : tic_step(*last - *first), at);
    ++at;
  }
  figure.script = script + "unset multiplot\n";
  return figure;
}

Figure surface_figure(const MeasuredResult& result) {
  std::vector<std::string> laws, surfaces;
  for (const auto& e : result.surfaces) {
    if (std::find(surfaces.begin(), surfaces.end(), e.surface) == surfaces.end())
      surfaces.push_back(e.surface);
    if (const auto law = to_string(e.law); std::find(laws.begin(), laws.end(), law) == laws.end())
      laws.push_back(law);
  }
  Figure figure{"surfaces", 17, 3.2 + 0.6 * static_cast<double>(surfaces.size()), {}, {}};
  std::string plots;
  std::vector<KeyEntry> key;
  double largest = 1;
  for (std::size_t k = 0; k < laws.size(); ++k) {
    DataBlock block{laws[k], {"held-out error [deg]", "surface", "null control [deg]"}, {}, {}};
    for (const auto& e : result.surfaces)
      if (to_string(e.law) == laws[k]) {
        const auto at = std::find(surfaces.begin(), surfaces.end(), e.surface) - surfaces.begin();
        block.rows.push_back({e.law_deg, static_cast<double>(at), e.null_law_deg});
        largest = std::max({largest, e.law_deg, e.null_law_deg});
      }
    figure.data.push_back(std::move(block));
    const Style style = style_of(laws[k]);
    const auto points = [&](int marker, double size) {
      return fmt::format("with points pointtype {} pointsize {} linecolor rgb '{}'", marker, size,
                         style.colour);
    };
    const int ring = style.marker - style.marker % 2;  // gnuplot's even markers are open, the next is filled
    const std::string filled = points(ring + 1, 1.1), open = points(ring, 0.8);
    plots += fmt::format("{}DATA index {} using 1:2 {}, DATA index {} using 3:2 {}", k ? ", " : "", k, filled,
                         k, open);
    key.push_back({filled, laws[k]});
    key.push_back({open, laws[k] + ", null control"});
  }
  const double count = static_cast<double>(surfaces.size());
  figure.height += key_height(key.size(), 2);
  figure.script = "set multiplot\nset key off\n" +
                  place(figure, {7.4, 16.5, 2.2 + key_height(key.size(), 2), figure.height - 0.4}) +
                  fmt::format(
                      "set xrange [0:{:.4g}]\nset yrange [{:.1f}:-0.5]\nset ytics ({})\nset grid xtics ytics "
                      "linecolor rgb '#e0e0e0'\n"
                      "set xlabel 'mean angle between predicted and "
                      "measured sliding [deg]'\nplot {}\n",
                      1.08 * largest, count - 0.5, named_tics(surfaces), plots) +
                  key_strip(figure, key, 2) + "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
