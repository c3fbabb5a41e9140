#include "apps/measured_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/figure.hpp"
#include "apps/ranking.hpp"
#include "apps/report_page.hpp"
#include "fitting/card.hpp"

namespace unhand::apps {
namespace {

using fitting::MeasuredDiscovery;
using fitting::NamedErrors;

Json json_of(const NamedErrors& errors, int n) {
  // The fields that every discovery has; null where the log has no such outcome.
  Json out{{"n", n},
           {"landing_x_mae_m", nullptr},
           {"landing_theta_mae_deg", nullptr},
           {"detach_vx_mae_m_s", nullptr},
           {"detach_omega_mae_deg_s", nullptr},
           {"trajectory_rms_m", nullptr},
           {"chi2_per_dof", nullptr}};
  for (const auto& [name, value] : errors) out[name] = number(value);
  return out;
}

Json json_of(const std::vector<fitting::Autocorrelation>& all) {
  Json out = Json::object();
  for (const auto& a : all) out[a.channel] = {{"lag1", number(a.lag1)}, {"z", number(a.z)}};
  return out;
}

std::string value_of(const NamedErrors& errors, const std::string& name) {
  for (const auto& [key, value] : errors)
    if (key == name) return fmt::format("{:.4g}", value);
  return "";
}

Table error_table(const MeasuredDiscovery& found) {
  Table table{{"error", "before, train", "before, test", "after, train", "after, test"}, {}, 1};
  std::vector<std::string> names;
  for (const auto* errors : {&found.before_test, &found.before_train})
    for (const auto& [name, value] : *errors)
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  for (const auto& name : names)
    table.rows.push_back({name, value_of(found.before_train, name), value_of(found.before_test, name),
                          value_of(found.after_train, name), value_of(found.after_test, name)});
  return table;
}

Table misfit_table(const MeasuredDiscovery& found) {
  Table table{{"channel", "samples", "before, train", "before, test", "after, train", "after, test",
               "neighbours, before", "neighbours, after"},
              {},
              1};
  const auto lag = [](const std::vector<fitting::Autocorrelation>& all, const std::string& channel) {
    for (const auto& a : all)
      if (a.channel == channel) return fmt::format("{:+.2f} ({:+.0f} sigma)", a.lag1, a.z);
    return std::string();
  };
  for (const auto& m : found.misfit)
    table.rows.push_back({m.channel, std::to_string(m.n), fmt::format("{:.3f}", m.before_train),
                          fmt::format("{:.3f}", m.before_test), fmt::format("{:.3f}", m.after_train),
                          fmt::format("{:.3f}", m.after_test), lag(found.autocorrelation_before, m.channel),
                          lag(found.autocorrelation_after, m.channel)});
  return table;
}

Table ranking_table(const MeasuredDiscovery& found) {
  Table table{
      {"candidate", "chi2 gain", "p", "correlation with the best", "refitted: BIC", "held-out fall"}, {}, 1};
  for (const auto& r : found.ranking)
    table.rows.push_back({r.id, r.visible ? fmt::format("{:.4g}", r.gain) : "no footprint",
                          fmt::format("{:.2g}", r.p_value), fmt::format("{:.3f}", r.correlation_with_best),
                          r.refitted ? fmt::format("{:+.1f}", r.delta_bic) : "",
                          r.refitted ? fmt::format("{:.3g}", r.held_out_gain) : ""});
  return table;
}

Table stability_table(const MeasuredDiscovery& found) {
  Table table{{"parameter", "split at the median of", "at", "below", "above", "apart [sigma]"}, {}, 2};
  for (const auto& s : found.stability)
    table.rows.push_back({s.parameter, s.covariate, fmt::format("{:.3g}", s.split_at),
                          fmt::format("{:.4g} ± {:.2g}", s.low, s.low_sigma),
                          fmt::format("{:.4g} ± {:.2g}", s.high, s.high_sigma),
                          fmt::format("{:+.1f}", s.z())});
  return table;
}

Table surface_table(const MeasuredResult& result) {
  Table table{{"surface", "law", "held-out error [deg]", "base", "null control", "null, base", "gain",
               "neighbours' residuals"},
              {},
              2};
  for (const auto& e : result.surfaces)
    table.rows.push_back({e.surface, to_string(e.law), fmt::format("{:.2f}", e.law_deg),
                          fmt::format("{:.2f}", e.base_deg), fmt::format("{:.2f}", e.null_law_deg),
                          fmt::format("{:.2f}", e.null_base_deg),
                          fmt::format("{:.2f} ± {:.2f}", e.gain_deg, e.gain_sigma),
                          fmt::format("{:.2f} ± {:.2f}", e.left, e.left_sigma)});
  return table;
}

constexpr const char *kBefore = "with linespoints pointtype 6 linecolor rgb '#d55e00'",
                     *kAfter = "with linespoints pointtype 7 linecolor rgb '#0072b2'";

/// Residuals over the share of the duration, a panel for each channel.
Figure residual_figure(const MeasuredDiscovery& found) {
  std::vector<std::string> channels;
  for (const auto& m : found.misfit) channels.push_back(m.channel);
  const int columns = 3, rows = (static_cast<int>(channels.size()) + columns - 1) / columns;
  Figure figure{"residual", 17, 2.2 + 3.9 * rows, {}, {}};
  std::string script = "set multiplot\nset key off\nset xrange [0:1]\nset xtics 0,0.25,1 format '%g'\n";
  int at = 0, index = 0;
  for (const auto& channel : channels) {
    double top = 2;
    for (const auto* profile : {&found.profile_before, &found.profile_after}) {
      DataBlock block{channel + (profile == &found.profile_before ? " before" : " after"),
                      {"share of the duration", "rms residual [sigma]", "mean residual [sigma]", "samples"},
                      {},
                      {}};
      for (const auto& bin : *profile)
        if (bin.channel == channel) {
          block.rows.push_back({bin.share, std::max(bin.rms, 0.05), bin.mean, static_cast<double>(bin.n)});
          top = std::max(top, bin.rms);
        }
      figure.data.push_back(std::move(block));
    }
    const double left = 1.8 + (at % columns) * 5.2, bottom = 2.3 + (rows - 1 - at / columns) * 3.9;
    script += place(figure, {left, left + 4.2, bottom, bottom + 2.5});
    script += fmt::format(
        "set title '{}' offset 0,-0.6\nset logscale y\nset yrange [0.5:{:.4g}]\nset format y '%g'\n"
        "set ytics (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)\nset ylabel '{}' offset 0.5\n"
        "set arrow 2 from 0,1 to 1,1 nohead linecolor rgb '#b0b0b0'\nset xlabel '{}' offset 0,0.6\n"
        "plot DATA index {} using 1:2 {}, DATA index {} using 1:2 {}\n",
        plain(channel), 1.5 * top, at % columns == 0 ? "rms [{/Symbol s}]" : "",
        at / columns == rows - 1 ? "share of the duration" : "", index, kBefore, index + 1, kAfter);
    index += 2;
    ++at;
  }
  script += key_strip(figure, {{kBefore, "before"}, {kAfter, "after"}}, 2);
  figure.script = script + "unset multiplot\n";
  return figure;
}

/// Held-out direction errors by surface, and those of the null control.
Figure surface_figure(const MeasuredResult& result) {
  std::vector<std::string> laws, surfaces;
  for (const auto& e : result.surfaces) {
    if (std::find(surfaces.begin(), surfaces.end(), e.surface) == surfaces.end())
      surfaces.push_back(e.surface);
    if (const auto law = to_string(e.law); std::find(laws.begin(), laws.end(), law) == laws.end())
      laws.push_back(law);
  }
  Figure figure{"surfaces", 17, 3.2 + 0.6 * static_cast<double>(surfaces.size()), {}, {}};
  std::string tics, plots;
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    tics += fmt::format("{}'{}' {}", i ? ", " : "", plain(surfaces[i]), i);
  std::vector<KeyEntry> key;
  const char* colours[] = {"#d55e00", "#009e73", "#0072b2", "#cc79a7"};
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
    const std::string filled =
        fmt::format("with points pointtype {} pointsize 1.1 linecolor rgb '{}'", 5 + 2 * k, colours[k % 4]);
    const std::string open =
        fmt::format("with points pointtype {} pointsize 0.8 linecolor rgb '{}'", 4 + 2 * k, colours[k % 4]);
    plots += fmt::format("{}DATA index {} using 1:2 {}, DATA index {} using 3:2 {}", k ? ", " : "", k, filled,
                         k, open);
    key.push_back({filled, plain(laws[k])});
    key.push_back({open, plain(laws[k]) + ", null control"});
  }
  const double count = static_cast<double>(surfaces.size());
  figure.height += key_height(key.size(), 2);
  figure.script = "set multiplot\nset key off\n" +
                  place(figure, {6.2, 16.5, 2.2 + key_height(key.size(), 2), figure.height - 0.4}) +
                  fmt::format(
                      "set xrange [0:{:.4g}]\nset yrange [{:.1f}:-0.5]\nset ytics ({})\nset grid xtics ytics "
                      "linecolor rgb '#e0e0e0'\n"
                      "set xlabel 'mean angle between predicted and measured sliding [deg], slips not seen "
                      "by the fit'\nplot {}\n",
                      1.08 * largest, count - 0.5, tics, plots) +
                  key_strip(figure, key, 2) + "unset multiplot\n";
  return figure;
}

std::string first_text(const MeasuredDiscovery& found) {
  if (!found.first.any) return "No channel leaves the noise.";
  if (found.first.time > 0)
    return fmt::format(
        "The residual first leaves the noise after {:.3f} s: a start fitted to the samples up to there "
        "leaves {:.2f} times the variance "
        "of the noise, most of it in {}.",
        found.first.time, found.first.chi2_per_dof, found.first.channel);
  return fmt::format("The residual leaves the noise in {} (phase {}).", found.first.channel, found.phase);
}

}  // namespace

Json measured_json(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  Json out = json_head("discovery");
  out["log"] = std::filesystem::path(result.log).filename().string();
  if (const auto checksum = fitting::checksum_of(result.log)) out["log_checksum"] = *checksum;
  out["base_model"] = found.model;
  out["kind"] = found.kind;
  out["verdict"] = to_string(found.verdict);
  out["effects"] = Json::array();
  for (const auto& effect : found.effects) {
    Json one{{"id", effect.id}, {"equivalent", Json::array()}, {"parameters", Json::object()}};
    for (const auto& [id, correlation] : effect.equivalent) one["equivalent"].push_back(id);
    for (const auto& p : effect.parameters)
      one["parameters"][p.name] = {{"value", number(p.value)}, {"sigma", number(p.sigma)}, {"unit", p.unit}};
    one["delta_bic"] = number(effect.delta_bic);
    one["p_value"] = number(effect.p_value);
    one["test_error_ratio"] = number(effect.test_error_ratio);
    one["footprint_correlations"] = Json::object();
    for (const auto& [id, correlation] : effect.equivalent) one["footprint_correlations"][id] = correlation;
    one["why"] = effect.why;
    for (const auto& [id, text] : found.separating)
      if (id == effect.id) one["separated_by"] = text;
    out["effects"].push_back(std::move(one));
  }
  out["unexplained"] = nullptr;
  if (found.unexplained)
    out["unexplained"] = {{"phase", found.unexplained->phase},
                          {"channel", found.unexplained->channel},
                          {"chi2_per_dof", number(found.unexplained->chi2_per_dof)},
                          {"description", found.unexplained->description}};
  out["error"] = {{"before",
                   {{"train", json_of(found.before_train, found.train)},
                    {"test", json_of(found.before_test, found.test)}}},
                  {"after",
                   {{"train", json_of(found.after_train, found.train)},
                    {"test", json_of(found.after_test, found.test)}}}};
  out["ranking"] = ranking_json(found.ranking);
  out["first_misfit"] = nullptr;
  if (found.first.any)
    out["first_misfit"] = {{"phase", found.phase},
                           {"channel", found.first.channel},
                           {"chi2_per_sample", number(found.first.chi2_per_dof)},
                           {"time_s", number(found.first.time)}};
  out["misfit"] = Json::array();
  for (const auto& m : found.misfit)
    out["misfit"].push_back({{"channel", m.channel},
                             {"n", m.n},
                             {"before_train", number(m.before_train)},
                             {"before_test", number(m.before_test)},
                             {"after_train", number(m.after_train)},
                             {"after_test", number(m.after_test)}});
  out["autocorrelation"] = {{"before", json_of(found.autocorrelation_before)},
                            {"after", json_of(found.autocorrelation_after)}};
  out["evidence"] = Json::array();
  for (const auto& e : found.evidence)
    out["evidence"].push_back({{"about", e.about}, {"text", e.text}, {"speaks_against", e.against}});
  out["stability"] = Json::array();
  for (const auto& s : found.stability)
    out["stability"].push_back({{"parameter", s.parameter},
                                {"covariate", s.covariate},
                                {"split_at", number(s.split_at)},
                                {"below", {{"value", number(s.low)}, {"sigma", number(s.low_sigma)}}},
                                {"above", {{"value", number(s.high)}, {"sigma", number(s.high_sigma)}}},
                                {"apart_sigma", number(s.z())}});
  if (!result.surfaces.empty()) {
    out["surfaces"] = Json::array();
    for (const auto& e : result.surfaces)
      out["surfaces"].push_back({{"surface", e.surface},
                                 {"law", to_string(e.law)},
                                 {"slips", e.slips},
                                 {"cv_direction_error_deg", number(e.law_deg)},
                                 {"base_direction_error_deg", number(e.base_deg)},
                                 {"null_control_deg", number(e.null_law_deg)},
                                 {"null_control_base_deg", number(e.null_base_deg)},
                                 {"gain_deg", number(e.gain_deg)},
                                 {"gain_sigma_deg", number(e.gain_sigma)},
                                 {"neighbour_correlation", number(e.left)},
                                 {"neighbour_correlation_sigma", number(e.left_sigma)}});
  }
  out["skipped"] = Json::array();
  for (const auto& [id, reason] : found.skipped) out["skipped"].push_back({{"id", id}, {"reason", reason}});
  out["command"] = result.command;
  return out;
}

std::string measured_text(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  std::string out = fmt::format("{}: {}\n{}, base model {}, {} train and {} held out\n{}\n", result.log,
                                to_string(found.verdict), found.kind, found.model, found.train, found.test,
                                first_text(found));
  for (const auto& effect : found.effects) {
    out += fmt::format("\n{}", effect.id);
    for (const auto& [id, correlation] : effect.equivalent)
      out += fmt::format("\n  or {} (footprints correlate by {:.4f})", id, correlation);
    for (const auto& p : effect.parameters)
      out += fmt::format("\n  {} = {:.6g} +- {:.2g} {}", p.name, p.value, p.sigma, p.unit);
    out += fmt::format("\n  BIC {:+.1f}, p {:.2g}; held out: {}\n", effect.delta_bic, effect.p_value,
                       effect.why);
  }
  if (found.unexplained) out += fmt::format("\nunexplained: {}\n", found.unexplained->description);
  for (const auto& e : found.evidence)
    out += fmt::format("\n{} {}{}{}\n", e.against ? "against:" : "note:", e.about,
                       e.about.empty() ? "" : ": ", e.text);
  return out + "\n" + error_table(found).text() + "\n" + misfit_table(found).text() +
         fmt::format("\n{:.1f} s\n", found.seconds);
}

void write_measured_report(const MeasuredResult& result, const Json& json,
                           const std::filesystem::path& directory) {
  const MeasuredDiscovery& found = result.answer;
  const bool slips = !result.surfaces.empty();
  const Figure residual = slips ? surface_figure(result) : residual_figure(found),
               ranking = ranking_figure(found.ranking, found.effects);
  draw(residual, directory);
  draw(ranking, directory);
  const auto picture = [&](const Figure& figure) {
    return html_picture(directory / (figure.name + ".png"), figure.name);
  };
  std::string answer, notes;
  for (const auto& effect : found.effects) {
    answer += fmt::format("<h3>{}</h3><p>", escaped(effect.id));
    for (const auto& p : effect.parameters)
      answer +=
          fmt::format("{} = {:.6g} &plusmn; {:.2g} {} (95 %: {:.6g} to {:.6g})<br>", escaped(p.name), p.value,
                      p.sigma, escaped(p.unit), p.value - 1.96 * p.sigma, p.value + 1.96 * p.sigma);
    answer += fmt::format("BIC {:+.1f}, p = {:.2g}. On held-out data: {}.</p>\n", effect.delta_bic,
                          effect.p_value, escaped(effect.why));
    for (const auto& [id, correlation] : effect.equivalent)
      answer +=
          fmt::format("<p>Not distinguishable here from <b>{}</b>: the footprints correlate by {:.4f}.</p>\n",
                      escaped(id), correlation);
    for (const auto& [id, text] : found.separating)
      if (id == effect.id) answer += fmt::format("<p>What would separate them: {}.</p>\n", escaped(text));
  }
  if (found.unexplained)
    answer += fmt::format("<p><b>Unexplained:</b> {}.</p>\n", escaped(found.unexplained->description));
  if (found.effects.empty() && !found.unexplained)
    answer += "<p>Nothing that the data show is missing in the model.</p>\n";
  for (const bool against : {true, false}) {
    std::string list;
    for (const auto& e : found.evidence)
      if (e.against == against)
        list += fmt::format("<li>{}{}.</li>\n",
                            e.about.empty() ? "" : "<b>" + escaped(e.about) + "</b>: ", escaped(e.text));
    if (!list.empty()) notes += fmt::format("<h3>{}</h3><ul>{}</ul>\n", against ? "Against" : "Beside", list);
  }
  std::string body = fmt::format(
      "<p>{}, base model <code>{}</code>, {} train and {} held out. Verdict: <b>{}</b>.</p>\n<h2>Where it "
      "starts</h2><p>{}</p>\n{}",
      escaped(found.kind), escaped(found.model), found.train, found.test, to_string(found.verdict),
      escaped(first_text(found)), picture(residual));
  body += "<h2>The answer</h2>\n" + answer;
  if (!notes.empty()) body += "<h2>What else the log says</h2>\n" + notes;
  body += "<h2>Errors before and after</h2>\n" + html(error_table(found));
  if (slips) body += "<h2>By surface</h2>\n" + html(surface_table(result));
  body += "<h2>Candidates</h2>\n" + picture(ranking) + html(ranking_table(found));
  if (!found.stability.empty())
    body +=
        "<h2>Does the answer depend on where one looks?</h2><p>The same parameters from halves of the train "
        "data.</p>\n" +
        html(stability_table(found));
  body +=
      "<h2>Misfit by channel</h2><p>chi2 per sample; 1 is the noise. Neighbours: correlation of neighbouring "
      "residuals on held-out data.</p>\n" +
      html(misfit_table(found));
  if (!found.skipped.empty())
    body += fmt::format("<p>{} left out; the first: {} ({}).</p>\n", found.skipped.size(),
                        escaped(found.skipped.front().first), escaped(found.skipped.front().second));
  body += fmt::format("<h2>Again</h2><p><code>{}</code><br>log checksum <code>{}</code></p>",
                      escaped(result.command), json.value("log_checksum", "unknown"));
  write_text(
      directory / "index.html",
      html_page("What the model lacks: " + std::filesystem::path(result.log).filename().string(), body));
  write_text(directory / "discovery.json", json_text(json));
}

}  // namespace unhand::apps
