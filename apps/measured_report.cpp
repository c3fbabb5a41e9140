#include "apps/measured_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "apps/figure.hpp"
#include "apps/ranking.hpp"
#include "apps/report_page.hpp"

namespace unhand::apps {
namespace {

using fitting::MeasuredDiscovery;
using fitting::NamedErrors;

/// A key of NamedErrors without its unit, and the unit that people read with the factor into it.
struct KeyUnit {
  std::string_view stem;
  const char* unit;
  double scale;
};

KeyUnit unit_of(std::string_view key) {
  struct Suffix {
    std::string_view text;
    const char* unit;
    double scale;
  };
  for (const Suffix& suffix :
       {Suffix{"_m_s2", "m/s^2", 1}, {"_m_s", "m/s", 1}, {"_deg", "deg", 1}, {"_m", "mm", 1e3}})
    if (key.size() > suffix.text.size() && key.ends_with(suffix.text))
      return {key.substr(0, key.size() - suffix.text.size()), suffix.unit, suffix.scale};
  return {key, "", 1};
}

std::string value_of(const NamedErrors& errors, const std::string& name) {
  for (const auto& [key, value] : errors)
    if (key == name) return error_text(key, value);
  return "";
}

Table error_table(const MeasuredDiscovery& found) {
  Table table{{"error", "before, train", "before, test", "after, train", "after, test"}, {}, 1};
  std::vector<std::string> names;
  for (const auto* errors : {&found.before_test, &found.before_train})
    for (const auto& [name, value] : *errors)
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  for (const auto& name : names)
    table.rows.push_back({error_title(name), value_of(found.before_train, name),
                          value_of(found.before_test, name), value_of(found.after_train, name),
                          value_of(found.after_test, name)});
  return table;
}

/// By channel; residuals of slips are angles, and without neighbours in time.
Table misfit_table(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  const bool slips = !result.surfaces.empty();
  Table table{{slips ? "mean angle [deg]" : "chi2 per sample", slips ? "slips" : "samples", "before, train",
               "before, test", "after, train", "after, test"},
              {},
              1};
  if (!slips) table.header.insert(table.header.end(), {"neighbours, before", "neighbours, after"});
  const auto lag = [](const std::vector<fitting::Autocorrelation>& all, const std::string& channel) {
    for (const auto& a : all)
      if (a.channel == channel) return fmt::format("{:+.2f} ({:+.0f} sigma)", a.lag1, a.z);
    return std::string();
  };
  for (const auto& m : found.misfit) {
    table.rows.push_back({m.channel, std::to_string(m.n), fmt::format("{:.3f}", m.before_train),
                          fmt::format("{:.3f}", m.before_test), fmt::format("{:.3f}", m.after_train),
                          fmt::format("{:.3f}", m.after_test)});
    if (!slips)
      table.rows.back().insert(table.rows.back().end(), {lag(found.autocorrelation_before, m.channel),
                                                         lag(found.autocorrelation_after, m.channel)});
  }
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

/// What was fitted to, and what judges.
std::string split_text(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  return result.surfaces.empty() ? fmt::format("{} train and {} held out", found.train, found.test)
                                 : fmt::format("{}, each held out once in the cross-validation",
                                               plural(static_cast<std::size_t>(found.test), "slip"));
}

std::string first_text(const MeasuredDiscovery& found) {
  if (!found.first.any)
    return found.unexplained && found.unexplained->chi2_per_dof > 1
               ? "The train groups are too few to tell where the residual leaves the noise."
               : "No channel leaves the noise.";
  if (found.first.time > 0)
    return fmt::format(
        "The residual {}: a start fitted to the samples up to there leaves {:.3g} times the variance of the "
        "noise, most of it in {}.",
        found.first.at_once
            ? fmt::format("leaves the noise from the start on, already in the first {:.3f} s, the shortest "
                          "time looked at",
                          found.first.time)
            : fmt::format("first leaves the noise after {:.3f} s", found.first.time),
        found.first.chi2_per_dof, found.first.channel);
  return fmt::format("The residual leaves the noise in {} (phase {}).", found.first.channel, found.phase);
}

/// What is missing where something is unexplained, and whether it may be used.
std::string missing_text(const fitting::MissingAcceleration& missing) {
  double most = 0, its_sigma = 0;
  std::string whose;
  for (const auto& c : missing.components)
    for (std::size_t j = 0; j < c.value.size(); ++j)
      if (std::abs(c.value[j]) > std::abs(most))
        most = c.value[j], its_sigma = c.sigma[j], whose = c.object.empty() ? "" : " (" + c.object + ")";
  return fmt::format(
      "Without assuming a form, an acceleration {} as a function of {} predicts train groups best that "
      "it was not estimated from; it is largest with {:+.3g} ± {:.2g} m/s^2{}. On held-out groups it {}: "
      "{:.3g} to "
      "{:.3g} per degree of freedom",
      missing.of, missing.against.substr(0, missing.against.find(' ')), most, its_sigma, whose,
      missing.helps ? "lowers the misfit" : "does not lower the misfit beyond chance, so it is no correction",
      missing.test_before, missing.test_after);
}

}  // namespace

std::string error_title(const std::string& key) {
  const auto [stem, unit, scale] = unit_of(key);
  std::string title;
  for (const char c : stem) title += c == '_' ? ' ' : c;
  for (const auto& [word, capitals] : {std::pair{"mae", "MAE"}, {"rms", "RMS"}, {"chi2 per dof", "chi2/dof"}})
    if (const auto at = title.find(word); at != std::string::npos)
      title.replace(at, std::string_view(word).size(), capitals);
  return *unit == '\0' ? title : fmt::format("{} [{}]", title, unit);
}

std::string error_text(const std::string& key, double value) {
  return std::isfinite(value) ? fmt::format("{:.4g}", unit_of(key).scale * value) : "-";
}

std::string measured_text(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  std::string out =
      fmt::format("{}: {}\n{}\n{}, base model {}, {}\n{}\n", result.log, to_string(found.verdict),
                  result.origin, found.kind, found.model, split_text(result), first_text(found));
  for (const auto& effect : found.effects) out += effect_text(effect);
  if (found.unexplained)
    out +=
        fmt::format("\nunexplained: {}\n", unexplained_text(found.effects, found.unexplained->description));
  if (found.unexplained && found.unexplained->missing)
    out += fmt::format("{}\n", missing_text(*found.unexplained->missing));
  for (const auto& e : found.evidence)
    out += fmt::format("\n{} {}{}{}\n", e.against ? "against:" : "note:", e.about,
                       e.about.empty() ? "" : ": ", e.text);
  if (!found.skipped.empty()) out += fmt::format("\nnote: {}\n", skipped_text(found.skipped));
  return out + "\n" + error_table(found).text() + "\n" + misfit_table(result).text() +
         fmt::format("\n{:.1f} s\n", found.seconds);
}

void write_measured_report(const MeasuredResult& result, const Json& json,
                           const std::filesystem::path& directory) {
  const MeasuredDiscovery& found = result.answer;
  const bool slips = !result.surfaces.empty();
  const Figure residual = slips ? surface_figure(result)
                                : measured_residual_figure(found.profile_before, found.profile_after,
                                                           "before", "after"),
               ranking = ranking_figure(found.ranking, found.effects);
  const std::string about = result.log + ": " + result.origin;
  draw(residual, directory, about);
  draw(ranking, directory, about);
  const auto picture = [&](const Figure& figure) {
    return html_picture(directory / (figure.name + ".png"), figure.name);
  };
  std::string answer, notes;
  for (const auto& effect : found.effects) {
    answer += effect_html(effect);
    for (const auto& [id, text] : found.separating)
      if (id == effect.id) answer += fmt::format("<p>What would separate them: {}.</p>\n", escaped(text));
  }
  if (found.unexplained)
    answer += fmt::format("<p><b>Unexplained:</b> {}.</p>\n",
                          escaped(unexplained_text(found.effects, found.unexplained->description)));
  if (found.unexplained && found.unexplained->missing) {
    const Figure missing = missing_acceleration_figure(*found.unexplained->missing);
    draw(missing, directory, about);
    answer +=
        fmt::format("<p>{}.</p>\n", escaped(missing_text(*found.unexplained->missing))) + picture(missing);
  }
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
      "<p>{}: {}, base model <code>{}</code>, {}. Verdict: <b>{}</b>.</p>\n<h2>Where it "
      "starts</h2><p>{}</p>\n{}",
      escaped(result.origin), escaped(found.kind), escaped(found.model), split_text(result),
      to_string(found.verdict), escaped(first_text(found)), picture(residual));
  body += "<h2>The answer</h2>\n" + answer;
  if (!notes.empty()) body += "<h2>What else the log says</h2>\n" + notes;
  body += "<h2>Errors before and after</h2>\n" + html(error_table(found));
  if (slips) body += "<h2>By surface</h2>\n" + html(surface_table(result));
  body += "<h2>Candidates</h2>\n" + picture(ranking) + html(ranking_table(found.ranking));
  if (!slips) {
    const Figure footprints = measured_footprints(found);
    draw(footprints, directory, about);
    body += fmt::format("<p>{}</p>\n", kFootprints) + picture(footprints);
  }
  if (!found.stability.empty())
    body +=
        "<h2>Does the answer depend on where one looks?</h2><p>The same parameters from halves of the train "
        "data.</p>\n" +
        html(stability_table(found));
  body += fmt::format(
              "<h2>Misfit by channel</h2><p>{}</p>\n",
              slips ? "Mean angle between predicted and measured direction of sliding, in degrees."
                    : "chi2 per sample; 1 is the noise. Neighbours: correlation of neighbouring residuals "
                      "on held-out data.") +
          html(misfit_table(result));
  if (!found.skipped.empty()) body += fmt::format("<p>{}.</p>\n", escaped(skipped_text(found.skipped)));
  body += fmt::format("<h2>Again</h2><p><code>{}</code><br>log checksum <code>{}</code></p>",
                      escaped(result.command), json.value("log_checksum", "unknown"));
  write_text(
      directory / "index.html",
      html_page("What the model lacks: " + std::filesystem::path(result.log).filename().string(), body));
  write_text(directory / "discovery.json", json_text(json));
}

}  // namespace unhand::apps
