#include "datasets/model_card.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <vector>

#include "datasets/near_miss.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* schema_name = "model-card";
constexpr int schema_version = 1;

/// "/a~b" as JSON pointers spell it.
std::string escaped(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (c == '~')
      out += "~0";
    else if (c == '/')
      out += "~1";
    else
      out += c;
  }
  return out;
}

/// An object of the card whose keys are taken out one by one; what is left is what this version does not
/// know.
class Fields {
 public:
  Fields(std::string file, std::string path, Json object)
      : file_(std::move(file)), path_(std::move(path)), object_(std::move(object)) {
    if (!object_.is_object()) fail("", fmt::format("is {}, not an object", object_.type_name()));
  }

  [[noreturn]] void fail(const std::string& key, const std::string& why) const {
    throw CardError(file_, key.empty() ? (path_.empty() ? "/" : path_) : path_ + "/" + escaped(key), why);
  }

  std::optional<Json> take(const std::string& key) {
    const auto found = object_.find(key);
    if (found == object_.end()) return {};
    Json value = *found;
    object_.erase(found);
    return value;
  }

  template <class T>
  T required(const std::string& key, std::optional<T> value) const {
    if (value) return *std::move(value);
    for (const auto& [name, ignored] : object_.items()) {
      if (is_near_miss(name, key)) fail(key, fmt::format("is missing: is '{}' meant?", name));
    }
    fail(key, "is missing");
  }

  std::optional<double> number(const std::string& key) {
    const auto value = take(key);
    if (!value) return {};
    if (!value->is_number()) fail(key, fmt::format("{} is not a number", value->dump()));
    const auto real = value->get<double>();
    if (!std::isfinite(real)) fail(key, "is not finite");
    return real;
  }

  std::optional<std::string> text(const std::string& key) {
    const auto value = take(key);
    if (!value) return {};
    if (!value->is_string()) fail(key, fmt::format("{} is not text", value->dump()));
    return value->get<std::string>();
  }

  std::optional<Fields> object(const std::string& key) {
    auto value = take(key);
    if (!value) return {};
    return Fields(file_, path_ + "/" + escaped(key), *std::move(value));
  }

  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const auto& [name, ignored] : object_.items()) out.push_back(name);
    return out;
  }

  /// Puts what is left of a part back, to be kept.
  void keep(const std::string& key, const Fields& part) {
    if (!part.object_.empty()) object_[key] = part.object_;
  }

  const Json& rest() const { return object_; }

 private:
  std::string file_, path_;
  Json object_;
};

/// Adds to `into` what it lacks; a part of the card that is gone takes its unknown keys with it.
void add_missing(Json& into, const Json& extra, bool may_add) {
  for (const auto& [key, value] : extra.items()) {
    const auto found = into.find(key);
    if (found == into.end()) {
      if (may_add) into[key] = value;
    } else if (found->is_object() && value.is_object()) {
      add_missing(*found, value, key != "parameters" && key != "valid_range");
    }
  }
}

Json parse_json(const std::string& text, const std::string& file) {
  try {
    return Json::parse(text);
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
  Fields parameters = root.required("parameters", root.object("parameters"));
  for (const auto& name : parameters.names()) {
    Fields one = *parameters.object(name);
    card.parameters[name] = read_parameter(one);
    parameters.keep(name, one);
  }
  root.keep("parameters", parameters);
  Fields log = root.required("log", root.object("log"));
  card.log.file = log.required("file", log.text("file"));
  card.log.title = log.text("title").value_or("");
  card.log.checksum = log.text("checksum");
  root.keep("log", log);
  card.split = root.text("split");
  if (auto ranges = root.object("valid_range")) {
    for (const auto& name : ranges->names()) {
      Fields one = *ranges->object(name);
      card.valid_range[name] = read_range(one);
      ranges->keep(name, one);
    }
    root.keep("valid_range", *ranges);
  }
  card.library_version = root.required("library_version", root.text("library_version"));
  if (!root.rest().empty()) card.extra = root.rest().dump();
  return card;
}

ModelCard read_model_card(const fs::path& file) {
  std::error_code error;
  if (fs::is_directory(file, error))
    throw CardError(file.string(), "/", "is a directory: a card is one file");
  if (!fs::exists(file, error)) throw CardError(file.string(), "/", "no such file");
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw CardError(file.string(), "/", "cannot be read");
  return parse_model_card(text.str(), file.string());
}

std::string to_json(const ModelCard& card) {
  Json out{{"schema", schema_name}, {"schema_version", schema_version}, {"model", card.model}};
  Json& parameters = out["parameters"] = Json::object();
  for (const auto& [name, p] : card.parameters) {
    Json& one = parameters[name] = {{"value", p.value}};
    if (p.sigma) one["sigma"] = *p.sigma;
    one["unit"] = p.unit;
  }
  out["log"] = {{"file", card.log.file}, {"title", card.log.title}};
  if (card.log.checksum) out["log"]["checksum"] = *card.log.checksum;
  if (card.split) out["split"] = *card.split;
  if (!card.valid_range.empty()) {
    Json& ranges = out["valid_range"] = Json::object();
    for (const auto& [name, r] : card.valid_range)
      ranges[name] = {{"low", r.low}, {"high", r.high}, {"unit", r.unit}};
  }
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
  const fs::path part = fmt::format("{}.part-{}", file.string(), getpid());
  std::error_code error;
  if (fs::is_directory(file, error))
    throw CardError(file.string(), "/", "is a directory: a card is one file");
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  out << text;
  out.close();
  if (out) fs::rename(part, file, error);
  if (!out || error) {
    fs::remove(part, error);
    throw CardError(file.string(), "/", "cannot be written");
  }
}

}  // namespace unhand::datasets
