// What candidates would do to the samples, drawn beside what the base model leaves of them.
#include <fmt/format.h>

#include <algorithm>

#include "apps/ranking.hpp"

namespace unhand::apps {

Figure footprint_figure(const std::vector<std::string>& channels, const std::vector<NamedCurves>& curves,
                        const std::string& x) {
  constexpr const char* kLines[] = {"#0072b2' dashtype 1", "#d55e00' dashtype 2", "#009e73' dashtype 4",
                                    "#cc79a7' dashtype 5"};
  const auto style_of_curve = [&](std::size_t k) {
    return k == 0 ? std::string("with points pointtype 7 pointsize 0.7 linecolor rgb '#9a9a9a'")
                  : fmt::format("with lines linewidth 1.3 linecolor rgb '{}", kLines[(k - 1) % 4]);
  };
  constexpr int kColumns = 3;
  const int rows = (static_cast<int>(channels.size()) + kColumns - 1) / kColumns;
  const double below = key_height(curves.size(), 2);
  Figure figure{"footprints", 17, 1.6 + below + 3.9 * rows, {}, {}};
  double low = 0, high = 0;
  for (const auto& curve : curves)
    for (const auto& [channel, points] : curve.channels)
      for (const auto& p : points) low = std::min(low, p.x), high = std::max(high, p.x);
  const double margin = 0.02 * std::max(1e-3, high - low);
  std::string script =
      fmt::format("set multiplot\nset key off\nset logscale y\nset xtics 0.2\nset xrange [{:.4g}:{:.4g}]\n",
                  low - margin, high + margin);
  int at = 0, index = 0;
  for (const auto& channel : channels) {
    double top = 2;
    std::string plots;
    for (std::size_t k = 0; k < curves.size(); ++k) {
      const auto found = curves[k].channels.find(channel);
      if (found == curves[k].channels.end()) continue;
      DataBlock block{channel + " " + curves[k].name, {x, "rms [sigma]", "mean [sigma]", "samples"}, {}, {}};
      for (const auto& p : found->second) {
        block.rows.push_back({p.x, p.rms, p.mean, static_cast<double>(p.samples)});
        top = std::max(top, p.rms);
      }
      figure.data.push_back(std::move(block));
      plots +=
          fmt::format("{}DATA index {} using 1:2 {}", plots.empty() ? "" : ", ", index++, style_of_curve(k));
    }
    const double left = 1.8 + (at % kColumns) * 5.2, bottom = 1.7 + below + (rows - 1 - at / kColumns) * 3.9;
    script += place(figure, {left, left + 4.2, bottom, bottom + 2.4});
    script += fmt::format(
        "set title '{}' offset 0,-0.6\nset yrange [{:.2g}:{:.4g}]\n{}"
        "set ylabel '{}' offset 0.5\nset xlabel '{}' offset 0,0.3\n"
        "set arrow 2 from {:.4g},1 to {:.4g},1 nohead linecolor rgb '#b0b0b0'\nplot {}\n",
        plain(channel), kResidualFloor, 1.5 * top, residual_tics(top),
        at % kColumns == 0 ? "rms [{/Symbol s}]" : "",
        at + kColumns >= static_cast<int>(channels.size()) ? x : "", low - margin, high + margin, plots);
    ++at;
  }
  std::vector<KeyEntry> key;
  for (std::size_t k = 0; k < curves.size(); ++k) key.push_back({style_of_curve(k), curves[k].name});
  figure.script = script + floor_note(figure) + key_strip(figure, key, 2) + "unset multiplot\n";
  return figure;
}

}  // namespace unhand::apps
