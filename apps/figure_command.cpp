// unhand figure: one figure of a paper on release dynamics, with the data and the script that draw it again.
#include "apps/figure_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "apps/compare_figures.hpp"
#include "apps/output.hpp"
#include "apps/release_figures.hpp"
#include "apps/table.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "experiment/compare.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::apps {
namespace {

struct FigureCommandOptions {
  std::string name, log, thrown, json, out{"."};
  std::vector<std::string> models{"limit_surface_disc", "limit_surface", "sliding_pivot"};
  int threads{0};
};

/// The log that figures are drawn from.
struct Source {
  std::string file;
  datasets::ThrowLog log;
};

Source source_of(const FigureCommandOptions& options) {
  if (!options.log.empty()) return {options.log, read_throws(options.log)};
  tell("unhand: no --log: drawn from the synthetic campaign quick12, seed 1\n");
  return {"quick12 (synthetic)", experiment::generate_campaign(experiment::campaign_design("quick12"), 1)};
}

const datasets::Throw& chosen(const Source& source, const FigureCommandOptions& options) {
  if (options.thrown.empty()) return source.log.throws.front();
  for (const auto& one : source.log.throws)
    if (one.id == options.thrown) return one;
  throw WrongUsage(fmt::format("--throw: {} has no throw '{}'", source.file, options.thrown));
}

/// One throw through every model, recorded.
std::vector<ReleaseTrace> traces_of(const Source& source, const FigureCommandOptions& options) {
  const auto all = experiment::prepare_all(source.log, source.file, options.threads);
  const auto& one = chosen(source, options);
  const auto& prepared = *std::find_if(all.begin(), all.end(), [&](const auto& p) { return p.id == one.id; });
  std::vector<ReleaseTrace> out;
  for (const auto& model : options.models) {
    const auto estimate = experiment::estimate_friction(source.log, all, model);
    experiment::require_patch(estimate, model);
    const auto& parameters = estimate.parameters;
    const auto contact = experiment::contact_model_for(prepared, model, parameters);
    if (!contact) throw WrongUsage(fmt::format("--models: {} has no modes to draw", model));
    const auto problem = experiment::release_problem(prepared, *contact);
    release::ReleaseOptions simulate;
    simulate.integrator.record = true;
    const auto result = release::simulate_release(problem, simulate);
    if (result.outcome != release::ReleaseOutcome::detached)
      throw Unanswered(fmt::format("{}, throw {}: {}", model, one.id, to_string(result.outcome)));
    out.push_back(
        trace_of(problem, result,
                 contact::Patch<double>::of_length(parameters.mu, parameters.length, parameters.pads)));
  }
  return out;
}

experiment::Comparison compared(const Source& source, const FigureCommandOptions& options) {
  experiment::CompareOptions request;
  request.models = options.models;
  request.threads = options.threads;
  return experiment::compare(source.log, source.file, request);
}

/// Predicted from the twist at detach that the first model says.
FlightOverlay overlay_of(const Source& source, const FigureCommandOptions& options) {
  FigureCommandOptions first = options;
  first.models = {options.models.front()};
  const auto comparison = compared(source, first);
  const auto& logged = chosen(source, options);
  if (!logged.mocap) throw Unanswered(fmt::format("throw {} has no motion capture", logged.id));
  const auto& throws = comparison.models.front().throws;
  const auto& p = std::find_if(throws.begin(), throws.end(), [&](const auto& t) {
                    return t.id == logged.id;
                  })->prediction;
  if (!p.landed())
    throw Unanswered(fmt::format("{} brings throw {} to no landing", options.models.front(), logged.id));
  const auto prepared = experiment::prepare(source.log, logged, source.file);
  FlightOverlay out;
  out.model = options.models.front();
  std::vector<double> since;
  for (std::size_t i = 0; i < logged.mocap->time.rows; ++i) {
    const double t = logged.mocap->time(i);
    if (!logged.mocap->is_valid(i) || t < p.detach.time || t > p.detach.time + p.landing.flight_time)
      continue;
    out.time.push_back(t);
    since.push_back(t - p.detach.time);
    out.measured.push_back({logged.mocap->pose(i, 0), logged.mocap->pose(i, 1), logged.mocap->pose(i, 2)});
  }
  if (out.time.empty()) throw Unanswered(fmt::format("throw {} was not tracked in flight", logged.id));
  const flight::FlightProblem<double> flight{p.detach.pose, p.detach.twist, prepared.gravity, prepared.drag_k,
                                             prepared.landing_height};
  out.predicted = flight::fly_through(flight, since);
  return out;
}

/// A round distance between some four tics up to `high`.
double step(double high) {
  if (!(high > 0)) return 1;
  const double raw = high / 4, decade = std::pow(10, std::floor(std::log10(raw)));
  return decade * (raw > 5 * decade ? 10 : raw > 2 * decade ? 5 : raw > decade ? 2 : 1);
}

/// MAE with the standard deviation of the absolute error as whiskers, held-out throws where there are any.
Figure mae_figure(const experiment::Comparison& comparison) {
  Figure figure{"mae", 17, 0, {}, {}};
  const auto split =
      std::any_of(comparison.models.front().throws.begin(), comparison.models.front().throws.end(),
                  [](const auto& t) { return t.split == datasets::Split::test; })
          ? datasets::Split::test
          : datasets::Split::train;
  std::string tics, body;
  const auto n = comparison.models.size();
  for (std::size_t i = 0; i < n; ++i)
    tics += fmt::format("{}'{}' {}", i > 0 ? ", " : "", plain(comparison.models[i].model), i);
  figure.height = 5 + 1.1 * static_cast<double>(n);
  const double left = 4.4, gap = 1.1, width = (figure.width - left - gap - 0.5) / 2,
               panel = (figure.height - 2.6) / 2;
  for (int q = 0; q < experiment::kQuantityCount; ++q) {
    DataBlock block{
        experiment::kQuantities[q].title, {"line", "MAE", "STD of the absolute error", "n", "model"}, {}, {}};
    double high = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto s = comparison.models[i].statistics(q, split);
      if (s.n == 0) continue;
      block.rows.push_back({static_cast<double>(i), s.mae, s.std, static_cast<double>(s.n)});
      block.labels.push_back(comparison.models[i].model);
      high = std::max(high, s.mae + s.std);
    }
    figure.data.push_back(std::move(block));
    const double x = left + (q % 2) * (width + gap), y = 1.3 + (1 - q / 2) * (panel + 1.3);
    body += place(figure, {x, x + width, y, y + panel - 0.7});
    body += fmt::format(
        "set ytics ({}) scale 0\n", q % 2 == 0 ? tics : [&] {
          std::string blank;
          for (std::size_t i = 0; i < n; ++i) blank += fmt::format("{}'' {}", i > 0 ? ", " : "", i);
          return blank;
        }());
    body += fmt::format(
        "set title '{}' offset 0,-0.7\nset xrange [0:{:.6g}]; set xtics {:.6g}\n"
        "plot DATA index {} using (0.5*$2):1:(0.5*$2):(0.28) with boxxyerror linecolor rgb '#56b4e9', \\\n"
        "     DATA index {} using 2:1:($2-$3 > 0 ? $2-$3 : 0):($2+$3) with xerrorbars pointtype 7 linecolor "
        "rgb '#000000' linewidth 1.2\n",
        plain(experiment::kQuantities[q].title), high > 0 ? 1.06 * high : 1, step(high), q, q);
  }
  figure.script = fmt::format(
      "set multiplot\nunset key\nset style fill solid 1 noborder\nset yrange [{}:-0.6]\n{}unset multiplot\n",
      static_cast<double>(n) - 0.4, body);
  return figure;
}

Figure required(std::optional<Figure> figure, const Source& source) {
  if (!figure) throw Unanswered(source.file + ": no landing was measured");
  return *std::move(figure);
}

struct Kind {
  const char *name, *what;
  std::function<Figure(const Source&, const FigureCommandOptions&)> make;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"landing-errors", "landing errors of each model, theta against x",
       [](const Source& s, const FigureCommandOptions& o) {
         return required(landing_figure(compared(s, o)), s);
       }},
      {"conditions", "mean landing errors of each condition",
       [](const Source& s, const FigureCommandOptions& o) {
         return required(condition_figure(compared(s, o)), s);
       }},
      {"mae", "table of mean absolute errors with their standard deviation",
       [](const Source& s, const FigureCommandOptions& o) { return mae_figure(compared(s, o)); }},
      {"modes", "normal force and modes of one throw over time",
       [](const Source& s, const FigureCommandOptions& o) { return mode_figure(traces_of(s, o)); }},
      {"wrench", "the wrench of one throw on the limit surface",
       [](const Source& s, const FigureCommandOptions& o) { return wrench_figure(traces_of(s, o)); }},
      {"pivot", "the object of one throw turning in the hand",
       [](const Source& s, const FigureCommandOptions& o) { return pivot_figure(traces_of(s, o)); }},
      {"phase", "slip against relative spin of one throw",
       [](const Source& s, const FigureCommandOptions& o) {
         const auto throws = experiment::prepare_all(s.log, s.file, o.threads);
         return phase_figure(
             traces_of(s, o),
             experiment::estimate_friction(s.log, throws, o.models.front()).parameters.length);
       }},
      {"flight", "one flight, predicted and tracked, with the residual",
       [](const Source& s, const FigureCommandOptions& o) { return flight_figure(overlay_of(s, o)); }},
  };
  return all;
}

void figure(const FigureCommandOptions& options) {
  require_gnuplot();
  require_writable_directory(options.out);
  require_writable(options.json);
  for (const auto& model : options.models) {
    try {
      experiment::require_release_model(model);
    } catch (const std::invalid_argument& error) {
      throw WrongUsage(fmt::format("--models: {}", error.what()));
    }
  }
  const auto kind =
      std::find_if(kinds().begin(), kinds().end(), [&](const Kind& k) { return options.name == k.name; });
  if (kind == kinds().end() && options.name != "all") {
    std::vector<std::string> names;
    for (const Kind& k : kinds()) names.push_back(k.name);
    throw WrongUsage(
        fmt::format("no figure is called '{}'; there are {}, and all", options.name, fmt::join(names, ", ")));
  }
  const Source source = source_of(options);
  Outputs outputs{{options.log}};
  const auto folder = outputs.directory(options.out);
  std::vector<std::string> drawn;
  for (const Kind& k : kinds())
    if (options.name == "all" || options.name == k.name) {
      const Figure made = k.make(source, options);
      draw(made, folder);
      drawn.push_back(made.name);
    }
  if (!options.json.empty()) {
    Json out = json_head("figure");
    out["log"] =
        options.log.empty() ? Json(nullptr) : Json(std::filesystem::path(options.log).filename().string());
    out["figures"] = drawn;
    outputs.json(options.json, out);
  }
  outputs.commit();
  for (const auto& name : drawn)
    fmt::print("{}\n", (std::filesystem::path(options.out) / (name + ".png")).string());
}

}  // namespace

Command figure_command(Parser& root) {
  auto options = std::make_shared<FigureCommandOptions>();
  Parser& parser = root.subcommand("figure", "Draw one figure, or all, of a log");
  std::string listed = "Which:";
  for (const Kind& kind : kinds()) listed += fmt::format("\n{}: {}", kind.name, kind.what);
  parser.option("NAME", options->name, listed + "\nall: every one").required();
  parser.option("--log", options->log, "A throw log; without one, the synthetic campaign quick12");
  parser.option("--throw", options->thrown, "Id of the throw for figures of one; the first if not given");
  parser.option("--models", options->models, "Models, separated by commas").with_commas().with_default();
  parser.option("--out", options->out, "Directory for NAME.png, NAME.pdf, NAME.dat and NAME.gp")
      .with_default();
  parser.option("--json", options->json, "Write the names of the figures as JSON");
  add_threads(parser, options->threads);
  parser.footer(
      "Friction is estimated from the log as `unhand compare` does. The residual of a model before and after "
      "an "
      "effect\nis drawn by `unhand discover --report`, the limit surface of measured slips by `unhand "
      "compare` on a slip log.\n"
      "Examples:\n  unhand figure modes --log campaign.h5 --throw 017 --out figures\n"
      "  unhand figure all --log campaign.h5 --models sliding_pivot,limit_surface --out figures");
  return {&parser, [options] { figure(*options); }};
}

}  // namespace unhand::apps
