// unhand fit on slip logs: the limit surface of every surface in it.
#include <fmt/format.h>

#include <cmath>

#include "apps/command.hpp"
#include "apps/fit.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "fitting/slips/compare_surfaces.hpp"

namespace unhand::apps {
namespace {

using fitting::SlipSamples;
using fitting::SurfaceModel;
using fitting::SurfaceScore;

/// Names of the coefficients, in their order.
std::vector<std::string> coefficient_names(const fitting::SlipSurface& surface) {
  if (surface.model != SurfaceModel::convex_quartic) return {"A_xx", "A_xy", "A_xt", "A_yy", "A_yt", "A_tt"};
  std::vector<std::string> out;
  for (std::size_t k = 0; k < surface.coefficients.size(); ++k) out.push_back(fmt::format("a_{}", k));
  return out;
}

datasets::ModelCard slip_card(const FitRequest& request, const std::vector<SlipSamples>& surfaces,
                              const std::vector<SurfaceScore>& scores) {
  datasets::ModelCard card;
  card.model = request.model;
  const char* unit = request.model == "convex_quartic" ? "1/N^4" : "1/N^2";
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    if (!scores[i].fit.fitted()) continue;
    const std::string of = "[" + surfaces[i].surface + "]";
    const auto& surface = scores[i].fit.surface;
    const auto names = coefficient_names(surface);
    for (std::size_t k = 0; k < surface.coefficients.size(); ++k)
      card.parameters[names[k] + of] = {surface.coefficients[k], {}, unit};
    card.parameters["characteristic_length" + of] = {surface.characteristic_length, {}, "m"};
    if (scores[i].scored()) {
      double square = 0, bias = 0;
      const auto& e = scores[i].errors_deg;
      const auto n = static_cast<double>(e.size());
      for (const double one : e) {
        square += (one - scores[i].mean_deg) * (one - scores[i].mean_deg) / std::max(1.0, n - 1);
        bias += one / n;
      }
      card.errors["cross_validation"]["direction_error_deg" + of] = {
          static_cast<int>(e.size()), scores[i].mean_deg, std::sqrt(square), bias};
    }
  }
  card.log = {utf8_name(request.log), "", fitting::checksum_of(request.log)};
  card.split = "all";
  card.library_version = datasets::library_version();
  return card;
}

Json surface_json(const SurfaceScore& score) {
  Json out{{"outcome", to_string(score.fit.outcome)}};
  if (!score.fit.fitted()) {
    out["reason"] = score.fit.reason;
    return out;
  }
  const auto& surface = score.fit.surface;
  const auto extremes = surface.extremes();
  out["characteristic_length_m"] = surface.characteristic_length;
  out["coefficients"] = surface.coefficients;
  out["least_force_N"] = extremes.least_force;
  out["largest_force_N"] = extremes.largest_force;
  out["torque_N_m"] = extremes.torque;
  out["sigma_direction_rad"] = score.fit.sigma_direction;
  out["sigma_level"] = score.fit.sigma_level;
  out["cv_direction_error_deg"] = score.scored() ? Json(score.mean_deg) : Json(nullptr);
  out["n"] = score.errors_deg.size();
  return out;
}

}  // namespace

void fit_slips(const FitRequest& request) {
  const datasets::SlipLog log = read_slips(request.log);
  std::vector<SlipSamples> surfaces;
  for (const auto& [name, surface] : log.surfaces) surfaces.push_back(fitting::slip_samples(name, surface));
  fitting::SurfaceComparisonOptions options;
  options.threads = request.threads;
  options.null_draws = 0;
  if (request.kfold > 0) options.folds = request.kfold;
  std::size_t most = 0;  // slips of one surface
  for (const auto& one : surfaces) most = std::max(most, one.slips.size());
  if (request.kfold > 0 && static_cast<std::size_t>(request.kfold) > most && most >= 2) {
    options.folds = static_cast<int>(most);
    tell("unhand: --kfold {}: {} folds, as many as a surface has slips\n", request.kfold, most);
  }
  std::optional<Progress> progress(std::in_place, "fit", 0);
  std::vector<SurfaceScore> scores;
  for (auto& row : fitting::compare_surfaces(surfaces, {fitting::surface_model(request.model)}, options))
    scores.push_back(std::move(row.front()));
  progress.reset();
  bool any = false;
  for (const auto& score : scores) {
    any = any || score.fit.fitted();
    if (!score.fit.fitted()) tell("unhand: {}\n", score.fit.reason);
  }
  if (!any) throw Unanswered(fmt::format("{}: {} was fitted to no surface", request.log, request.model));

  Table table{{"surface", "slips", "samples", "least force [N]", "largest force [N]", "torque [N m]",
               "sigma direction [deg]", "sigma level", "direction error, cross-validated [deg]"},
              {},
              1};
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const auto& fit = scores[i].fit;
    const bool known = fit.fitted();
    const auto extremes = known ? fit.surface.extremes() : fitting::SlipSurface::Extremes{};
    table.rows.push_back({surfaces[i].surface, fmt::to_string(surfaces[i].slips.size()),
                          fmt::to_string(surfaces[i].samples.size()), fixed(known, extremes.least_force, 3),
                          fixed(known, extremes.largest_force, 3), fixed(known, extremes.torque, 5),
                          fixed(known, fit.sigma_direction * experiment::kDegrees, 2),
                          fixed(known, fit.sigma_level, 3),
                          fixed(scores[i].scored(), scores[i].mean_deg, 2)});
  }
  Json json = json_head("fit");
  json["log"] = request.log;
  json["model"] = request.model;
  json["folds"] = options.folds;
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    json["surfaces"][surfaces[i].surface] = surface_json(scores[i]);
  Outputs outputs{{request.log}};
  if (!request.json.empty()) outputs.json(request.json, json);
  if (!request.card.empty())
    outputs.text(request.card, datasets::to_json(slip_card(request, surfaces, scores)));
  if (!request.report.empty()) {
    const auto directory = outputs.directory(request.report);
    write_text(directory / "report.md", fmt::format("# Fit\n\n{}\n\n{} by surface\n\n{}",
                                                    markdown_text(request.log + ": " + origin_text(log)),
                                                    request.model, table.markdown()));
    write_text(directory / "fit.json", json_text(json));
  }
  outputs.commit();
  fmt::print("{}: {}\n{} by surface\n\n{}", request.log, origin_text(log), request.model, table.text());
}

}  // namespace unhand::apps
