#include "apps/ranking.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/report_page.hpp"
#include "fitting/distributions.hpp"

namespace unhand::apps {

Json ranking_json(std::span<const fitting::Ranked> ranking) {
  Json out = Json::array();
  for (const auto& r : ranking)
    out.push_back({{"id", r.id},
                   {"score_p_value", number(r.p_value)},
                   {"footprint_correlation_with_best", number(r.correlation_with_best)},
                   {"chi2_gain", number(r.gain)},
                   {"step", r.step},
                   {"visible", r.visible},
                   {"refitted", r.refit_step.has_value()},
                   {"refit_step", r.refit_step ? Json(*r.refit_step) : Json(nullptr)},
                   {"delta_bic", r.refit_step ? number(r.delta_bic) : Json(nullptr)},
                   {"held_out_gain", r.held_out_gain ? number(*r.held_out_gain) : Json(nullptr)},
                   {"fate", to_string(r.fate)}});
  return out;
}

Table ranking_table(std::span<const fitting::Ranked> ranking) {
  Table table{{"candidate", "chi2 gain", "in step", "p", "correlation with its step's best", "refitted: BIC",
               "in step", "held-out fall", "fate"},
              {},
              1};
  for (const auto& r : ranking)
    table.rows.push_back({r.id, r.visible ? fmt::format("{:.4g}", std::max(0.0, r.gain)) : "no footprint",
                          std::to_string(r.step), p_text(r.p_value),
                          fmt::format("{:.3f}", r.correlation_with_best),
                          r.refit_step ? fmt::format("{:+.1f}", r.delta_bic) : "",
                          r.refit_step ? std::to_string(*r.refit_step) : "",
                          r.held_out_gain ? fmt::format("{:.3g}", *r.held_out_gain) : "", to_string(r.fate)});
  return table;
}

Figure ranking_figure(std::span<const fitting::Ranked> ranking,
                      std::span<const fitting::AcceptedEffect> accepted) {
  Figure figure{"ranking", 17, 10, {}, {}};
  DataBlock block{"first-order gain of chi2 by candidate", {"gain", "position", "accepted", "step"}, {}, {}};
  std::vector<fitting::Ranked> by_step(ranking.begin(), ranking.end());
  std::stable_sort(by_step.begin(), by_step.end(),
                   [](const auto& a, const auto& b) { return a.step < b.step; });
  std::string tics;
  int lines = 0, step = 0;  // a headline and a gap for every step
  double largest = 10;
  const auto line = [&](const std::string& text) {
    tics += fmt::format("{}'{}' {}", lines > 0 ? ", " : "", text, lines);
    return static_cast<double>(lines++);
  };
  for (const auto& r : by_step) {
    if (!(r.gain > 1)) continue;
    if (r.step != step) line(fmt::format("{{/:Bold step {}}}", step = r.step));
    block.rows.push_back({r.gain, line(plain(r.id)), fitting::is_accepted(r.id, accepted) ? 1.0 : 0.0,
                          static_cast<double>(r.step)});
    largest = std::max(largest, r.gain);
  }
  if (block.rows.empty()) line("none");
  figure.height = 2 + 0.55 * lines;
  figure.data.push_back(block);
  figure.script = fmt::format(
      "set key off\nset lmargin 38\nset logscale x\nset format x '10^{{%T}}'\nset xrange [0.7:{:.4g}]\n"
      "set yrange [{}:-0.6]\nset ytics ({}) scale 0\n"
      "set xlabel '{{/Symbol c}}^2 taken away, to first order (filled: accepted)'\n"
      "plot DATA index 0 using ($3 > 0 ? NaN : $1):2 with points pointtype 6 linecolor rgb '#707070', \\\n"
      "     DATA index 0 using ($3 > 0 ? $1 : NaN):2 with points pointtype 7 linecolor rgb '#0072b2'\n",
      2 * largest, lines - 0.4, tics);
  return figure;
}

std::string effect_text(const fitting::AcceptedEffect& effect) {
  std::string out = "\n" + effect.id;
  for (const auto& [id, correlation] : effect.equivalent)
    out += fmt::format("\n  or {} (footprints correlate by {:.4f})", id, correlation);
  for (const auto& p : effect.parameters)
    out += fmt::format("\n  {} = {}", p.name, with_sigma(p.value, p.sigma, p.unit));
  const std::string p = effect.p_value ? ", p " + p_text(*effect.p_value) : "";
  return out + fmt::format("\n  BIC {:+.1f}{}; held out: {}\n", effect.delta_bic, p, effect.why);
}

std::vector<std::string> separating_lines(const fitting::AcceptedEffect& effect) {
  std::vector<std::string> out;
  std::string hopeless;  // the name that none of the experiments tells it from: the best of them is told once
  for (const auto& e : effect.separating) {
    const auto numbers = fmt::format("correlation {:.4f} -> {:.4f}, simulated", e.before, e.after);
    if (e.separates)
      out.push_back(fmt::format("to tell it from {}: {} ({})", e.from, e.what, numbers));
    else if (hopeless != e.from &&
             std::none_of(effect.separating.begin(), effect.separating.end(),
                          [&](const auto& o) { return o.from == e.from && o.separates; }))
      out.push_back(fmt::format("none of the experiments tried tells it from {}; the best is {} ({})", e.from,
                                e.what, numbers)),
          hopeless = e.from;
  }
  return out;
}

std::string small_text(const fitting::SmallEffect& small) {
  const double matters = fitting::DiscoverOptions{}.prediction_matters;
  const bool predicts = small.rms.is_better_by(matters),
             spoils = small.rms.position.rises_by(matters) || small.rms.angle.rises_by(matters);
  std::string sizes;
  for (const auto& p : small.parameters)
    sizes +=
        fmt::format("{}{} = {}", sizes.empty() ? "" : ", ", p.name, with_sigma(p.value, p.sigma, p.unit));
  const std::string numbers =
      fmt::format("{} ({}; BIC {:+.1f}, p {}; test throws, predicted before the throw: {}", small.id, sizes,
                  small.delta_bic, p_text(small.p_value), small.rms.in_words());
  if (small.any_pads) return fmt::format("evident, but no pads are without it: {})", numbers);
  if (!predicts && !small.likelier)
    return fmt::format("evident on the train throws alone, as the test throws are no likelier with it: {})",
                       numbers);
  if (!predicts && spoils)
    return fmt::format("evident, but no answer, as predictions of the test throws are worse with it: {})",
                       numbers);
  if (!predicts) return fmt::format("evident, but too small to matter: {})", numbers);
  return fmt::format(
      "evident on the train throws, but the test throws do not confirm it: {}, yet no channel's chi2 falls "
      "by what matters, and {})",
      numbers, small.likelier ? "another of their errors grows" : "their likelihood does not rise enough");
}

std::string withdrawn_text(const fitting::Imitation& one) {
  return fmt::format("accepted at first, and withdrawn: {} (BIC {:+.1f}): {}", one.id, one.delta_bic,
                     one.why);
}

std::string held_out_text(const fitting::Discovery& found) {
  if (found.held_out.empty()) return {};
  return fmt::format("The log's throws all have one split: held out here were {} of them, by condition: {}.",
                     found.held_out.size(), fmt::join(found.held_out, ", "));
}

std::string skipped_text(const std::vector<std::pair<std::string, std::string>>& skipped) {
  if (skipped.empty()) return {};
  constexpr std::size_t kNamed = 5;
  std::string out = fmt::format("{} left out: ", skipped.size());
  for (std::size_t k = 0; k < std::min(kNamed, skipped.size()); ++k)
    out += fmt::format("{}{} ({})", k > 0 ? "; " : "", skipped[k].first, skipped[k].second);
  if (skipped.size() > kNamed) out += fmt::format("; and {} more", skipped.size() - kNamed);
  return out;
}

Json skipped_json(const std::vector<std::pair<std::string, std::string>>& skipped) {
  Json out = Json::array();
  for (const auto& [id, reason] : skipped) out.push_back({{"id", id}, {"reason", reason}});
  return out;
}

std::string gain_text(const std::vector<fitting::AcceptedEffect>& effects) {
  const auto ratio = [&](const char* id) -> const fitting::Parameter* {
    for (const auto& effect : effects)
      if (effect.id == id && !effect.parameters.empty()) return &effect.parameters.front();
    return nullptr;
  };
  const auto *mass = ratio("sensor.mass"), *inertia = ratio("sensor.inertia");
  if (!mass || !inertia ||
      !(std::abs(mass->value - inertia->value) <=
        fitting::kNormal95 * std::hypot(mass->sigma, inertia->sigma)))
    return {};
  return fmt::format(
      "Mass and inertia are off by the same ratio, as far as their intervals tell: to the motion that is "
      "nothing, and a gain of {:.4g} on the whole measured wrench leaves just that. A weighing of the object "
      "tells which, or a known weight on the sensor.",
      mass->value);
}

std::string filter_text(const std::vector<fitting::AcceptedEffect>& effects) {
  std::string out;
  for (const auto& effect : effects) {
    const bool wrench = effect.id == "sensor.ft_time_offset";
    if ((!wrench && effect.id != "sensor.mocap_time_offset") || effect.parameters.empty() ||
        !(effect.parameters.front().value > 0))
      continue;
    const double late = effect.parameters.front().value;
    out += fmt::format(
        "{}A low-pass filter of the {} with a time constant of {:.3g} ms ({:.0f} Hz) delays what it {} by as "
        "much as such a clock does: {} tells which.",
        out.empty() ? "" : " ", wrench ? "F/T sensor" : "tracker", 1e3 * late,
        1 / (2 * std::numbers::pi * late), wrench ? "reads" : "sees",
        wrench ? "its data sheet, or a tap on the sensor,"
               : "a knock that both the tracker and another sensor see");
  }
  return out;
}

std::string unexplained_text(std::span<const fitting::AcceptedEffect> effects,
                             const std::string& description) {
  if (effects.empty()) return description;
  return description +
         ". The intervals of what was found allow for noise, not for this: it may bend the sizes by more";
}

std::string effect_html(const fitting::AcceptedEffect& effect) {
  std::string out = fmt::format("<h3>{}</h3><p>", escaped(effect.id));
  for (const auto& p : effect.parameters) {
    const auto [low, high] = p.interval95();
    const std::string interval =
        is_held(p.value, p.sigma)
            ? ""
            : fmt::format(" (95 %: {} to {})", rounded(low, p.sigma).value, rounded(high, p.sigma).value);
    out += fmt::format("{} = {}{}<br>", escaped(p.name), escaped(with_sigma(p.value, p.sigma, p.unit)),
                       interval);
  }
  const std::string p_value = effect.p_value ? ", p = " + p_text(*effect.p_value) : "";
  out += fmt::format("BIC {:+.1f}{}. On held-out data: {}.</p>\n", effect.delta_bic, p_value,
                     escaped(effect.why));
  for (const auto& [id, correlation] : effect.equivalent)
    out +=
        fmt::format("<p>Not distinguishable here from <b>{}</b>: the footprints correlate by {:.4f}.</p>\n",
                    escaped(id), correlation);
  for (const auto& line : separating_lines(effect)) out += fmt::format("<p>{}.</p>\n", escaped(line));
  return out;
}

Json parameters_json(const std::vector<fitting::Parameter>& parameters) {
  Json out = Json::object();
  for (const auto& p : parameters)
    out[p.name] = {{"value", number(p.value)},
                   {"sigma", number(p.sigma)},
                   {"low95", number(p.interval95()[0])},
                   {"high95", number(p.interval95()[1])},
                   {"unit", p.unit}};
  return out;
}

Json effect_json(const fitting::AcceptedEffect& effect) {
  Json out{
      {"id", effect.id}, {"equivalent", Json::array()}, {"parameters", parameters_json(effect.parameters)}};
  for (const auto& [id, correlation] : effect.equivalent) out["equivalent"].push_back(id);
  out["delta_bic"] = number(effect.delta_bic);
  out["p_value"] = number(effect.p_value);
  out["test_error_ratio"] = number(effect.test_error_ratio);
  out["footprint_correlations"] = Json::object();
  for (const auto& [id, correlation] : effect.equivalent) out["footprint_correlations"][id] = correlation;
  out["why"] = effect.why;
  out["separating_experiments"] = Json::array();
  for (const auto& e : effect.separating)
    out["separating_experiments"].push_back({{"from", e.from},
                                             {"experiment", e.what},
                                             {"correlation_in_this_log", number(e.before)},
                                             {"correlation_with_it", number(e.after)},
                                             {"separates", e.separates}});
  return out;
}

void NamedCurves::add(const std::string& channel, const ResidualPoint& point) {
  auto at = std::ranges::find(channels, channel, &decltype(channels)::value_type::first);
  if (at == channels.end()) at = channels.insert(at, {channel, {}});
  at->second.push_back(point);
}

std::vector<ResidualPoint> NamedCurves::of(const std::string& channel) const {
  for (const auto& [known, points] : channels)
    if (known == channel) return points;
  return {};
}

std::string residual_tics(double top) {
  return top > 6 ? "set ytics (0.1, 1, 10, 100, 1000, '10^4' 1e4, '10^5' 1e5, '10^6' 1e6)\n"
                 : "set ytics (0.1, 0.2, 0.5, 1, 2, 5)\n";
}

std::string floor_note(const Figure& figure) {
  return fmt::format(
      "set label 98 'below {} {{/Symbol s}}: not shown' at screen {:.4f},{:.4f} right font ',7'\n",
      kResidualFloor, 1 - 0.3 / figure.width, 1 - 0.3 / figure.height);
}

double add_residuals(Figure& figure, const std::string& channel, const std::string& x,
                     const std::vector<ResidualPoint>& before, const std::vector<ResidualPoint>& after) {
  double top = 2;
  for (const auto* points : {&before, &after}) {
    DataBlock block{channel + (points == &before ? " before" : " after"),
                    {x, "rms residual [sigma]", "mean residual [sigma]", "samples"},
                    {},
                    {}};
    for (const auto& p : *points) {
      block.rows.push_back({p.x, p.rms, p.mean, static_cast<double>(p.samples)});
      top = std::max(top, p.rms);
    }
    figure.data.push_back(std::move(block));
  }
  return top;
}

Figure footprint_figure(const std::vector<NamedCurves>& curves, const std::string& x) {
  constexpr const char* kLines[] = {"#0072b2' dashtype 1", "#d55e00' dashtype 2", "#009e73' dashtype 4",
                                    "#cc79a7' dashtype 5"};
  const auto style_of_curve = [&](std::size_t k) {
    return k == 0 ? std::string("with points pointtype 7 pointsize 0.7 linecolor rgb '#9a9a9a'")
                  : fmt::format("with lines linewidth 1.3 linecolor rgb '{}", kLines[(k - 1) % 4]);
  };
  constexpr int kColumns = 3;
  const auto& channels = curves.front().channels;
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
  for (const auto& [channel, unused] : channels) {
    double top = 2;
    std::string plots;
    for (std::size_t k = 0; k < curves.size(); ++k) {
      const auto points = curves[k].of(channel);
      if (points.empty()) continue;
      DataBlock block{channel + " " + curves[k].name, {x, "rms [sigma]", "mean [sigma]", "samples"}, {}, {}};
      for (const auto& p : points) {
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
