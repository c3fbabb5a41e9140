// A JSON object read key by key, with the place of a mistake in its error. Internal to datasets.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "datasets/model_card.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::datasets {

/// "/a~b" as JSON pointers spell it.
inline std::string escaped(std::string_view key) {
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
class JsonFields {
 public:
  JsonFields(std::string file, std::string path, nlohmann::ordered_json object)
      : file_(std::move(file)), path_(std::move(path)), object_(std::move(object)) {
    if (!object_.is_object()) fail("", fmt::format("is {}, not an object", object_.type_name()));
  }

  [[noreturn]] void fail(const std::string& key, const std::string& why) const {
    throw CardError(file_, key.empty() ? (path_.empty() ? "/" : path_) : path_ + "/" + escaped(key), why);
  }

  std::optional<nlohmann::ordered_json> take(const std::string& key) {
    const auto found = object_.find(key);
    if (found == object_.end()) return {};
    nlohmann::ordered_json value = *found;
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

  bool has(const std::string& key) const { return object_.contains(key); }

  /// The same of a key that may be null.
  std::optional<double> number_or_null(const std::string& key) {
    if (has(key) && object_[key].is_null()) object_.erase(key);
    return number(key);
  }

  std::optional<std::string> text(const std::string& key) {
    const auto value = take(key);
    if (!value) return {};
    if (!value->is_string()) fail(key, fmt::format("{} is not text", value->dump()));
    return value->get<std::string>();
  }

  std::optional<bool> boolean(const std::string& key) {
    const auto value = take(key);
    if (!value) return {};
    if (!value->is_boolean()) fail(key, fmt::format("{} is neither true nor false", value->dump()));
    return value->get<bool>();
  }

  std::vector<std::string> texts(const std::string& key) {
    const auto value = take(key);
    if (!value) return {};
    if (!value->is_array()) fail(key, fmt::format("is {}, not an array", value->type_name()));
    std::vector<std::string> out;
    for (const auto& one : *value) {
      if (!one.is_string()) fail(key, fmt::format("{} is not text", one.dump()));
      out.push_back(one.get<std::string>());
    }
    return out;
  }

  std::optional<JsonFields> object(const std::string& key) {
    auto value = take(key);
    if (!value) return {};
    return JsonFields(file_, path_ + "/" + escaped(key), *std::move(value));
  }

  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const auto& [name, ignored] : object_.items()) out.push_back(name);
    return out;
  }

  /// Puts what is left of a part back, to be kept.
  void keep(const std::string& key, const JsonFields& part) {
    if (!part.object_.empty()) object_[key] = part.object_;
  }

  const nlohmann::ordered_json& rest() const { return object_; }

 private:
  std::string file_, path_;
  nlohmann::ordered_json object_;
};

}  // namespace unhand::datasets
