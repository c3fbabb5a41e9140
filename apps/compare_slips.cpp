// unhand compare on slip logs: limit surfaces identified from measured slips.
#include <fmt/format.h>

#include <set>

#include "apps/command.hpp"
#include "apps/compare.hpp"
#include "apps/compare_slip_figures.hpp"
#include "apps/figure.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "fitting/slips/compare_surfaces.hpp"

namespace unhand::apps {
namespace {

using fitting::SlipSamples;
using fitting::SurfaceModel;
using fitting::SurfaceScore;
using Scores = std::vector<std::vector<SurfaceScore>>;  // by surface, then by model

/// Over the surfaces that every model answers for, so that the means compare like with like.
struct Means {
  std::size_t surfaces{};
  std::vector<double> cv, null;  ///< by model
};
Means means_of(const Scores& scores) {
  Means out;
  out.cv.resize(scores.front().size());
  out.null.resize(scores.front().size());
  for (const auto& row : scores) {
    if (!std::all_of(row.begin(), row.end(), [](const SurfaceScore& s) { return s.scored(); })) continue;
    ++out.surfaces;
    for (std::size_t k = 0; k < row.size(); ++k) {
      out.cv[k] += row[k].mean_deg;
      out.null[k] += row[k].null_control_deg;
    }
  }
  for (std::size_t k = 0; k < out.cv.size(); ++k) {
    out.cv[k] /= static_cast<double>(std::max<std::size_t>(out.surfaces, 1));
    out.null[k] /= static_cast<double>(std::max<std::size_t>(out.surfaces, 1));
  }
  return out;
}

Json score_json(const SurfaceScore& score) {
  Json out;
  out["cv_direction_error_deg"] = nullptr;
  out["null_control_deg"] = nullptr;
  out["outcome"] = to_string(score.outcome);
  if (score.scored()) {
    out["cv_direction_error_deg"] = score.mean_deg;
    out["null_control_deg"] = score.null_control_deg;
    out["cv_direction_error_median_deg"] = score.median_deg;
    out["n"] = score.errors_deg.size();
  } else {
    out["reason"] = score.reason;
  }
  if (score.fit.fitted()) {
    const auto extremes = score.fit.surface.extremes();
    out["coefficients"] = score.fit.surface.coefficients;
    out["least_force_N"] = extremes.least_force;
    out["largest_force_N"] = extremes.largest_force;
    out["torque_N_m"] = extremes.torque;
    out["sigma_direction_rad"] = score.fit.sigma_direction;
    out["sigma_level"] = score.fit.sigma_level;
  }
  return out;
}

Json slips_json(const CompareRequest& request, const std::vector<SlipSamples>& surfaces, const Scores& scores,
                const fitting::SurfaceComparisonOptions& options) {
  Json out = json_head("compare");
  out["log"] = request.log;
  out["folds"] = options.folds;
  out["null_draws"] = options.null_draws;
  const Means means = means_of(scores);
  Json& all = out["models"] = Json::object();
  for (std::size_t k = 0; k < scores.front().size(); ++k) {
    Json& model = all[to_string(scores.front()[k].model)];
    Json& by_surface = model["surfaces"] = Json::object();
    for (std::size_t i = 0; i < surfaces.size(); ++i)
      by_surface[surfaces[i].surface] = score_json(scores[i][k]);
    model["mean_cv_direction_error_deg"] = nullptr;
    model["mean_null_control_deg"] = nullptr;
    if (means.surfaces > 0) {
      model["mean_cv_direction_error_deg"] = means.cv[k];
      model["mean_null_control_deg"] = means.null[k];
    }
    model["mean_over"] = means.surfaces;
  }
  return out;
}

Table slips_table(const std::vector<SlipSamples>& surfaces, const Scores& scores) {
  Table out{{"surface", "n"}, {}, 1};
  for (const SurfaceScore& score : scores.front()) out.header.push_back(to_string(score.model));
  for (const SurfaceScore& score : scores.front()) out.header.push_back("null " + to_string(score.model));
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    out.rows.push_back({surfaces[i].surface, fmt::to_string(surfaces[i].samples.size())});
    for (const SurfaceScore& score : scores[i])
      out.rows.back().push_back(fixed(score.scored(), score.mean_deg, 2));
    for (const SurfaceScore& score : scores[i])
      out.rows.back().push_back(fixed(score.scored(), score.null_control_deg, 2));
  }
  const Means means = means_of(scores);
  out.rows.push_back({"mean", fmt::to_string(means.surfaces)});
  for (const double mean : means.cv) out.rows.back().push_back(fixed(means.surfaces > 0, mean, 2));
  for (const double mean : means.null) out.rows.back().push_back(fixed(means.surfaces > 0, mean, 2));
  return out;
}

Table sample_rows(const std::vector<SlipSamples>& surfaces, const Scores& scores) {
  Table out{{"surface", "slip", "f_x_N", "f_y_N", "tau_over_L_N", "u_x", "u_y", "u_omega"}, {}, 2};
  for (const SurfaceScore& score : scores.front())
    out.header.push_back("error_deg_" + to_string(score.model));
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    for (std::size_t j = 0; j < surfaces[i].samples.size(); ++j) {
      const auto& sample = surfaces[i].samples[j];
      std::vector<std::string> row{surfaces[i].surface,
                                   surfaces[i].slips[static_cast<std::size_t>(sample.slip)]};
      for (const double value : sample.wrench) row.push_back(fmt::to_string(value));
      for (const double value : sample.direction) row.push_back(fmt::to_string(value));
      for (const SurfaceScore& score : scores[i])
        row.push_back(score.scored() ? fmt::to_string(score.errors_deg[j]) : std::string());
      out.rows.push_back(std::move(row));
    }
  return out;
}

/// Says once what could not be answered; if nothing could, there is no answer.
void report_failures(const Scores& scores) {
  std::set<std::string> reasons;
  bool any = false;
  for (const auto& row : scores)
    for (const SurfaceScore& score : row) {
      any = any || score.scored();
      if (!score.scored()) reasons.insert(score.reason);
    }
  if (!any && !reasons.empty()) throw Unanswered(*reasons.begin());
  for (const auto& reason : reasons) tell("unhand: {}\n", reason);
}

}  // namespace

void compare_slips(const CompareRequest& request) {
  if (!request.cards.empty() || !request.write_cards.empty())
    throw WrongUsage("limit surfaces are fitted to the slips here: neither --card nor --write-cards");
  const datasets::SlipLog log = read_slips(request.log);
  std::vector<SurfaceModel> models;
  for (const auto& name : request.models) models.push_back(fitting::surface_model(name));
  if (models.empty()) models.assign(std::begin(fitting::surface_models), std::end(fitting::surface_models));
  std::vector<SlipSamples> surfaces;
  for (const auto& [name, surface] : log.surfaces) surfaces.push_back(fitting::slip_samples(name, surface));

  fitting::SurfaceComparisonOptions options;
  options.threads = request.threads;
  Scores scores;
  {
    Progress progress("fit", surface_comparison_steps(surfaces.size(), models.size(), options));
    auto counted = options;
    counted.step = [&] { progress.step(); };
    scores = fitting::compare_surfaces(surfaces, models, counted);
  }
  report_failures(scores);

  const std::string heading = fmt::format(
      "{}: {}\nmean angle [deg] between predicted and measured twist in (vx, vy, L omega); {} folds by slip; "
      "null: "
      "the same\non data simulated from the fitted ellipsoid, {} draws\n",
      request.log, origin_text(log), options.folds, options.null_draws);
  const Table table = slips_table(surfaces, scores);
  const Json json = slips_json(request, surfaces, scores, options);
  answer_with(request, heading, table, json, [&](const std::filesystem::path& directory) {
    const Figure errors = surface_error_figure(surfaces, scores);
    draw(errors, directory, origin_text(log));
    std::string pictures = fmt::format("![Direction errors by surface]({}.png)\n\n", errors.name);
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      const std::string& surface = surfaces[i].surface;
      const std::string name = file_stem(surface);
      const Figure figure =
          section_figure(surfaces[i], scores[i], name == surface ? name : fmt::format("{}_{}", name, i + 1));
      draw(figure, directory, origin_text(log));
      pictures += fmt::format("![Limit surface of {}]({}.png)\n\n", markdown_text(surface), figure.name);
    }
    write_text(directory / "report.md", fmt::format("# Limit surfaces from slips\n\n{}\n{}\n{}",
                                                    markdown_text(heading), table.markdown(), pictures));
    write_text(directory / "slips.csv", sample_rows(surfaces, scores).csv());
  });
}

}  // namespace unhand::apps
