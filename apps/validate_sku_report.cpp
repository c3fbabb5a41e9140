// The answer of `unhand validate-sku`, in words, tables and JSON.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "apps/table.hpp"
#include "apps/throws.hpp"
#include "apps/validate_sku.hpp"

namespace unhand::apps {

using experiment::kDegrees;
using fitting::SkuValidation;

namespace {

/// null where it is not known.
Json known(bool is, double value) { return is ? Json(value) : Json(nullptr); }

Json spread_json(const fitting::LandingSpread& s) {
  return {{"landing_x_m", s.x},
          {"landing_theta_deg", s.theta * kDegrees},
          {"bias_x_m", s.bias_x},
          {"bias_theta_deg", s.bias_theta * kDegrees}};
}

/// A share of a variance; covariances may make it a little less than nothing, which is no "-0.0 %".
std::string percent(double share) { return fmt::format("{:.1f} %", std::round(1000 * share) / 10 + 0.0); }

Table budget_table(const SkuValidation& answer) {
  Table out{
      {"input", "known from", "value", "1 sigma", "unit", "landing x [cm]", "theta [deg]", "share", "bend"},
      {},
      2};
  for (const auto& line : answer.budget)
    out.rows.push_back({line.input.name, to_string(line.input.source),
                        fmt::format("{:.4g}", line.input.value), fmt::format("{:.2g}", line.input.sigma),
                        line.input.unit, fmt::format("{:.2f}", 100 * line.x),
                        fmt::format("{:.2f}", line.theta * kDegrees), percent(line.share),
                        fmt::format("{:.2f}", line.curvature)});
  return out;
}

Table gain_table(const SkuValidation& answer) {
  Table out{{"measurement", "of", "takes off the variance"}, {}, 2};
  for (const auto& gain : answer.gains)
    out.rows.push_back(
        {gain.measurement, fmt::format("{}", fmt::join(gain.inputs, ", ")), percent(gain.share)});
  return out;
}

Table candidate_table(const SkuValidation& answer) {
  Table out{{"condition", "held", "lands at x [m]", "lands at theta [deg]", "1 sigma x [cm]",
             "1 sigma theta [deg]"},
            {},
            2};
  for (const auto& c : answer.candidates)
    out.rows.push_back({c.condition, c.held ? "yes" : "no", fixed(c.landed, c.landing_x, 3),
                        fixed(c.landed, c.landing_theta * kDegrees, 1), fixed(c.landed, 100 * c.linear.x, 2),
                        fixed(c.landed, c.linear.theta * kDegrees, 2)});
  return out;
}

Table spread_table(const SkuValidation& answer) {
  Table out{
      {"", "1 sigma x [cm]", "1 sigma theta [deg]", "mean shift x [cm]", "mean shift theta [deg]", "within"},
      {},
      1};
  const auto row = [&](const char* name, const fitting::LandingSpread& s, double within) {
    out.rows.push_back({name, fmt::format("{:.2f}", 100 * s.x), fmt::format("{:.2f}", s.theta * kDegrees),
                        with_sign(100 * s.bias_x, 2), with_sign(s.bias_theta * kDegrees, 2),
                        fmt::format("{:.1f} %", 100 * within)});
  };
  row("Monte Carlo", answer.monte_carlo, answer.within);
  row("derivatives", answer.linear, answer.within_linear);
  return out;
}

std::string measured_text(const SkuValidation& answer) {
  const auto& m = *answer.measured;
  const bool contradicted =
      answer.verdict == fitting::SkuVerdict::contradicted || m.rms_z > fitting::kMostSurprise;
  const std::string never =
      m.never_lands == 0 ? "" : fmt::format("; {} of them never land, says the card", m.never_lands);
  return fmt::format(
      "{}: of {} measured throws of this object {:.1f} % land within the tolerance of their prediction, each "
      "from its own motion (error "
      "{:.2f} cm, {:.2f} deg in the mean of the absolute; bias {:+.2f} cm, {:+.2f} deg); the errors are "
      "{:.2f} "
      "times what was foretold{}\n",
      m.confirmed                              ? "Confirmed"
      : contradicted                           ? "Contradicted"
      : m.p_value < fitting::kTooFewToBeChance ? "Fewer within the tolerance than asked"
                                               : "Neither confirmed nor contradicted",
      m.count(), 100 * m.within, 100 * m.mae_x, m.mae_theta * kDegrees, 100 * m.bias_x,
      m.bias_theta * kDegrees, m.rms_z, never);
}

/// The card's own errors on throws that it was not fitted to, which the spread does not hold.
std::string held_out_text(const datasets::ModelCard& card) {
  const auto test = card.errors.find("test");
  if (test == card.errors.end()) return {};
  const auto x = test->second.find("landing_x_m"), theta = test->second.find("landing_theta_deg");
  if (x == test->second.end() || theta == test->second.end()) return {};
  return fmt::format("The card's own errors on held-out throws (MAE): {:.2f} cm, {:.2f} deg.\n",
                     100 * x->second.mae, theta->second.mae);
}

/// "throwable, provided that the card also holds for what it was not tried on: mass, surface".
std::string verdict_text(const SkuValidation& answer) {
  std::vector<std::string> conditions;
  for (const auto& one : answer.untried) conditions.push_back(one.condition);
  const bool judged = answer.verdict != fitting::SkuVerdict::contradicted &&
                      answer.verdict != fitting::SkuVerdict::beyond_the_model;
  return fmt::format("{}{}{}", to_string(answer.verdict),
                     conditions.empty() ? ""
                     : !judged          ? "; the card was not tried on: "
                               : ", provided that the card also holds for what it was not tried on: ",
                     fmt::join(conditions, ", "));
}

}  // namespace

std::string sku_text(const SkuQuestion& question, const SkuValidation& answer, bool markdown) {
  const auto table = [&](const Table& t) { return markdown ? t.markdown() : t.text(); };
  const auto title = [&](const std::string& text) {
    return markdown ? fmt::format("\n## {}\n\n", text) : fmt::format("\n{}\n\n", text);
  };
  const auto shown = [&](const std::string& text) { return markdown ? markdown_text(text) : text; };
  const auto& sku = question.sku;
  std::string out = markdown ? fmt::format("# {}: {}\n\n", shown(sku.name), verdict_text(answer))
                             : fmt::format("{}: {}\n", sku.name, verdict_text(answer));
  out += answer.message + ".\n";
  for (const auto& one : answer.untried) out += fmt::format("Beyond the card: {}.\n", one.reason);
  out += fmt::format("{:.3g} kg, {:.3g} kg m^2, centre of mass {:.3g} m from the pads, {}; {} of {}.\n",
                     sku.mass, *sku.inertia, sku.com_offset, shown(sku.surface), question.card.model,
                     shown(question.card_file));
  if (fitting::untried_surface(question.card, sku.surface))
    out += fmt::format("Friction is that of the card's log ({}); for another surface {}.\n",
                       shown(question.card.log.title),
                       question.request.assumed.other_surface > 0 ? "--other-surface is allowed for"
                                                                  : "allow with --other-surface (0.2: 20 %)");
  if (const auto* log = question.request.log)
    out += fmt::format("Throws of {}: {}.\n", shown(question.log_file), shown(origin_text(*log)));
  out += held_out_text(question.card);
  if (answer.measured)
    out += measured_text(answer);
  else if (question.request.log != nullptr)
    out += fmt::format("{} holds no throws of this object with a landing: nothing measured to judge by.\n",
                       shown(question.log_file));
  for (const auto& note : answer.notes) out += fmt::format("Note: {}.\n", note);
  out += title(answer.candidates.size() > 1 ? "Motions of the log, with this object (first order)"
                                            : "The motion");
  out += table(candidate_table(answer));
  if (!answer.budget.empty()) {
    out += title(fmt::format("Spread of the landing, {}", answer.reference().condition));
    out += table(spread_table(answer));
    out += answer.agree ? "\nThey agree.\n" : fmt::format("\n{}.\n", answer.disagreement);
    if (answer.lost > 0)
      out += fmt::format("{:.1f} % of the draws slip out of the grip or do not land.\n", 100 * answer.lost);
    out += title("What it is made of (share of the variance in tolerances; bend: second order in sigma)");
    out += table(budget_table(answer));
    if (answer.budget.back().share < -5e-4)  // as printed
      out +=
          "\nA share below zero: the card knows this input against another, so that what both bring is less "
          "than each alone.\n";
    out += title("What to measure");
    out += table(gain_table(answer));
  }
  return out;
}

Json sku_json(const SkuQuestion& question, const SkuValidation& answer) {
  const auto& request = question.request;
  Json out = json_head("validate-sku");
  out["sku"] = {{"file", question.sku_file},
                {"name", question.sku.name},
                {"mass_kg", question.sku.mass},
                {"inertia_kg_m2", *question.sku.inertia},
                {"com_offset_m", question.sku.com_offset},
                {"surface", question.sku.surface}};
  out["card"] = question.card_file;
  out["model"] = question.card.model;
  out["log"] = question.log_file.empty() ? Json(nullptr) : Json(question.log_file);
  out["tolerance"] = {{"landing_x_m", request.tolerance.x},
                      {"landing_theta_deg", request.tolerance.theta * kDegrees},
                      {"confidence", request.confidence}};
  out["verdict"] = to_string(answer.verdict);
  out["message"] = answer.message;
  out["outside_valid_range"] = fitting::reasons_of(answer.untried);
  out["notes"] = answer.notes;
  out["needed_grip_force_N"] = answer.needed_grip_force ? Json(*answer.needed_grip_force) : Json(nullptr);
  out["condition"] = answer.reference().condition;
  out["candidates"] = Json::array();
  for (const auto& c : answer.candidates)
    out["candidates"].push_back({{"condition", c.condition},
                                 {"held", c.held},
                                 {"landed", c.landed},
                                 {"landing_x_m", known(c.landed, c.landing_x)},
                                 {"landing_theta_deg", known(c.landed, c.landing_theta * kDegrees)},
                                 {"sigma_x_m", known(c.landed, c.linear.x)},
                                 {"sigma_theta_deg", known(c.landed, c.linear.theta * kDegrees)}});
  const bool drawn = !answer.samples.empty();
  out["linear"] = drawn ? spread_json(answer.linear) : Json(nullptr);
  if (drawn) out["linear"]["within"] = answer.within_linear;
  out["monte_carlo"] = drawn ? spread_json(answer.monte_carlo) : Json(nullptr);
  if (drawn) {
    out["monte_carlo"]["within"] = answer.within;
    out["monte_carlo"]["within_sigma"] = answer.within_sigma;
    out["monte_carlo"]["lost"] = answer.lost;
    out["monte_carlo"]["samples"] = request.samples;
  }
  out["repeats"] = nullptr;
  if (const auto& r = answer.repeats)
    out["repeats"] = {{"motions", r->motions},     {"conditions", r->conditions},
                      {"landing_x_m", r->x},       {"landing_theta_deg", r->theta * kDegrees},
                      {"offset_x_m", r->offset_x}, {"offset_theta_deg", r->offset_theta * kDegrees},
                      {"within", r->within}};
  out["agree"] = drawn ? Json(answer.agree) : Json(nullptr);
  out["disagreement"] = answer.disagreement.empty() ? Json(nullptr) : Json(answer.disagreement);
  out["budget"] = Json::array();
  for (const auto& line : answer.budget)
    out["budget"].push_back({{"input", line.input.name},
                             {"source", to_string(line.input.source)},
                             {"value", line.input.value},
                             {"sigma", line.input.sigma},
                             {"unit", line.input.unit},
                             {"landing_x_m", line.x},
                             {"landing_theta_deg", line.theta * kDegrees},
                             {"share", line.share},
                             {"curvature", number(line.curvature)}});
  out["measurements"] = Json::array();
  for (const auto& gain : answer.gains)
    out["measurements"].push_back(
        {{"measurement", gain.measurement}, {"inputs", gain.inputs}, {"share", gain.share}});
  out["measured"] = nullptr;
  if (const auto& m = answer.measured) {
    out["measured"] = {{"confirmed", m->confirmed},     {"n", m->throws.size()},
                       {"never_lands", m->never_lands}, {"held_out", m->held_out},
                       {"within", m->within},           {"p_value", m->p_value},
                       {"landing_x_mae_m", m->mae_x},   {"landing_theta_mae_deg", m->mae_theta * kDegrees},
                       {"bias_x_m", m->bias_x},         {"bias_theta_deg", m->bias_theta * kDegrees},
                       {"rms_z", number(m->rms_z)},     {"throws", Json::array()}};
    for (const auto& one : m->throws)
      out["measured"]["throws"].push_back({{"id", one.id},
                                           {"condition", one.condition},
                                           {"error_x_m", one.error_x},
                                           {"error_theta_deg", one.error_theta * kDegrees},
                                           {"sigma_x_m", one.sigma_x},
                                           {"sigma_theta_deg", one.sigma_theta * kDegrees}});
  }
  return out;
}

}  // namespace unhand::apps
