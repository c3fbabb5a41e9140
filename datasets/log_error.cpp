#include "datasets/log_error.hpp"

#include <fmt/format.h>

#include <utility>

namespace unhand::datasets {
namespace {

/// Names come from the file itself and may hold anything, line breaks included.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return text;
}

}  // namespace

LogError::LogError(std::string file_name, std::string path_inside, std::string why,
                   const std::string& message)
    : std::runtime_error(one_line(message)),
      file(std::move(file_name)),
      path(std::move(path_inside)),
      reason(std::move(why)) {}

LogError::LogError(std::string file_name, std::string path_inside, std::string why)
    : LogError(file_name, path_inside, why,
               fmt::format("{}: {}{}{}", file_name, path_inside, path_inside.empty() ? "" : ": ", why)) {}

TomlError::TomlError(std::string file_name, int line_number, int column_number, std::string key,
                     std::string why)
    : LogError(file_name, key, why,
               line_number > 0
                   ? fmt::format("{}:{}:{}: {}: {}", file_name, line_number, column_number, key, why)
                   : fmt::format("{}: {}{}{}", file_name, key, key.empty() ? "" : ": ", why)),
      line(line_number),
      column(column_number) {}

}  // namespace unhand::datasets
