#include "datasets/toml_keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "datasets/file_kind.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;

std::string shown(const toml::node& node) {
  std::ostringstream out;
  node.visit([&](const auto& value) { out << value; });
  return out.str();
}

TomlError error_at(const std::string& file, const toml::source_position& at, std::string_view key,
                   const std::string& why) {
  return {file, static_cast<int>(at.line), static_cast<int>(at.column), std::string(key), why};
}

}  // namespace

std::string TomlLimits::text() const {
  return fmt::format("{}{}, {}] {}", open_low ? "(" : "[", low, high, unit);
}

TomlKeys TomlKeys::parse(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) throw TomlError(file.string(), 0, 0, "", "no such file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw TomlError(file.string(), 0, 0, "", "cannot be opened");
  const std::string text(std::istreambuf_iterator<char>(in), {});
  if (const std::string kind = kind_of(text); !kind.empty())
    throw TomlError(file.string(), 0, 0, "", with_kind("is not a TOML file", kind));
  return parse_text(text, file.string());
}

TomlKeys TomlKeys::parse_text(std::string_view text, const std::string& name) {
  try {
    auto root = std::make_shared<const toml::table>(toml::parse(text, name));
    return {name, root, *root};
  } catch (const toml::parse_error& bad) {
    throw error_at(name, bad.source().begin, "syntax", std::string(bad.description()));
  }
}

void TomlKeys::fail(std::string_view key, const std::string& why) const {
  const toml::node* node = table_->get(key);
  toml::source_position at{};  // of a missing key: where its table stands, if it is not the whole file
  if (node != nullptr)
    at = node->source().begin;
  else if (table_ != root_.get())
    at = table_->source().begin;
  throw error_at(file_, at, key, why);
}

std::optional<double> TomlKeys::number(std::string_view key, const TomlLimits& limits) {
  const toml::node* node = ask(key);
  if (node == nullptr) return {};
  return checked(key, *node, limits);
}

std::optional<std::string> TomlKeys::text(std::string_view key) {
  const toml::node* node = ask(key);
  if (node == nullptr) return {};
  if (!node->is_string()) fail(key, fmt::format("{} is not text", shown(*node)));
  std::string value = node->as_string()->get();
  if (value.empty()) fail(key, "is empty text");
  return value;
}

bool TomlKeys::numbers(std::string_view key, const TomlLimits& limits, std::span<double> out) {
  const toml::node* node = ask(key);
  if (node == nullptr) return false;
  const toml::array* list = node->as_array();
  if (list == nullptr || list->size() != out.size())
    fail(key, fmt::format("{} is not a list of {} numbers", shown(*node), out.size()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = checked(key, *list->get(i), limits);
  return true;
}

std::optional<std::array<double, 3>> TomlKeys::triple(std::string_view key, const TomlLimits& limits) {
  std::array<double, 3> out{};
  if (!numbers(key, limits, out)) return {};
  return out;
}

std::optional<TomlKeys> TomlKeys::table(std::string_view key) {
  const toml::node* node = ask(key);
  if (node == nullptr) return {};
  if (!node->is_table()) fail(key, fmt::format("{} is not a table", shown(*node)));
  return TomlKeys(file_, root_, *node->as_table());
}

std::vector<TomlKeys> TomlKeys::tables(std::string_view key) {
  const toml::node* node = ask(key);
  if (node == nullptr) return {};
  if (!node->is_array_of_tables())
    fail(key, fmt::format("{} is not a list of tables, [[{}]]", shown(*node), key));
  std::vector<TomlKeys> out;
  for (const toml::node& one : *node->as_array()) out.push_back(TomlKeys(file_, root_, *one.as_table()));
  return out;
}

void TomlKeys::reject_unknown() const {
  for (const auto& [key, node] : *table_) {
    const std::string_view name = key.str();
    if (std::find(asked_.begin(), asked_.end(), name) != asked_.end()) continue;
    const std::string_view meant = nearest_name(name, asked_);
    std::string known;
    for (const std::string_view k : asked_) known += fmt::format("{}{}", known.empty() ? "" : ", ", k);
    fail(name, meant.empty() ? fmt::format("unknown key (known: {})", known)
                             : fmt::format("unknown key: did you mean '{}'?", meant));
  }
}

const toml::node* TomlKeys::ask(std::string_view key) {
  asked_.push_back(key);
  return table_->get(key);
}

double TomlKeys::checked(std::string_view key, const toml::node& node, const TomlLimits& limits) const {
  const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
  if (!value) fail(key, fmt::format("{} is not a number; accepted: {}", shown(node), limits.text()));
  if (!limits.accept(*value)) fail(key, fmt::format("{} is outside {}", shown(node), limits.text()));
  return *value;
}

}  // namespace unhand::datasets
