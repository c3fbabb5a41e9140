// unhand discover: what a model lacks, from the data.
#include "apps/discover.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/discover_measured.hpp"
#include "apps/figure.hpp"
#include "apps/progress.hpp"
#include "apps/ranking.hpp"
#include "apps/table.hpp"
#include "apps/throws.hpp"
#include "apps/weak_grip.hpp"
#include "contact/registry.hpp"
#include "fitting/card.hpp"
#include "fitting/discovery/footprints.hpp"

namespace unhand::apps {
namespace {

using fitting::Discovery;
using fitting::OutcomeErrors;

struct DiscoverOptions {
  std::string log, model{"limit_surface_disc"}, report, json, card;
  std::vector<std::string> forget;
  double matters{0.5}, tolerance{1e-5}, floor{0};
  std::optional<int> most;
  int threads{0};
};

Json errors_json(const OutcomeErrors& e) {
  Json lacks = Json::array();
  for (const auto& [outcome, fit, resolution] : e.lacks) {
    const auto of_repeated = [known = fit.repetitions > 0](double value) {
      return known ? number(value) : Json(nullptr);
    };
    lacks.push_back({{"outcome", to_string(outcome)},
                     {"unit", unit_of(outcome)},
                     {"rms", of_repeated(std::sqrt(fit.repetitions + fit.shared))},
                     {"repetitions_rms", of_repeated(std::sqrt(fit.repetitions))},
                     {"sensor_sigma", number(resolution)},
                     {"p_value", of_repeated(fit.p_value)}});
  }
  return {{"n", e.n},
          {"landing_x_mae_m", number(e.landing_x_mae)},
          {"landing_theta_mae_deg", number(e.landing_theta_mae)},
          {"detach_vx_mae_m_s", number(e.detach_vx_mae)},
          {"detach_omega_mae_deg_s", number(e.detach_omega_mae)},
          {"trajectory_rms_m", number(e.trajectory_rms)},
          {"chi2_per_dof", number(e.chi2_per_dof)},
          {"lack_of_fit", lacks}};
}

Json structure_json(const std::vector<fitting::ChannelStructure>& structures) {
  Json out = Json::array();
  for (const auto& s : structures) {
    Json depends = Json::array();
    for (const auto& d : s.structure.depends)
      depends.push_back({{"on", d.on}, {"share", number(d.share)}, {"p_value", number(d.p_value)}});
    out.push_back({{"phase", to_string(s.phase)},
                   {"channel", to_string(s.channel)},
                   {"n", s.structure.n},
                   {"chi2_per_sample", number(s.structure.chi2_per_sample)},
                   {"chi2_p_value", number(s.structure.chi2_p_value)},
                   {"autocorrelation", number(s.structure.autocorrelation)},
                   {"autocorrelation_p_value", number(s.structure.autocorrelation_p)},
                   {"offset",
                    {{"mean_sigma", number(s.structure.offset.mean)},
                     {"share", number(s.structure.offset.share)},
                     {"p_value", number(s.structure.offset.p_value)}}},
                   {"depends", depends}});
  }
  return out;
}

Json missing_json(const fitting::MissingEstimate& missing) {
  const bool flight = missing.phase == fitting::Phase::flight;
  Json out{{"quantity", flight ? "acceleration" : "wrench of one pad, hand frame"},
           {"time", flight ? "since the detach, s" : "share of the opening"},
           {"components", {"x", "z", "theta"}},
           {"curves", Json::object()},
           {"candidate", Json::array()},
           {"candidate_explains", number(missing.candidate.explained)}};
  for (const auto& [group, object] : missing.groups)
    for (const auto& curve : missing.curves)
      if (curve.group == group)
        out["curves"][object] = {{"knots", curve.knots}, {"value", curve.value}, {"sigma", curve.sigma}};
  for (const auto& t : missing.candidate.terms)
    for (const auto& size : t.sizes)
      out["candidate"].push_back({{"term", t.name},
                                  {"object", size.group ? Json(missing.groups.at(*size.group)) : Json()},
                                  {"coefficient", number(size.value)},
                                  {"sigma", number(size.sigma)},
                                  {"unit", t.unit}});
  constexpr const char* kCorrection[] = {"withheld", "curve", "candidate", "not_judged"};
  out["correction"] = kCorrection[static_cast<int>(missing.correction)];
  out["held_out_error"] = {{"before", number(missing.error_before)},
                           {"after", number(missing.error_after)},
                           {"unit", missing.error_unit}};
  return out;
}

Json misfit_json(const std::vector<fitting::ChannelMisfit>& misfit) {
  Json out = Json::array();
  for (const auto& m : misfit)
    out.push_back({{"phase", to_string(m.phase)},
                   {"channel", to_string(m.channel)},
                   {"n", m.n},
                   {"chi2_per_sample", number(m.chi2_per_sample())}});
  return out;
}

/// As a shell reads it back.
std::string quoted(const std::string& word) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) || std::strchr("_./:+=,@%-", c); };
  if (!word.empty() && std::all_of(word.begin(), word.end(), is_plain)) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// The command line that finds the same again: what it gave, but for outputs and threads.
std::string command_of(const DiscoverOptions& options, const Parser& parser) {
  std::string out = fmt::format("unhand discover {}", quoted(options.log));
  const auto add = [&](const char* name, const auto& value) {
    if (parser.given(name)) out += fmt::format(" {} {}", name, quoted(fmt::format("{}", value)));
  };
  add("--model", options.model);
  for (const auto& id : options.forget) add("--forget", id);
  add("--matters", options.matters);
  add("--most", options.most.value_or(0));
  add("--floor", options.floor);
  add("--rtol", options.tolerance);
  return out;
}

void discover(const DiscoverOptions& options, const Parser& parser) {
  require_outputs({{options.json}, {options.card}, {options.report, Wanted::directory}}, {options.log});
  if (!options.report.empty()) require_gnuplot();
  const std::string command = command_of(options, parser);
  if (const auto kind = measured_kind(options.log)) {
    refuse_options(parser, {"--matters", "--rtol"}, "only throws from a hand are judged and integrated so");
    if (*kind != MeasuredKind::flights)
      refuse_options(parser, {"--floor"}, "only free flights come to rest on one");
    if (*kind == MeasuredKind::slips) refuse_options(parser, {"--most"}, "slips have one law");
    return discover_measured(
        *kind, {options.log, options.report, options.json, options.card, command,
                parser.given("--model") ? std::optional(options.model) : std::nullopt, options.forget,
                options.floor, options.most.value_or(6), options.threads});
  }
  refuse_options(parser, {"--floor"}, "only free flights come to rest on one");
  const auto& others = measured_models();
  if (std::find(others.begin(), others.end(), options.model) != others.end())
    throw WrongUsage(fmt::format("--model {}: {} holds planar throws", options.model, options.log));
  const auto log = read_throws(options.log);
  fitting::DiscoverOptions request;
  request.campaign.model = options.model;
  request.campaign.threads = request.fit.threads = options.threads;
  request.campaign.integrator.tolerances = {options.tolerance, 1e-3 * options.tolerance};
  request.matters = options.matters;
  request.most_effects = options.most.value_or(3);
  request.forget = options.forget;
  try {
    fitting::validate(request);
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--{}", error.what()));
  }
  const Discovery found = [&] {
    const Progress progress("discover", 0);
    return fitting::discover(log, options.log, request);
  }();
  if (found.verdict == fitting::Verdict::not_answered)
    throw Unanswered(fmt::format("{}: {}", options.log, found.message));

  const auto& problem = *found.problem;
  const auto errors = comparison_of(problem, found.after.fit,
                                    predict_throws(problem, found.after.fit, {false, options.threads}));
  tell_weak_grip(errors);

  Outputs outputs{{options.log}};
  const Json json = discovery_json(found, options.log, options.model);
  if (!options.json.empty()) outputs.json(options.json, json);
  if (!options.card.empty()) {
    datasets::ModelCard card = card_of(problem, found.after.fit, errors, options.log, log);
    if (found.unexplained) card.warnings = {"unexplained: " + found.unexplained->description};
    outputs.text(options.card, datasets::to_json(card));
  }
  if (!options.report.empty())
    write_discovery_report(found, options.log, origin_text(log), command, json,
                           outputs.directory(options.report));
  outputs.commit();
  fmt::print("{}", discovery_text(found, options.log, origin_text(log)));
}

}  // namespace

Json discovery_json(const Discovery& found, const std::string& log, const std::string& model) {
  Json out = json_head("discovery");
  out["log"] = std::filesystem::path(log).filename().string();
  if (const auto checksum = fitting::checksum_of(log)) out["log_checksum"] = *checksum;
  out["base_model"] = model;
  out["verdict"] = to_string(found.verdict);
  out["effects"] = Json::array();
  const std::string gain = gain_text(found.effects), filter = filter_text(found.effects);
  for (const auto& effect : found.effects) {
    Json one = effect_json(effect);
    if (!gain.empty() && (effect.id == "sensor.mass" || effect.id == "sensor.inertia"))
      one["reads_the_same"] = gain;
    if (!filter.empty() && effect.id == "sensor.ft_time_offset") one["reads_the_same"] = filter;
    out["effects"].push_back(std::move(one));
  }
  out["fitted_along"] = found.along;
  out["evident_but_small"] = nullptr;
  if (const auto& small = found.small)
    out["evident_but_small"] = {{"id", small->id},
                                {"delta_bic", number(small->delta_bic)},
                                {"p_value", number(small->p_value)},
                                {"held_out_gain", number(small->held_out_fall)},
                                {"test_rms_before_m", number(small->rms.position.before)},
                                {"test_rms_after_m", number(small->rms.position.after)},
                                {"test_rms_before_rad", number(small->rms.angle.before)},
                                {"test_rms_after_rad", number(small->rms.angle.after)},
                                {"test_likelier", small->likelier},
                                {"parameters", parameters_json(small->parameters)}};
  out["withdrawn"] = Json::array();
  for (const auto& one : found.imitations)
    out["withdrawn"].push_back({{"id", one.id}, {"why", one.why}, {"delta_bic", number(one.delta_bic)}});
  out["unexplained"] = nullptr;
  if (found.unexplained) {
    out["unexplained"] = {{"phase", to_string(found.unexplained->phase)},
                          {"channel", to_string(found.unexplained->channel)},
                          {"chi2_per_dof", number(found.unexplained->chi2_per_dof)},
                          {"description", found.unexplained->description}};
    if (found.unexplained->missing) out["unexplained"]["missing"] = missing_json(*found.unexplained->missing);
  }
  out["error"] = {
      {"before", {{"train", errors_json(found.before.train)}, {"test", errors_json(found.before.test)}}},
      {"after", {{"train", errors_json(found.after.train)}, {"test", errors_json(found.after.test)}}}};
  out["ranking"] = ranking_json(found.ranking);
  out["first_misfit"] = nullptr;
  if (found.first.any)
    out["first_misfit"] = {{"phase", to_string(found.first.phase)},
                           {"channel", to_string(found.first.channel)},
                           {"chi2_per_sample", number(found.first.chi2_per_sample)}};
  out["misfit"] = {
      {"before",
       {{"train", misfit_json(found.before.fit.misfit)}, {"test", misfit_json(found.before.held_out)}}},
      {"after",
       {{"train", misfit_json(found.after.fit.misfit)}, {"test", misfit_json(found.after.held_out)}}}};
  out["structure"] = {{"before", structure_json(found.before.structure)},
                      {"after", structure_json(found.after.structure)}};
  if (!found.held_out.empty()) out["held_out"] = found.held_out;
  out["skipped"] = skipped_json(found.skipped);
  out["notes"] = found.notes;
  out["model"] = found.model;
  const auto parameters = [&](const char* key, const fitting::FitResult& fit) {
    out[key] = Json::object();
    for (const auto& u : fit.campaign)
      out[key][u.unknown.name] = {
          {"value", number(u.value)}, {"sigma", number(u.sigma)}, {"unit", u.unknown.unit}};
  };
  parameters("parameters", found.after.fit);
  parameters("parameters_before", found.before.fit);
  return out;
}

std::string discovery_text(const Discovery& found, const std::string& log, const std::string& origin) {
  std::string out = fmt::format("{}: {}\n{}\n", log, to_string(found.verdict), origin);
  if (found.first.any)
    out += fmt::format(
        "the residual first leaves the noise in the phase {}, channel {} ({:.3g} times its variance)\n",
        to_string(found.first.phase), to_string(found.first.channel), found.first.chi2_per_sample);
  else
    out += "no channel of the train throws leaves a misfit that asks for an explanation\n";
  for (const auto& s : found.before.structure)
    if (found.first.any && s.phase == found.first.phase && s.channel == found.first.channel)
      out += fmt::format("  there: {}\n", s.structure.in_words());
  for (const auto& effect : found.effects) {
    out += effect_text(effect);
    for (const auto& line : separating_lines(effect)) out += fmt::format("  {}\n", line);
  }
  for (const std::string& note : {gain_text(found.effects), filter_text(found.effects)})
    if (!note.empty()) out += "\n" + note + "\n";
  for (const auto& id : found.along) out += fmt::format("\n{}\n", along_text(id, found.after.fit));
  out += fmt::format("\n{}\n", parameters_text(found));
  if (found.small) out += fmt::format("\n{}\n", small_text(*found.small));
  if (!found.unexplained)  // which names them
    for (const auto& one : found.imitations) out += fmt::format("\n{}\n", withdrawn_text(one));
  if (found.unexplained)
    out +=
        fmt::format("\nunexplained: {}\n", unexplained_text(found.effects, found.unexplained->description));
  for (const std::string& note : {held_out_text(found), skipped_text(found.skipped)})
    if (!note.empty()) out += "\n" + note + "\n";
  for (const std::string& note : found.notes) out += fmt::format("\nnote: {}\n", note);
  return out + "\n" + prediction_errors(found).text() + fmt::format("\n{:.1f} s\n", found.seconds);
}

namespace {

/// Of throws, then of free flights, falls and slips.
std::vector<std::string> base_models() {
  auto out = contact::contact_model_names();
  out.insert(out.end(), measured_models().begin(), measured_models().end());
  return out;
}

}  // namespace

Command discover_command(Parser& root) {
  auto options = std::make_shared<DiscoverOptions>();
  Parser& parser = root.subcommand("discover",
                                   "Find what a model lacks: trace the residual to an effect, add it, "
                                   "and report the error before and after");
  parser
      .option("LOG", options->log,
              "A log of planar throws, of free flights, of accelerometers in free fall (dimension 3), or "
              "a slip-log")
      .required();
  parser
      .option("--model", options->model,
              "The base model of throws; other logs have their own (projectile, free_fall, ellipsoid)")
      .one_of(base_models())
      .with_default();
  parser.file("--report", options->report, "Directory for the page, its figures and discovery.json");
  parser.file("--json", options->json, "Write the result as JSON");
  parser.file("--card", options->card, "Write the card of the extended model");
  parser
      .option("--forget", options->forget,
              "Effects, and laws as contact.law:MODEL, that the catalogue is told to forget")
      .with_commas();
  parser
      .option("--matters", options->matters,
              "Throws from a hand: least fall of chi2 per sample on held-out ones for an effect to count")
      .range(1e-3, 1e3)
      .with_default();
  parser.option("--most", options->most, "Most effects to add (3 for planar throws, 6 for other logs)")
      .range(0, 10);
  parser.option("--floor", options->floor, "Free flights: height of the floor that boxes come to rest on [m]")
      .range(-1e3, 1e3)
      .with_default();
  parser.option("--rtol", options->tolerance, "Throws from a hand: relative tolerance of the integration")
      .range(1e-10, 1e-3)
      .with_default();
  add_threads(parser, options->threads);
  parser.footer(
      "Verdicts: effect_found, no_missing_effect, unexplained.\n"
      "Example:\n  unhand discover campaign.h5 --model limit_surface_disc --report out/ --json "
      "discovery.json");
  return {&parser, [options, &parser] { discover(*options, parser); }};
}

}  // namespace unhand::apps
