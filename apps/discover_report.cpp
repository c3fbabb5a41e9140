// The page of `unhand discover`: one self-contained HTML file.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/discover.hpp"
#include "apps/figure.hpp"
#include "apps/ranking.hpp"
#include "apps/report_page.hpp"
#include "apps/table.hpp"
#include "experiment/campaign_effects.hpp"

namespace unhand::apps {
namespace {

using fitting::Discovery;
using fitting::OutcomeErrors;

NamedCurves curves_of(const std::string& name, const std::vector<fitting::ResidualBin>& bins) {
  NamedCurves out{name, {}};
  for (const auto& bin : bins)
    out.add(std::string(to_string(bin.channel)), {bin.time, bin.rms, bin.mean, bin.n});
  return out;
}

/// Residuals over time, before and after, a panel for each channel that has any.
Figure residual_figure(const Discovery& found) {
  const auto channels = curves_of("before", found.before.residual).channels;
  const auto after = curves_of("after", found.after.residual);
  const int columns = channels.size() > 1 ? 2 : 1;
  const int rows = (static_cast<int>(channels.size()) + columns - 1) / columns;
  Figure figure{"residual", 17, 1.8 + 3.9 * rows, {}, {}};
  double low = 0, high = 0.05;
  for (const auto& bin : found.before.residual)
    low = std::min(low, bin.time), high = std::max(high, bin.time);
  const double margin = 0.02 * (high - low);  // for the markers at the ends
  low -= margin, high += margin;
  std::string script = "set multiplot\nset key off\n";
  int index = 0, at = 0;
  for (const auto& [channel, before] : channels) {
    const double top = add_residuals(figure, channel, "time from release [s]", before, after.of(channel));
    const double left = 1.9 + (at % columns) * 8.2, bottom = 1.9 + (rows - 1 - at / columns) * 3.9;
    script += place(figure, {left, left + 6.3, bottom, bottom + 2.5});
    script += fmt::format(
        "set title '{}' offset 0,-0.6\nset logscale y\nset xrange [{:.3f}:{:.3f}]\nset yrange [{}:{:.4g}]\n"
        "{}{}set ylabel 'rms "
        "[{{/Symbol s}}]' offset 0.5\n"
        "set arrow 1 from 0,graph 0 to 0,graph 1 nohead dashtype 3 linecolor rgb '#808080'\n"
        "set arrow 2 from {:.3f},1 to {:.3f},1 nohead linecolor rgb '#b0b0b0'\n"
        "plot DATA index {} using 1:2 {}, DATA index {} using 1:2 {}\n",
        plain(channel), low, high, kResidualFloor, 1.5 * top, residual_tics(top),
        at + columns >= static_cast<int>(channels.size())
            ? "set xlabel 'time from release [s]' offset 0,0.3\n"
            : "unset xlabel\n",
        low, high, index, kBefore, index + 1, kAfter);
    index += 2;
    ++at;
  }
  script += floor_note(figure);
  script += found.adds_nothing() ? key_strip(figure, {{kAfter, "base model, to which nothing was added"}}, 1)
                                 : key_strip(figure, {{kBefore, "before"}, {kAfter, "after"}}, 2);
  figure.script = script + "unset multiplot\n";
  return figure;
}

Figure footprints_of(const Discovery& found) {
  std::vector<NamedCurves> all{curves_of("residual of the base model", found.before.residual)};
  for (const auto& footprint : found.footprints) all.push_back(curves_of(footprint.id, footprint.bins));
  return footprint_figure(all, "time from release [s]");
}

/// What is missing, component by component; a curve for every object.
Figure missing_figure(const fitting::MissingEstimate& missing) {
  const bool flight = missing.phase == fitting::Phase::flight;
  Figure figure{"missing", 17, 6.3, {}, {}};
  double last = 0;
  for (const auto& curve : missing.curves)
    if (!curve.knots.empty()) last = std::max(last, curve.knots.back());
  const std::array<const char*, 3> unit =
      flight ? std::array{"a_x [m/s^2]", "a_z [m/s^2]", "{/Symbol a} [rad/s^2]"}
             : std::array{"f_x [N]", "f_z [N]", "{/Symbol t} [N m]"};
  constexpr const char* kColour[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7"};
  std::string script = "set multiplot\nset key off\n";
  std::vector<KeyEntry> key;
  for (std::size_t component = 0; component < 3; ++component) {
    const double left = 2.0 + 5.2 * static_cast<double>(component);
    script += place(figure, {left, left + 3.4, 1.9, 5.4});
    script += fmt::format(
        "set title '{}' offset 0,-0.5\nset xlabel '{}' offset 0,0.3\nset xrange [0:{:.6g}]; set xtics "
        "{:.6g}\n"
        "plot 0 with lines linecolor rgb '#808080'",
        unit[component], flight ? "since the detach [s]" : "share of the opening", 1.04 * last,
        tic_step(last));
    int colour = 0;
    for (const auto& [group, object] : missing.groups)
      for (const auto& curve : missing.curves) {
        if (curve.group != group) continue;
        DataBlock block{fmt::format("{} {}", object, unit[component]), {"time", "value", "sigma"}, {}, {}};
        for (std::size_t j = 0; j < curve.knots.size(); ++j)
          block.rows.push_back({curve.knots[j], curve.value[component][j], curve.sigma[component][j]});
        figure.data.push_back(std::move(block));
        const std::string style =
            fmt::format("with yerrorlines pointtype {} pointsize 0.6 linecolor rgb '{}'", 6 + colour % 4,
                        kColour[colour % 4]);
        script += fmt::format(", DATA index {} using 1:2:3 {}", figure.data.size() - 1, style);
        if (component == 0)
          key.push_back({fmt::format("with linespoints pointtype {} linecolor rgb '{}'", 6 + colour % 4,
                                     kColour[colour % 4]),
                         object});
        ++colour;
      }
    script += "\n";
  }
  script += key_strip(figure, key, static_cast<int>(key.size()));
  figure.script = script + "unset multiplot\n";
  return figure;
}

Table structure_table(const Discovery& found) {
  Table table{{"phase", "channel", "before", "after"}, {}, 2};
  for (const auto& before : found.before.structure) {
    std::string after = "-";
    for (const auto& s : found.after.structure)
      if (s.phase == before.phase && s.channel == before.channel) after = s.structure.in_words();
    table.rows.push_back({std::string(to_string(before.phase)), std::string(to_string(before.channel)),
                          before.structure.in_words(), found.adds_nothing() ? "" : after});
  }
  table.left = 4;
  return table;
}

/// The errors before and after, by the names of their rows.
std::vector<std::pair<const char*, OutcomeErrors>> errors_of(const Discovery& found) {
  return {{"before, train", found.before.train},
          {"before, test", found.before.test},
          {"after, train", found.after.train},
          {"after, test", found.after.test}};
}

/// Whether the errors go with the condition: rms over what repetitions scatter by, outcome by outcome.
Table lack_table(const Discovery& found) {
  Table table{{"prediction errors over repetitions' scatter"}, {}, 1};
  for (const auto& lack : found.before.train.lacks) table.header.push_back(to_string(lack.outcome));
  for (const auto& [name, e] : errors_of(found)) {
    table.rows.push_back({name});
    for (const auto& column : found.before.train.lacks) {
      std::string cell = "-";
      for (const auto& [outcome, fit, resolution] : e.lacks)
        if (outcome == column.outcome && fit.repetitions > 0)
          cell = fmt::format("{:.2f} (p {})", std::sqrt(fit.ratio()), p_text(fit.p_value));
      table.rows.back().push_back(cell);
    }
  }
  return table;
}

Table misfit_table(const Discovery& found) {
  Table table{
      {"phase", "channel", "samples", "before, train", "after, train", "before, test", "after, test"}, {}, 2};
  const auto find = [](const std::vector<fitting::ChannelMisfit>& all, const fitting::ChannelMisfit& like) {
    for (const auto& m : all)
      if (m.channel == like.channel && m.phase == like.phase)
        return fmt::format("{:.3f}", m.chi2_per_sample());
    return std::string("-");
  };
  for (const auto& m : found.before.fit.misfit)
    table.rows.push_back({std::string(to_string(m.phase)), std::string(to_string(m.channel)),
                          std::to_string(m.n), find(found.before.fit.misfit, m),
                          find(found.after.fit.misfit, m), find(found.before.held_out, m),
                          find(found.after.held_out, m)});
  return table;
}

/// "mu = 0.50 ± 0.01, ..." of the unknowns whose name `takes`, without the first `skipped` letters of it.
template <class Takes>
std::string values_text(const fitting::FitResult& fit, const Takes& takes, std::size_t skipped) {
  std::vector<std::string> values;
  for (const auto& u : fit.campaign)
    if (takes(u.unknown.name))
      values.push_back(
          fmt::format("{} = {}", u.unknown.name.substr(skipped),
                      std::isfinite(u.sigma) ? with_sigma(u.value, u.sigma, u.unknown.unit) : "open"));
  return fmt::format("{}", fmt::join(values, ", "));
}

/// In the place of figures over time.
constexpr const char* kLandingsAlone = "<p>Landings alone were measured: nothing to draw over time.</p>\n";

}  // namespace

Table prediction_errors(const Discovery& found) {
  Table table{{"predicted before the throw", "n", "landing x MAE [mm]", "theta MAE [deg]",
               "detach vx MAE [m/s]", "omega MAE [deg/s]", "trajectory RMS [mm]", "chi2/dof"},
              {},
              1};
  const auto mm = [](std::optional<double> metres) {
    if (metres) *metres *= 1e3;
    return metres;
  };
  for (const auto& [name, e] : errors_of(found))
    table.rows.push_back({name, std::to_string(e.n), fixed(mm(e.landing_x_mae), 2),
                          fixed(e.landing_theta_mae, 3), fixed(e.detach_vx_mae, 5),
                          fixed(e.detach_omega_mae, 3), fixed(mm(e.trajectory_rms), 3),
                          fixed(e.chi2_per_dof, 3)});
  return table;
}

std::string parameters_text(const Discovery& found) {
  const auto is_base = [](const std::string& name) {
    return !experiment::effect_of(experiment::without_object(name));
  };
  const std::string now = values_text(found.after.fit, is_base, 0);
  return fmt::format("fitted parameters of {}: {}{}", found.model, now,
                     found.adds_nothing() ? "" : "; before: " + values_text(found.before.fit, is_base, 0));
}

std::string along_text(const std::string& id, const fitting::FitResult& fit) {
  const auto is_its = [&](const std::string& name) { return name.starts_with(id + "."); };
  return fmt::format("fitted along, since no pads are rigid: {} ({})", id,
                     values_text(fit, is_its, id.size() + 1));
}

void write_discovery_report(const Discovery& found, const std::string& log, const std::string& origin,
                            const std::string& command, const Json& json,
                            const std::filesystem::path& directory) {
  const Figure residual = residual_figure(found), ranking = ranking_figure(found.ranking, found.effects);
  const std::string about = log + ": " + origin;
  const bool over_time = !found.before.residual.empty();
  if (over_time) draw(residual, directory, about);
  draw(ranking, directory, about);
  if (over_time) draw(footprints_of(found), directory, about);
  const bool estimated = found.unexplained && found.unexplained->missing;
  if (estimated) draw(missing_figure(*found.unexplained->missing), directory, about);
  const auto picture = [&](const std::string& name) {
    return html_picture(directory / (name + ".png"), name);
  };
  std::string answer;
  for (const auto& effect : found.effects) answer += effect_html(effect);
  for (const std::string& note : {gain_text(found.effects), filter_text(found.effects)})
    if (!note.empty()) answer += fmt::format("<p>{}</p>\n", escaped(note));
  for (const auto& id : found.along)
    answer += fmt::format("<p>{}.</p>\n", escaped(along_text(id, found.after.fit)));
  answer += fmt::format("<p>{}.</p>\n", escaped(parameters_text(found)));
  if (found.small) answer += fmt::format("<p>{}.</p>\n", escaped(small_text(*found.small)));
  if (!found.unexplained)
    for (const auto& one : found.imitations)
      answer += fmt::format("<p>{}.</p>\n", escaped(withdrawn_text(one)));
  if (found.unexplained)
    answer += fmt::format("<p><b>Unexplained:</b> {}.</p>\n",
                          escaped(unexplained_text(found.effects, found.unexplained->description)));
  if (estimated) answer += picture("missing");
  if (found.effects.empty() && !found.unexplained)
    answer += "<p>Nothing that the data show is missing in the model.</p>\n";
  const std::string first = found.first.any ? fmt::format(
                                                  "The residual first leaves the noise in the phase "
                                                  "<b>{}</b>, channel <b>{}</b>, with {:.3g} times "
                                                  "the declared variance.",
                                                  to_string(found.first.phase),
                                                  to_string(found.first.channel), found.first.chi2_per_sample)
                                            : "No channel of the train throws leaves a misfit that asks for "
                                              "an explanation.";
  std::string notes;
  for (const std::string& note : {held_out_text(found), skipped_text(found.skipped)})
    if (!note.empty()) notes += fmt::format("<p>{}</p>\n", escaped(note));
  for (const std::string& note : found.notes) notes += fmt::format("<p>Note: {}.</p>\n", escaped(note));
  const std::string body = fmt::format(
      "<p>{}: base model <code>{}</code>. Verdict: <b>{}</b>.</p>\n<h2>Where it starts</h2><p>{}</p>\n{}"
      "<h2>The answer</h2>\n{}<h2>Errors before and after</h2>\n"
      "<p>Predicted from what is known before the throw, minus measured; chi2/dof with the throws' own "
      "unknowns fitted. Test throws took no part in any fit, but they decided what was accepted: after, "
      "theirs is a validation error, slightly optimistic. Below, the rms of these errors over what "
      "repetitions of a condition scatter by about their mean: above 1.4 most of the error goes with the "
      "condition, and a better model would take it away.</p>{}{}{}"
      "<h2>Candidates</h2><p>From the footprint of each: the derivative of every predicted sample, with the "
      "model's own unknowns projected out.</p>{}{}{}"
      "<h2>Misfit by phase and channel</h2><p>chi2 per sample; 1 is the declared noise. The uncertainty of "
      "wrenches in the hand has 4 % of their size in addition: a complete model leaves less than 1 of "
      "them.</p>{}"
      "<h2>Structure of the residual</h2><p>Of the train throws: size, autocorrelation, and what it goes "
      "with (share of its mean square).</p>{}<h2>Again</h2><p><code>{}</code><br>log checksum "
      "<code>{}</code></p>",
      escaped(origin), escaped(json.at("base_model").get<std::string>()), to_string(found.verdict), first,
      over_time ? picture("residual") : kLandingsAlone, answer, notes, html(prediction_errors(found)),
      html(lack_table(found)), picture("ranking"), html(ranking_table(found.ranking)),
      over_time ? fmt::format("<p>{}</p>", kFootprints) + picture("footprints") : "",
      html(misfit_table(found)), html(structure_table(found)), escaped(command),
      json.value("log_checksum", "unknown"));
  const std::string name = std::filesystem::path(log).filename().string();
  write_text(directory / "index.html", html_page("What the model lacks: " + name, body));
  write_text(directory / "discovery.json", json_text(json));
}

}  // namespace unhand::apps
