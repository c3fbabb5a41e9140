#include "apps/discover_measured.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "apps/command.hpp"
#include "apps/figure.hpp"
#include "apps/measured_report.hpp"
#include "apps/output.hpp"
#include "apps/progress.hpp"
#include "apps/throws.hpp"
#include "experiment/tracked_flight.hpp"
#include "fitting/card.hpp"
#include "fitting/discovery/footprints.hpp"
#include "fitting/measured/fall_discovery.hpp"

namespace unhand::apps {
namespace {

using fitting::MeasuredDiscovery;

const char* default_model(MeasuredKind kind) {
  return kind == MeasuredKind::flights ? "projectile"
         : kind == MeasuredKind::falls ? "free_fall"
                                       : "ellipsoid";
}

/// The ids of what may be found in such a log.
std::vector<std::string> catalogue(MeasuredKind kind) {
  std::vector<std::string> out;
  if (kind == MeasuredKind::slips) {
    for (const auto model : fitting::surface_models)
      out.push_back(std::string(fitting::kLaw) + fitting::to_string(model));
    for (const char* id : {fitting::kWrenchBias, fitting::kStribeck, fitting::kViscous}) out.emplace_back(id);
    return out;
  }
  for (const auto& effect :
       kind == MeasuredKind::flights ? experiment::known_flight_effects() : experiment::known_fall_effects())
    out.push_back(effect.id);
  return out;
}

/// The parameters that were found, for `unhand compare` to read.
datasets::ModelCard card_of(const MeasuredDiscovery& found, const datasets::ThrowLog& log,
                            const std::string& file) {
  datasets::ModelCard card;
  card.model = found.model;
  for (const auto& effect : found.effects) {
    card.effects.push_back(effect.id);
    for (const auto& p : effect.parameters)
      card.parameters[effect.id + "." + p.name] = {p.value, p.sigma, p.unit, true};
  }
  if (!found.parameters.empty()) {
    // A sigma may be wider than the fit's: the other names of an effect are allowed for. It keeps its
    // correlations.
    auto& [names, matrix] =
        card.covariance.emplace(datasets::CardCovariance{found.parameters, found.covariance});
    const std::size_t n = names.size();
    for (std::size_t i = 0; i < n; ++i) {
      const double variance = matrix[i * n + i], sigma = card.parameters.at(names[i]).sigma.value_or(0);
      const double wider = variance > 0 ? sigma / std::sqrt(variance) : 0;
      for (std::size_t j = 0; j < n; ++j) matrix[i * n + j] *= wider, matrix[j * n + i] *= wider;
      matrix[i * n + i] = sigma * sigma;
    }
  }
  card.log = {utf8_name(file), log.title, fitting::checksum_of(file)};
  card.split = "train";
  card.library_version = datasets::library_version();
  return card;
}

}  // namespace

std::optional<MeasuredKind> measured_kind(const std::string& log) {
  if (datasets::read_schema_name(log) == "slip-log") return MeasuredKind::slips;
  const auto read = datasets::read_throw_log(log);
  if (read.throws.empty()) return {};
  const auto has = [&](const auto& what) {
    return std::any_of(read.throws.begin(), read.throws.end(), what);
  };
  if (read.dimension == 2 && has([](const datasets::Throw& t) { return t.hand.has_value(); })) return {};
  if (has([](const datasets::Throw& t) { return t.mocap.has_value(); })) return MeasuredKind::flights;
  if (read.dimension == 3 && has([](const datasets::Throw& t) { return t.imu.has_value(); }))
    return MeasuredKind::falls;
  return {};
}

const std::vector<std::string>& measured_models() {
  static const std::vector<std::string> names{"projectile", "free_fall", "ellipsoid"};
  return names;
}

void discover_measured(MeasuredKind kind, const MeasuredRequest& request) {
  if (request.model && *request.model != default_model(kind))
    throw WrongUsage(
        fmt::format("--model {}: the base model of this log is {}", *request.model, default_model(kind)));
  const auto known = catalogue(kind);
  for (const std::string& id : request.forget)
    if (std::find(known.begin(), known.end(), id) == known.end())
      throw WrongUsage(
          fmt::format("--forget {}: the catalogue of this log has {}", id, fmt::join(known, ", ")));
  if (kind == MeasuredKind::slips && !request.card.empty())
    throw WrongUsage("--card: limit surfaces of a slip-log get theirs from `unhand fit LOG --card FILE`");
  MeasuredResult result;
  result.log = request.log;
  result.command = request.command;
  std::optional<datasets::ThrowLog> log;
  std::optional<Progress> progress(std::in_place, "discover", 0);
  if (kind == MeasuredKind::slips) {
    fitting::SurfaceDiscoveryOptions options;
    options.forget = request.forget;
    options.comparison.threads = request.threads;
    const auto slips = read_slips(request.log);
    result.origin = origin_text(slips);
    auto found = fitting::discover_surfaces(slips, options);
    result.answer = std::move(found.answer);
    result.surfaces = std::move(found.evidence);
  } else {
    log = read_throws(request.log);
    result.origin = origin_text(*log);
    if (kind == MeasuredKind::flights) require_flights(*log, request.log);
    fitting::MeasuredOptions options;
    options.search.forget = request.forget;
    options.search.most_effects = request.most;
    options.search.fit.threads = request.threads;
    options.floor = request.floor;
    try {
      result.answer = kind == MeasuredKind::flights ? fitting::discover_flights(*log, options)
                                                    : fitting::discover_falls(*log, options);
    } catch (const std::invalid_argument& error) {
      throw Unanswered(fmt::format("{}: {}", request.log, error.what()));
    }
  }
  progress.reset();
  if (result.answer.verdict == fitting::Verdict::not_answered)
    throw Unanswered(fmt::format("{}: {}", request.log, result.answer.message));
  Outputs outputs{{request.log}};
  const Json json = measured_json(result);
  if (!request.json.empty()) outputs.json(request.json, json);
  if (!request.card.empty())
    outputs.text(request.card, datasets::to_json(card_of(result.answer, *log, request.log)));
  if (!request.report.empty()) write_measured_report(result, json, outputs.directory(request.report));
  outputs.commit();
  fmt::print("{}", measured_text(result));
}

}  // namespace unhand::apps
