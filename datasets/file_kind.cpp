#include "datasets/file_kind.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

namespace unhand::datasets {
namespace {

constexpr std::size_t kFirstBytes = 4096;  // every JSON file of this project begins with its schema
constexpr std::string_view kBlanks = " \t\r\n", kHdf5Signature = "\x89HDF\r\n\x1a\n";

/// The text behind "schema": in JSON; empty if there is none.
std::string_view schema_in(std::string_view json) {
  constexpr std::string_view key = "\"schema\"";
  const std::size_t found = json.find(key);
  if (found == std::string_view::npos) return {};
  json.remove_prefix(found + key.size());
  for (const char expected : {':', '"'}) {
    json.remove_prefix(std::min(json.find_first_not_of(kBlanks), json.size()));
    if (json.empty() || json.front() != expected) return {};
    json.remove_prefix(1);
  }
  const std::size_t end = json.find('"');
  return end == std::string_view::npos ? std::string_view{} : json.substr(0, end);
}

}  // namespace

std::string kind_of(std::string_view bytes) {
  bytes = bytes.substr(0, kFirstBytes);
  if (bytes.starts_with(kHdf5Signature)) return "an HDF5 file";
  if (!begins_json_object(bytes)) return {};
  const std::string_view schema = schema_in(bytes);
  if (schema.empty()) return "JSON";
  return schema == "model-card" ? "a model card (JSON)" : fmt::format("JSON of schema '{}'", schema);
}

bool begins_json_object(std::string_view bytes) {
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  if (bytes.starts_with(byte_order_mark)) bytes.remove_prefix(byte_order_mark.size());
  const std::size_t first = bytes.find_first_not_of(kBlanks);
  return first != std::string_view::npos && bytes[first] == '{';
}

std::string kind_of_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes(kFirstBytes, '\0');
  in.read(bytes.data(), std::ssize(bytes));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return kind_of(bytes);
}

std::string with_kind(const std::string& said, const std::string& kind) {
  return kind.empty() ? said : fmt::format("{}; it is {}", said, kind);
}

}  // namespace unhand::datasets
