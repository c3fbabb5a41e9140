// unhand figure: one figure of a paper on release dynamics, with the data and the script that draw it again.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "apps/command.hpp"
#include "apps/compare_figures.hpp"
#include "apps/figure_source.hpp"
#include "apps/output.hpp"
#include "apps/release_figures.hpp"
#include "apps/table.hpp"
#include "apps/tell.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::apps {
namespace {

struct FigureCommandOptions {
  std::string name, out{"."}, json;
  FigureRequest request;
};

constexpr int kDetachVx = 0, kLandingX = 2;  // of experiment::kQuantities

/// The absolute errors of one quantity over the throws of a split, sorted.
std::vector<double> absolute_errors(const experiment::ModelComparison& model, int quantity,
                                    datasets::Split split, double scale) {
  std::vector<double> out;
  for (const auto& one : model.throws)
    if (const auto& error = one.error[quantity]; one.split == split && error)
      out.push_back(scale * std::abs(*error));
  std::sort(out.begin(), out.end());
  return out;
}

/// "0.43 ± 0.38", two digits of the mean; the mean alone of one throw.
std::string mean_and_std(const experiment::ErrorStatistics& of) {
  const double size = std::max(of.mae, 1e-9);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(size))), 0, 9);
  return of.n > 1 ? fmt::format("{:.{}f} ± {:.{}f}", of.mae, decimals, of.std, decimals)
                  : fmt::format("{:.{}f}", of.mae, decimals);
}

/// MAE with the quartiles of the absolute error as whiskers, and in words with its standard deviation, which
/// may exceed the mean and so has no place on a logarithmic axis; held-out throws where there are any.
std::optional<Figure> mae_figure(const experiment::Comparison& comparison) {
  Figure figure{"mae", 19, 0, {}, {}};
  const auto split =
      std::any_of(comparison.models.front().throws.begin(), comparison.models.front().throws.end(),
                  [](const auto& t) { return t.split == datasets::Split::test; })
          ? datasets::Split::test
          : datasets::Split::train;
  std::string body;
  bool any = false;
  const auto thrown =
      std::count_if(comparison.models.front().throws.begin(), comparison.models.front().throws.end(),
                    [&](const auto& t) { return t.split == split; });
  const auto n = comparison.models.size();
  std::vector<std::string> names;
  for (const auto& model : comparison.models) names.push_back(model.model);
  figure.height = 5.7 + 1.1 * static_cast<double>(n);
  const double left = 4.2, words = 2.4, gap = 0.4, width = (figure.width - left - gap) / 2 - words,
               panel = (figure.height - 3.3) / 2;
  for (int q = 0; q < experiment::kQuantityCount; ++q) {
    const double scale = q == kDetachVx || q == kLandingX ? 100 : 1;  // to cm
    const std::string title = q == kDetachVx   ? "detach vx [cm/s]"
                              : q == kLandingX ? "landing x [cm]"
                                               : experiment::kQuantities[q].title;
    DataBlock block{title,
                    {"line", "MAE", "lower quartile of the absolute error", "upper quartile",
                     "STD of the absolute error (0 of one throw)", "n", "model"},
                    {},
                    {}};
    std::vector<double> means, shown;
    std::string points;
    body +=
        "set label 'MAE ± STD' at graph 1.05, graph 1 left offset 0,0.6 font ',7.5' textcolor rgb "
        "'#606060'\n";
    for (std::size_t i = 0; i < n; ++i) {
      const auto errors = absolute_errors(comparison.models[i], q, split, scale);
      if (errors.empty()) continue;
      const auto of = experiment::statistics_of(errors);
      const double low = quantile(errors, 0.25), high = quantile(errors, 0.75);
      const Style style = style_of(comparison.models[i].model);
      points += fmt::format(
          "{}DATA index {} every ::{}::{} using 2:1:3:4 with xerrorbars pointtype {} linecolor rgb '{}' "
          "linewidth 1.2",
          points.empty() ? "plot " : ", \\\n     ", q, block.rows.size(), block.rows.size(), style.marker,
          style.colour);
      body += fmt::format("set label '{}{}' at graph 1.05, first {} left font ',7.5'\n", mean_and_std(of),
                          of.n == thrown ? "" : fmt::format(" (n = {})", of.n), i);
      block.rows.push_back({static_cast<double>(i), of.mae, low, high, of.std, static_cast<double>(of.n)});
      block.labels.push_back(comparison.models[i].model);
      means.push_back(of.mae);
      shown.insert(shown.end(), {of.mae, low, high});
    }
    if (shown.empty()) means = shown = {1}, points = "plot NaN";
    const auto [least, most] = std::minmax_element(means.begin(), means.end());
    if (*most < 5 * *least) shown.push_back(0);  // models that are alike, on an axis from 0
    any = any || !block.rows.empty();
    figure.data.push_back(std::move(block));
    const double x = left + (q % 2) * (width + words + gap), y = 1.3 + (1 - q / 2) * (panel + 1.3);
    body += place(figure, {x, x + width, y, y + panel - 0.7});
    body +=
        fmt::format("set ytics ({}) scale 0\n", named_tics(q % 2 == 0 ? names : std::vector<std::string>(n)));
    body += fmt::format("set title '{}' offset 0,-0.7\nset xtics font ',7.5'\n{}{}\nunset label\n",
                        plain(title), value_axis(shown, common_scale({shown})), points);
  }
  if (!any) return {};
  figure.script = fmt::format(
      "set multiplot\nunset key\nset label 1 'mean absolute errors over the {} {} throws, whiskers: the "
      "middle half' at screen 0.5,{:.4f} center\nset yrange "
      "[{}:-0.6]\n{}unset multiplot\n",
      thrown, split == datasets::Split::test ? "held-out" : "train", 1 - 0.4 / figure.height,
      static_cast<double>(n) - 0.4, body);
  return figure;
}

Figure required(std::optional<Figure> figure, const FigureSource& source,
                const char* missing = "no landing was measured") {
  if (!figure) throw Unanswered(fmt::format("{}: {}", source.file(), missing));
  return *std::move(figure);
}

struct Kind {
  const char *name, *what;
  std::function<Figure(FigureSource&)> make;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"landing-errors", "landing errors of each model, theta against x",
       [](FigureSource& s) { return required(landing_figure(s.compared()), s); }},
      {"conditions", "mean landing errors of each condition",
       [](FigureSource& s) { return required(condition_figure(s.compared()), s); }},
      {"mae", "mean absolute errors of each model with their standard deviation, and where half of them lie",
       [](FigureSource& s) {
         return required(mae_figure(s.compared()), s, "neither a detach nor a landing was measured");
       }},
      {"modes", "normal force and modes of one throw over time",
       [](FigureSource& s) { return mode_figure(s.traces()); }},
      {"wrench", "the wrench of one throw on the limit surface",
       [](FigureSource& s) { return wrench_figure(s.traces()); }},
      {"pivot", "the object of one throw turning in the hand",
       [](FigureSource& s) { return pivot_figure(s.traces()); }},
      {"phase", "slip against relative spin of one throw",
       [](FigureSource& s) { return phase_figure(s.traces(), s.length()); }},
      {"flight", "one flight, predicted and tracked, with the residual",
       [](FigureSource& s) { return flight_figure(s.overlay()); }},
  };
  return all;
}

void figure(const FigureCommandOptions& options) {
  require_gnuplot();
  require_outputs({{options.out, Wanted::directory}, {options.json}}, options.request.inputs());
  const auto kind =
      std::find_if(kinds().begin(), kinds().end(), [&](const Kind& k) { return options.name == k.name; });
  if (kind == kinds().end() && options.name != "all") {
    std::vector<std::string> names;
    for (const Kind& k : kinds()) names.push_back(k.name);
    names.push_back("all");
    throw WrongUsage(
        datasets::unknown_name(fmt::format("no figure is called '{}'", options.name), options.name, names));
  }
  FigureSource source(options.request);
  Outputs outputs{options.request.inputs()};
  const auto folder = outputs.directory(options.out);
  std::vector<std::string> drawn;
  std::vector<std::pair<std::string, std::string>> left_out;  // with the reason
  for (const Kind& k : kinds()) {
    if (options.name != "all" && options.name != k.name) continue;
    std::optional<Figure> made;
    const auto leave_out = [&](const std::exception& error) {
      if (options.name != "all") throw;
      left_out.emplace_back(k.name, error.what());
    };
    try {
      made = k.make(source);
    } catch (const Unanswered& error) {
      leave_out(error);
    } catch (const WrongUsage& error) {  // of models without modes alone
      leave_out(error);
    }
    if (!made) continue;
    draw(*made, folder, source.about());
    drawn.push_back(made->name);
  }
  if (drawn.empty()) throw Unanswered(fmt::format("no figure can be drawn: {}", left_out.front().second));
  for (const auto& [name, reason] : left_out) tell("unhand: left out {}: {}\n", name, reason);
  if (!options.json.empty()) {
    Json out = json_head("figure");
    const std::filesystem::path log = options.request.log;
    out["log"] = log.empty() ? Json(nullptr) : Json(log.filename().string());
    out["figures"] = drawn;
    out["left_out"] = Json::object();
    for (const auto& [name, reason] : left_out) out["left_out"][name] = reason;
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
  parser.option("NAME", options->name, listed + "\nall: every one that the log has data for").required();
  parser.file("--log", options->request.log, "A throw log; without one, the synthetic campaign quick12");
  parser.option("--throw", options->request.thrown,
                "Id of the throw for figures of one; the first if not given");
  parser
      .option("--models", options->request.models,
              "Models, separated by commas; limit_surface_disc, limit_surface and sliding_pivot, or those of "
              "the cards, if not given")
      .with_commas();
  parser
      .option("--card", options->request.cards,
              "A model card: its parameters are used for its model; may be repeated")
      .one_value_each();
  parser
      .file("--out", options->out,
            "Directory for NAME.png, NAME.pdf, NAME.dat and NAME.gp, with _ in the place of - in NAME")
      .with_default();
  parser.file("--json", options->json, "Write the names of the figures as JSON");
  add_threads(parser, options->request.threads);
  parser.footer(
      "Friction that no card gives is estimated from the log as `unhand compare` does. The residual of a\n"
      "model before and after an effect is drawn by `unhand discover --report`, the limit surface of\n"
      "measured slips by `unhand compare` on a slip log.\n"
      "Examples:\n  unhand figure modes --log campaign.h5 --throw 017 --out figures\n"
      "  unhand figure all --log campaign.h5 --models sliding_pivot,limit_surface --out figures\n"
      "  unhand figure all --log tracked.h5 --card card.json --out figures");
  return {&parser, [options] { figure(*options); }};
}

}  // namespace unhand::apps
