#include "datasets/model_card.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>

#include "datasets/file_kind.hpp"
#include "datasets/json_fields.hpp"
#include "datasets/whole_file.hpp"
#include "dynamics/dense_solve.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Fields = JsonFields;

constexpr const char* schema_name = "model-card";
constexpr int schema_version = 1;

/// Objects whose keys are names that the card's owner chose.
bool is_named_parts(const std::string& key) {
  return key == "parameters" || key == "valid_range" || key == "own_spreads" || key == "errors";
}

/// Adds to `into` what it lacks; a part of the card that is gone takes its unknown keys with it.
void add_missing(Json& into, const Json& extra, bool may_add) {
  for (const auto& [key, value] : extra.items()) {
    const auto found = into.find(key);
    if (found == into.end()) {
      if (may_add) into[key] = value;
    } else if (found->is_object() && value.is_object()) {
      add_missing(*found, value, !is_named_parts(key));
    }
  }
}

constexpr int kDeepest = 64;  ///< of objects and arrays within each other; a card has five

Json parse_json(const std::string& text, const std::string& file) {
  const auto shallow = [&](int depth, Json::parse_event_t, const Json&) {
    if (depth > kDeepest)
      throw CardError(file, "/", fmt::format("objects and arrays are nested deeper than {}", kDeepest));
    return true;
  };
  try {
    return Json::parse(text, shallow);
  } catch (const Json::out_of_range& bad) {  // a number that no double holds
    const std::string why = bad.what();
    throw CardError(file, "/", why.substr(std::min(why.find("number"), why.size())));
  } catch (const Json::parse_error& bad) {
    const std::size_t at = bad.byte > 0 ? std::min(bad.byte - 1, text.size()) : 0;
    const std::string_view before = std::string_view(text).substr(0, at);
    const auto line = 1 + std::count(before.begin(), before.end(), '\n');
    const std::size_t start = before.rfind('\n');
    const std::size_t column = start == std::string_view::npos ? at + 1 : at - start;
    std::string why = bad.what();
    if (const auto cut = why.find("syntax error"); cut != std::string::npos) why = why.substr(cut);
    throw CardError(file, fmt::format("line {}, column {}", line, column), why);
  }
}

CardParameter read_parameter(Fields& from) {
  CardParameter out;
  out.value = from.required("value", from.number("value"));
  out.sigma = from.number("sigma");
  if (out.sigma && *out.sigma < 0) from.fail("sigma", fmt::format("{} is below 0", *out.sigma));
  out.unit = from.required("unit", from.text("unit"));
  out.determined = from.boolean("determined").value_or(true);
  out.degrees_of_freedom = from.number("degrees_of_freedom");
  if (out.degrees_of_freedom && !(*out.degrees_of_freedom >= 1))
    from.fail("degrees_of_freedom", fmt::format("{} is below 1", *out.degrees_of_freedom));
  if (from.has("low95") || from.has("high95")) {
    const double low = from.number_or_null("low95").value_or(-HUGE_VAL);
    const double high = from.number_or_null("high95").value_or(HUGE_VAL);
    if (low > out.value) from.fail("low95", fmt::format("{} lies above the value", low));
    if (high < out.value) from.fail("high95", fmt::format("{} lies below the value", high));
    out.interval95 = {low, high};
  }
  return out;
}

CardSpread read_spread(Fields& from) {
  CardSpread out;
  out.sigma = from.required("sigma", from.number("sigma"));
  if (out.sigma < 0) from.fail("sigma", fmt::format("{} is below 0", out.sigma));
  out.unit = from.required("unit", from.text("unit"));
  return out;
}

CardStatistics read_statistics(Fields& from) {
  CardStatistics out;
  const double n = from.required("n", from.number("n"));
  if (!(n >= 0 && n < 1e9 && n == std::floor(n))) from.fail("n", fmt::format("{} is no count", n));
  out.n = static_cast<int>(n);
  out.mae = from.required("mae", from.number("mae"));
  const auto std = from.number_or_null("std");
  if (out.n > 1) out.std = from.required("std", std);
  out.bias = from.required("bias", from.number("bias"));
  return out;
}

/// Refuses what no covariance of these parameters is, beyond the rounding of numbers written by hand.
void require_covariance(const CardCovariance& covariance,
                        const std::map<std::string, CardParameter>& parameters, Fields& from) {
  constexpr double kRounding = 1e-6;
  const auto& [names, matrix] = covariance;
  const std::size_t n = names.size();
  Eigen::MatrixXd correlation =
      Eigen::MatrixXd::Identity(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const double variance = matrix[i * n + i];
    if (const auto& sigma = parameters.at(names[i]).sigma;
        sigma && !(std::abs(variance - *sigma * *sigma) <= kRounding * *sigma * *sigma))
      from.fail("matrix",
                fmt::format("has the variance {} of {}, whose sigma is {}: accepted is its square, {}",
                            variance, names[i], *sigma, *sigma * *sigma));
    for (std::size_t j = 0; j < n; ++j) {
      const double covaries = matrix[i * n + j], scale = std::sqrt(variance * matrix[j * n + j]);
      if (i == j) continue;
      if (!(std::abs(covaries) <= (1 + kRounding) * scale))
        from.fail("matrix",
                  fmt::format("has the covariance {} of {} and {}; accepted with their variances: -{} to {}",
                              covaries, names[i], names[j], scale, scale));
      if (scale > 0)
        correlation(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = covaries / scale;
    }
  }
  if (n == 0) return;
  if (const double least = dynamics::spectrum_of(correlation).values[0]; !(least >= -kRounding))
    from.fail("matrix",
              fmt::format("is no covariance: the least eigenvalue of its correlations is {}; accepted: >= 0",
                          least));
}

CardCovariance read_covariance(Fields& from, const std::map<std::string, CardParameter>& parameters) {
  CardCovariance out;
  out.names = from.texts("names");
  for (const auto& name : out.names)
    if (!parameters.contains(name)) from.fail("names", fmt::format("'{}' is no parameter of the card", name));
  const auto matrix = from.required("matrix", from.take("matrix"));
  const auto fail = [&] {
    from.fail("matrix", fmt::format("is not {0} rows of {0} finite numbers", out.names.size()));
  };
  if (!matrix.is_array() || matrix.size() != out.names.size()) fail();
  for (const auto& row : matrix) {
    if (!row.is_array() || row.size() != out.names.size()) fail();
    for (const auto& one : row) {
      if (!one.is_number()) fail();
      out.matrix.push_back(one.get<double>());
    }
  }
  const std::size_t n = out.names.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      if (!std::isfinite(out.matrix[i * n + j])) fail();
      const double scale = std::sqrt(out.matrix[i * n + i] * out.matrix[j * n + j]);
      if (!(std::abs(out.matrix[i * n + j] - out.matrix[j * n + i]) <= 1e-9 * scale) ||
          out.matrix[i * n + i] < 0)
        from.fail("matrix", "is no covariance: not symmetric, or negative on its diagonal");
    }
  require_covariance(out, parameters, from);
  return out;
}

CardRange read_range(Fields& from) {
  CardRange out;
  out.low = from.required("low", from.number("low"));
  out.high = from.required("high", from.number("high"));
  if (out.low > out.high) from.fail("low", fmt::format("{} lies above high, {}", out.low, out.high));
  out.unit = from.required("unit", from.text("unit"));
  return out;
}

/// An object whose keys are names. False if it is not there.
template <class Part>
bool read_parts(Fields& from, const std::string& key, std::map<std::string, Part>& into,
                Part (*read)(Fields&)) {
  auto parts = from.object(key);
  if (!parts) return false;
  for (const auto& name : parts->names()) {
    Fields one = *parts->object(name);
    into[name] = read(one);
    parts->keep(name, one);
  }
  from.keep(key, *parts);
  return true;
}

void write_covariance(const CardCovariance& covariance, Json& out) {
  const std::size_t n = covariance.names.size();
  if (covariance.matrix.size() != n * n)
    throw CardError("(in memory)", "/covariance/matrix",
                    fmt::format("{} numbers for {} names", covariance.matrix.size(), n));
  Json rows = Json::array();
  for (std::size_t i = 0; i < n; ++i) {
    Json row = Json::array();
    for (std::size_t j = 0; j < n; ++j) row.push_back(covariance.matrix[i * n + j]);
    rows.push_back(std::move(row));
  }
  out["covariance"] = {{"names", covariance.names}, {"matrix", std::move(rows)}};
}

}  // namespace

ModelCard parse_model_card(const std::string& text, const std::string& file) {
  Fields root(file, "", parse_json(text, file));
  const auto schema = root.required("schema", root.text("schema"));
  if (schema != schema_name) root.fail("schema", fmt::format("is '{}', not '{}'", schema, schema_name));
  const double version = root.required("schema_version", root.number("schema_version"));
  if (version != schema_version)
    root.fail("schema_version", fmt::format("{} is not supported (known: {})", version, schema_version));

  ModelCard card;
  card.model = root.required("model", root.text("model"));
  if (card.model.empty()) root.fail("model", "is empty text");
  card.effects = root.texts("effects");
  if (!read_parts(root, "parameters", card.parameters, read_parameter))
    root.required("parameters", root.object("parameters"));
  if (auto covariance = root.object("covariance")) {
    card.covariance = read_covariance(*covariance, card.parameters);
    root.keep("covariance", *covariance);
  }
  read_parts(root, "own_spreads", card.own_spreads, read_spread);
  Fields log = root.required("log", root.object("log"));
  card.log.file = log.required("file", log.text("file"));
  card.log.title = log.text("title").value_or("");
  card.log.checksum = log.text("checksum");
  card.log.surfaces = log.texts("surfaces");
  root.keep("log", log);
  card.split = root.text("split");
  if (auto errors = root.object("errors")) {
    for (const auto& name : errors->names()) read_parts(*errors, name, card.errors[name], read_statistics);
    root.keep("errors", *errors);
  }
  read_parts(root, "valid_range", card.valid_range, read_range);
  card.warnings = root.texts("warnings");
  card.library_version = root.required("library_version", root.text("library_version"));
  if (!root.rest().empty()) card.extra = root.rest().dump();
  return card;
}

std::string library_version() { return UNHAND_VERSION; }

std::optional<double> CardCovariance::of(const std::string& a, const std::string& b) const {
  const auto i = static_cast<std::size_t>(std::find(names.begin(), names.end(), a) - names.begin()),
             j = static_cast<std::size_t>(std::find(names.begin(), names.end(), b) - names.begin());
  if (i == names.size() || j == names.size()) return {};
  return matrix[i * names.size() + j];
}

ModelCard read_model_card(const fs::path& file) {
  std::error_code error;
  if (fs::is_directory(file, error))
    throw CardError(file.string(), "/", "is a directory: a card is one file");
  if (!fs::exists(file, error)) throw CardError(file.string(), "", "no such file");
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw CardError(file.string(), "", "cannot be read");
  if (!begins_json_object(text.str()))
    throw CardError(file.string(), "", with_kind("is not a model card (JSON)", kind_of(text.str())));
  return parse_model_card(text.str(), file.string());
}

std::optional<CardParameter> middle_of_range(const ModelCard& card, const std::string& file,
                                             const std::string& condition, const std::string& unit) {
  const auto found = card.valid_range.find(condition);
  if (found == card.valid_range.end()) return {};
  const CardRange& range = found->second;
  if (range.unit != unit)
    throw CardError(file, fmt::format("/valid_range/{}/unit", condition),
                    fmt::format("is '{}', not '{}'", range.unit, unit));
  CardParameter out;
  out.value = 0.5 * (range.low + range.high);
  out.sigma = (range.high - range.low) / std::sqrt(12.0);
  out.unit = unit;
  return out;
}

std::string to_json(const ModelCard& card) {
  Json out{{"schema", schema_name}, {"schema_version", schema_version}, {"model", card.model}};
  if (!card.effects.empty()) out["effects"] = card.effects;
  Json& parameters = out["parameters"] = Json::object();
  for (const auto& [name, p] : card.parameters) {
    Json& one = parameters[name] = {{"value", p.value}};
    if (p.sigma) one["sigma"] = *p.sigma;
    one["unit"] = p.unit;
    if (!p.determined) one["determined"] = false;
    if (p.degrees_of_freedom) one["degrees_of_freedom"] = *p.degrees_of_freedom;
    if (p.interval95) {
      const auto end = [](double x) { return std::isinf(x) ? Json() : Json(x); };
      one["low95"] = end((*p.interval95)[0]);
      one["high95"] = end((*p.interval95)[1]);
    }
  }
  if (card.covariance) write_covariance(*card.covariance, out);
  for (const auto& [name, spread] : card.own_spreads)
    out["own_spreads"][name] = {{"sigma", spread.sigma}, {"unit", spread.unit}};
  out["log"] = {{"file", card.log.file}, {"title", card.log.title}};
  if (card.log.checksum) out["log"]["checksum"] = *card.log.checksum;
  if (!card.log.surfaces.empty()) out["log"]["surfaces"] = card.log.surfaces;
  if (card.split) out["split"] = *card.split;
  for (const auto& [split, quantities] : card.errors) {
    Json& one = out["errors"][split] = Json::object();
    for (const auto& [name, e] : quantities)
      one[name] = {
          {"n", e.n}, {"mae", e.mae}, {"std", e.n > 1 ? Json(e.std) : Json(nullptr)}, {"bias", e.bias}};
  }
  if (!card.valid_range.empty()) {
    Json& ranges = out["valid_range"] = Json::object();
    for (const auto& [name, r] : card.valid_range)
      ranges[name] = {{"low", r.low}, {"high", r.high}, {"unit", r.unit}};
  }
  if (!card.warnings.empty()) out["warnings"] = card.warnings;
  out["library_version"] = card.library_version;
  if (!card.extra.empty()) add_missing(out, parse_json(card.extra, "(extra keys of a card)"), true);
  std::string text;
  try {
    text = out.dump(1) + "\n";
  } catch (const Json::type_error&) {
    throw CardError("(in memory)", "/", "holds text that is not UTF-8");
  }
  parse_model_card(text);  // what cannot be read again is not written
  return text;
}

void write_model_card(const fs::path& file, const ModelCard& card) {
  const std::string text = to_json(card);
  std::error_code error;
  if (fs::is_directory(file, error))
    throw CardError(file.string(), "/", "is a directory: a card is one file");
  if (const std::string failed = replace_whole(file, text); !failed.empty())
    throw CardError(file.string(), "/", "cannot be written: " + failed);
}

}  // namespace unhand::datasets
